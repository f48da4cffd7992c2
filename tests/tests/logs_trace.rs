//! A run as a trace for Perfetto, held against what the run recorded: every cycle of the timing tables with its stages, every
//! frame of the log, every mark of a fault, all on one time axis.

use runlog::timing::{self, CycleTiming};
use serde_json::Value;
use std::fs;
use std::path::Path;
use system_tests::{CompletedProcess, Pace, Program, SHORT, Scene, json, run_both, timing_rows, turn};

const FAULTS: &str = "[[fault]]\nname = \"valve-stuck\"\nat = \"drive\"\nfrom_s = 0.2\nto_s = 0.25\n";

fn export(folder: &Path, out: &Path) -> CompletedProcess {
    Program::Bench.start(&[&"export", &folder, &"--to", &"trace", &"--out", &out]).wait().expect_code(0)
}

struct Trace {
    events: Vec<Value>,
    cycle_zero_us: f64,
}

impl Trace {
    fn read(path: &Path) -> Self {
        let trace = json(path);
        let cycle_zero_us = trace["otherData"]["cycle_zero_us"].as_f64().expect("the time of cycle 0");
        let events = trace["traceEvents"].as_array().expect("events").clone();
        for event in events.iter().filter(|event| event["ph"] != "M") {
            assert!(event["ts"].as_f64().is_some_and(|us| us >= 0.0), "{event}");
        }
        Self { events, cycle_zero_us }
    }

    /// Number of the process or thread that has this name.
    fn named(&self, kind: &str, pid: Option<u64>, name: &str) -> u64 {
        let is_it = |event: &&Value| {
            event["name"] == kind
                && event["args"]["name"] == name
                && pid.is_none_or(|pid| event["pid"].as_u64() == Some(pid))
        };
        let found = self.events.iter().find(is_it).unwrap_or_else(|| panic!("no {kind} {name}"));
        found[if pid.is_some() { "tid" } else { "pid" }].as_u64().expect("a number")
    }

    /// Events of a thread, or of a whole process, without names.
    fn of(&self, pid: u64, tid: Option<u64>) -> Vec<&Value> {
        let is_its = |event: &&Value| {
            event["ph"] != "M"
                && event["pid"].as_u64() == Some(pid)
                && tid.is_none_or(|tid| event["tid"].as_u64() == Some(tid))
        };
        self.events.iter().filter(is_its).collect()
    }

    /// Holds the cycles of a process against its table; `stages` in the order of the process.
    fn expect_cycles(&self, process: &str, rows: &[CycleTiming], zero_ns: i128, stages: [&str; 3]) {
        let pid = self.named("process_name", None, process);
        let slices = self.of(pid, Some(self.named("thread_name", Some(pid), "cycles")));
        assert_eq!(slices.len(), 4 * rows.len(), "{process}: a cycle and three stages for each row");
        let mut previous_end_us = 0.0;
        for (row, slices) in rows.iter().zip(slices.chunks(4)) {
            let at_us = |ns: u64| (i128::from(ns) - zero_ns) as f64 / 1e3 + self.cycle_zero_us;
            let span = |slice: &Value| [&slice["ts"], &slice["dur"]].map(|us| us.as_f64().expect("a number"));
            let [start_us, length_us] = span(slices[0]);
            assert_eq!(slices[0]["name"], format!("cycle {}", row.cycle));
            assert_eq!(slices[0]["args"]["skipped"].as_u64(), Some(row.skipped));
            let expected_us = at_us(row.woke_ns).max(previous_end_us);
            assert!(same(start_us, expected_us), "{process}: overlap or gap: {} of {row:?}", slices[0]);
            assert!(same(length_us, (row.done_ns - row.woke_ns) as f64 / 1e3), "{process}: {row:?}");
            previous_end_us = start_us + length_us;
            let mut stage_us = start_us;
            for (slice, stage) in slices[1..].iter().zip(stages) {
                let expected_ns = match stage {
                    "receive" => row.receive_ns,
                    "step" => row.step_ns,
                    _ => row.send_ns,
                };
                let [from_us, long_us] = span(slice);
                assert_eq!(slice["name"], stage, "{process}");
                assert!(
                    same(from_us, stage_us) && same(long_us, expected_ns as f64 / 1e3),
                    "{slice} of {row:?}"
                );
                stage_us = from_us + long_us;
            }
            assert!(
                stage_us <= previous_end_us + ROUNDING_US,
                "{process}: stages lie in their cycle: {row:?}"
            );
        }
        let waits = self.of(pid, Some(self.named("thread_name", Some(pid), "wake-up: due to woke")));
        assert_eq!(waits.len(), rows.len());
        for (row, wait) in rows.iter().zip(waits) {
            let late_us = wait["args"]["wake_up_us"].as_f64().expect("a number");
            assert!(same(late_us, (row.woke_ns - row.due_ns) as f64 / 1e3), "{process}: {wait} of {row:?}");
        }
    }
}

/// Times are us with three digits behind the point; sums of a few of them are as exact as 64-bit numbers of a minute.
const ROUNDING_US: f64 = 1e-3;

fn same(one_us: f64, other_us: f64) -> bool {
    (one_us - other_us).abs() < ROUNDING_US
}

