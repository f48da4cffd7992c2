//! The conformance check against controllers that keep the contract, ours and the C firmware, and against ones that each break it
//! in one place: the check must name that place, what follows from it, and nothing else.
//!
//! Times are judged by none of these tests, only what does not depend on the machine.

use protocol::can::CanFrame;
use protocol::checksum;
use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame, ValveCommand};
use std::collections::BTreeMap;
use std::path::Path;
use system_tests::{
    Build, CompletedProcess, Peer, Program, Running, SHORT, Scene, executable, firmware, turn,
};

/// The check on the scene's bus; what follows `--` is the controller's command line.
fn check(scene: &Scene, options: &str, controller: &[&str]) -> Running {
    let mut command = Program::Bench.command();
    command.args(["check-controller", "--bus", &scene.url(), "--junit"]).arg(scene.path("junit.xml"));
    command.args(options.split_whitespace());
    if !controller.is_empty() {
        command.arg("--").args(controller);
    }
    Running::start("bench check-controller", &mut command)
}

/// How each check ended, by class and name, from the file that CI systems read.
fn results(scene: &Scene, ended: &CompletedProcess) -> BTreeMap<String, &'static str> {
    let text = std::fs::read_to_string(scene.path("junit.xml"))
        .unwrap_or_else(|error| panic!("no result: {error}\n{}\n{}", ended.stdout, ended.stderr));
    let document = roxmltree::Document::parse(&text).expect("XML");
    let cases = document.descendants().filter(|node| node.has_tag_name("testcase"));
    let case = |case: roxmltree::Node<'_, '_>| {
        let attribute = |name| case.attribute(name).expect("the attribute");
        let class = attribute("classname").strip_prefix("controller.").expect("the suite");
        let result = match case.first_element_child().map(|child| child.tag_name().name()) {
            Some("failure") => "failed",
            Some("skipped") => "skipped",
            _ => "passed",
        };
        (format!("{class} {}", attribute("name")), result)
    };
    cases.map(case).collect()
}

/// The names of those that ended so.
fn that<'a>(results: &'a BTreeMap<String, &'static str>, result: &str) -> Vec<&'a str> {
    results.iter().filter(|(_, one)| **one == result).map(|(name, _)| name.as_str()).collect()
}

const ALL_IN_LOCKSTEP: usize = 20;
const ONLY_IN_REAL_TIME: [&str; 3] = ["regular cycle-time", "regular response", "skipped-cycles every-cycle"];

#[test]
fn our_controller_keeps_the_contract() {
    let scene = Scene::new(&SHORT.replace("0.4", "2.0"));
    let controller = executable(Program::Controller, Build::Shipped);
    let path = |name: &str| scene.path(name).display().to_string();
    let (rig, experiment, out) = (path("rig.toml"), path("experiment.toml"), path("out"));
    let run = [controller.to_str().unwrap(), "run", "--bus", "{bus}", "--pace", "lockstep"];
    let line = [&run[..], &["--rig", &rig, "--experiment", &experiment, "--out", &out]].concat();
    let ended = check(&scene, "--pace lockstep --both-axes --seconds 1", &line).wait();
    let results = results(&scene, &ended);
    assert_eq!(that(&results, "failed"), [""; 0], "{}\n{}", ended.stdout, ended.stderr);
    assert_eq!(that(&results, "skipped"), ONLY_IN_REAL_TIME, "{}", ended.stdout);
    assert_eq!(results.len(), ALL_IN_LOCKSTEP);
    ended.expect_code(0);
}

