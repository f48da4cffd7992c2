//! Faults of the bus and on it, in real time on the embedded bus: hosts that go, hosts too many, a second controller,
//! a listener that does not listen.

use protocol::can::CanFrame;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use system_tests::account::of_sensors;
use system_tests::events::{self, expect_valve_shut_between};
use system_tests::{Pace, RESTLESS, Running, SHORT, Scene, count, count_of_id, json, run_both, turn};

const UNDER_WAY: usize = 900;

/// Controllers of both axes that mind nobody's absence, nor a second one's presence.
fn alone(scene: &Scene, folder: &str) -> [Running; 2] {
    ["drive", "load"].map(|axis| {
        let controller = scene.axis_controller(Pace::Real, axis).out(&scene.path(folder));
        controller.with("--alone --repeat").start()
    })
}

#[test]
fn a_second_controller_shuts_the_valve_until_one_of_them_is_silent() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let mut emulator = scene.emulator(Pace::Real).start();
    let first = alone(&scene, "first");
    scene.wait_for_rows("emulator", UNDER_WAY);
    let second = alone(&scene, "second");
    emulator.wait_for("fault two-sources: two senders on the drive command, valve shut");
    emulator.wait_for("fault two-sources: two senders on the load command, valve shut");
    scene.wait_for_more_rows("emulator", 200);
    second.into_iter().for_each(|controller| drop(controller.kill()));
    emulator.wait_for("one sender left on the drive command, valve follows");
    scene.wait_for_more_rows("emulator", 600);
    emulator.interrupt();
    first.into_iter().for_each(|controller| drop(controller.wait().expect_code(0)));
    let summary = scene.summary();
    let measurement = scene.measurement();
    expect_valve_shut_between(&summary, &measurement, "two-sources", "one-source");
    for axis in ["drive", "load"] {
        assert!(count(&summary, &format!("/{axis}_commands/two_sources")) >= 1, "{axis}");
    }
    let reported = events::all(&summary);
    for span in events::spans(&reported, "two-sources", "one-source", measurement.len()) {
        assert!(span.len() >= 20, "cleared after 20 silent cycles, not before: {span:?}");
    }
}

#[test]
fn controllers_that_know_of_each_other_take_a_second_one_for_a_fault_and_stop() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let (emulator, first) = scene.under_way(Pace::Real, UNDER_WAY);
    let second = scene.controller(Pace::Real).out(&scene.path("second")).with("--repeat").start();
    first.wait().expect_code(1).expect_stderr(&["partner-restarted", "began anew in the middle"]);
    second.wait().expect_code(1);
    emulator.interrupt();
    let reported = events::all(&scene.summary());
    assert!(events::times(&reported, "emergency-stop") >= 1, "{reported:?}");
    let valve = scene.measurement().column("drive_valve");
    assert!(valve[valve.len() - 1000..].iter().all(|opening| *opening == 0.0), "the valve stays shut");
}

#[test]
fn a_listener_that_never_reads_loses_at_its_own_queue_and_finds_just_that_in_the_gaps() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let host = scene.bus_host("");
    let listener = scene.peer();
    let never = scene.peer();
    let controller = scene.controller(Pace::Real).with("--repeat").start();
    scene.wait_for_peers(3);
    let emulator = scene.emulator(Pace::Real).start();
    // 2000 cycles are some 9000 frames; the longest queue that the host asks for holds 5600.
    scene.wait_for_rows("emulator", 2000);
    let received = std::thread::spawn(move || listener.frames_to_the_end());
    scene.wait_for_more_rows("emulator", 500);
    emulator.interrupt();
    controller.wait().expect_code(0);
    let host = host.interrupt();
    let received = received.join().expect("the listener listens at last");
    drop(never);

    let report: serde_json::Value = serde_json::from_str(&host.stdout).expect("the host reports as JSON");
    let summary = scene.summary();
    let of_peer = |index: usize| &report["peers"][index]["dropped_at_queue"];
    let log = scene.bus_log();
    for id in [0x110_u16, 0x111, 0x120, 0x121, 0x130, 0x140, 0x150, 0x151, 0x152] {
        let of_id = |frames: &[CanFrame]| {
            frames.iter().filter(|frame| frame.standard_id() == Some(id)).count() as u64
        };
        let dropped = count_of_id(of_peer(0), &format!("{id:03X}"));
        assert_eq!(of_id(&log), of_id(&received) + dropped, "{id:#x}: sent is heard and dropped");
        assert!(of_id(&log) > 0, "{id:#x} was on the bus");
    }
    for (id, name) in [(0x120, "120"), (0x121, "121")] {
        let gaps = of_sensors(&received, id).missing_between_ticks;
        assert_eq!(gaps, count_of_id(of_peer(0), name), "gaps in {id:#x} are what its queue dropped");
        assert!(gaps > 0, "{id:#x}: the listener was late enough to lose some");
        assert!(count_of_id(of_peer(1), name) > gaps, "who never reads loses more");
    }
    let axes = ["/drive_commands/lost", "/load_commands/lost", "/drive_commands/two_sources"];
    assert!(axes.iter().all(|pointer| count(&summary, pointer) == 0), "the run is unaffected");
    for peer in [2, 3] {
        assert_eq!(
            of_peer(peer).as_object().map(serde_json::Map::len),
            Some(0),
            "others' queues are their own"
        );
    }
}

