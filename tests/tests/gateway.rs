//! The gateway: unmodified clients from PyPI record, decode, send and replay through it what is on the embedded bus.
//!
//! What a client recorded is held against what the rig wrote of the same run, frame by frame.

use protocol::can::CanFrame;
use rustix::process::Signal;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use system_tests::foreign_python::{light_path, python};
use system_tests::gateway::{GatewayClient, GatewayProcess};
use system_tests::{
    PATIENCE, Pace, Packet, Peer, Running, SHORT, Scene, count, text, turn, wait_until, workspace,
};

/// Identifiers and data of a candump log, without time and interface.
fn frames(log: &Path) -> Vec<String> {
    text(log).lines().map(|line| line.split(' ').nth(2).expect("a frame").to_owned()).collect()
}

/// A program of python-can, or another module, with Ctrl-C as a terminal would have it.
fn python_module(module: &str, arguments: &[String]) -> Command {
    let mut command = Command::new("env");
    command.env("PYTHONPATH", light_path());
    command.arg("--default-signal=INT").arg(python()).args(["-m", module]).args(arguments);
    command
}

/// What the bus carries next, seen by a peer that is no client of the gateway.
fn next_on(peer: &Peer) -> CanFrame {
    match peer.receive(PATIENCE) {
        Some(Packet::Frame(frame)) => frame,
        other => panic!("no frame but {other:?}"),
    }
}

#[test]
fn python_can_records_a_run_to_the_frame_and_cantools_decodes_it() {
    let _turn = turn::take();
    let scene = Scene::new(SHORT);
    let emulator = scene.emulator(Pace::Real).start();
    // Python on a busy machine may fall behind by more than the usual queue holds.
    let mut gateway = GatewayProcess::open(&scene, "--queue-frames 100000");
    let log = scene.path("logged.log");
    let to_file = ["-f".to_owned(), log.display().to_string()];
    let logger = Running::start(
        "can.logger",
        &mut python_module("can.logger", &[&to_file, &gateway.python_can()[..]].concat()),
    );
    gateway.wait_for_times("is on the bus", 1);
    let controller = scene.controller(Pace::Real).start();
    emulator.wait();
    controller.wait();
    let ran = frames(&scene.path("emulator/bus.log"));
    let lines = || std::fs::read_to_string(&log).unwrap_or_default().lines().count();
    wait_until("4000 frames in the logger's file, which it writes in blocks", || lines() > 4000);
    logger.signal(Signal::INT);
    logger.wait();

    let logged = frames(&log);
    assert_eq!(count(&gateway.close(), "/frames_lost"), 0);
    // Two frames of one moment from two senders may change places on their ways: each identifier is compared by itself, from
    // wherever in the run the logger came to wherever it went.
    let ids: BTreeSet<&str> = logged.iter().map(|frame| frame.split('#').next().unwrap()).collect();
    assert!(ids.is_superset(&["110", "120", "121", "130", "140", "150", "151"].into()), "{ids:?}");
    for id in ids {
        let of = |frames: &[String]| -> Vec<String> {
            frames.iter().filter(|frame| frame.starts_with(&format!("{id}#"))).cloned().collect()
        };
        let (run, had) = (of(&ran), of(&logged));
        let same = run.windows(had.len()).any(|window| *window == *had);
        assert!(same, "{id}: what was logged ({}) is no stretch of what was sent ({})", had.len(), run.len());
    }

    let decode = ["decode".to_owned(), workspace().join("protocol/rig.dbc").display().to_string()];
    let input = std::fs::File::open(&log).expect("the log");
    let decoded = python_module("cantools", &decode).stdin(Stdio::from(input)).output().expect("cantools");
    let text = String::from_utf8_lossy(&decoded.stdout);
    assert!(decoded.status.success(), "{}", String::from_utf8_lossy(&decoded.stderr));
    assert_eq!(
        text.matches("DriveSensors(").count(),
        logged.iter().filter(|f| f.starts_with("120#")).count()
    );
    assert_eq!(text.matches("::").count(), logged.len(), "a line that was not decoded");
}

