//! People at the rig: scripted hands and buttons, the rig's own emergency stop on the bus, and its console.

use plant::RigParameters;
use protocol::can::CanFrame;
use protocol::frames::{EmergencyStop, EmergencyStopReason, Frame};
use rehearsal::{Rehearsal, RehearsalParts};
use std::path::Path;
use system_tests::events::{Event, all, times};
use system_tests::{Build, Pace, Running, SHORT, Scene, bus_log, count, expect_same, turn, wait_until};

/// The experiment of the other tests, with more in its `[rig]`.
fn with_people(rig: &str) -> Scene {
    Scene::new(&format!("{SHORT}{rig}"))
}

/// Runs the rig in lockstep with one member that sends what it likes; the member takes no other part.
fn lockstep(scene: &Scene, cycles: usize, say: impl FnMut(u32) -> Option<Frame>) {
    let seconds = cycles as f64 * 1e-3;
    let emulator = scene.emulator(Pace::Lockstep).with(&format!("--seconds {seconds}")).start();
    scene.peer().be_console(say);
    emulator.wait().expect_code(0);
}

/// The rig's calls about its own emergency stop, each with the cycle of the sensors that follow it.
fn rig_calls(log: &Path) -> Vec<(usize, bool)> {
    let mut cycle = 0;
    let mut calls = Vec::new();
    for frame in bus_log(log) {
        match Frame::decode(&frame) {
            Ok(Frame::RigEmergencyStop(stop)) => {
                assert_eq!(stop, EmergencyStop::of_operator(stop.release));
                calls.push((cycle, stop.release));
            }
            Ok(Frame::DriveSensors(_)) => cycle += 1,
            _ => {}
        }
    }
    calls
}

fn cycles_of(events: &[Event], kind: &str) -> Vec<usize> {
    events.iter().filter(|event| event.kind == kind).map(|event| event.cycle).collect()
}

const STOP_AND_RELEASE: &str = "[[rig.event]]\nat_s = 0.4\ndo = \"emergency-stop\"\n\
                                [[rig.event]]\nat_s = 0.95\ndo = \"release\"\n";

#[test]
fn a_scripted_stop_is_called_out_every_100_ms_and_empties_the_supply() {
    let scene = with_people(STOP_AND_RELEASE);
    lockstep(&scene, 1800, |_| None);
    let stops = [400, 500, 600, 700, 800, 900].map(|cycle| (cycle, false));
    assert_eq!(rig_calls(&scene.path("emulator/bus.log")), [&stops[..], &[(950, true)]].concat());
    let events = all(&scene.summary());
    assert_eq!(cycles_of(&events, "emergency-stop"), [400]);
    assert_eq!(cycles_of(&events, "emergency-stop-released"), [950]);
    let supply = scene.truth().column("supply_pressure_Pa");
    assert_eq!(supply[400], 700_000.0);
    // Discharge with 0.05 s: after 70 ms 6 bar e^-1.4 above 1 bar; after 0.55 s 10 Pa. Recovery with 0.3 s.
    assert!((240_000.0..260_000.0).contains(&supply[470]), "{} Pa", supply[470]);
    assert!((supply[950] - 101_325.0).abs() < 50.0, "{} Pa", supply[950]);
    assert!(supply[1799] > 650_000.0, "{} Pa", supply[1799]);
    // What was done stands in run.json, in the experiment's own words.
    let setup = &scene.run_description()["rig_setup"];
    assert_eq!(setup["event"][0]["do"], "emergency-stop");
    assert_eq!(setup["event"][1]["at_s"], 0.95);
}

#[test]
fn the_rig_says_the_same_in_lockstep_and_in_a_rehearsal() {
    const CYCLES: usize = 1000;
    let scene = with_people(STOP_AND_RELEASE);
    lockstep(&scene, CYCLES, |_| None);
    let logged = scene.bus_log();

    let rig = RigParameters::baseline();
    let people = plant::Scene::from_toml(STOP_AND_RELEASE, "people", &rig).expect("a scene");
    let setup = plant::Scene { carriage_position_m: 0.1, ..people };
    let parts = RehearsalParts { rig: &rig, scene: &setup, seed: 1, controllers: Vec::new() };
    let mut rehearsal = Rehearsal::new(parts).expect("a rig");
    let (listener, frames) = crossbeam_channel::bounded(4 * CYCLES);
    rehearsal.listen(listener);
    (0..CYCLES).for_each(|_| _ = rehearsal.step(|_, _| {}));
    let rehearsed: Vec<CanFrame> = frames.try_iter().collect();

    let release = |frames: &[CanFrame]| {
        let is_release = |frame: &&CanFrame| {
            matches!(Frame::decode(frame), Ok(Frame::RigEmergencyStop(EmergencyStop { release: true, .. })))
        };
        frames.iter().find(is_release).map(|frame| frame.data().to_vec())
    };
    // rig.dbc: the reason is none in a release.
    assert_eq!([release(&logged), release(&rehearsed)], [Some(vec![0, 1]), Some(vec![0, 1])]);
    assert!(rehearsed.len() > 2 * CYCLES, "{} frames", rehearsed.len());
    let first = logged.iter().zip(&rehearsed).position(|(one, other)| one != other);
    assert_eq!(first.map(|at| (logged[at], rehearsed[at])), None, "the first frame that differs");
}