#[test]
fn a_trace_holds_every_cycle_with_its_stages_every_frame_and_every_fault() {
    let _machine = turn::take();
    let scene = Scene::new(SHORT);
    let folder = scene.path("emulator");
    let faults = scene.write("faults.toml", FAULTS);
    let options = format!("--full-timing --faults {}", faults.display());
    run_both(
        &scene.emulator(Pace::Real).with(&options),
        &scene.controller(Pace::Real).out(&folder).with("--full-timing"),
    );
    let out = scene.path("run.json");
    let said = export(&folder, &out).stdout;
    let trace = Trace::read(&out);

    let rig = timing_rows(&folder.join("emulator-timing.csv"));
    let controller = timing_rows(&folder.join("controller-timing.csv"));
    assert!(rig.len() > 1000 && controller.len() > 1000);
    assert!(said.contains(&format!("{} cycles, 2 marks", rig.len() + controller.len())), "{said}");
    let zero_ns = i128::from(rig[0].due_ns) - i128::from(rig[0].cycle) * 1_000_000;
    trace.expect_cycles("rig", &rig, zero_ns, ["send", "receive", "step"]);
    trace.expect_cycles("controller", &controller, zero_ns, ["receive", "step", "send"]);

    let log = fs::read_to_string(folder.join("bus.log")).expect("the log");
    let frames = trace.of(trace.named("process_name", None, "bus"), None);
    assert_eq!(frames.len(), log.lines().count());
    let zero_s = json(&folder.join("summary.json"))["bus_log_cycle_zero_s"].as_f64().expect("a time");
    let zero_us = (zero_s * 1e6).round() as i64;
    for (line, event) in log.lines().zip(&frames) {
        let words: Vec<_> = line.split(' ').collect();
        let stamp_us: i64 = words[0].replace(['(', ')', '.'], "").parse().expect("a stamp");
        assert!(same(
            event["ts"].as_f64().expect("a time"),
            (stamp_us - zero_us) as f64 + trace.cycle_zero_us
        ));
        assert_eq!(
            (&event["args"]["interface"], &event["args"]["frame"]),
            (&words[1].into(), &words[2].into())
        );
    }
    // Both clocks meet: the log stamps sensors when they are handed over, in whole us, and so is its cycle 0.
    let sensors: Vec<_> = frames.iter().filter(|event| event["name"] == "DriveSensors").collect();
    let sent: Vec<_> = rig.iter().map(|row| row.drive.sensors_ns).filter(|ns| *ns > 0).collect();
    assert_eq!(sensors.len(), sent.len());
    for (event, ns) in sensors.iter().zip(sent) {
        let handed_over_us = (i128::from(ns) - zero_ns) as f64 / 1e3 + trace.cycle_zero_us;
        let apart_us = event["ts"].as_f64().expect("a time") - handed_over_us;
        assert!(apart_us.abs() < 2.0, "{event}: {apart_us} us apart");
    }

    let pid = trace.named("process_name", None, "rig");
    let marks = trace.of(pid, Some(trace.named("thread_name", Some(pid), "faults")));
    let table = fs::read_to_string(folder.join("faults.csv")).expect("faults.csv");
    assert_eq!((marks.len(), table.lines().count()), (2, 3));
    for (mark, (line, what)) in marks.iter().zip(table.lines().skip(1).zip(["begins", "ends"])) {
        let time_s: f64 = line.split(',').next().and_then(|cell| cell.parse().ok()).expect("a time");
        assert_eq!((&mark["name"], &mark["s"]), (&format!("valve-stuck drive: {what}").into(), &"g".into()));
        assert!(same(mark["ts"].as_f64().expect("a time"), time_s * 1e6 + trace.cycle_zero_us), "{mark}");
    }

    // Rows that share a wake-up, as a stall of the rig can bring about.
    let (mut shared, at_row) = (controller, 500);
    let [first, second] = &mut shared[at_row..at_row + 2] else { panic!("two rows") };
    let work_ns = second.done_ns - second.woke_ns;
    second.woke_ns = first.woke_ns;
    second.due_ns = first.due_ns;
    second.done_ns = second.woke_ns + work_ns;
    let mut table = Vec::new();
    timing::write_head(&mut table).expect("a head line");
    shared.iter().for_each(|row| timing::write_row(&mut table, row).expect("a row"));
    fs::write(folder.join("controller-timing.csv"), table).expect("the table");
    export(&folder, &out);
    Trace::read(&out).expect_cycles("controller", &shared, zero_ns, ["receive", "step", "send"]);

    fs::remove_file(folder.join("controller.json")).expect("the report");
    let said = export(&folder, &out).expect_stderr(&["controller-timing.csv: left out"]);
    assert!(said.stdout.contains(&format!("{} cycles, 2 marks", rig.len())), "{}", said.stdout);
}

#[test]
fn a_trace_without_timing_rows_has_the_frames_and_says_how_cycles_are_recorded() {
    let scene = Scene::new(SHORT);
    let log = scene.write("some.log", "(2.000250) a 120#0011223344556677\n(1.000000) b 1ABCDEF0#01\n");
    let out = scene.path("some.json");
    let said = export(&log, &out).expect_stderr(&["no cycles", "--full-timing"]);
    assert!(said.stdout.contains("2 frames, 0 cycles, 0 marks"), "{}", said.stdout);
    let trace = json(&out);
    assert!(trace["otherData"]["cycle_zero_us"].is_null(), "a log alone does not tell");
    let events = trace["traceEvents"].as_array().expect("events");
    let frames: Vec<_> = events.iter().filter(|event| event["ph"] == "i").collect();
    assert_eq!((&frames[0]["name"], &frames[0]["ts"]), (&"DriveSensors".into(), &1_000_250.0.into()));
    assert_eq!((&frames[1]["name"], &frames[1]["ts"]), (&"1ABCDEF0".into(), &0.0.into()));
}
