//! A soak accounts for every frame, whatever becomes of its programs and of itself: its results are whole after each segment.

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use system_tests::process_table::ProcessStat;
use system_tests::{
    Program, RESTLESS, Running, Scene, count, expect_whole_lines, find, json, turn, wait_until,
};

/// A soak in the scene's folder `soak`, in segments of 8 s, with a program that does nothing as its load generator.
fn soak(scene: &Scene, minutes: f64) -> Running {
    let mut command = Program::Bench.command();
    command.args(["soak", "--minutes", &minutes.to_string(), "--segment-seconds", "8"]);
    command.args(["--load", "sleep 600", "--experiments", "experiment", "--min-free-mb", "1"]);
    command.args(["--bus", &scene.url()]).arg("--out").arg(scene.path("soak"));
    command.arg("--rig").arg(scene.path("rig.toml")).arg("--experiment-folder").arg(scene.path(""));
    Running::start("bench soak", &mut command)
}

fn results(scene: &Scene) -> Value {
    for name in ["soak.hlog", "soak.md", "soak-junit.xml"] {
        assert!(scene.path("soak").join(name).is_file(), "{name} is missing");
    }
    let junit = std::fs::read_to_string(scene.path("soak/soak-junit.xml")).expect("a JUnit file");
    assert!(junit.ends_with("</testsuite>\n</testsuites>\n"), "cut off: {junit}");
    json(&scene.path("soak/soak.json"))
}

fn check<'a>(segment: &'a Value, name: &str) -> &'a str {
    find(&segment["checks"], "name", name)["result"].as_str().expect("a result")
}

/// Processes of this name that `parent` has started.
fn children(parent: u32, name: &str) -> Vec<u32> {
    let children = ProcessStat::all().filter(|process| process.parent == parent && process.name == name);
    children.map(|process| process.number).collect()
}

fn segment_folder(number: u32) -> String {
    format!("soak/segments/{number:04}-experiment")
}

#[test]
fn every_frame_of_a_soak_is_accounted_for_and_the_injected_loss_is_found() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    // Time for three segments even where it takes long to judge one.
    let ended = soak(&scene, 0.5).wait().expect_code(0);
    assert!(ended.stderr.contains("soak: may be trusted: "), "{}", ended.stderr);
    let soak_json = results(&scene);
    let segments = soak_json["segments"].as_array().expect("segments");
    assert!(segments.len() >= 3, "{}", ended.stderr);
    for segment in segments {
        for name in ["processes", "account", "gaps", "records"] {
            assert_eq!(check(segment, name), "passed", "{name} of {segment}");
        }
    }
    // The third of the four ways loses frames; every one was counted at the wire and found at the receivers.
    assert_eq!(check(&segments[2], "loss"), "passed");
    assert!(count(&soak_json, "/totals/lost_on_wire") > 200, "{}", soak_json["totals"]);
    let rows = segments[2]["account"].as_array().expect("rows");
    let by_gaps =
        rows.iter().filter(|row| row["missing_by_gaps"].as_u64().is_some_and(|missing| missing > 0));
    assert_eq!(by_gaps.count(), 4, "two axes' sensors and commands");
    assert_eq!(segments[1]["load"].as_str().map(|load| load.ends_with("sleep 600")), Some(true));
    assert!(count(&soak_json, "/distributions/emulator-wakeup/count") > 15_000);
    // Started again, it is done.
    let again = soak(&scene, 0.5).wait().expect_code(0);
    assert!(again.stderr.contains("the time asked for is up"), "{}", again.stderr);
    assert_eq!(results(&scene)["segments"], soak_json["segments"]);
}

#[test]
fn a_killed_controller_fails_its_segment_alone_and_its_rows_stay() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let running = soak(&scene, 0.35);
    scene.wait_for_rows(&segment_folder(1), 2000);
    let controllers = children(running.number(), "controller");
    assert_eq!(controllers.len(), 1);
    let controller = Pid::from_raw(controllers[0] as i32).expect("a process");
    kill_process(controller, Signal::KILL).expect("it runs");
    let ended = running.wait().expect_code(1);
    assert!(ended.stderr.contains("may not be trusted: 1 of "), "{}", ended.stderr);
    let soak_json = results(&scene);
    let segments = soak_json["segments"].as_array().expect("segments");
    assert_eq!((check(&segments[0], "processes"), check(&segments[0], "account")), ("failed", "failed"));
    for segment in &segments[1..] {
        assert_eq!(
            (check(segment, "processes"), check(segment, "account")),
            ("passed", "passed"),
            "{segment}"
        );
    }
    assert!(segments.len() >= 2);
    assert!(expect_whole_lines(&scene.path(&segment_folder(1)).join("measurement.csv")) >= 2000);
    let junit = std::fs::read_to_string(scene.path("soak/soak-junit.xml")).expect("a JUnit file");
    let case = junit.lines().find(|line| line.contains("0001-experiment") && line.contains("\"processes\""));
    assert!(
        case.is_some_and(|case| case.contains("<failure") && case.contains("killed by SIGKILL")),
        "{junit}"
    );
}

#[test]
fn a_soak_that_was_killed_or_interrupted_goes_on_with_all_it_had() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let running = soak(&scene, 0.6);
    scene.wait_for_rows(&segment_folder(2), 1000);
    let emulators = children(running.number(), "emulator");
    running.kill();
    let first = results(&scene);
    assert_eq!((count(&first, "/totals/segments"), count(&first, "/totals/failed")), (1, 0));
    // Nothing that it started outlives it.
    wait_until("the emulator ends with its soak", || !ProcessStat::is_alive(emulators[0]));

    let running = soak(&scene, 0.6);
    scene.wait_for_rows(&segment_folder(3), 2000);
    let ended = running.interrupt();
    assert!(ended.stderr.contains("may be trusted: 2 segments"), "{}", ended.stderr);
    let second = results(&scene);
    let segments = second["segments"].as_array().expect("segments");
    assert_eq!(segments[0], first["segments"][0]);
    assert_eq!(
        (&segments[1]["finished"], &segments[2]["finished"]),
        (&Value::Bool(false), &Value::Bool(true))
    );
    // Ended by hand in its midst, and accounted for all the same.
    assert_eq!((check(&segments[2], "account"), check(&segments[2], "gaps")), ("passed", "passed"));
    let counted = |results: &Value| count(results, "/distributions/emulator-wakeup/count");
    assert!(counted(&second) > counted(&first));

    let mut other = Program::Bench.command();
    other.args(["soak", "--minutes", "1", "--experiments", "experiment", "--bus", &scene.url()]);
    other.arg("--rig").arg(scene.path("rig.toml")).arg("--experiment-folder").arg(scene.path(""));
    other.arg("--out").arg(scene.path("soak"));
    let refused = Running::start("bench soak", &mut other).wait().expect_code(2);
    assert!(
        refused.stderr.contains("other settings") && refused.stderr.contains("--anyway"),
        "{}",
        refused.stderr
    );
}
