//! Every fault of sensors, valves, supply, air and mechanics does what its row of the table says, seen in the files of a run in
//! lockstep; `faults_script.rs` holds that none is forgotten.
//!
//! Faults last from 0.2 to 0.3 s of runs of 0.4 s unless a test says otherwise. The truth is what the sensors are held against:
//! noise of 20 um, 0.5 N and 400 Pa, steps below that.

use protocol::frames::RigStatus;
use system_tests::broken::{BEGINS, ENDS, FaultRun, FaultRunPlan, Row, fault};

const ATMOSPHERE_PA: f64 = 101_325.0;

/// What a kind of sensor measures: the unit that its keys end in, a size of error that is far above the noise and within the
/// range, its noise, its step, the low end of its range.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    size: f64,
    noise: f64,
    step: f64,
    least: f64,
}

const POSITION: Quantity =
    Quantity { name: "position", unit: "m", size: 0.01, noise: 20e-6, step: 0.5 / 65535.0, least: 0.0 };
const FORCE: Quantity =
    Quantity { name: "force", unit: "n", size: 100.0, noise: 0.5, step: 2000.0 / 32767.0, least: -2000.0 };
const PRESSURE: Quantity =
    Quantity { name: "pressure", unit: "pa", size: 50_000.0, noise: 400.0, step: 1e6 / 16383.0, least: 0.0 };

/// A sensor: its column, that of its truth, what its mounting adds.
struct Channel {
    at: &'static str,
    shown: &'static str,
    truth: &'static str,
    mounted: f64,
    of: Quantity,
}

const fn channel(
    at: &'static str,
    shown: &'static str,
    truth: &'static str,
    mounted: f64,
    of: Quantity,
) -> Channel {
    Channel { at, shown, truth, mounted, of }
}

const CHANNELS: [Channel; 8] = [
    channel("drive", "drive_position_m", "drive_position_m", 0.0, POSITION),
    channel("load", "load_position_m", "load_position_m", 0.8e-3, POSITION),
    channel("drive", "drive_force_N", "drive_sensor_force_N", 0.0, FORCE),
    channel("load", "load_force_N", "load_sensor_force_N", 0.0, FORCE),
    channel("drive.a", "drive_pressure_a_Pa", "drive_pressure_a_Pa", 0.0, PRESSURE),
    channel("drive.b", "drive_pressure_b_Pa", "drive_pressure_b_Pa", 0.0, PRESSURE),
    channel("load.a", "load_pressure_a_Pa", "load_pressure_a_Pa", 0.0, PRESSURE),
    channel("load.b", "load_pressure_b_Pa", "load_pressure_b_Pa", 0.0, PRESSURE),
];

impl Channel {
    /// Holds that a sensor is off by noise and a step alone: the largest of some hundred draws.
    fn expect_near(&self, k: usize, off: f64) {
        assert!(off.abs() < 6.0 * self.of.noise + self.of.step, "{} {k}: {off}", self.shown);
    }
}

/// Both axes move throughout.
fn moving(faults: &str) -> FaultRun {
    FaultRunPlan { faults, act: |_| Some([0.3, 0.3]), ..FaultRunPlan::default() }.run_with_marks()
}

