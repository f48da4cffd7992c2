//! The timing of both processes on one clock: tables that join by cycle, histograms that hold every frame, and a stop of the
//! controller that its own rows explain.

use crate::hlog;
use runlog::timing::{CycleTiming, Exchange};
use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use system_tests::{
    Pace, RESTLESS, Scene, both_good, count, dropped_at_queue, find, json, timing_rows, turn,
};

fn samples(path: &Path) -> BTreeMap<String, u64> {
    let mut samples = BTreeMap::new();
    for (tag, _, _, histogram) in hlog::intervals(path) {
        *samples.entry(tag).or_default() += histogram.len();
    }
    samples
}

/// Whether the cycle was due when sensors arrived that are not of the axis that wakes the process.
fn begun_by_the_other(row: &CycleTiming, waking_axis: &str) -> bool {
    let (waking, other) = if waking_axis == "drive" { (row.drive, row.load) } else { (row.load, row.drive) };
    waking.sensors_ns == 0 || (row.due_ns == other.sensors_ns && row.due_ns != waking.sensors_ns)
}

/// Holds table, histograms and report of a controller against each other.
fn expect_one_account(scene: &Scene, process: u32, name: &str, waking_axis: &str) -> Vec<CycleTiming> {
    let at = |file: String| scene.path("controller").join(file);
    let report = json(&at(format!("{name}.json")));
    let rows = timing_rows(&at(format!("{name}-timing.csv")));
    assert_eq!(
        rows.len() as u64,
        count(&report, "/cycles_answered"),
        "{name}: a row for each cycle answered"
    );
    assert!(rows.windows(2).all(|pair| pair[1].cycle == pair[0].cycle + 1 + pair[1].skipped), "{name}");
    assert_eq!(count(&report, "/timing_dropped"), 0, "{name}");
    let of_axis = |key| count(&report, &format!("/axes/{waking_axis}/{key}"));
    let summary = scene.summary();
    let dropped = dropped_at_queue(&summary, process, if waking_axis == "drive" { "120" } else { "121" });
    assert_eq!(of_axis("sensors_lost"), dropped, "{name}: what its full queue did not take, and no more");
    let waited = of_axis("sensors_received") - count(&report, "/sensors_before_start");
    // Where a stall let the waking axis's sensors be overtaken and not the other's, those begin the row.
    let others = rows.iter().filter(|row| begun_by_the_other(row, waking_axis)).count() as u64;
    let waits = waited + others;
    let samples = samples(&at(format!("{name}.hlog")));
    assert_eq!(samples[&format!("{name}-wakeup")], waits, "{name}: every frame that waited is a sample");
    assert_eq!(samples[&format!("{name}-completion")], waits, "{name}: and is late until it is answered");
    assert_eq!(count(&report, "/completion_ns/count"), waits, "{name}");
    for stage in ["receive", "step", "send", "execution"] {
        assert_eq!(samples[&format!("{name}-{stage}")], rows.len() as u64, "{name}-{stage}");
        let key = format!("/{}_ns/count", stage);
        assert_eq!(count(&report, &key), rows.len() as u64, "{name}: {key}");
    }
    for row in &rows {
        assert!(row.due_ns <= row.woke_ns && row.woke_ns <= row.done_ns, "{name}: {row:?}");
        let work_ns = row.receive_ns + row.step_ns + row.send_ns;
        assert_eq!(work_ns, row.done_ns - row.woke_ns, "{name}: the stages are the whole of it: {row:?}");
    }
    rows
}

/// One-way latencies, ns, by cycle answered: rig to controller, controller to rig.
fn one_way(
    rig: &[CycleTiming],
    controller: &[CycleTiming],
    of: impl Fn(&CycleTiming) -> Exchange,
) -> [Vec<i64>; 2] {
    let sent: BTreeMap<u64, u64> = rig.iter().map(|row| (row.cycle, of(row).sensors_ns)).collect();
    let acted = rig.iter().map(&of).filter(|exchange| exchange.command_ns != 0);
    let came: BTreeMap<u64, u64> = acted.map(|exchange| (exchange.answers, exchange.command_ns)).collect();
    let way = |from: u64, to: u64| (from != 0 && to != 0).then(|| to.cast_signed() - from.cast_signed());
    let there = controller.iter().filter_map(|row| way(*sent.get(&row.cycle)?, of(row).sensors_ns));
    let back = controller.iter().filter_map(|row| way(of(row).command_ns, *came.get(&row.cycle)?));
    [there.collect(), back.collect()]
}