#[test]
fn the_c_firmware_keeps_the_contract_in_lockstep_and_in_real_time() {
    let scene = Scene::new(SHORT);
    firmware::build(&scene.path("built"), &[]);
    let program = scene.path("built/firmware-embedded");
    let line = [program.to_str().unwrap(), "{path}"];
    let ended = check(&scene, "--pace lockstep-echo --seconds 1", &line).wait().expect_code(0);
    let in_lockstep = results(&scene, &ended);
    assert_eq!(that(&in_lockstep, "failed"), [""; 0], "{}", ended.stdout);
    assert_eq!(in_lockstep["emergency-stop valve-shut"], "passed");

    // On a machine that stands still now and then a cycle goes without an answer: that is not the firmware's.
    let _turn = turn::take();
    let ended = check(&scene, "--pace real --seconds 1", &line).wait();
    let results = results(&scene, &ended);
    for name in [
        "regular answers",
        "regular length",
        "regular checksum",
        "regular reserved-bits",
        "regular range",
        "regular identifiers",
        "sensor-loss no-invented-echo",
        "sensor-loss told",
    ] {
        assert_eq!(results[name], "passed", "{name}: {}", ended.stdout);
    }
    for name in ["regular cycle-time", "regular response", "skipped-cycles every-cycle"] {
        assert_ne!(results[name], "skipped", "{name}: {}", ended.stdout);
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    None,
    Checksum,
    ReservedBits,
    Range,
    Length,
    Counter,
    CounterOfSensors,
    Misses,
    AnswersTwice,
    OldEcho,
    OthersFrame,
    AnswersNoise,
    IgnoresStop,
    ComesBackWhileStopped,
    IgnoresLoss,
    CountsCyclesItself,
    DiesOfStop,
    DiesOfLoss,
}

/// A controller that holds its valve open and breaks the contract in one place.
struct FaultyController {
    fault: Fault,
    alive: u8,
    stopped_since: Option<u32>,
    answered: u16,
    silent_cycles: u32,
    last: Option<u16>,
}

impl FaultyController {
    fn new(fault: Fault) -> Self {
        Self { fault, alive: 0, stopped_since: None, answered: 0, silent_cycles: 0, last: None }
    }

    fn act(&mut self, peer: &Peer, cycle: u32, frames: &[CanFrame]) {
        let received = |id: u16| frames.iter().any(|frame| frame.standard_id() == Some(id));
        if received(0x108) {
            self.stopped_since.get_or_insert(cycle);
        }
        let sensors = frames.iter().any(|frame| matches!(Frame::decode(frame), Ok(Frame::DriveSensors(_))));
        if sensors || self.fault == Fault::CountsCyclesItself {
            self.answered = (cycle % 4096) as u16;
        }
        self.silent_cycles = if sensors { 0 } else { self.silent_cycles + 1 };
        let dies = match self.fault {
            Fault::DiesOfStop => self.stopped_since.is_some(),
            Fault::DiesOfLoss => self.silent_cycles > 0,
            _ => false,
        };
        if dies {
            return peer.leave();
        }
        let answers = match self.fault {
            Fault::Misses => sensors && cycle % 500 != 250,
            Fault::IgnoresLoss | Fault::CountsCyclesItself => true,
            _ => sensors,
        };
        if self.silent_cycles == 50 {
            let stop = EmergencyStop { reason: EmergencyStopReason::SensorLoss, release: false };
            peer.send_frame(&Frame::DriveEmergencyStop(stop));
        }
        if answers {
            self.answer(peer, cycle);
        }
        if self.fault == Fault::AnswersNoise && received(0x5A5) {
            self.answer(peer, cycle);
        }
        if self.fault == Fault::AnswersTwice && cycle % 100 == 50 {
            self.answer(peer, cycle);
        }
        if self.fault == Fault::OthersFrame && cycle.is_multiple_of(100) {
            peer.send(&CanFrame::new(0x160, &[1, 0]).to_bytes());
        }
    }

    fn answer(&mut self, peer: &Peer, cycle: u32) {
        let since_stop = self.stopped_since.map(|since| cycle - since);
        let shut = match self.fault {
            Fault::IgnoresStop => false,
            Fault::ComesBackWhileStopped => since_stop.is_some_and(|since| since < 300),
            _ => since_stop.is_some(),
        };
        let shut = shut || (self.silent_cycles >= 50 && self.fault != Fault::IgnoresLoss);
        let echo = if self.fault == Fault::OldEcho { self.last.unwrap_or(0) } else { self.answered };
        if self.fault == Fault::OldEcho && cycle.is_multiple_of(3) {
            self.last = Some(self.answered);
        }
        let command = ValveCommand { opening: 0.1, alive: self.alive, echo, enable: !shut };
        let step = match self.fault {
            Fault::Counter => 3,
            Fault::CounterOfSensors if cycle.is_multiple_of(64) => 0,
            _ => 1,
        };
        self.alive = (self.alive + step) % 16;
        let mut data = Frame::DriveValveCommand(command).encode().unwrap().data()[..4].to_vec();
        // Now and then, as real mistakes are; a check must not need more.
        if cycle % 97 == 96 {
            match self.fault {
                Fault::ReservedBits => data[3] |= 0x80,
                Fault::Range => (data[0], data[1]) = (0, data[1] & 0xF0 | 0x08),
                _ => {}
            }
        }
        data.push(checksum::of(0x110, &data));
        match self.fault {
            Fault::Checksum if cycle % 97 == 96 => data[4] ^= 1,
            Fault::Length if cycle % 97 == 96 => data.push(0),
            _ => {}
        }
        peer.send(&CanFrame::new(0x110, &data).to_bytes());
    }
}

/// What the check says of a controller with this fault, when it starts this command beside it: the failed ones, and all.
fn broken(fault: Fault, command: &[&str]) -> (Vec<String>, CompletedProcess) {
    let scene = Scene::new(SHORT);
    let running = check(&scene, "--pace lockstep --seconds 1", command);
    std::thread::scope(|scope| {
        let socket = scene.socket();
        let _controller = scope.spawn(move || three_sessions(&socket, fault));
        let ended = running.wait();
        let results = results(&scene, &ended);
        (that(&results, "failed").iter().map(|name| (*name).to_owned()).collect(), ended)
    })
}

/// Three times a controller that was reset.
fn three_sessions(socket: &Path, fault: Fault) {
    for _ in 0..3 {
        let mut controller = FaultyController::new(fault);
        let onlooker = Peer::connect(socket);
        Peer::connect(socket)
            .take_part("controller", |peer, cycle, frames| controller.act(peer, cycle, frames));
        // One that dies is not back before the next session.
        let _ = onlooker.frames_to_the_end();
    }
}

#[test]
fn each_way_of_breaking_the_contract_is_named_with_what_follows_from_it_and_nothing_else() {
    const EVERY_CYCLE: &str = "regular every-cycle";
    const COUNTER: &str = "regular counter";
    const NOISE: &str = "noise every-cycle";
    let table: [(Fault, &[&str]); 18] = [
        (Fault::None, &[]),
        // What the rig would not take is no answer either, and a gap in the counter.
        (Fault::Checksum, &[NOISE, "regular checksum", COUNTER, EVERY_CYCLE]),
        (Fault::ReservedBits, &[NOISE, COUNTER, EVERY_CYCLE, "regular reserved-bits"]),
        (Fault::Range, &[NOISE, COUNTER, EVERY_CYCLE, "regular range"]),
        (Fault::Length, &[NOISE, COUNTER, EVERY_CYCLE, "regular length"]),
        (Fault::Counter, &[COUNTER]),
        (Fault::CounterOfSensors, &[COUNTER]),
        (Fault::Misses, &[NOISE, EVERY_CYCLE]),
        (Fault::AnswersTwice, &[NOISE, EVERY_CYCLE]),
        (Fault::OldEcho, &[NOISE, "regular command-age", EVERY_CYCLE]),
        (Fault::OthersFrame, &["regular identifiers"]),
        (Fault::AnswersNoise, &[NOISE]),
        (Fault::IgnoresStop, &["emergency-stop valve-shut"]),
        (Fault::ComesBackWhileStopped, &["emergency-stop valve-shut"]),
        (Fault::IgnoresLoss, &["sensor-loss valve-shut"]),
        (Fault::CountsCyclesItself, &["sensor-loss no-invented-echo"]),
        // Who is dead opens no valve: of a fault that kills a controller no other check would report.
        (Fault::DiesOfStop, &["emergency-stop to-the-end"]),
        (Fault::DiesOfLoss, &["sensor-loss to-the-end"]),
    ];
    for (fault, expected) in table {
        let (failed, ended) = broken(fault, &[]);
        assert_eq!(failed, expected, "{fault:?}\n{}\n{}", ended.stdout, ended.stderr);
        ended.expect_code(i32::from(!expected.is_empty()));
    }
}

/// Nothing of what is left distinguishes a process that has ended from a controller that keeps its valve shut.
#[test]
fn a_process_that_has_ended_is_reported_in_every_session() {
    let (failed, ended) = broken(Fault::None, &["true"]);
    let sessions = ["emergency-stop", "regular", "sensor-loss"];
    assert_eq!(failed, sessions.map(|session| format!("{session} to-the-end")), "{}", ended.stdout);
    assert_eq!(ended.stdout.matches("its process has ended: exit status: 0").count(), 3, "{}", ended.stdout);
    ended.expect_code(1);
}

#[test]
fn a_controller_that_is_not_there_or_never_moves_is_reported() {
    let scene = Scene::new(SHORT);
    let ended = check(&scene, "--pace real --patience 0.2", &["true"]).wait().expect_code(1);
    assert_eq!(that(&results(&scene, &ended), "passed"), [""; 0]);
    assert!(ended.stdout.contains("nothing came in 200 cycles"), "{}", ended.stdout);
    let nobody = check(&scene, "--pace real", &["/no/such/program"]).wait().expect_code(2);
    nobody.expect_stderr(&["'/no/such/program' does not start"]);
    let _host = scene.bus_host("");
    let taken = check(&scene, "--pace real", &["true"]).wait().expect_code(3);
    taken.expect_stderr(&["has a host already", "end the emulator on this bus first"]);
}