/// One kind of fault in all eight sensors at once; `numbers` makes them from unit and size. Errors against the truth follow,
/// and what was shown.
fn all_sensors(
    kind: &str,
    numbers: impl Fn(&str, f64) -> String,
    check: impl Fn(&Channel, &[f64], &[f64], &[f64]),
) -> FaultRun {
    let script: String = CHANNELS
        .iter()
        .map(|Channel { at, of, .. }| {
            fault(&format!("{}-sensor-{kind}", of.name), at, &numbers(of.unit, of.size))
        })
        .collect();
    let outcome = moving(&script);
    for channel in &CHANNELS {
        let shown = outcome.measurement.column(channel.shown);
        let truth: Vec<_> =
            outcome.truth.column(channel.truth).into_iter().map(|truth| truth + channel.mounted).collect();
        let errors: Vec<_> = shown.iter().zip(&truth).map(|(shown, truth)| shown - truth).collect();
        // Before and after a sensor is sound.
        for k in (BEGINS - 100..BEGINS).chain(ENDS..ENDS + 80) {
            channel.expect_near(k, errors[k]);
        }
        check(channel, &shown, &truth, &errors);
    }
    outcome
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn sensors_stick_and_drop_out_and_the_status_says_which_are_at_an_end() {
    all_sensors(
        "stuck",
        |_, _| String::new(),
        |channel, shown, _, _| {
            let (at, stuck) = (channel.shown, &shown[BEGINS..ENDS]);
            assert!(stuck.iter().all(|value| value.to_bits() == stuck[0].to_bits()), "{at} moves");
            assert!(shown[ENDS..].iter().any(|value| value != &stuck[0]), "{at} stays stuck");
        },
    );
    let outcome = all_sensors(
        "dropout",
        |_, _| String::new(),
        |channel, shown, _, _| {
            let dropped = |value: &f64| (value - channel.of.least).abs() < channel.of.step / 2.0;
            assert!(shown[BEGINS..ENDS].iter().all(dropped), "{}", channel.shown);
        },
    );
    let all_saturated = |status: &RigStatus| {
        status.drive_position_saturated
            && status.drive_force_saturated
            && status.drive_pressure_a_saturated
            && status.drive_pressure_b_saturated
            && status.load_position_saturated
            && status.load_force_saturated
            && status.load_pressure_a_saturated
            && status.load_pressure_b_saturated
    };
    let all = outcome.statuses().filter(all_saturated).count();
    assert_eq!(all, 11, "ten in 0.1 s, and what came since the last of them");
}

#[test]
fn sensors_are_off_by_an_offset_a_gain_and_a_drift() {
    all_sensors(
        "offset",
        |unit, size| format!("offset_{unit} = -{size}"),
        |channel, _, _, errors| {
            // Mean of a hundred draws of noise: a tenth of it, five times.
            let off = mean(&errors[BEGINS..ENDS]) + channel.of.size;
            assert!(off.abs() < 0.5 * channel.of.noise, "{}: {off}", channel.shown);
        },
    );
    all_sensors(
        "gain",
        |_, _| "gain = 0.95".into(),
        |channel, shown, truth, _| {
            (BEGINS..ENDS).for_each(|k| channel.expect_near(k, shown[k] - 0.95 * truth[k]));
        },
    );
    all_sensors(
        "drift",
        |unit, size| format!("drift_{unit}_per_s = -{size}"),
        |channel, _, _, errors| {
            for (k, error) in errors.iter().enumerate().take(ENDS).skip(BEGINS) {
                channel.expect_near(k, error + channel.of.size * (k - BEGINS) as f64 * 1e-3);
            }
        },
    );
}

#[test]
fn sensors_are_noisy_spiky_and_coarse() {
    all_sensors(
        "noise",
        |unit, size| format!("noise_{unit} = {}", size / 2.0),
        |channel, _, _, errors| {
            let rms =
                mean(&errors[BEGINS..ENDS].iter().map(|error| error * error).collect::<Vec<_>>()).sqrt();
            // Standard error of a deviation of a hundred draws: 7 %; five of them.
            assert!((2.0 * rms / channel.of.size - 1.0).abs() < 0.35, "{}: {rms}", channel.shown);
        },
    );
    all_sensors(
        "spike",
        |unit, size| format!("spike_{unit} = -{size}\nevery_ms = 25"),
        |channel, _, _, errors| {
            for (k, error) in errors.iter().enumerate().take(ENDS).skip(BEGINS) {
                let spike = if (k - BEGINS).is_multiple_of(25) { -channel.of.size } else { 0.0 };
                channel.expect_near(k, error - spike);
            }
        },
    );
    all_sensors(
        "quantisation",
        |unit, size| format!("step_{unit} = {size}"),
        |channel, shown, _, errors| {
            let Quantity { size, noise, step, .. } = channel.of;
            for k in BEGINS..ENDS {
                let steps = shown[k] / size;
                assert!((steps - steps.round()).abs() * size < step, "{} {k}", channel.shown);
                assert!(errors[k].abs() < size / 2.0 + 6.0 * noise + step);
            }
        },
    );
}

/// The drive's valve is commanded to 0.5, and to -0.4 in answer to cycle 249: from cycle 250 on.
fn reported(cycle: u32) -> Option<[f64; 2]> {
    Some([if cycle < 249 { 0.5 } else { -0.4 }, 0.0])
}

fn with_valve(name: &str, numbers: &str) -> FaultRun {
    let outcome =
        FaultRunPlan { faults: &fault(name, "drive", numbers), act: reported, ..FaultRunPlan::default() }
            .run_with_marks();
    let reported = outcome.measurement.column("drive_valve");
    assert!(
        reported[100] > 0.49 && reported[249] > 0.49 && reported[250] < -0.39,
        "the record shows what was commanded"
    );
    outcome
}

#[test]
fn a_stuck_valve_holds_its_spool_and_the_flow() {
    let outcome = with_valve("valve-stuck", "");
    let spool = outcome.truth.column("drive_spool");
    assert!(spool[BEGINS..=ENDS].iter().all(|s| s.to_bits() == spool[BEGINS].to_bits()), "it moves");
    let flow = outcome.truth.column("drive_edge_flow_a_m3_per_s");
    assert!(flow[251..ENDS].iter().all(|flow| *flow > 1e-4), "supplied against the command of -0.4");
    // Ten time constants of 1.6 ms after its end the spool is where it is asked to be, and the chamber exhausts.
    assert!((spool[ENDS + 20] + 0.4).abs() < 1e-3 && flow[ENDS + 20] < -1e-4);
}

#[test]
fn a_dead_a_limited_and_an_offset_valve_go_elsewhere() {
    // 40 ms are 25 time constants; a command is a multiple of 1/2047.
    for (name, numbers, before, after) in [
        ("valve-dead", "", 0.0, 0.0),
        ("valve-limited", "limit = 0.1", 0.1, -0.1),
        ("valve-offset", "offset = 0.2", 0.7, -0.2),
    ] {
        let outcome = with_valve(name, numbers);
        let spool = outcome.truth.column("drive_spool");
        assert!((spool[249] - before).abs() < 3e-4, "{name}: {}", spool[249]);
        assert!((spool[ENDS - 1] - after).abs() < 3e-4, "{name}: {}", spool[ENDS - 1]);
        assert!((spool[ENDS + 50] + 0.4).abs() < 3e-4, "{name}: it is whole again");
        if name == "valve-dead" {
            let flow = outcome.truth.column("drive_edge_flow_a_m3_per_s");
            assert!(flow[BEGINS + 20..ENDS].iter().all(|flow| *flow == 0.0), "nothing passes it");
        }
    }
}

#[test]
fn a_slow_valve_follows_with_its_time_constant() {
    let spool = with_valve("valve-slow", "time_constant_s = 0.02").truth.column("drive_spool");
    let way = |ms: f64| 0.5 - 0.9 * (1.0 - (-ms / 20.0).exp());
    for ms in [10, 20, 40] {
        // A period early by its own step (4 %), 1.6 ms late by its own lag (8 % of what is left).
        let off = spool[250 + ms] - way(ms as f64);
        assert!(off.abs() < 0.06, "{ms} ms after the command: off by {off}");
    }
    let sound = with_valve("valve-offset", "offset = 0.0").truth.column("drive_spool");
    assert!((sound[260] + 0.4).abs() < 3e-3, "a sound one is there after 10 ms");
}

#[test]
fn the_supply_sags_and_fails_with_its_time_constant() {
    let run = |name: &str, numbers: &str| {
        FaultRunPlan { faults: &fault(name, "supply", numbers), ..FaultRunPlan::default() }.run_with_marks()
    };
    let sags = run("supply-sag", "drop_pa = 300000\ntime_constant_s = 0.05");
    let sagging = sags.truth.column("supply_pressure_Pa");
    let fails = run("supply-loss", "");
    let failing = fails.truth.column("supply_pressure_Pa");
    for k in BEGINS..=ENDS {
        let left = (-((k - BEGINS) as f64) / 50.0).exp();
        // Exact exponentials: some hundred roundings of 7e5.
        assert!((sagging[k] - (4e5 + 3e5 * left)).abs() < 1e-6, "cycle {k}: {}", sagging[k]);
        assert!((failing[k] - (ATMOSPHERE_PA + (7e5 - ATMOSPHERE_PA) * left)).abs() < 1e-6, "cycle {k}");
    }
    assert!(sagging[ENDS + 90] > sagging[ENDS] + 5e4, "it recovers");
    let shut = |outcome: &FaultRun| {
        outcome.truth.column("check_valves_shut").iter().filter(|shut| **shut == 1.0).count()
    };
    assert_eq!(shut(&sags), 0, "the pilot pressure is below");
    assert!(shut(&fails) > 10, "the check valves close below their pilot pressure");
}

/// Air leaves a chamber whose piston is held by friction, so that its volume stays.
fn held(name: &str, numbers: &str) -> FaultRun {
    let faults = fault(name, "drive.a", numbers) + &fault("friction-rise", "drive", "factor = 100.0");
    let outcome = FaultRunPlan { faults: &faults, ..FaultRunPlan::default() }.run_with_marks();
    let position = outcome.truth.column("drive_position_m");
    assert!(
        position[BEGINS..ENDS].iter().all(|x| x.to_bits() == position[0].to_bits()),
        "the piston is held"
    );
    outcome
}

const VOLUME_M3: f64 = 20e-6 + 1963.5e-6 * 0.25;

#[test]
fn a_burst_hose_empties_the_chamber_with_the_computed_time_constant() {
    let outcome = held("hose-burst", "kv_m3_per_h = 1.5");
    let pressure = outcome.truth.column("drive_pressure_a_Pa");
    let tau_s = VOLUME_M3 / (ATMOSPHERE_PA * 12.95 * 1.5 / 1e5 / 3600.0);
    let choked = (BEGINS..ENDS).take_while(|k| pressure[*k] > 2.0 * ATMOSPHERE_PA);
    let mut compared = 0;
    for k in choked {
        let computed = pressure[BEGINS] * (-((k - BEGINS) as f64) * 1e-3 / tau_s).exp();
        // A midpoint rule of 100 us on 0.1 s.
        assert!((pressure[k] / computed - 1.0).abs() < 1e-5, "cycle {k}: {} for {computed}", pressure[k]);
        compared += 1;
    }
    assert!(compared > 20, "choked for {compared} ms only");
    let other = outcome.truth.column("drive_pressure_b_Pa");
    assert!((other[ENDS - 1] / other[0] - 1.0).abs() < 1e-9, "the other chamber keeps its air");
}

#[test]
fn a_leaking_chamber_empties_as_the_law_of_the_gap_says() {
    let pressure = held("chamber-leak", "leakage_nl_per_min = 400.0").truth.column("drive_pressure_a_Pa");
    // dp/dt = -c (p^2 - a^2), with p = a (1 + r e^(-2act)) / (1 - r e^(-2act)).
    let (a, p) = (ATMOSPHERE_PA, pressure[BEGINS]);
    let c = ATMOSPHERE_PA / VOLUME_M3 * (400.0 / 60_000.0) / 35e10;
    let r = (p - a) / (p + a);
    for (k, shown) in pressure.iter().enumerate().take(ENDS).skip(BEGINS) {
        let decay = r * (-2.0 * a * c * (k - BEGINS) as f64 * 1e-3).exp();
        let computed = a * (1.0 + decay) / (1.0 - decay);
        assert!((shown / computed - 1.0).abs() < 1e-5, "cycle {k}: {shown} for {computed}");
    }
    assert!(pressure[ENDS - 1] < 0.95 * p, "it leaks");
}

#[test]
fn friction_that_rises_holds_an_axis_that_would_move() {
    let act = |cycle: u32| Some([if cycle < 199 { 0.0 } else { 0.5 }, if cycle < 199 { 0.0 } else { 0.5 }]);
    let faults = fault("friction-rise", "drive", "factor = 100.0");
    let outcome = FaultRunPlan { faults: &faults, act, ..FaultRunPlan::default() }.run_with_marks();
    let way = |column: &str| {
        let x = outcome.truth.column(column);
        [(x[ENDS - 1] - x[BEGINS]).abs(), (x[ENDS + 99] - x[ENDS]).abs()]
    };
    let [held_m, _] = way("drive_position_m");
    let [moved_m, _] = way("load_position_m");
    assert_eq!(held_m, 0.0, "3500 N hold it");
    assert!(moved_m > 0.001, "the other one moves: {moved_m} m");
    assert!(way("drive_position_m")[1] > 0.005, "it breaks loose at the end");
}

#[test]
fn mass_on_top_is_what_forces_have_to_move() {
    let faults =
        fault("added-mass", "drive", "mass_kg = 20.0") + &fault("added-mass", "load", "mass_kg = 3.0");
    let outcome = moving(&faults);
    for (axis, axis_kg, added_kg) in [("drive", 5.0, 20.0), ("load", 1.5, 3.0)] {
        let column = |name: &str| outcome.truth.column(&format!("{axis}_{name}"));
        let forces =
            ["pneumatic", "hand", "contact", "viscous_friction", "sliding_friction", "holding", "effect"]
                .map(|name| column(&format!("{name}_force_N").replace("friction_force", "friction")));
        let acceleration = column("rod_acceleration_m_per_s2");
        let mut seen = 0;
        for k in (0..400).filter(|k| acceleration[*k].abs() > 0.01) {
            let mass_kg = forces.iter().map(|force| force[k]).sum::<f64>() / acceleration[k];
            let expected_kg = axis_kg + if (BEGINS..ENDS).contains(&k) { added_kg } else { 0.0 };
            // Forces of a thousand newton that nearly cancel.
            assert!((mass_kg / expected_kg - 1.0).abs() < 1e-9, "{axis}, cycle {k}: {mass_kg} kg");
            seen += usize::from((BEGINS..ENDS).contains(&k));
        }
        assert!(seen > 10, "{axis} is hardly accelerated");
    }
}

#[test]
fn rods_part_once_and_an_axis_hits_the_end_of_its_stroke() {
    let faults = "[[fault]]\nname = \"mechanical-unlink\"\nfrom_s = 0.2\n\
                  [[fault]]\nname = \"end-stop-hit\"\nat = \"drive\"\nfrom_s = 0.25\n";
    let rig = "carriage_position_m = 0.25\nlinked = true\n";
    // Against the air that a shut valve traps, 3000 N would not do.
    let act = |cycle: u32| Some([if cycle < 249 { 0.0 } else { 1.0 }, 0.0]);
    let outcome = FaultRunPlan { rig, faults, cycles: 700, act, ..FaultRunPlan::default() }.run_with_marks();
    let linked: Vec<_> = outcome.statuses().map(|status| status.linked).collect();
    // The status of every tenth cycle, in the fifth.
    let parted = linked.iter().position(|linked| !linked).expect("the rods part");
    assert_eq!(parted, BEGINS / 10);
    assert!(linked[parted..].iter().all(|linked| !linked), "they stay parted");
    let rows = outcome.rows();
    let what: Vec<_> = rows.iter().map(|row| (row.fault.as_str(), row.what.as_str())).collect();
    assert_eq!(what, [("mechanical-unlink", "begins"), ("end-stop-hit", "begins"), ("end-stop-hit", "ends")]);
    let (x, v) =
        (outcome.truth.column("drive_position_m"), outcome.truth.column("drive_rod_velocity_m_per_s"));
    let hit = rows[2].cycle;
    assert_eq!((x[hit], v[hit]), (0.5, 0.0), "it stops dead at the end");
    assert!(v[hit - 2] > 0.1, "it came with {} m/s", v[hit - 2]);
    assert_eq!(outcome.truth.column("drive_hand_force_N")[hit], 0.0, "and is let go");
}

#[test]
fn conditions_begin_a_fault_when_the_rig_is_there() {
    let faults = "[[fault]]\nname = \"valve-dead\"\nat = \"drive\"\nwhen = \"drive.position_m\"\nabove = 0.26\nfor_s = 0.05\n\
                  [[fault]]\nname = \"supply-loss\"\nwhen = \"drive.pressure_a_pa\"\nabove = 9e5\nto_s = 0.3\n";
    let outcome = moving(faults);
    let x = outcome.truth.column("drive_position_m");
    let passed = x.iter().position(|x| *x > 0.26).expect("it passes 0.26 m");
    let row = |number, what: &str| {
        let found = outcome.rows().into_iter().find(|row: &Row| row.number == number && row.what == what);
        found.unwrap_or_else(|| panic!("fault {number} never {what}: {:?}", outcome.rows())).cycle
    };
    assert_eq!((row(1, "begins"), row(1, "ends")), (passed, passed + 50));
    assert_eq!(row(2, "never-began"), 300);
}