#[test]
fn rows_of_both_processes_join_to_the_time_on_the_way_each_way() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) =
        scene.start(Pace::Real, "--seconds 4 --full-timing", "--repeat --full-timing");
    let process = controller.number();
    both_good(emulator, controller);
    let answered = expect_one_account(&scene, process, "controller", "drive");
    let rig = timing_rows(&scene.path("emulator/emulator-timing.csv"));
    let summary = scene.summary();
    assert_eq!(rig.len() as u64, count(&summary, "/cycles") - count(&summary, "/skipped"));
    let report = scene.report();
    let sensors = find(&report["arrivals"], "frame", "DriveSensors");
    assert_eq!(count(sensors, "/count"), count(&report, "/axes/drive/sensors_received"));
    let least = answered.len() * 95 / 100;
    for (axis, ways) in [
        ("drive", one_way(&rig, &answered, |row| row.drive)),
        ("load", one_way(&rig, &answered, |row| row.load)),
    ] {
        for (way, latencies_ns) in ["rig to controller", "controller to rig"].into_iter().zip(ways) {
            // The load of this experiment holds its valve shut: its commands do not act.
            if (axis, way) == ("load", "controller to rig") {
                continue;
            }
            let positive = latencies_ns.iter().filter(|ns| **ns > 0).count();
            assert!(positive > least, "{axis}, {way}: {positive} of {} cycles answered", answered.len());
        }
    }
}

fn events(scene: &Scene) -> Vec<(String, Value)> {
    let dumps = std::fs::read_dir(scene.path("controller/flight")).expect("a folder of dumps");
    dumps
        .map(|dump| {
            let dump = dump.expect("a dump").path();
            let name = dump.file_name().expect("a name").to_string_lossy().into_owned();
            assert!(!timing_rows(&dump.join("timing.csv")).is_empty(), "{name}: the cycles around it");
            let log = std::fs::read_to_string(dump.join("bus.log")).expect("the frames around it");
            for id in [" 120#", " 110#"] {
                assert!(log.contains(id), "{name}: frames {id} of both ways");
            }
            (name, json(&dump.join("event.json")))
        })
        .collect()
}

#[test]
fn a_controller_that_was_stopped_says_so_in_its_rows_and_freezes_its_recorder() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, mut controller) = scene.start(Pace::Real, "--seconds 4", "--repeat --full-timing");
    scene.wait_for_rows("emulator", 1200);
    controller.signal(Signal::STOP);
    std::thread::sleep(Duration::from_millis(30));
    controller.signal(Signal::CONT);
    // Past the window of the first dump.
    scene.wait_for_more_rows("emulator", 600);
    controller.signal(Signal::USR1);
    controller.wait_for("asked for the last seconds");
    let process = controller.number();
    both_good(emulator, controller);
    let rows = expect_one_account(&scene, process, "controller", "drive");
    let stopped =
        rows.iter().position(|row| row.skipped >= 25).expect("a row that skips the cycles of the stop");
    // A cycle that was stopped in its midst reports it in its own row, before the one that skips; a handler that runs on another
    // thread, in a later one.
    let reported: Vec<_> = (0..rows.len()).filter(|row| rows[*row].vitals.continued > 0).collect();
    assert!(
        matches!(reported[..], [row] if row + 1 >= stopped),
        "reported in {reported:?}, stopped at {stopped}"
    );
    assert_eq!(rows[reported[0]].vitals.continued, 1, "{:?}", rows[reported[0]]);
    let report = scene.report();
    assert_eq!(count(&report, "/vitals/continued"), 1);
    let max_ns = count(&report, "/wakeup_ns/max");
    assert!(max_ns >= 25_000_000, "{max_ns} ns, the wait of the oldest sensors");
    let events = events(&scene);
    assert_eq!(events.len() as u64, count(&report, "/flight/dumps"), "{events:?}");
    let long = |event: &Value| event["trigger"] == "overrun" && count(event, "/late_ns") >= 25_000_000;
    assert!(events.iter().any(|(_, event)| long(event)), "{events:?}");
    assert!(events.iter().any(|(name, _)| name.ends_with("-signal")), "{events:?}");
}

#[test]
fn a_process_for_each_axis_has_files_and_tags_of_its_own() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let emulator = scene.emulator(Pace::Real).with("--seconds 2").start();
    let controllers = ["drive", "load"].map(|axis| {
        let controller = scene.axis_controller(Pace::Real, axis);
        (axis, controller.with("--repeat --full-timing --no-flight").start())
    });
    emulator.wait().expect_code(0);
    for (axis, controller) in controllers {
        let process = controller.number();
        controller.wait().expect_code(0);
        let rows = expect_one_account(&scene, process, &format!("controller-{axis}"), axis);
        let other = |row: &CycleTiming| if axis == "drive" { row.load } else { row.drive };
        assert!(rows.iter().all(|row| other(row) == Exchange::default()), "{axis} times itself alone");
    }
    assert!(!scene.path("controller/flight").exists(), "nobody keeps a ring");
}
