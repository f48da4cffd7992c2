//! Each finding from counts and rows that show it, and what comes first.

use super::*;
use crate::{explain, made_up};
use serde_json::{Value, json};

fn found(run: RunFiles) -> Vec<Cause> {
    let events = explain::events(0, &run);
    find(&[run], &events).iter().map(|finding| finding.cause).collect()
}

#[test]
fn nothing_is_found_in_an_undisturbed_run() {
    assert_eq!(found(made_up::run(3000)), []);
}

#[test]
fn counters_speak_without_any_late_cycle() {
    let cases: [(&str, Value, Cause); 6] = [
        ("/summary/vitals", json!({ "continued": 1 }), Cause::EmulatorStopped),
        ("/summary/vitals", json!({ "minor_faults": 5000, "major_faults": 0 }), Cause::PageFaults),
        ("/summary/bus_host/injected_loss", json!({ "110": 30, "120": 25 }), Cause::FrameLoss),
        ("/summary/frames_lost_at_rig", json!(7), Cause::FrameLoss),
        ("/summary/bus/dropped_on_receive", json!(3), Cause::SlowListener),
        ("/summary/wall_clock_steps", json!([{ "at_s": 1.0, "step_s": -3600.0 }]), Cause::ClockStep),
    ];
    for (path, value, cause) in cases {
        let mut run = made_up::run(100);
        let (parent, key) = path.trim_start_matches("/summary").rsplit_once('/').unwrap();
        made_up::edit_summary(&mut run, |summary| summary.pointer_mut(parent).unwrap()[key] = value);
        assert_eq!(found(run), [cause], "{path}");
    }
    let mut run = made_up::run(100);
    made_up::edit_controller(&mut run, |controller| controller["vitals"] = json!({ "continued": 2 }));
    assert_eq!(found(run), [Cause::ControllerStopped]);
}

#[test]
fn a_listener_that_does_not_read_costs_nobody_else_a_frame() {
    let mut run = made_up::run(100);
    made_up::edit_summary(&mut run, |summary| {
        let peers = summary.pointer_mut("/bus_host/peers").unwrap().as_array_mut().unwrap();
        peers.push(json!({ "name": "process 3", "frames_received": 0, "dropped_at_queue": { "120": 40 } }));
    });
    assert_eq!(found(run), [Cause::SlowListener]);
}

#[test]
fn what_a_queue_of_ours_dropped_is_not_lost_on_the_wire() {
    let mut run = made_up::run(100);
    made_up::edit_summary(&mut run, |summary| {
        summary["bus_host"]["peers"][1]["dropped_at_queue"] = json!({ "110": 5 });
        summary["frames_lost_at_rig"] = json!(5);
    });
    assert_eq!(found(run), [Cause::SlowListener]);
}

#[test]
fn faults_in_many_cycles_are_a_storm_without_a_late_one() {
    let mut run = made_up::run(3000);
    let rows = run.rows.get_mut("controller").unwrap();
    rows.iter_mut().step_by(10).for_each(|row| row.vitals.minor_faults = 2);
    assert_eq!(found(run), [Cause::PageFaults]);
}

fn contention_of(waits_ns: &[u64]) -> Finding {
    let mut run = made_up::run(3000);
    for (cycle, wait_ns) in (100..).step_by(200).zip(waits_ns) {
        made_up::stall(&mut run, "emulator", cycle, wait_ns + 100_000).vitals.run_delay_ns = *wait_ns;
    }
    let events = explain::events(0, &run);
    let found = find(&[run], &events);
    assert_eq!(found.len(), 1, "{found:#?}");
    found[0].clone()
}

#[test]
fn contention_is_always_reported_and_named_when_it_comes_back() {
    let single = contention_of(&[9_000_000]);
    assert_eq!((single.cause, single.by_itself), (Cause::CpuContention, true));
    assert_eq!(single.explained_ns, 9_000_000);
    assert!(contention_of(&[300_000; 6]).by_itself, "short ones are what interrupts do");
    assert!(contention_of(&[2_500_000; 2]).by_itself);
    assert!(!contention_of(&[2_500_000; 3]).by_itself, "a hog of 2 to 3 ms that comes back");
    assert!(!contention_of(&[8_000_000; 2]).by_itself);
}

#[test]
fn waiting_of_a_machine_that_nobody_saw_running_is_no_hog() {
    let mut run = made_up::run(3000);
    for cycle in [100, 300, 500] {
        made_up::stall(&mut run, "emulator", cycle, 2_600_000).vitals.run_delay_ns = 2_500_000;
    }
    let mut events = explain::events(0, &run);
    events.iter_mut().for_each(|event| event.machine_ran = false);
    assert!(find(&[run], &events)[0].by_itself);
}

#[test]
fn lateness_without_rows_is_no_undisturbed_run() {
    let mut run = made_up::stalled(500, "emulator", 100, 5_400_000);
    made_up::edit_summary(&mut run, |summary| {
        summary["wakeup_ns"] = json!({ "max": 5_400_000, "count": 500 });
        summary["skipped"] = json!(5);
    });
    assert_eq!(found(run.clone()), [Cause::MachineStoodStill], "its rows tell it");
    run.rows.clear();
    let reported = find(&[run.clone()], &[]);
    assert_eq!(reported[0].cause, Cause::Unknown);
    assert!(
        reported[0].sentence.starts_with("5 cycles skipped, worst wake-up 5.40 ms; no rows"),
        "{reported:?}"
    );
    made_up::edit_summary(&mut run, |summary| {
        summary["skipped"] = json!(0);
        summary["wakeup_ns"]["max"] = json!(150_000);
    });
    assert_eq!(found(run.clone()), [], "counts tell that nothing was late");
    made_up::edit_summary(&mut run, |summary| *summary = json!({}));
    assert_eq!(found(run), [Cause::Unknown]);
}

#[test]
fn what_somebody_did_stands_before_what_machines_do() {
    let mut run = made_up::stalled(3000, "emulator", 100, 9_300_000);
    made_up::stall(&mut run, "emulator", 500, 5_300_000).vitals.continued = 1;
    assert_eq!(found(run), [Cause::EmulatorStopped, Cause::MachineStoodStill]);
}