#[test]
fn a_bus_that_stays_away_ends_both_with_complete_files() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let host = scene.bus_host("");
    let (mut emulator, controller) = scene.start(Pace::Real, "--bus-grace 1", "--repeat --bus-grace 1");
    scene.wait_for_rows("emulator", UNDER_WAY);
    host.kill();
    emulator.wait_for("the bus is gone");
    emulator.wait().expect_code(3).expect_stderr(&["--bus-grace"]);
    controller.wait().expect_code(3).expect_stderr(&["--bus-grace"]);
    let summary = scene.summary();
    assert_eq!(count(&summary, "/cycles"), scene.measurement().len() as u64);
    assert_eq!(count(&summary, "/bus/disconnects"), 1);
    assert!(count(&summary, "/bus/dropped_on_send") > 1000, "a second of frames was dropped, and counted");
    assert_eq!(summary["passed"], false);
    // Frames that the bus did not take were on no bus.
    assert!(
        count(&summary, "/frames_sent") + count(&summary, "/frames_received") == scene.bus_log().len() as u64
    );
    let _ = scene.truth();
    assert_eq!(count(&scene.report(), "/bus/disconnects"), 1);
}

#[test]
fn a_rig_that_was_killed_is_missed_while_others_still_talk() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let host = scene.bus_host("");
    let (emulator, mut controller) = scene.start(Pace::Real, "", "--repeat --bus-grace 2");
    let stranger = scene.peer();
    scene.wait_for_rows("emulator", UNDER_WAY);
    emulator.kill();
    let over = Arc::new(AtomicBool::new(false));
    let is_over = Arc::clone(&over);
    let chatter = std::thread::spawn(move || {
        let frame = CanFrame::new(0x7F0, &[1]).to_bytes();
        while !is_over.load(Ordering::Relaxed) {
            stranger.send(&frame);
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    controller.wait_for("no sensors for 0.2 s");
    controller.wait().expect_code(3).expect_stderr(&["--bus-grace"]);
    over.store(true, Ordering::Relaxed);
    chatter.join().expect("the stranger talked to the end");
    drop(host);
}

#[test]
fn a_bus_that_comes_back_in_time_is_found_by_both_and_the_gap_is_counted() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let host = scene.bus_host("");
    let (mut emulator, mut controller) = scene.start(Pace::Real, "--bus-grace 30", "--repeat --bus-grace 30");
    scene.wait_for_rows("emulator", UNDER_WAY);
    host.kill();
    emulator.wait_for("the bus is gone");
    controller.wait_for("the bus is gone");
    emulator.wait_for("no fresh drive command");
    let host = scene.bus_host("");
    emulator.wait_for("the bus is back");
    controller.wait_for("the bus is back");
    emulator.wait_for("fresh drive commands again");
    scene.wait_for_more_rows("emulator", 600);
    emulator.interrupt();
    controller.wait().expect_code(0);
    drop(host);
    let summary = scene.summary();
    expect_valve_shut_between(&summary, &scene.measurement(), "command-stale", "command-fresh");
    for counted in [&summary, &scene.report()] {
        assert_eq!((count(counted, "/bus/disconnects"), count(counted, "/bus/reconnects")), (1, 1));
    }
    let reported = events::all(&summary);
    assert_eq!((events::times(&reported, "bus-lost"), events::times(&reported, "bus-back")), (1, 1));
}

#[test]
fn the_socket_of_a_host_that_was_killed_is_taken_over() {
    let _machine = turn::take();
    let scene = Scene::new(SHORT);
    scene.bus_host("").kill();
    assert!(scene.socket().exists(), "a killed host leaves its socket");
    // In lockstep: a machine that stalls for a second would make the controller stop the rig, and the emulator wait for another.
    run_both(&scene.emulator(Pace::Lockstep), &scene.controller(Pace::Lockstep));
    assert!(scene.summary()["bus_host"].is_object(), "the emulator hosted the bus");
    assert!(!scene.socket().exists(), "a host that ends removes its socket");
}

#[test]
fn a_second_host_is_refused_and_a_second_rig_leaves_while_the_first_goes_on() {
    let _machine = turn::take();
    let scene = Scene::new(RESTLESS);
    let mut first = scene.emulator(Pace::Real).start();
    // Long enough on the bus to know that it was here first.
    scene.wait_for_rows("emulator", 500);
    let host = scene.start_bus_host("");
    host.wait()
        .expect_code(3)
        .expect_stderr(&["has a host already", "connect to it, or choose another path"]);
    let second = scene.emulator(Pace::Real).out(&scene.path("second")).start();
    second
        .wait()
        .expect_code(3)
        .expect_stderr(&["has a host already; joining it", "another rig is on this bus already"]);
    first.wait_for("another rig is on this bus; stop one of them");
    first.interrupt();
    assert!(json(&scene.path("second/summary.json"))["bus_host"].is_null());
    assert!(count(&scene.summary(), "/frames_ignored/second_rig") > 0);
}
