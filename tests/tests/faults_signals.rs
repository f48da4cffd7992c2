//! Ctrl-C and SIGTERM, to each program and to both, in real time and in lockstep: exit 130, and every file complete.

use rustix::process::Signal;
use system_tests::exit::INTERRUPTED;
use system_tests::{Pace, RESTLESS, Running, Scene, count, expect_whole_lines, turn};

const SIGNALS: [Signal; 2] = [Signal::INT, Signal::TERM];
const PACES: [Pace; 2] = [Pace::Real, Pace::Lockstep];

fn under_way(pace: Pace) -> (Scene, Running, Running) {
    let scene = Scene::new(RESTLESS);
    let (emulator, controller) = scene.under_way(pace, 600);
    (scene, emulator, controller)
}

fn expect_complete(scene: &Scene, pace: Pace, signal: Signal) {
    let at = format!("{pace:?}, {signal:?}");
    let summary = scene.summary();
    let measurement = scene.measurement();
    assert_eq!(count(&summary, "/cycles"), measurement.len() as u64, "rows of measurement.csv, {at}");
    assert_eq!(scene.truth().len(), measurement.len(), "rows of truth.csv, {at}");
    let frames = count(&summary, "/frames_sent") + count(&summary, "/frames_received");
    assert_eq!(scene.bus_log().len() as u64, frames, "lines of bus.log, {at}");
    let report = scene.report();
    let rows = expect_whole_lines(&scene.path("controller/controller-drive.csv"));
    // Of the drive: on a loaded machine its sensors of a cycle may be overtaken while the load's are answered.
    let answered = count(&report, "/axes/drive/cycles_answered");
    assert_eq!(answered, rows as u64, "rows of controller-drive.csv, {at}");
    if pace == Pace::Real {
        for hlog in ["emulator/emulator.hlog", "controller/controller.hlog"] {
            assert!(scene.path(hlog).exists(), "{hlog} is missing, {at}");
        }
    }
}

fn expect_interrupted(running: Running) {
    let ended = running.wait().expect_code(INTERRUPTED);
    ended.expect_stderr(&["interrupted; everything recorded so far is saved"]);
}

/// In lockstep the emulator did not wait for its farewell to be delivered once it was interrupted: now and then the host
/// went first, and the controller gave up with "no sensors for too long" and exit 3.
#[test]
fn an_emulator_that_is_interrupted_says_so_saves_all_and_sends_the_controller_home() {
    let _machine = turn::take();
    for pace in PACES {
        for signal in SIGNALS {
            let (scene, emulator, controller) = under_way(pace);
            emulator.signal(signal);
            expect_interrupted(emulator);
            controller.wait().expect_code(0).expect_stderr(&["the rig has ended"]);
            expect_complete(&scene, pace, signal);
        }
    }
}

/// In lockstep the controller looked for a signal only when its queue was empty, which it never was while the run went
/// on: Ctrl-C did nothing for as long as the experiment repeated.
#[test]
fn a_controller_that_is_interrupted_saves_all_and_the_emulator_says_what_it_misses() {
    let _machine = turn::take();
    for signal in SIGNALS {
        let (scene, mut emulator, controller) = under_way(Pace::Real);
        controller.signal(signal);
        expect_interrupted(controller);
        emulator.wait_for("no fresh drive command for 20 cycles, valve shut; is its controller running?");
        emulator.signal(signal);
        expect_interrupted(emulator);
        expect_complete(&scene, Pace::Real, signal);
        let (scene, emulator, controller) = under_way(Pace::Lockstep);
        controller.signal(signal);
        expect_interrupted(controller);
        emulator.wait().expect_code(3).expect_stderr(&["all members left the barrier"]);
        expect_complete(&scene, Pace::Lockstep, signal);
    }
}

#[test]
fn both_interrupted_at_once_save_all() {
    let _machine = turn::take();
    for pace in PACES {
        for signal in SIGNALS {
            let (scene, emulator, controller) = under_way(pace);
            controller.signal(signal);
            emulator.signal(signal);
            expect_interrupted(emulator);
            // The rig's farewell may reach it before its own signal does; then it ends as if it had been alone.
            let controller = controller.wait();
            match controller.code {
                Some(0) => drop(controller.expect_stderr(&["the rig has ended"])),
                _ => drop(
                    controller.expect_code(INTERRUPTED).expect_stderr(&["interrupted; everything recorded"]),
                ),
            }
            expect_complete(&scene, pace, signal);
        }
    }
}

#[test]
fn a_bus_host_that_is_interrupted_reports_what_it_counted() {
    for signal in SIGNALS {
        let host = Scene::new(RESTLESS).bus_host("");
        host.signal(signal);
        let ended = host.wait().expect_code(INTERRUPTED);
        let report: serde_json::Value = serde_json::from_str(&ended.stdout).expect("a report in JSON");
        assert_eq!(count(&report, "/frames"), 0);
    }
}
