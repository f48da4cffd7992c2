//! One process for both axes, one for each, or a rehearsal without a bus: the same run, to the byte.
//!
//! The axes know each other as over the bus wherever they live, so nothing else may differ. Two members of the lockstep barrier
//! do not come to the same order of frames by chance: a run of thousands of cycles would show it.

use std::time::Duration;
use system_tests::{AxisTable, LINKED, Pace, SHORT, Scene, bus_log, expect_same, json, text, workspace};

/// What a rehearsal leaves too.
const TABLES: [&str; 4] = ["measurement.csv", "truth.csv", "controller-drive.csv", "controller-load.csv"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ProcessSetup {
    OneProcess,
    DriveFirst,
    LoadFirst,
    Rehearsal,
}

/// Runs the experiment to its end, everything into one folder, as `scripts/run` does.
fn run(experiment: &str, setup: ProcessSetup) -> Scene {
    let scene = Scene::new(experiment);
    let out = scene.path("run");
    if setup == ProcessSetup::Rehearsal {
        scene.rehearsal().out(&out).with_shipped_programs().start().wait().expect_code(0);
        return scene;
    }
    let axes: &[&str] = match setup {
        ProcessSetup::OneProcess => &["both"],
        ProcessSetup::LoadFirst => &["load", "drive"],
        _ => &["drive", "load"],
    };
    let emulator =
        scene.emulator(Pace::Lockstep).out(&out).with(&format!("--members {}", axes.len())).start();
    let controllers: Vec<_> = axes
        .iter()
        .map(|axis| {
            let controller =
                scene.axis_controller(Pace::Lockstep, axis).out(&out).with_shipped_programs().start();
            // Long enough for the first to be on the bus before the second.
            std::thread::sleep(Duration::from_millis(100));
            controller
        })
        .collect();
    emulator.wait().expect_code(0);
    controllers.into_iter().for_each(|controller| drop(controller.wait().expect_code(0)));
    scene
}

/// Holds all four ways against each other. Returns the run of one process.
fn expect_all_the_same(experiment: &str) -> Scene {
    let one = run(experiment, ProcessSetup::OneProcess);
    for setup in [ProcessSetup::DriveFirst, ProcessSetup::LoadFirst] {
        let two = run(experiment, setup);
        let files = [&TABLES[..], &["bus.log"]].concat();
        expect_same(&one.path("run"), &two.path("run"), &files, &format!("differs, {setup:?}"));
    }
    let rehearsal = run(experiment, ProcessSetup::Rehearsal);
    expect_same(&one.path("run"), &rehearsal.path("run"), &TABLES, "differs, rehearsed");
    assert!(!rehearsal.path("run/bus.log").exists(), "a rehearsal has no bus");
    one
}

fn states(scene: &Scene, axis: &str) -> Vec<String> {
    let table = AxisTable::read(&scene.path("run").join(format!("controller-{axis}.csv")));
    table.states("main_chain").into_iter().map(str::to_owned).collect()
}

#[test]
fn the_linked_experiment_of_the_paper_is_the_same_in_one_process_in_two_and_rehearsed() {
    let one = expect_all_the_same(&text(&workspace().join("controller/experiments/load-step.toml")));
    let load = AxisTable::read(&one.path("run/controller-load.csv"));
    assert!(load.len() > 6000, "{} rows", load.len());
    let (force, opening) = (load.numbers("force_N"), load.numbers("opening"));
    let experiment = load.first("main_chain", "experiment", 0);
    // The force of the step is pressed for by the load and met by the drive.
    let pressed = force[experiment + 3000..experiment + 5900].iter().sum::<f64>() / 2900.0;
    assert!((pressed - 400.0).abs() < 40.0, "{pressed} N of 400 N on average after the step");
    assert!(opening.iter().any(|opening| *opening != 0.0));
}

#[test]
fn two_repetitions_are_the_same_in_one_process_in_two_and_rehearsed() {
    let repeated = LINKED.replacen("[run]\n", "[run]\nrepetitions = 2\n", 1);
    let one = expect_all_the_same(&repeated);
    for axis in ["drive", "load"] {
        let seen = states(&one, axis);
        let experiments = seen.iter().filter(|state| *state == "experiment").count();
        assert_eq!(experiments, 2, "{axis}: {seen:?}");
        assert_eq!(json(&one.path("run/controller.json"))["axes"][axis]["repetitions_done"], 2, "{axis}");
    }
}

#[test]
fn an_axis_that_the_experiment_leaves_out_is_the_same_in_one_process_in_two_and_rehearsed() {
    let one = expect_all_the_same(SHORT);
    let load = AxisTable::read(&one.path("run/controller-load.csv"));
    assert!(load.numbers("enabled").iter().all(|enabled| *enabled == 0.0), "its valve is held shut");
    assert_eq!(states(&one, "load"), states(&one, "drive"), "it goes along");
    assert!(bus_log(&one.path("run/bus.log")).len() > 4 * load.len());
}

#[test]
fn a_process_for_each_axis_leaves_a_report_of_its_own() {
    let two = run(SHORT, ProcessSetup::DriveFirst);
    for (axis, other) in [("drive", "load"), ("load", "drive")] {
        let report = json(&two.path("run").join(format!("controller-{axis}.json")));
        assert_eq!(report["axes"][axis]["chain_state"], "done");
        assert!(report["axes"][other].is_null(), "{axis} knows of {other} by the bus alone");
    }
    assert!(!two.path("run/controller.json").exists());
}
