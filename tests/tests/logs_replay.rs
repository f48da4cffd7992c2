//! A recorded log back on a bus: every frame, in order and by its time; never stale commands to a live rig.

use protocol::can::CanFrame;
use runlog::candump::read_line;
use std::fs;
use std::path::Path;
use std::time::Duration;
use system_tests::{Pace, Packet, Peer, Program, Running, SHORT, Scene, count, json, run_both, turn};

/// Silence after which nothing more comes.
const SILENCE: Duration = Duration::from_millis(500);

fn replay(scene: &Scene, log: &Path, options: &str) -> Running {
    let mut bench = Program::Bench.command();
    bench.arg("replay").arg(log).args(["--bus", &scene.url()]).args(options.split_whitespace());
    Running::start("bench replay", bench.arg("--out").arg(scene.path("replayed")))
}

/// Frames that came until there were `least` of them, and a silence.
fn received(peer: &Peer, least: usize) -> Vec<CanFrame> {
    let mut frames = Vec::new();
    loop {
        let patience = if frames.len() < least { system_tests::PATIENCE } else { SILENCE };
        match peer.receive(patience) {
            Some(Packet::Frame(frame)) => frames.push(frame),
            Some(other) => panic!("{other:?}"),
            None => return frames,
        }
    }
}

/// A command of the drive every 10 ms, as many as said; the data are right.
fn commands(count: u64) -> String {
    let line = |number: u64| {
        let frame = protocol::frames::ValveCommand { alive: (number % 16) as u8, ..Default::default() };
        let frame = protocol::frames::Frame::DriveValveCommand(frame).encode().expect("in range");
        format!("({}.{:06}) can0 {frame}\n", 1_700_000_000 + number / 100, number % 100 * 10_000)
    };
    (0..count).map(line).collect()
}

#[test]
fn every_frame_of_a_run_is_on_the_bus_again_in_its_order() {
    let scene = Scene::new(SHORT);
    run_both(&scene.emulator(Pace::Lockstep), &scene.controller(Pace::Lockstep));
    let log = fs::read_to_string(scene.path("emulator/bus.log")).expect("the log");
    // The first 300 ms, and frames of others.
    let mut short: String = log.lines().take(1500).map(|line| format!("{line}\n")).collect();
    let last = short.lines().last().and_then(read_line).expect("a line").stamp_ns;
    let later = |ms: u64| {
        format!("({}.{:06})", (last / 1_000_000 + ms) / 1000, (last / 1_000_000 + ms) % 1000 * 1000)
    };
    short += &format!("{} bus0 1ABCDEF0#01\n{} bus0 7FF#R3\n", later(20), later(30));
    let expected: Vec<_> = short.lines().map(|line| read_line(line).expect("a line").frame).collect();
    let short = scene.write("short.log", &short);
    let _host = scene.bus_host("");
    let peer = scene.peer();
    let replayed = replay(&scene, &short, "");
    let came = received(&peer, expected.len());
    assert!(came == expected, "first difference: {:?}", came.iter().zip(&expected).position(|(a, b)| a != b));
    let reported = replayed.wait().expect_code(0).stdout;
    assert!(reported.contains("timing error: p50"), "{reported}");
    let report = json(&scene.path("replayed/replay.json"));
    assert_eq!(report["ended"], "whole");
    for pointer in ["/frames_sent", "/frames_in_log", "/timing_error_ns/count"] {
        assert_eq!(count(&report, pointer), expected.len() as u64, "{pointer}");
    }
    assert!(scene.path("replayed/replay.hlog").is_file());
}