#[test]
fn the_rig_releases_its_own_stop_alone() {
    let scene = with_people(STOP_AND_RELEASE);
    let stop = |release| {
        Some(Frame::ConsoleEmergencyStop(EmergencyStop { reason: EmergencyStopReason::Operator, release }))
    };
    lockstep(&scene, 1600, |cycle| match cycle {
        500 => stop(false),
        600 => stop(true),
        700 => stop(false),
        1299 => stop(true),
        _ => None,
    });
    let events = all(&scene.summary());
    assert_eq!(cycles_of(&events, "emergency-stop"), [400], "held by one or the other all the time");
    assert_eq!(cycles_of(&events, "emergency-stop-still-held"), [950]);
    assert_eq!(cycles_of(&events, "emergency-stop-released"), [1300]);
    assert_eq!(rig_calls(&scene.path("emulator/bus.log")).last(), Some(&(950, true)));
}

#[test]
fn a_run_with_people_in_it_is_the_same_to_the_byte() {
    let people = format!(
        "{STOP_AND_RELEASE}[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0.1\nto_s = 1.5\nguide_to_m = 0.4\n\
         [[rig.hand]]\non = \"carriage\"\nfrom_s = 0.3\nto_s = 0.9\nforce_n = -45\n\
         [[rig.event]]\nat_s = 0.2\ndo = \"link\"\nuntil_s = 1.2\n\
         [[rig.event]]\nat_s = 1.3\ndo = \"weights\"\nadded_mass_kg = 5\n"
    );
    let run = |people: &str| {
        let scene = with_people(people);
        let (emulator, controller) = scene.start(Pace::Lockstep, "--seconds 1.6", "--repeat");
        emulator.wait().expect_code(0);
        controller.wait();
        scene
    };
    let [one, other] = [run(&people), run(&people)];
    let [folder, again] = [&one, &other].map(|scene| scene.path("emulator"));
    expect_same(&folder, &again, &["bus.log", "measurement.csv", "truth.csv"], "differs");
    let events = all(&one.summary());
    assert_eq!(cycles_of(&events, "link-given-up"), [1200]);
    assert_eq!(times(&events, "weights"), 1);
}

#[test]
fn the_hand_of_the_script_adds_to_that_of_the_bus() {
    let scene =
        with_people("[[rig.hand]]\non = \"carriage\"\nfrom_s = 0.1\nto_s = 0.4\nforce_n = 20\nramp_s = 0\n");
    lockstep(&scene, 600, |cycle| {
        let hand = protocol::frames::HandForce { carriage_n: 12.0, load_eye_n: -8.0 };
        (cycle == 199).then_some(Frame::HandForce(hand))
    });
    let truth = scene.truth();
    let (carriage, load) = (truth.column("drive_hand_force_N"), truth.column("load_hand_force_N"));
    // A step of the wire is 0.061 N; the load's own extension grows against +x.
    for (row, expected_n) in [(99, [0.0, 0.0]), (100, [20.0, 0.0]), (200, [32.0, 8.0]), (400, [12.0, 8.0])] {
        let got = [carriage[row], load[row]];
        let near = got.iter().zip(expected_n).all(|(got, expected)| (got - expected).abs() < 0.04);
        assert!(near, "row {row}: {got:?} N for {expected_n:?}");
    }
}

/// How far a guiding arm brings the parked load's eye towards 0.3 m in 6 s, m, with this besides.
fn way_of_the_eye(besides: &str) -> f64 {
    let hand = "[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0.5\nto_s = 6.5\nguide_to_m = 0.3\n";
    let scene = with_people(&format!("{hand}{besides}"));
    lockstep(&scene, 6500, |_| None);
    let truth = scene.truth();
    let (force, eye) = (truth.column("load_hand_force_N"), truth.column("load_position_m"));
    let most = force.iter().fold(0.0, |most: f64, force| most.max(force.abs()));
    assert!(most <= 150.0, "{most} N");
    eye[500] - eye[6499]
}

#[test]
fn trapped_air_lets_a_hand_move_the_parked_eye_by_millimetres_only() {
    // Chamber a holds 3 bar in 20 cm^3 and is a spring of p A^2 / V, 57 kN/m; b adds 1 kN/m. 150 N less friction of 26 N
    // stretch it by some 2 mm, falling pressure a little further. The check valves of an emergency stop shut in the same air.
    let running = way_of_the_eye("");
    let stopped = way_of_the_eye("[[rig.event]]\nat_s = 0\ndo = \"emergency-stop\"\n");
    assert!((0.0015..0.004).contains(&running), "{running} m");
    assert!((running - stopped).abs() < 1e-4, "{running} m and {stopped} m");
}

