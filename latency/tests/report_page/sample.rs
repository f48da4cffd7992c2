//! A report as a session of ten pairs might leave it, made up: every list has entries, some numbers are missing or none.

use latency::model::*;
use latency::samples::Samples;
use realtime::ArrivalFigures;
use runlog::timing_recorder::CommandAges;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Runs of the session, each of so many seconds.
const RUNS: usize = 10;
const SECONDS: u64 = 60;

/// The same numbers every time, spread over the unit interval.
struct PseudoRandom(u64);

impl PseudoRandom {
    fn next(&mut self) -> f64 {
        // Knuth's linear congruence; its upper bits are good enough for a picture.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A latency around `middle_ns`, with a long tail every thousandth time or so.
    fn latency_ns(&mut self, middle_ns: f64) -> u64 {
        let bell: f64 = (0..4).map(|_| self.next() - 0.5).sum();
        let tail = if self.next() < 0.0015 { 10f64.powf(2.3 * self.next()) } else { 1.0 };
        (middle_ns * (0.45 * bell).exp() * tail) as u64
    }
}

fn distribution(name: &str, source: Source, about: &str, middle_ns: f64) -> Distribution {
    let mut random = PseudoRandom(name.bytes().map(u64::from).sum());
    let (mut all, mut maxima) = (Samples::default(), Vec::new());
    for run in 0..RUNS {
        for second in 0..SECONDS {
            let samples: Vec<_> = (0..200).map(|_| random.latency_ns(middle_ns)).collect();
            maxima.push(Maximum { run, second, max_ns: samples.iter().copied().max().unwrap_or_default() });
            samples.iter().for_each(|ns| all.record(*ns, 1));
        }
    }
    Distribution {
        name: name.into(),
        source,
        about: about.into(),
        percentiles_ns: all.percentiles_ns(),
        bins: all.bins(),
        maxima: if source == Source::Reference { Vec::new() } else { maxima },
    }
}

fn distributions() -> Vec<Distribution> {
    use Source::{Controller, Emulator, Joined, Reference};
    [
        ("emulator-wakeup", Emulator, "the rig: scheduled time of a cycle to running", 14_000.0),
        ("controller-wakeup", Controller, "arrival of the sensors to running", 19_000.0),
        ("cyclictest", Reference, "cyclictest at the same priority, interval and CPU", 13_200.0),
        ("drive-round-trip", Emulator, "sensors handed over to the answering command's arrival", 118_000.0),
        ("load-round-trip", Emulator, "the same of the load axis", 131_000.0),
        (
            "ping-pong-bus",
            Reference,
            "16 bytes there and back between two processes on the same bus",
            92_000.0,
        ),
        ("ping-pong-socketpair", Reference, "the same on a bare socket pair", 61_000.0),
        ("drive-rig-to-controller", Joined, "sensors on their way", 31_000.0),
        ("drive-controller-to-rig", Joined, "command on its way", 27_000.0),
        ("load-rig-to-controller", Joined, "sensors on their way", 38_000.0),
        ("load-controller-to-rig", Joined, "command on its way", 29_000.0),
        (
            "drive-command-age",
            Emulator,
            "sensors handed over to the cycle in which the command acts",
            1_000_000.0,
        ),
        ("load-command-age", Emulator, "the same of the load axis", 1_050_000.0),
        ("emulator-receive", Emulator, "taking frames", 3_800.0),
        ("emulator-step", Emulator, "the plant's millisecond", 2_400.0),
        ("emulator-send", Emulator, "sending frames", 17_000.0),
        ("emulator-execution", Emulator, "from waking to done", 24_000.0),
        ("controller-receive", Controller, "taking frames", 4_700.0),
        ("controller-step", Controller, "chains and algorithms", 5_900.0),
        ("controller-send", Controller, "sending frames", 13_000.0),
        ("controller-execution", Controller, "from waking to done", 27_000.0),
        ("emulator-completion", Emulator, "from the scheduled time to done", 39_000.0),
        ("emulator-period-error", Emulator, "distance of two wake-ups less the period", 2_200.0),
    ]
    .map(|(name, source, about, middle_ns)| distribution(name, source, about, middle_ns))
    .into()
}

fn ratio(name: &str, middle: f64, reference_ns: f64) -> Ratio {
    let mut random = PseudoRandom(7 + name.len() as u64);
    let pair = |_| {
        let reference_ns = reference_ns * (0.9 + 0.2 * random.next());
        ((reference_ns * middle * (0.85 + 0.3 * random.next())) as u64, reference_ns as u64)
    };
    let pairs_ns: Vec<(u64, u64)> = (0..RUNS).map(pair).collect();
    let (interval, confidence) = (Some((middle * 0.93, middle * 1.08)), Some(0.979));
    Ratio { name: name.into(), pairs_ns, median: middle, interval, confidence }
}

fn row(cycle: u64, due_us: f64, late_us: f64, execution_us: f64) -> NearbyCycle {
    let run_delay_us = if late_us > 100.0 { late_us * 0.02 } else { 0.0 };
    NearbyCycle { cycle, due_us, late_us, execution_us, run_delay_us, cpu: 1, ..NearbyCycle::default() }
}

/// Ten cycles before, the late one, those after it.
fn nearby_cycles(process: &str, cycle: u64, late_us: f64, random: &mut PseudoRandom) -> Vec<NearbyCycle> {
    let missed = (late_us / 1000.0) as i64;
    let places = (-10..=0).chain(missed + 1..missed + 12);
    let offset_us = if process == "emulator" { 0.0 } else { 48.0 };
    let one = |place: i64| {
        let usual_us = 10.0 + 14.0 * random.next();
        let late_us = if place == 0 { late_us + usual_us } else { usual_us };
        let execution_us = 21.0 + 9.0 * random.next();
        row(cycle.wrapping_add_signed(place), place as f64 * 1000.0 + offset_us, late_us, execution_us)
    };
    places.map(one).collect()
}

fn event(place: u64, cause: Cause, late_us: f64, sentence: &str, evidence: &[&str]) -> Event {
    let mut random = PseudoRandom(place);
    let cycle = 12_345 + 977 * place;
    let process = if cause == Cause::ControllerStopped { "controller" } else { "emulator" };
    let both_are_late = cause == Cause::MachineStoodStill;
    let late_of = |one: &str| if one == process || both_are_late { late_us } else { 4.0 };
    let nearby_cycles = ["emulator", "controller"]
        .map(|one| (one.to_owned(), nearby_cycles(one, cycle, late_of(one), &mut random)))
        .into();
    let gap = |cpu, from_us, length_us, another_ran| ProbeGap { cpu, from_us, length_us, another_ran };
    let probe = match cause {
        Cause::MachineStoodStill => {
            vec![gap(0, -35.0, late_us + 30.0, false), gap(1, -31.0, late_us + 22.0, false)]
        }
        Cause::CpuContention => vec![gap(1, -120.0, late_us + 130.0, true), gap(0, 1900.0, 240.0, true)],
        _ => Vec::new(),
    };
    Event {
        run: place as usize % RUNS,
        process: process.into(),
        cycle,
        at_s: cycle as f64 * 1e-3,
        late_ns: (late_us * 1e3) as u64,
        slow_ns: if cause == Cause::PageFaults { 850_000 } else { 0 },
        skipped: (late_us / 1000.0) as u64,
        cause,
        sentence: sentence.into(),
        evidence: evidence.iter().map(|one| (*one).to_owned()).collect(),
        nearby_cycles,
        probe,
        waited_ns: 0,
        machine_ran: cause != Cause::MachineStoodStill,
        dump: (place == 0).then(|| format!("flight/{process}-{cycle:010}-overrun")),
        frames: BTreeMap::from([("110".into(), 301), ("120".into(), 299)]),
        rig_events: if place == 0 { vec!["Cycle 17: stale drive".into()] } else { Vec::new() },
    }
}

fn worst() -> Vec<Event> {
    vec![
        event(
            0,
            Cause::EmulatorStopped,
            5020.0,
            "The rig's process was stopped by a signal for 5.0 ms and continued.",
            &[
                "The process was continued (SIGCONT) in the late cycle.",
                "It did not wait for a CPU: 0.1 ms of 5.0 ms.",
                "The controller ran on time meanwhile, and the probe saw no gap: the machine was running.",
            ],
        ),
        event(
            1,
            Cause::MachineStoodStill,
            3480.0,
            "The machine stood still for 3.5 ms: every CPU had a gap in which no thread ran.",
            &["The probe saw 3.5 ms on CPU 0 and CPU 1 at once.", "Both processes were late together."],
        ),
        event(
            2,
            Cause::CpuContention,
            2210.0,
            "Another thread of the same or higher priority had CPU 1 for 2.2 ms.",
            &[
                "The thread was ready and waited 2.1 ms for its CPU.",
                "The probe's gap on CPU 1 says that another thread ran.",
            ],
        ),
        event(
            3,
            Cause::PageFaults,
            30.0,
            "The thread waited for pages: 214 minor and 2 major faults in one cycle.",
            &["Page faults in this cycle: 216; usual: none."],
        ),
        event(
            4,
            Cause::ControllerStopped,
            5100.0,
            "A controller was stopped for 5.1 ms.",
            &["Continued once."],
        ),
        event(5, Cause::Unexplained, 740.0, "Nothing that was recorded explains it.", &[]),
        event(6, Cause::MachineStoodStill, 690.0, "The machine stood still for 0.7 ms.", &["Both CPUs."]),
    ]
}

fn run(place: usize) -> RunPart {
    let skipped = if place < 3 { 5 - place as u64 } else { 0 };
    let counts = [
        ("cycles", 60_000),
        ("skipped", skipped),
        ("overruns", skipped.min(1)),
        ("frames_sent", 132_012),
        ("frames_received", 129_981),
        ("frames_lost", 0),
        ("frames_late", place as u64 / 4),
        ("frames_duplicate", 0),
        ("frames_malformed", 0),
        ("stale_commands", 0),
        ("minor_faults", 3),
    ];
    let interval_ns = PercentilesNs {
        p50: Some(1_000_040),
        p90: Some(1_009_000),
        p99: Some(1_041_000),
        p999: Some(1_230_000),
        p9999: None,
        max: Some(6_020_000),
        count: 59_990,
    };
    let arrivals =
        [("emulator", "DriveValveCommand"), ("emulator", "LoadValveCommand"), ("controller", "DriveSensors")];
    let arrival = |(receiver, frame): (&str, &str)| ArrivalRow {
        receiver: receiver.into(),
        figures: ArrivalFigures {
            frame: frame.to_owned().into(),
            period_ms: 1,
            count: 59_990,
            gaps: skipped,
            bursts: Some(2),
            interval_ns,
        },
    };
    RunPart {
        folder: format!("/tmp/airbench/latency/20261120-1030{place:02}-idle"),
        group: "idle".into(),
        started_unix_s: 1_795_170_592.0 + 70.0 * place as f64,
        duration_s: SECONDS as f64,
        counts: counts.map(|(name, count)| (name.to_owned(), count)).into(),
        frame_faults: FrameFaults {
            rig: FrameFaultCounts {
                lost: None,
                late: Some(place as u64 / 4),
                duplicate: Some(0),
                malformed: Some(0),
            },
            controllers: FrameFaultCounts::default(),
        },
        command_ages: CommandAges::default(),
        percentiles_ns: ["emulator-wakeup", "drive-round-trip"]
            .map(|name| (name.to_owned(), interval_ns))
            .into(),
        arrivals: arrivals.map(arrival).into(),
        passed: place != 1,
        lacks: if place == 4 {
            vec!["no probe.csv: gaps of the machine are not known".into()]
        } else {
            vec![]
        },
    }
}

fn comparison() -> Comparison {
    let cell = |median_ns, change_percent, beyond_noise| ComparisonCell {
        median_ns,
        range_ns: (median_ns - median_ns / 9, median_ns + median_ns / 7),
        change_percent,
        beyond_noise,
    };
    let row = |figure: &str, median_ns: u64| ComparisonRow {
        figure: figure.into(),
        cells: vec![
            cell(median_ns, None, None),
            cell(median_ns * 2, Some(100.0), Some(true)),
            cell(median_ns * 98 / 100, Some(-2.0), Some(false)),
            cell(median_ns, Some(f64::NAN), None),
        ],
    };
    Comparison {
        groups: ["idle", "stress-ng", "spin", "short"].map(str::to_owned).into(),
        rows: vec![
            row("emulator-wakeup p50", 14_100),
            row("emulator-wakeup p99", 48_300),
            row("drive-round-trip p50", 118_000),
        ],
    }
}

fn facts(facts: &[(&str, &str)]) -> Vec<Fact> {
    facts.iter().map(|(name, value)| Fact { name: (*name).into(), value: (*value).into() }).collect()
}

fn conditions() -> Conditions {
    Conditions {
        machine: facts(&[
            ("processor", "AMD EPYC 7763 64-Core Processor, 2 CPUs online"),
            ("kernel", "6.1.0-41-amd64 #1 SMP PREEMPT_DYNAMIC Debian 6.1.158-1"),
            ("preemption model", "voluntary (PREEMPT_DYNAMIC)"),
            (
                "kernel command line",
                "BOOT_IMAGE=/boot/vmlinuz root=/dev/vda1 ro quiet mitigations=auto console=ttyS0",
            ),
            ("governor", "not told by the kernel"),
            ("clock source", "kvm-clock"),
            ("hypervisor", "KVM"),
            ("RT throttling", "950000 us of 1000000 us"),
            ("IRQ affinity", "all on 0-1"),
            ("limits", "rtprio 99, memlock unlimited"),
            ("build", "airbench 0.1.0, release, rustc 1.95.0"),
        ]),
        command_lines: facts(&[
            (
                "emulator",
                "emulator run --bus unix:///tmp/airbench/bus0 --experiment experiments/hold.toml --pin 1 --full-timing",
            ),
            (
                "controller",
                "controller run --bus unix:///tmp/airbench/bus0 --experiment experiments/hold.toml --pin 0",
            ),
        ]),
        privileges: facts(&[
            ("priority", "FIFO 80 granted"),
            ("memory", "locked"),
            ("/dev/cpu_dma_latency", "held at 0"),
        ]),
        load_generator: None,
        reference: Some(
            "cyclictest --mlockall --priority=80 --interval=1000 --affinity=1 --json=c.json".into(),
        ),
        reference_missing_because: None,
        probe: true,
    }
}

/// Made once: without optimisation it takes seconds.
pub(crate) fn rich() -> Report {
    static RICH: OnceLock<Report> = OnceLock::new();
    RICH.get_or_init(make_rich).clone()
}

fn make_rich() -> Report {
    let sentence = |text: &str| text.to_owned();
    Report {
        schema: SCHEMA.into(),
        schema_version: SCHEMA_VERSION,
        title: "Latency on an idle machine, ten pairs".into(),
        made_unix_s: 1_795_171_400.0,
        claim: Claim {
            supported: false,
            sentence: "Medians and p99 compare with the reference's; the maxima are the hypervisor's.".into(),
            reasons: vec![
                sentence("The machine is virtual (KVM): it stood still twice, for 3.5 ms at the longest."),
                sentence("The preemption model is voluntary, not PREEMPT_RT."),
            ],
            not_controlled: vec![
                sentence("Frequency scaling: the kernel does not tell its governor."),
                sentence("Interrupts run on the same CPUs as the measured threads."),
                sentence("Neighbours on the host."),
            ],
        },
        conditions: conditions(),
        distributions: distributions(),
        ratios: vec![
            ratio("emulator-wakeup p50 / cyclictest p50", 1.04, 13_200.0),
            ratio("emulator-wakeup p99 / cyclictest p99", 0.97, 31_000.0),
            ratio("drive-round-trip p50 / ping-pong-bus p50", 1.31, 92_000.0),
            Ratio {
                name: "too few".into(),
                pairs_ns: vec![(5, 0), (4, 3)],
                median: f64::NAN,
                interval: None,
                confidence: None,
            },
        ],
        worst: worst(),
        findings: vec![
            Finding {
                cause: Cause::MachineStoodStill,
                count: 2,
                explained_ns: 6_000_000,
                by_itself: true,
                sentence: "The machine stood still twice.".into(),
            },
            Finding {
                cause: Cause::EmulatorStopped,
                count: 1,
                explained_ns: 5_020_000,
                by_itself: false,
                sentence: "The rig was stopped once.".into(),
            },
        ],
        runs: (0..RUNS).map(run).collect(),
        comparison: Some(comparison()),
        bounds: vec![
            BoundResult {
                figure: "emulator-wakeup.p99_us".into(),
                value: Some(48.3),
                max: Some(100.0),
                kept: true,
                ..resolved()
            },
            BoundResult { figure: "frames_lost".into(), max: Some(0.0), ..resolved() },
            BoundResult {
                figure: "ratio.emulator-wakeup.p99".into(),
                value: Some(1.05),
                max: Some(1.1),
                interval: Some((0.27, 4.95)),
                resolved: false,
                pairs_to_resolve: Some(11_111),
                ..resolved()
            },
            BoundResult {
                figure: "ratio.emulator-wakeup.p50".into(),
                value: Some(1.1),
                resolved: false,
                ..resolved()
            },
            BoundResult {
                figure: "cycles".into(),
                value: Some(f64::INFINITY),
                min: Some(59_000.0),
                kept: true,
                ..resolved()
            },
        ],
    }
}

/// A bound of a figure that was not measured.
fn resolved() -> BoundResult {
    BoundResult {
        figure: String::new(),
        value: None,
        min: None,
        max: None,
        kept: false,
        interval: None,
        resolved: true,
        pairs_to_resolve: None,
    }
}

/// A report of nothing.
pub(crate) fn empty() -> Report {
    Report {
        schema: SCHEMA.into(),
        schema_version: SCHEMA_VERSION,
        made_unix_s: f64::NAN,
        claim: Claim { supported: true, ..Claim::default() },
        ..Report::default()
    }
}