#[test]
fn a_live_rig_gets_no_stale_command_and_no_second_rig_beside_it() {
    let scene = Scene::new(SHORT);
    let mixed = format!(
        "{}(1700000001.000000) can0 120#0000000000000000\n(1700000001.001000) can0 7F0#01\n",
        commands(3)
    );
    let log = scene.write("mixed.log", &mixed);
    let _machine = turn::take();
    let emulator = scene.emulator(Pace::Real).with("--seconds 60").start();
    scene.wait_for_rows("emulator", 50);
    let refused = replay(&scene, &log, "").wait().expect_code(2);
    refused.expect_stderr(&["a rig is live", "3 commands and 1 frames of a rig", "--leave-out commands,rig"]);
    let refused = replay(&scene, &log, "--leave-out commands").wait().expect_code(2);
    refused.expect_stderr(&["0 commands and 1 frames"]);
    replay(&scene, &log, "--leave-out commands,rig").wait().expect_code(0);
    let report = json(&scene.path("replayed/replay.json"));
    assert_eq!((count(&report, "/frames_sent"), count(&report, "/frames_left_out")), (1, 4));
    emulator.interrupt();
    assert_eq!(count(&scene.summary(), "/stale_commands"), 0);
    let log = fs::read_to_string(scene.path("emulator/bus.log")).expect("the rig's own log");
    assert!(log.contains(" 7F0#01") && !log.contains(" 110#"), "what was left out is not on the bus");
}

#[test]
fn a_rig_that_comes_alive_ends_a_replay_that_would_disturb_it() {
    let (scene, _host, peer) = Scene::with_bus();
    let log = scene.write("long.log", &commands(6000));
    let replayed = replay(&scene, &log, "");
    let before = received_some(&peer, 5);
    peer.send(&CanFrame::new(0x120, &[0; 8]).to_bytes());
    let ended = replayed.wait().expect_code(3).stdout;
    assert!(ended.contains("a rig came alive"), "{ended}");
    let report = json(&scene.path("replayed/replay.json"));
    assert_eq!(report["ended"], "live-rig");
    assert_eq!(count(&report, "/frames_sent"), (before + received(&peer, 0).len()) as u64);
    // Without what disturbs there is nothing to be sent, and with something else it goes on beside the rig.
    replay(&scene, &log, "--leave-out 110").wait().expect_code(2).expect_stderr(&["nothing of"]);
}

fn received_some(peer: &Peer, count: usize) -> usize {
    for _ in 0..count {
        let came = peer.receive(system_tests::PATIENCE);
        assert!(matches!(came, Some(Packet::Frame(_))), "{came:?}");
    }
    count
}

#[test]
fn an_interrupted_replay_keeps_what_was_done() {
    let (scene, _host, peer) = Scene::with_bus();
    let replayed = replay(&scene, &scene.write("long.log", &commands(6000)), "--spin-us 100");
    let before = received_some(&peer, 10);
    replayed.interrupt();
    let report = json(&scene.path("replayed/replay.json"));
    assert_eq!(report["ended"], "interrupted");
    let sent = (before + received(&peer, 0).len()) as u64;
    assert!(sent < 6000);
    assert_eq!((count(&report, "/frames_sent"), count(&report, "/timing_error_ns/count")), (sent, sent));
}

#[test]
fn nothing_is_sent_of_a_log_that_is_not_right_to_its_last_line() {
    let (scene, _host, peer) = Scene::with_bus();
    let later = "(9999999999.000000) can0 110#0000000000\n";
    for (more, words) in [
        ("(1700000001.0) can0 11#00\n\n", ":4:21: an identifier has 3 digits"),
        (later, ":4: this frame is more than 7 days"),
        ("(1700000001.0) can1 110#00\n", "can0, can1: choose one with --interface"),
    ] {
        let log = scene.write("hostile.log", &format!("{}{more}", commands(3)));
        replay(&scene, &log, "").wait().expect_code(2).expect_stderr(&[words]);
    }
    assert!(received(&peer, 0).is_empty());
    let log = scene.write("good.log", &commands(3));
    replay(&Scene::new(SHORT), &log, "--wait-s 0").wait().expect_code(3).expect_stderr(&["needs a host"]);
}
