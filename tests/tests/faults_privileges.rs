//! Without privileges for real time a run works all the same; what was refused is reported with its remedy.

use std::os::unix::fs::{PermissionsExt, chown};
use system_tests::exit::{BOUND_BROKEN, BUS_FAILED};
use system_tests::{Pace, SHORT, Scene, count, turn};

const NOBODY: u32 = 65534;
/// Limits under which no user but root may have FIFO priority or locked memory.
const NO_LIMITS_RAISED: &str = "ulimit -r 0 && ulimit -l 64";
/// What a controller says that answered too few cycles until the rig ended.
const NOT_DONE: &str = "the rig ended before the experiment was done";

#[test]
fn missing_privileges_are_reported_with_the_remedy_and_the_run_succeeds() {
    let _machine = turn::take();
    let scene = Scene::new(SHORT);
    let mut emulator = scene.emulator(Pace::Real).with("--seconds 10").after_shell(NO_LIMITS_RAISED);
    let mut controller = scene.controller(Pace::Real).after_shell(NO_LIMITS_RAISED);
    if rustix::process::geteuid().is_root() {
        let folder = scene.path("");
        std::fs::set_permissions(&folder, PermissionsExt::from_mode(0o700)).expect("our own folder");
        chown(&folder, Some(NOBODY), Some(NOBODY)).expect("root may give it away");
        (emulator, controller) = (emulator.as_user(NOBODY), controller.as_user(NOBODY));
    }
    let (emulator, controller) = (emulator.start(), controller.start());
    let remedies =
        ["warning: no FIFO priority", "setcap cap_sys_nice+ep", "warning: no locked memory", "limits.d"];
    emulator.wait().expect_code(0).expect_stderr(&remedies);
    let controller = controller.wait().expect_stderr(&remedies);
    if controller.code != Some(0) {
        let report = std::fs::read_to_string(scene.path("controller/controller.json")).expect("a report");
        let is_late = turn::LATENESS.iter().any(|words| report.contains(words));
        assert!(is_late || controller.stderr.contains(NOT_DONE), "{}", controller.stderr);
        controller.expect_code(if is_late { BOUND_BROKEN } else { BUS_FAILED });
    }
    let run = scene.run_description();
    let refused: Vec<&str> =
        run["realtime_refused"].as_array().expect("a list").iter().filter_map(|line| line.as_str()).collect();
    assert!(refused.iter().any(|line| line.contains("FIFO priority")), "the record knows too: {refused:?}");
    assert!(count(&scene.summary(), "/cycles") > 1500);
}

#[test]
fn who_asks_for_no_privileges_is_warned_of_none() {
    let _machine = turn::take();
    let scene = Scene::new(SHORT);
    let (emulator, controller) = scene.start(Pace::Real, "--no-realtime", "--no-realtime");
    // A controller that gave up leaves its emulator waiting for another one.
    for running in [controller, emulator] {
        let ended = running.wait().expect_code(0);
        assert!(!ended.stderr.contains("warning"), "{}", ended.stderr);
    }
    assert_eq!(scene.run_description()["realtime_granted"], serde_json::json!([]));
}