// The console.

/// The rig in real time with its console open and nobody on its bus.
fn with_console(scene: &Scene) -> Running {
    let mut emulator = scene.emulator(Pace::Real).with("--console --no-realtime --seconds 60").start();
    emulator.wait_for("console: open");
    scene.wait_for_rows("emulator", 10);
    emulator
}

#[test]
fn typed_commands_are_executed_answered_and_recorded() {
    let scene = Scene::new(SHORT);
    let mut emulator = with_console(&scene);
    let peer = scene.peer();
    for (line, answer) in [
        ("help", "hand load N"),
        ("stop", "emergency stop\n"),
        ("release", "emergency stop released"),
        ("link", "link refused"),
        ("unlink", "rods parted"),
        ("weights 7.5", "weights on the carriage: 7.5 kg"),
        ("hand carriage -80", "pushes the carriage with -80 N, the load eye with 0 N"),
        ("hand load 30", "pushes the carriage with -80 N, the load eye with 30 N"),
        ("weights 50", "weights '50': allowed are 0 to 20 kg"),
        ("start 3", "'start 3' is none of stop, release, link"),
    ] {
        emulator.type_line(line);
        emulator.wait_for(answer);
    }
    scene.wait_for_more_rows("emulator", 300);
    emulator.type_line("quit");
    let received = peer.frames_to_the_end();
    emulator.wait().expect_code(0).expect_stderr(&["ended at the console"]);
    let events = all(&scene.summary());
    for kind in ["emergency-stop", "emergency-stop-released", "link-refused", "unlinked", "weights"] {
        assert_eq!(times(&events, kind), 1, "{kind}: {events:?}");
    }
    assert_eq!(times(&events, "console-hand"), 2);
    // On the bus as in the record: called out when pressed, and once when released.
    let releases = |frames: &[CanFrame]| -> Vec<bool> {
        let calls = frames.iter().filter_map(|frame| match Frame::decode(frame) {
            Ok(Frame::RigEmergencyStop(stop)) => Some(stop.release),
            _ => None,
        });
        calls.collect()
    };
    let logged = releases(&scene.bus_log());
    assert_eq!((logged.first(), logged.last()), (Some(&false), Some(&true)));
    assert_eq!(logged.iter().filter(|release| **release).count(), 1);
    assert_eq!(releases(&received), logged);
    let truth = scene.truth();
    let last = truth.len() - 1;
    assert_eq!(truth.column("drive_hand_force_N")[last], -80.0);
    assert_eq!(truth.column("load_hand_force_N")[last], -30.0);
    // 80 N break the carriage's friction of 35 N.
    assert!(truth.column("drive_position_m")[last] < 0.1);
}

#[test]
fn people_allocate_nothing_in_the_1_ms_path() {
    let scene = with_people(&format!(
        "{}[[rig.hand]]\non = \"load-eye\"\nfrom_s = 1.1\nto_s = 2\nguide_to_m = 0.4\n\
         [[rig.event]]\nat_s = 1.3\ndo = \"link\"\nuntil_s = 1.7\n\
         [[rig.event]]\nat_s = 1.4\ndo = \"weights\"\nadded_mass_kg = 5\n",
        STOP_AND_RELEASE.replace("0.4", "1.2").replace("0.95", "1.6")
    ));
    let _machine = turn::take();
    let launch = scene.emulator(Pace::Real).build(Build::CountingAllocations);
    let mut emulator = launch.with("--console --seconds 60").start();
    scene.wait_for_rows("emulator", 1800);
    ["stop", "release", "hand load 20", "unlink", "weights 1"]
        .iter()
        .for_each(|line| emulator.type_line(line));
    // What was typed last is done last.
    emulator.wait_for("weights on the carriage: 1 kg");
    emulator.type_line("quit");
    emulator.wait().expect_code(0);
    let summary = scene.summary();
    assert_eq!(times(&all(&summary), "emergency-stop"), 2);
    assert_eq!(count(&summary, "/allocations_in_cycle"), 0);
}

#[test]
fn the_end_of_the_input_closes_the_console_and_not_the_run() {
    let scene = Scene::new(SHORT);
    let mut emulator = with_console(&scene);
    emulator.type_line("hand carriage 10");
    emulator.wait_for("10 N");
    emulator.end_input();
    scene.wait_for_more_rows("emulator", 500);
    emulator.interrupt();
}

#[test]
fn without_the_option_nothing_is_read_from_standard_input() {
    let scene = Scene::new(SHORT);
    let mut emulator = scene.emulator(Pace::Real).with("--no-realtime --seconds 1").start();
    emulator.type_line("stop");
    wait_until("the run goes on", || scene.path("emulator/run.json").exists());
    let ended = emulator.wait().expect_code(0);
    assert!(!ended.stderr.contains("console"), "{}", ended.stderr);
    assert_eq!(times(&all(&scene.summary()), "emergency-stop"), 0);
}