#[test]
fn python_can_sends_to_the_bus_and_to_the_other_clients() {
    let (scene, _host, peer) = Scene::with_bus();
    let mut gateway = GatewayProcess::open(&scene, "");
    let mut other = GatewayClient::connect_raw(&gateway);
    let port = gateway.address.port();
    let script = format!(
        "import can\n\
         with can.Bus(interface='socketcand', channel='bus', host='127.0.0.1', port={port}) as bus:\n\
         \x20   bus.send(can.Message(arbitration_id=0x123, data=[1, 0xA0], is_extended_id=False))\n\
         \x20   bus.send(can.Message(arbitration_id=0x123, data=[], is_extended_id=True))\n\
         \x20   got = bus.recv(30)\n\
         \x20   print(hex(got.arbitration_id), got.is_extended_id, got.data.hex())\n"
    );
    let sender = Running::start(
        "python",
        Command::new(python()).env("PYTHONPATH", light_path()).args(["-c", &script]),
    );
    for expected in ["123#01A0", "00000123#"] {
        assert_eq!(next_on(&peer).to_string(), expected);
    }
    assert_eq!(other.frame(), ("123".into(), "01A0".into()));
    assert_eq!(other.frame(), ("00000123".into(), String::new()));
    // Not its own two: a sender does not hear itself.
    gateway.wait_for_times("is on the bus", 2);
    peer.send(&CanFrame::from_raw(0x8000_0456, &[7]).to_bytes());
    assert_eq!(sender.wait().expect_code(0).stdout.trim(), "0x456 True 07");
    let report = gateway.close();
    assert_eq!((count(&report, "/frames_from_clients"), count(&report, "/frames_not_taken")), (2, 0));
}

#[test]
fn python_can_replays_a_log_onto_the_bus() {
    let (scene, _host, peer) = Scene::with_bus();
    let gateway = GatewayProcess::open(&scene, "");
    let line = |n: usize| format!("(1700000000.{:06}) can0 5A5#{n:04X}\n", n * 200);
    let log = scene.write("replay.log", &(0..200).map(line).collect::<String>());
    let file = ["--".to_owned(), log.display().to_string()];
    let options = [&gateway.python_can()[..], &file].concat();
    let player = Running::start("can.player", &mut python_module("can.player", &options));
    for n in 0..200_u16 {
        assert_eq!(next_on(&peer), CanFrame::new(0x5A5, &n.to_be_bytes()), "frame {n}");
    }
    player.wait().expect_code(0);
    assert_eq!(count(&gateway.close(), "/frames_from_clients"), 200);
}

#[test]
fn who_may_only_read_sends_nothing() {
    let (scene, _host, peer) = Scene::with_bus();
    let gateway = GatewayProcess::open(&scene, "--read-only");
    let mut client = GatewayClient::connect_raw(&gateway);
    client.send("< send 108 2 1 0 >");
    client.expect("< error unknown command >");
    peer.send(&CanFrame::new(0x5A5, &[1]).to_bytes());
    assert_eq!(client.frame(), ("5A5".into(), "01".into()));
    assert_eq!(peer.receive(Duration::from_millis(50)), None);
    assert_eq!(count(&gateway.close(), "/bus_counters/sent"), 0);
}

#[test]
fn the_gateway_waits_for_a_bus_that_is_not_there_yet_and_comes_back_to_one_that_was_gone() {
    let scene = Scene::new(SHORT);
    let mut gateway = GatewayProcess::open(&scene, "");
    gateway.wait_for_times("waiting for it", 1);
    let mut client = GatewayClient::connect_raw(&gateway);
    for (round, there) in [(1_u8, 1), (2, 2)] {
        let host = scene.bus_host("");
        gateway.wait_for_times("is there", there);
        let peer = scene.peer();
        peer.send(&CanFrame::new(0x5A5, &[round]).to_bytes());
        assert_eq!(client.frame(), ("5A5".into(), format!("{round:02X}")));
        drop(host);
        gateway.wait_for_times("is gone; waiting", there);
    }
    assert_eq!(count(&gateway.close(), "/bus_counters/reconnects"), 1);
}
