//! Lockstep: the same command lines give the same files to the byte, however fast the machine and whoever starts first.

use protocol::frames::{Frame, ValveCommand};
use rustix::process::Signal;
use std::time::Duration;
use system_tests::load::BusyLoops;
use system_tests::{Pace, SHORT, Scene, both_good, expect_same, same};

/// Files of emulator and controller that must be the same.
const FILES: [&str; 4] =
    ["emulator/bus.log", "emulator/measurement.csv", "emulator/truth.csv", "controller/controller-drive.csv"];

/// How a run differs from another in what must not matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RunCondition {
    EmulatorFirst,
    ControllerFirst,
    MachineBusy,
    ControllerStoppedForAWhile,
    ListenerThatNeverReads,
}

fn run(condition: RunCondition, options: &str) -> Scene {
    let scene = Scene::new(SHORT);
    let _busy = (condition == RunCondition::MachineBusy).then(BusyLoops::on_every_processor);
    let (emulator, controller) =
        (scene.emulator(Pace::Lockstep).with(options), scene.controller(Pace::Lockstep));
    let (emulator, controller) = match condition {
        RunCondition::ControllerFirst => {
            let controller = controller.start();
            std::thread::sleep(Duration::from_millis(50));
            (emulator.start(), controller)
        }
        RunCondition::ListenerThatNeverReads => {
            let emulator = emulator.start();
            let listener = scene.peer();
            let controller = controller.start();
            emulator.wait().expect_code(0);
            drop(listener);
            controller.wait().expect_code(0);
            return scene;
        }
        _ => (emulator.start(), controller.start()),
    };
    if condition == RunCondition::ControllerStoppedForAWhile {
        let _peer = scene.peer();
        controller.signal(Signal::STOP);
        std::thread::sleep(Duration::from_millis(300));
        controller.signal(Signal::CONT);
    }
    both_good(emulator, controller);
    scene
}

#[test]
fn two_runs_give_the_same_files_to_the_byte_whatever_the_circumstances() {
    let first = run(RunCondition::EmulatorFirst, "");
    let rows = first.measurement();
    // 0.5 s to the start, 0.2 s settling, 0.65 s experiment, 0.2 s settling: fewer rows would compare nothing.
    assert!(rows.len() > 1500, "{} rows", rows.len());
    assert!(first.bus_log().len() > 4 * rows.len());
    for condition in [
        RunCondition::EmulatorFirst,
        RunCondition::ControllerFirst,
        RunCondition::MachineBusy,
        RunCondition::ControllerStoppedForAWhile,
        RunCondition::ListenerThatNeverReads,
    ] {
        let again = run(condition, "");
        let what = format!("differs with {condition:?}");
        expect_same(&first.path(""), &again.path(""), &FILES, &what);
        for figure in ["position_error_dynamic_m", "position_error_static_m"] {
            let of = |scene: &Scene| scene.report()["axes"]["drive"][figure].clone();
            assert_eq!(of(&first), of(&again), "{figure} with {condition:?}");
            assert!(of(&first).is_number(), "{figure} was measured");
        }
    }
}

#[test]
fn an_answer_to_the_last_cycle_is_logged_however_long_it_takes() {
    const CYCLES: u32 = 50;
    let scene = Scene::new(SHORT);
    let emulator = scene.emulator(Pace::Lockstep).with("--seconds 0.05").start();
    scene.peer().take_part("slow", |peer, cycle, _| {
        if cycle + 1 == CYCLES {
            std::thread::sleep(Duration::from_millis(300));
        }
        let command = ValveCommand { alive: (cycle % 16) as u8, echo: cycle as u16, ..Default::default() };
        peer.send_frame(&Frame::DriveValveCommand(command));
    });
    emulator.wait().expect_code(0);
    let log = scene.bus_log();
    let answers = log.iter().filter(|frame| matches!(Frame::decode(frame), Ok(Frame::DriveValveCommand(_))));
    assert_eq!(answers.count(), CYCLES as usize);
}

#[test]
fn another_seed_gives_another_log() {
    let (one, other) = (run(RunCondition::EmulatorFirst, ""), run(RunCondition::EmulatorFirst, "--seed 2"));
    for file in FILES {
        assert!(!same(&one.path(file), &other.path(file)), "{file} does not depend on the seed");
    }
}

#[test]
fn the_log_knows_no_wall_clock() {
    let scene = run(RunCondition::EmulatorFirst, "");
    let log = std::fs::read_to_string(scene.path("emulator/bus.log")).expect("a log");
    assert!(log.starts_with("(0000000000.000000) bus0 120#"), "{:?}", log.lines().next());
    assert!(scene.run_description()["started_unix_s"].is_null());
}
