//! The live page in a browser: what a person sees of a run that goes on, and what a hand on the page does to it.
//!
//! Debian's chromium, driven from `tests/browser/live_page.js`, looks at the page of a real `bench watch` beside a real emulator
//! and controller. One browser goes through all cases; what the page did to the rig is then looked up in the run's own files.

use protocol::can::CanFrame;
use protocol::frames::{EmergencyStop, Frame, HandSetPoint, HandSetPointAxis};
use rustix::process::Signal;
use std::path::PathBuf;
use std::process::Command;
use system_tests::onlooker::LivePage;
use system_tests::{Pace, Running, Scene, Table, bus_log, turn, workspace};

/// To and fro, slowly enough for an eye, and a start after a stop.
const TO_AND_FRO: &str = include_str!("../scenes/to-and-fro.toml");

/// Cases of the script that use the first run; the next one has the emulator started anew.
const CASES_OF_FIRST_RUN: usize = 10;
const DISCHARGED_PA: f64 = 1.2e5;
/// An axis that stands, m/s: the air trapped beside its piston has come to rest.
const STANDS_M_PER_S: f64 = 1e-3;

struct Rig {
    emulator: Running,
    controller: Running,
}

impl Rig {
    fn start(scene: &Scene, folder: &str) -> Self {
        let telemetry = format!("--console --telemetry {}", scene.path("telemetry").display());
        let emulator = scene.emulator(Pace::Real).out(&scene.path(folder)).with(&telemetry).start();
        let out = scene.path(&format!("{folder}-controller"));
        Self { emulator, controller: scene.controller(Pace::Real).out(&out).with("--repeat").start() }
    }

    fn end(self) {
        for program in [&self.controller, &self.emulator] {
            program.signal(Signal::INT);
        }
        self.controller.wait();
        self.emulator.wait().expect_code(130);
    }
}

/// Where what drives the browser was installed.
fn browser_modules() -> PathBuf {
    let modules = std::env::var_os("AIRBENCH_BROWSER")
        .map_or_else(|| workspace().join("target/tools/browser"), PathBuf::from);
    let is_there = modules.join("node_modules/playwright-core").exists();
    assert!(is_there, "{} is missing: run scripts/test, which installs the browser", modules.display());
    modules
}

#[test]
fn the_page_shows_a_run_and_a_hand_on_it_reaches_the_rig() {
    let _machine = turn::take();
    let scene = Scene::new(TO_AND_FRO);
    let first = Rig::start(&scene, "first");
    let page = LivePage::open(&scene, "--control");
    let address = format!("http://{}/#token={}", page.address, page.token);
    let mut command = Command::new("node");
    command.arg(workspace().join("tests/browser/live_page.js"));
    command.env("AIRBENCH_PAGE", address).env("AIRBENCH_BROWSER", browser_modules());
    let mut browser = Running::start("browser", &mut command);
    for passed in 1..=CASES_OF_FIRST_RUN {
        browser.wait_for_times("passed: ", passed);
    }
    browser.wait_for("asks: end");
    first.end();
    browser.type_line("done");
    browser.wait_for("asks: start");
    scene.write("experiment.toml", &TO_AND_FRO.replace("to and fro", "to and fro again"));
    let second = Rig::start(&scene, "second");
    browser.type_line("done");
    let ended = browser.wait().expect_code(0);
    // For who reads the log of a passing test.
    eprintln!("{}", ended.stderr);
    second.end();
    page.close();

    two_stops_and_both_stopped_the_axis(&scene);
    one_set_point_by_hand(&scene);
}

#[test]
fn what_is_vendored_is_as_it_was_published() {
    let folder = workspace().join("live/src/page/vendor/uplot");
    let mut command = Command::new("sha256sum");
    command.args(["--check", "--strict", "SHA256SUMS"]).current_dir(folder);
    let ended = Running::start("sha256sum", &mut command).wait().expect_code(0);
    assert_eq!(ended.stdout.matches(": OK").count(), 3, "{}", ended.stdout);
}

/// One by the click and one by the key, each with its release; the other pages' attempts left nothing.
fn two_stops_and_both_stopped_the_axis(scene: &Scene) {
    let of_console: Vec<EmergencyStop> =
        bus_log(&scene.path("first/bus.log")).iter().filter_map(stop).collect();
    let releases = of_console.iter().filter(|stop| stop.release).count();
    assert_eq!(releases, 2, "{of_console:?}");

    let truth = Table::read(&scene.path("first/truth.csv"));
    let (supply, speed) = (truth.column("supply_pressure_Pa"), truth.column("drive_rod_velocity_m_per_s"));
    let ends: Vec<f64> = supply
        .windows(2)
        .zip(&speed)
        .filter(|(pair, _)| pair[0] < DISCHARGED_PA && pair[1] >= DISCHARGED_PA)
        .map(|(_, speed)| speed.abs())
        .collect();
    assert_eq!(ends.len(), 2, "the supply came back after each stop");
    assert!(ends.iter().all(|speed| *speed < STANDS_M_PER_S), "the drive stood: {ends:?} m/s");
}

fn one_set_point_by_hand(scene: &Scene) {
    let log = bus_log(&scene.path("first/bus.log"));
    let asked: Vec<HandSetPoint> = log
        .iter()
        .filter_map(|frame| match Frame::decode(frame) {
            Ok(Frame::HandSetPoint(asked)) => Some(asked),
            _ => None,
        })
        .collect();
    let [HandSetPoint { axis: HandSetPointAxis::Drive, position_m, .. }] = asked[..] else {
        panic!("{asked:?}")
    };
    // The wire's step is 7.6 um.
    assert!((position_m - 0.2).abs() < 4e-6, "{position_m} m");
}

fn stop(frame: &CanFrame) -> Option<EmergencyStop> {
    match Frame::decode(frame) {
        Ok(Frame::ConsoleEmergencyStop(stop)) => Some(stop),
        _ => None,
    }
}
