//! A bus that keeps time, with the shipped programs on it: response times below their bounds, bus-off and the way back, refusals.

use protocol::frames::BIT_RATE_PER_S;
use protocol::response_time::rig::RigAnalysis;
use serde_json::Value;
use system_tests::launch::Pace;
use system_tests::process::Ended;
use system_tests::records::{count, json};
use system_tests::scene::{LINKED, SHORT, Scene};

/// Runs emulator and controller over a bus with these options; the emulator ends well with the controllers, or after some time.
fn run(scene: &Scene, pace: Pace, wire: &str, options: &str) -> (Value, Ended) {
    let url = format!("{}?{wire}", scene.url());
    let emulator = scene.emulator(pace).bus(url).with(options).start();
    let controller = scene.controller(pace).start();
    let ended = emulator.wait().expect_code(0);
    let _ = controller.wait();
    (json(&scene.path("emulator/summary.json")), ended)
}

fn wire_time(summary: &Value) -> &Value {
    &summary["bus_host"]["wire_time"]
}

/// On the model's own clock. A machine that holds the programs up makes frames come closer together than they may, and the bound
/// allows for what was seen of that; on one that does not, it is the bound of the docs.
#[test]
fn every_frame_of_a_run_is_through_within_its_worst_case() {
    let scene = Scene::new(LINKED);
    let (summary, _) = run(&scene, Pace::Real, "bitrate=1000000", "");
    let wire = wire_time(&summary);
    let analysis = RigAnalysis::worst_case(BIT_RATE_PER_S).with(|frame| {
        let arrivals = &wire["identifiers"][format!("{:03X}", frame.message.id)]["arrivals"];
        frame.allow_for(arrivals["least_distance_ns"].as_u64(), arrivals["release_jitter_ns"].as_u64());
        true
    });
    let mut cyclic = 0;
    for frame in analysis.frames() {
        let id = format!("{:03X}", frame.message.id);
        let Some(seen) = wire["identifiers"].get(&id) else { continue };
        let bound_ns = analysis.response_of(frame.message.id).expect("1 Mbit/s carries all").response_ns;
        let measured_ns = count(seen, "/response_ns/max");
        assert!(measured_ns <= bound_ns, "{}: {measured_ns} of {bound_ns} ns; {wire:#}", frame.message.name);
        assert!(count(seen, "/bits/1") <= u64::from(frame.bits), "{}", frame.message.name);
        cyclic += u64::from(frame.message.cycle_time_ms > 0);
    }
    assert_eq!(cyclic, 10, "commands, sensors, tick, status and the chains' four were seen");
    let load_ppm = count(wire, "/load_ppm");
    assert!((300_000..700_000).contains(&load_ppm), "{load_ppm}");
    assert_eq!((count(wire, "/errors"), count(wire, "/bus_offs")), (0, 0));
    let handed_on = count(wire, "/delivered_late/count");
    assert_eq!(handed_on, count(wire, "/frames"), "what was sent to its end was handed on");
}

/// All attempts at the drive's commands fail from 1 s on for 20 ms: the controllers' node goes off the bus and is back 100 ms
/// later. Meanwhile the rig has no fresh command, shuts the valves, and says so.
#[test]
fn a_node_that_goes_off_the_bus_recovers_and_the_valve_is_shut_meanwhile() {
    let scene = Scene::new(SHORT);
    let wire = "bitrate=1000000&error_rate=1&errors_id=110&errors_from_ms=1000&errors_to_ms=1020";
    let (summary, _) = run(&scene, Pace::Lockstep, wire, "--seconds 3");
    let off: Vec<&Value> = wire_time(&summary)["nodes"]
        .as_array()
        .expect("nodes")
        .iter()
        .filter(|node| count(node, "/bus_offs") > 0)
        .collect();
    assert_eq!(off.len(), 1, "one node: {off:?}");
    assert_eq!(off[0]["name"], "controller");
    assert_eq!((count(off[0], "/bus_offs"), count(off[0], "/error_passive")), (1, 1));
    assert_eq!((off[0]["bus_off"].clone(), count(off[0], "/errors")), (Value::Bool(false), 32));
    assert!(count(off[0], "/missed_in_bus_off") > 200, "two sensor frames a cycle for 0.1 s");
    let dropped = &off[0]["dropped_in_bus_off"];
    assert!(count(dropped, "/110") >= 1, "what it had to send is dropped and counted: {dropped}");
    let said = summary["events"].to_string();
    assert!(said.contains("command-stale") && said.contains("command-fresh"), "{said}");
    // Passive, off the bus and restarted: three error frames for its programs.
    let controller = json(&scene.path("controller/controller.json"));
    assert_eq!(count(&controller, "/bus/error_frames"), 3);
}

#[test]
fn lockstep_over_a_wire_with_errors_gives_the_same_bytes_twice() {
    let runs = [(); 2].map(|()| {
        let scene = Scene::new(SHORT);
        let (summary, _) = run(&scene, Pace::Lockstep, "bitrate=1000000&error_rate=0.01&seed=5", "");
        assert!(count(wire_time(&summary), "/errors") > 20);
        scene
    });
    let logs = runs.each_ref().map(|scene| std::fs::read(scene.path("emulator/bus.log")).expect("a log"));
    assert!(logs[0] == logs[1] && !logs[0].is_empty());
}

#[test]
fn half_a_mbit_is_refused_with_the_arithmetic() {
    let scene = Scene::new(SHORT);
    let arithmetic = [
        "at 500000 bit/s the cyclic frames of rig.dbc do not fit",
        "135 bits each   1 ms = 27.00 %",
        "too late",
        "load 137.60 %, limit 70 %",
        "use bitrate=1000000",
    ];
    let emulator = scene.emulator(Pace::Real).bus(format!("{}?bitrate=500000", scene.url())).start();
    let _ = emulator.wait().expect_code(2).expect_said(&arithmetic);
    assert!(!scene.path("emulator").exists(), "refused before anything is touched");
    let _ = scene.start_bus_host("bitrate=500000").wait().expect_code(2).expect_said(&arithmetic);
}
