//! Malformed frames: each is counted where it belongs, and changes nothing.
//!
//! A member of the lockstep barrier beside the controller injects one packet of the table every third cycle, while the
//! carriage moves. Lockstep makes the proof sharp: `truth.csv` is byte-equal to that of a run without the injector.

use crate::malformed_table::{COUNTERS, Counter, Injection, table};
use protocol::frames::{Frame, Tick, ValveCommand};
use serde_json::Value;
use system_tests::{Pace, Peer, SHORT, Scene, both_good, count, expect_same, json, same};

/// The carriage moves from here on; before, an open valve would show as well, but later is closer to what matters.
const FIRST_CYCLE: u32 = 750;
const EVERY: u32 = 3;
const FILES: [&str; 3] =
    ["emulator/measurement.csv", "emulator/truth.csv", "controller/controller-drive.csv"];

type Act<'a> = &'a mut dyn FnMut(&Peer, u32);

/// Runs the short experiment with a member that acts as `act` says; `None` runs it without one.
fn run(act: Option<Act<'_>>) -> Scene {
    let scene = Scene::new(SHORT);
    let members = if act.is_some() { 2 } else { 1 };
    let (emulator, controller) = scene.start(Pace::Lockstep, &format!("--members {members}"), "");
    if let Some(act) = act {
        scene.peer().take_part("injector", |peer, cycle, _| act(peer, cycle));
    }
    both_good(emulator, controller);
    scene
}

fn inject(injections: &[Injection], peer: &Peer, cycle: u32) {
    let index = cycle.wrapping_sub(FIRST_CYCLE);
    if index.is_multiple_of(EVERY)
        && let Some(injection) = injections.get((index / EVERY) as usize)
    {
        peer.send(&(injection.packet)(cycle));
    }
}

fn reported(scene: &Scene, counter: Counter) -> [Value; 2] {
    let of = |file: &str, pointer: Option<&str>| {
        pointer.map_or(Value::Null, |pointer| count(&json(&scene.path(file)), pointer).into())
    };
    [
        of("emulator/summary.json", Some(counter.in_summary())),
        of("controller/controller.json", counter.in_controller()),
    ]
}

#[test]
fn each_malformed_frame_is_counted_where_it_belongs_and_changes_nothing() {
    let injections = table();
    assert!(injections.len() >= 20, "the table has {} entries", injections.len());
    let without = run(None);
    let with = run(Some(&mut |peer, cycle| inject(&injections, peer, cycle)));
    expect_same(&without.path(""), &with.path(""), &FILES, "was changed");
    for counter in COUNTERS {
        let sent: Vec<&str> =
            injections.iter().filter(|one| one.counter == counter).map(|one| one.what.as_str()).collect();
        let expected = Value::from(sent.len());
        let [summary, controller] = reported(&with, counter);
        assert_eq!(summary, expected, "{counter:?} in summary.json, of: {sent:#?}");
        if counter.in_controller().is_some() {
            assert_eq!(controller, expected, "{counter:?} in controller.json, of: {sent:#?}");
        }
        let [before, _] = reported(&without, counter);
        assert_eq!(before, Value::from(0), "{counter:?} without the injector");
    }
}

#[test]
fn the_sums_over_all_kinds_hold_what_each_kind_counted() {
    let injections = table();
    let scene = run(Some(&mut |peer, cycle| inject(&injections, peer, cycle)));
    let summary = scene.summary();
    let sent =
        |wanted: &[Counter]| injections.iter().filter(|one| wanted.contains(&one.counter)).count() as u64;
    assert_eq!(count(&summary, "/frames_malformed"), sent(&[Counter::Malformed]));
    assert_eq!(count(&summary, "/stale_commands"), sent(&[Counter::StaleDrive, Counter::StaleLoad]));
    for axis in ["drive_commands", "load_commands"] {
        assert_eq!(
            count(&summary, &format!("/{axis}/two_sources")),
            0,
            "{axis}: a frame refused is no source"
        );
        assert_eq!(count(&summary, &format!("/{axis}/lost")), 0, "{axis}: a frame refused is no gap");
    }
}

/// That nothing changes is worth something only if a good frame in the same place changes much.
#[test]
fn one_good_command_from_elsewhere_does_change_the_run() {
    let without = run(None);
    let with = run(Some(&mut |peer, cycle| {
        if cycle == FIRST_CYCLE {
            let command = ValveCommand { opening: 1.0, alive: 5, echo: (cycle % 4096) as u16, enable: true };
            peer.send_frame(&Frame::DriveValveCommand(command));
        }
    }));
    for file in FILES {
        assert!(!same(&without.path(file), &with.path(file)), "{file} was not changed");
    }
}

/// A well-formed frame that only a rig sends is not malformed; it is reported by its own name.
#[test]
fn a_tick_from_elsewhere_is_counted_as_a_second_rig() {
    let scene = run(Some(&mut |peer, cycle| {
        if cycle == FIRST_CYCLE {
            peer.send_frame(&Frame::Tick(Tick { cycle, lockstep: true, ..Tick::default() }));
        }
    }));
    let summary = scene.summary();
    assert_eq!(count(&summary, "/frames_ignored/second_rig"), 1);
    assert_eq!(count(&summary, "/frames_malformed"), 0);
}
