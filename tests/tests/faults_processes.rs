//! Faults of processes while running, in real time on the embedded bus: killed, restarted, stopped for a while.

use rustix::process::Signal;
use serde_json::Value;
use std::time::Duration;
use system_tests::events::{self, expect_valve_shut_between};
use system_tests::{Pace, RESTLESS, Running, SHORT, Scene, Table, count, dropped_at_queue, json, turn};

/// Rows after which the valve moves.
const UNDER_WAY: usize = 900;
/// States of the main chain from the restart on, when all goes well.
const STATES: [&str; 7] =
    ["initial-positioning", "preparing", "initial-force", "settling", "experiment", "final-settling", "done"];
const STOPPED: Duration = Duration::from_millis(200);

/// Goes on for a while, ends the run as a person would, and hands back summary and measurement.
fn end(scene: &Scene, emulator: Running) -> (Value, Table) {
    scene.wait_for_more_rows("emulator", 600);
    emulator.interrupt();
    let measurement = scene.measurement();
    let summary = scene.summary();
    assert_eq!(count(&summary, "/cycles"), measurement.len() as u64, "a row for each cycle");
    assert_eq!(count(&summary, "/records_dropped"), 0);
    (summary, measurement)
}

#[test]
fn a_controller_that_is_killed_leaves_the_valve_shut_until_the_next_one_comes() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (mut emulator, controller) = scene.under_way(Pace::Real, UNDER_WAY);
    controller.kill();
    emulator.wait_for("no fresh drive command for 20 cycles, valve shut");
    let second = scene.controller(Pace::Real).out(&scene.path("second")).with("--repeat").start();
    emulator.wait_for("fresh drive commands again");
    let (summary, measurement) = end(&scene, emulator);
    second.wait().expect_code(0);
    expect_valve_shut_between(&summary, &measurement, "command-stale", "command-fresh");
    assert!(count(&summary, "/drive_commands/expired") >= 1);
    assert_eq!(count(&summary, "/drive_commands/two_sources"), 0, "a restart is no second source");
    assert!(!scene.path("controller/controller.json").exists(), "a killed process writes no report");
    assert!(count(&json(&scene.path("second/controller.json")), "/cycles_answered") > 0);
}

#[test]
fn an_emulator_that_is_killed_and_restarted_is_found_again_and_the_chain_starts_anew() {
    let _machine = turn::take();
    let scene = Scene::new(&SHORT.replace("duration_s = 0.25", "duration_s = 2.0"));
    let emulator = scene.emulator(Pace::Real).out(&scene.path("first")).start();
    let mut controller = scene.controller(Pace::Real).start();
    controller.wait_for(": drive experiment");
    scene.wait_for_rows("first", UNDER_WAY);
    emulator.kill();
    controller.wait_for("the bus is gone");
    let second = scene.emulator(Pace::Real).out(&scene.path("second")).start();
    controller.wait_for("the rig restarted; starting over");
    second.wait().expect_code(0).expect_stderr(&["the controllers are done"]);
    controller.wait().expect_code(0);
    let report = scene.report();
    assert!(count(&report, "/bus/disconnects") >= 1 && count(&report, "/bus/reconnects") >= 1);
    let news = report["news"].as_array().expect("news");
    let anew = news.iter().position(|item| item == "rig-restarted").expect("the restart is reported");
    let states = |axis: &str| -> Vec<&str> {
        let of_axis = news[anew..].iter().map(|item| &item["state"]).filter(|state| state["axis"] == axis);
        of_axis.filter_map(|state| state["state"].as_str()).collect()
    };
    for axis in ["drive", "load"] {
        assert_eq!(states(axis), STATES, "{axis}");
    }
    Table::read_to_last_whole_line(&scene.path("first/measurement.csv")).expect_no_hole();
    let measurement = Table::read(&scene.path("second/measurement.csv"));
    measurement.expect_no_hole();
    assert!(
        measurement.len() > 3000,
        "the experiment was driven from its beginning: {} rows",
        measurement.len()
    );
}

#[test]
fn a_controller_that_stands_still_has_its_valve_shut_and_its_losses_counted_at_both_ends() {
    let _machine = turn::take();
    // Long enough for the second to overflow the queue of a usual kernel.
    for stopped in [STOPPED, 4 * STOPPED] {
        let scene = Scene::new(RESTLESS);
        let (mut emulator, controller) = scene.under_way(Pace::Real, UNDER_WAY);
        controller.signal(Signal::STOP);
        emulator.wait_for("no fresh drive command for 20 cycles, valve shut");
        std::thread::sleep(stopped);
        controller.signal(Signal::CONT);
        emulator.wait_for("fresh drive commands again");
        let (summary, measurement) = end(&scene, emulator);
        let process = controller.number();
        controller.wait().expect_code(0);
        expect_valve_shut_between(&summary, &measurement, "command-stale", "command-fresh");
        assert!(count(&summary, "/drive_commands/expired") >= 1);
        assert_eq!(count(&summary, "/frames_lost_at_rig"), 0, "what was never sent is not lost");
        assert!(count(&summary, "/stale_commands") >= 2, "both axes went stale");
        let report = scene.report();
        for (axis, id) in [("drive", "120"), ("load", "121")] {
            let dropped = dropped_at_queue(&summary, process, id);
            let lost = count(&report, &format!("/axes/{axis}/sensors_lost"));
            assert_eq!(lost, dropped, "{axis}, stopped for {stopped:?}");
        }
    }
}

#[test]
fn an_emulator_that_stands_still_catches_up_and_counts_skipped_cycles_never_lost_frames() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (mut emulator, mut controller) = scene.under_way(Pace::Real, UNDER_WAY);
    emulator.stop();
    // A loaded machine may have kept the sensors back before: what the controller says is no measure of the time.
    std::thread::sleep(STOPPED);
    controller.wait_for("no sensors for 0.2 s");
    emulator.signal(Signal::CONT);
    emulator.wait_for("woke late");
    let (summary, _) = end(&scene, emulator);
    controller.wait().expect_code(0);
    let skipped = count(&summary, "/skipped");
    // It stood still for 200 ms at least.
    assert!(skipped >= 150, "{skipped} cycles skipped");
    assert!(count(&summary, "/overruns") >= 1);
    assert_eq!(count(&summary, "/frames_lost_at_rig"), 0, "nothing was lost at the rig");
    let report = scene.report();
    assert_eq!(count(&report, "/rig_cycles_skipped"), skipped, "the controller knows of every skipped cycle");
    for axis in ["drive", "load"] {
        assert_eq!(count(&report, &format!("/axes/{axis}/sensors_lost")), 0, "{axis}: skipped is not lost");
    }
    let reported: u64 = events::all(&summary)
        .iter()
        .filter(|event| event.kind == "skipped")
        .map(|event| count(&event.of, "/cycles"))
        .sum();
    assert_eq!(reported, skipped, "every skipped cycle was reported");
}
