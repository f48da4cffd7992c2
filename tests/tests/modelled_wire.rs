//! A bus that keeps time, with the shipped programs on it: response times below their bounds, bus-off and the way back, refusals.

use protocol::frames::{BIT_RATE_PER_S, DRIVE_SENSORS};
use protocol::periods::CYCLE_NS;
use protocol::response_time::rig::{RigAnalysis, RigFrame};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use system_tests::{CompletedProcess, LINKED, Pace, SHORT, Scene, bus_log, count, shipped_experiments, turn};

/// Runs emulator and controller over a bus with these options; the emulator ends well with the controllers, or after some time.
fn run(scene: &Scene, pace: Pace, wire: &str, options: &str) -> (Value, CompletedProcess) {
    let url = format!("{}?{wire}", scene.url());
    let emulator = scene.emulator(pace).bus(url).with(options).start();
    let controller = scene.controller(pace).start();
    let ended = emulator.wait().expect_code(0);
    controller.wait();
    (scene.summary(), ended)
}

fn wire_time(summary: &Value) -> &Value {
    &summary["bus_host"]["wire_time"]
}

/// How frames came: shortest distance and jitter, as far as there were some.
fn came(seen: &Value) -> [Option<u64>; 2] {
    ["least_distance_ns", "release_jitter_ns"].map(|key| seen["arrivals"][key].as_u64())
}

/// Holds what a wire showed of each frame against the documented bound, on the model's own clock. The bound is a promise to
/// frames that, with all that outrank them, kept to what is declared of them. Where a machine held the programs up and they did
/// not, the bound that allows for what came is held instead: model and analysis agree. Returns what was said of those.
fn expect_below_the_bounds(wire: &Value) -> Vec<String> {
    let plain = RigAnalysis::worst_case(BIT_RATE_PER_S);
    let seen_of = |frame: &RigFrame| wire["identifiers"].get(format!("{:03X}", frame.message.id));
    let as_it_came = plain.clone().with(|frame| {
        if let Some([distance_ns, jitter_ns]) = seen_of(frame).map(came) {
            frame.allow_for(distance_ns, jitter_ns);
        }
        true
    });
    let bounds_ns = |analysis: &RigAnalysis| -> Vec<u64> {
        analysis.responses().iter().map(|found| found.expect("1 Mbit/s carries all").response_ns).collect()
    };
    let bounds = bounds_ns(&plain).into_iter().zip(bounds_ns(&as_it_came));
    let (mut kept, mut cyclic, mut widened) = (true, 0, Vec::new());
    for (frame, (plain_ns, as_it_came_ns)) in plain.frames.iter().zip(bounds) {
        let Some(seen) = seen_of(frame) else { continue };
        let name = frame.message.name;
        let [distance_ns, jitter_ns] = came(seen);
        let by_itself = frame.kept_to(distance_ns, jitter_ns);
        kept &= by_itself;
        let measured_ns = count(seen, "/response_ns/max");
        let bound_ns = if kept { plain_ns } else { as_it_came_ns };
        assert!(
            measured_ns <= bound_ns,
            "{name}: {measured_ns} of {bound_ns} ns, plain {plain_ns} ns; not as declared: {widened:#?}; {wire:#}"
        );
        assert!(count(seen, "/bits/1") <= u64::from(frame.bits), "{name}");
        if !kept {
            let why = if by_itself {
                "kept to it, but not all that outrank it".into()
            } else {
                let declared = frame.arrivals;
                format!("distance {distance_ns:?}, jitter {jitter_ns:?} ns, declared {declared:?}")
            };
            widened.push(format!("{name}: {measured_ns} of {as_it_came_ns} ns, plain {plain_ns} ns: {why}"));
        }
        cyclic += u64::from(frame.message.cycle_time_ms > 0 && count(seen, "/frames") > 100);
    }
    assert_eq!(cyclic, 10, "commands, sensors, tick, status and the chains' four were seen");
    assert_eq!((count(wire, "/errors"), count(wire, "/bus_offs")), (0, 0));
    widened
}

#[test]
fn every_frame_of_a_real_run_is_through_within_its_worst_case() {
    let scene = Scene::new(LINKED);
    let _machine = turn::take();
    let (summary, _) = run(&scene, Pace::Real, "bitrate=1000000", "");
    let wire = wire_time(&summary);
    let widened = expect_below_the_bounds(wire);
    eprintln!("{} frame(s) held against the bound as they came, not the plain one:", widened.len());
    widened.iter().for_each(|line| eprintln!("  {line}"));
    let load_ppm = count(wire, "/load_ppm");
    assert!((300_000..700_000).contains(&load_ppm), "{load_ppm}");
    let handed_on = count(wire, "/delivered_late/count");
    assert_eq!(handed_on, count(wire, "/frames"), "what was sent to its end was handed on");
}

/// Any frame of a lockstep log and any later one of its identifier are as many cycles apart as is declared.
fn expect_arrivals_as_declared(experiment: &str, log: &Path) {
    let mut cycle = 0;
    let mut cycles_of: BTreeMap<u16, Vec<u64>> = BTreeMap::new();
    for frame in bus_log(log) {
        let Some(id) = frame.standard_id() else { continue };
        let sent = cycles_of.entry(id).or_default();
        // The drive's sensors are the first frame of each cycle, save for stops.
        cycle += u64::from(id == DRIVE_SENSORS.id);
        sent.push(cycle);
    }
    for frame in RigAnalysis::worst_case(BIT_RATE_PER_S).frames {
        let Some(sent) = cycles_of.get(&frame.message.id) else { continue };
        for count in 1..=30.min(sent.len() - 1) {
            let least_ns = frame.arrivals.earliest_ns(count as u64);
            let pairs = sent.iter().zip(&sent[count..]);
            if let Some((from, to)) = pairs.into_iter().find(|(from, to)| (*to - *from) * CYCLE_NS < least_ns)
            {
                let name = frame.message.name;
                panic!("{experiment}: {name}: {} within cycles {from} to {to}", count + 1);
            }
        }
    }
}

/// Simulated time: no machine disturbs the rhythm. Each frame keeps the plain bound, and our own programs keep to all that the
/// bound assumes of them: distances and jitter on the model's clock, and how many come within any time.
#[test]
fn in_lockstep_every_shipped_experiment_keeps_the_plain_bound_and_what_it_assumes() {
    let shipped = shipped_experiments();
    assert!(shipped.iter().any(|(name, _)| name == "load-step"), "{shipped:?}");
    for (experiment, path) in shipped {
        let scene = Scene::new(LINKED);
        let url = format!("{}?bitrate=1000000", scene.url());
        let emulator = scene.emulator(Pace::Lockstep).bus(url).experiment(&path).with("--seconds 30").start();
        let controller = scene.controller(Pace::Lockstep).experiment(&path).start();
        emulator.wait().expect_code(0);
        controller.wait();
        let widened = expect_below_the_bounds(wire_time(&scene.summary()));
        assert!(widened.is_empty(), "{experiment}: not as declared: {widened:#?}");
        expect_arrivals_as_declared(&experiment, &scene.path("emulator/bus.log"));
    }
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
    assert_eq!(count(&scene.report(), "/bus/error_frames"), 3);
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
    emulator.wait().expect_code(2).expect_stderr(&arithmetic);
    assert!(!scene.path("emulator").exists(), "refused before anything is touched");
    scene.start_bus_host("bitrate=500000").wait().expect_code(2).expect_stderr(&arithmetic);
}
