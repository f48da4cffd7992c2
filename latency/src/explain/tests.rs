//! Each cause is named from rows that show it, and an undisturbed run has no event.

use super::*;
use crate::made_up::{self, START_NS};
use crate::model::Cause;

fn one(run: &RunFiles) -> Event {
    let mut events = events(0, run);
    assert_eq!(events.len(), 1, "{events:#?}");
    events.remove(0)
}

fn gap(cpu: u64, from_cycle: u64, length_ns: u64, another_ran: bool) -> Gap {
    let from_ns = START_NS + from_cycle * CYCLE_NS;
    Gap { cpu, from_ns, to_ns: from_ns + length_ns, another_ran }
}

#[test]
fn an_undisturbed_run_has_no_event() {
    assert!(events(0, &made_up::run(500)).is_empty());
}

#[test]
fn a_stopped_rig_is_one_event_and_its_controller_is_not_late() {
    let mut run = made_up::stalled(500, "emulator", 100, 5_400_000);
    // The handler may run a cycle later.
    run.rows.get_mut("emulator").unwrap()[102].vitals.continued = 1;
    let event = one(&run);
    assert_eq!((event.cause, event.process.as_str()), (Cause::EmulatorStopped, "emulator"));
    assert_eq!((event.cycle, event.skipped, event.late_ns), (100, 5, 5_400_000));
    assert!(event.sentence.contains("5.40 ms late and missed 5 cycles"), "{}", event.sentence);
    assert!(event.nearby_cycles["emulator"].iter().any(|row| row.cycle == 105));
    assert!(event.nearby_cycles.contains_key("controller"));
}

#[test]
fn a_stopped_controller_is_late_from_the_first_sensors_that_it_let_wait() {
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "controller", 200, 5_300_000).vitals.continued = 1;
    let event = one(&run);
    assert_eq!((event.cause, event.process.as_str()), (Cause::ControllerStopped, "controller"));
    assert_eq!((event.cycle, event.skipped), (200, 5));
    assert!((5_200_000..5_400_000).contains(&event.late_ns), "{}", event.late_ns);
}

#[test]
fn the_flight_recorder_knows_how_long_sensors_waited() {
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "controller", 200, 1_300_000).vitals.continued = 1;
    made_up::edit_summary(&mut run, |summary| summary["frames_lost_at_rig"] = 9.into());
    let quiet = events(0, &run);
    assert!(quiet.iter().all(|event| event.skipped == 0), "a single cycle may have been lost: {quiet:#?}");
    run.recorded_late_ns.insert("controller".into(), BTreeMap::from([(201, 1_310_000)]));
    let event = one(&run);
    assert_eq!((event.cause, event.cycle, event.skipped), (Cause::ControllerStopped, 200, 1));
    assert_eq!(event.late_ns, 1_310_000);
}

#[test]
fn sensors_that_were_lost_are_no_missed_cycles() {
    let mut run = made_up::run(500);
    let rows = run.rows.get_mut("controller").unwrap();
    rows.retain(|row| row.cycle != 300);
    rows[300].skipped = 1;
    assert!(events(0, &run).is_empty());
}

#[test]
fn a_thread_that_had_to_wait_for_its_cpu_met_contention() {
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "emulator", 100, 3_200_000).vitals.run_delay_ns = 3_100_000;
    let event = one(&run);
    assert_eq!(event.cause, Cause::CpuContention);
    assert!(event.sentence.contains("had CPU 0 for 3.10 ms"), "{}", event.sentence);
    // A probe that another thread kept away says the same.
    run.gaps = Some(vec![gap(0, 100, 3_200_000, true)]);
    assert_eq!(one(&run).cause, Cause::CpuContention);
}

#[test]
fn a_cpu_that_stood_still_under_the_probe_is_no_contention() {
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "controller", 100, 2_500_000).vitals.run_delay_ns = 2_400_000;
    assert_eq!(one(&run).cause, Cause::CpuContention, "without a probe nobody can tell");
    run.gaps = Some(vec![gap(1, 100, 2_400_000, false)]);
    let event = one(&run);
    assert_eq!(event.cause, Cause::MachineStoodStill);
    assert!(event.sentence.contains("which the probe saw"), "{}", event.sentence);
    assert_eq!(event.probe.len(), 1);
    // A gap of another CPU is no proof for this one.
    run.gaps = Some(vec![gap(0, 100, 2_400_000, false)]);
    assert_eq!(one(&run).cause, Cause::CpuContention);
}

#[test]
fn both_processes_late_at_once_is_the_machine() {
    let mut run = made_up::stalled(500, "emulator", 100, 900_000);
    made_up::stall(&mut run, "controller", 100, 900_000).vitals.run_delay_ns = 850_000;
    let events = events(0, &run);
    assert_eq!(events.len(), 2);
    assert!(events.iter().all(|event| event.cause == Cause::MachineStoodStill), "{events:#?}");
    assert!(events[0].evidence.iter().any(|line| line.starts_with("In the same moment")), "{events:#?}");
}

#[test]
fn a_late_timer_without_any_trace_is_most_likely_the_machine() {
    let run = made_up::stalled(500, "emulator", 100, 3_700_000);
    let event = one(&run);
    assert_eq!(event.cause, Cause::MachineStoodStill);
    assert!(event.sentence.contains("most likely"), "{}", event.sentence);
    assert!(event.sentence.contains("waited only 800 ns of 3.70 ms"), "{}", event.sentence);
}

#[test]
fn a_probe_that_saw_the_cpu_free_contradicts() {
    let mut run = made_up::stalled(500, "emulator", 100, 3_700_000);
    run.gaps = Some(vec![gap(0, 10, 200_000, false)]);
    assert_eq!(one(&run).cause, Cause::Unexplained);
}

#[test]
fn many_faults_are_a_cause_and_a_few_are_not() {
    for (minor, major, cause) in
        [(60, 0, Cause::PageFaults), (0, 2, Cause::PageFaults), (3, 0, Cause::Unexplained)]
    {
        let mut run = made_up::run(500);
        let vitals = &mut made_up::slow(&mut run, "emulator", 100, 400_000).vitals;
        (vitals.minor_faults, vitals.major_faults) = (minor, major);
        assert_eq!(one(&run).cause, cause, "{minor} minor, {major} major");
    }
}

#[test]
fn slow_work_is_distinguished_from_a_machine_that_stood_still() {
    let mut run = made_up::run(500);
    made_up::slow(&mut run, "emulator", 100, 2_000_000);
    let event = one(&run);
    assert_eq!(event.cause, Cause::Unexplained);
    assert!(event.evidence.iter().any(|line| line.contains("step 2.00 ms")), "{event:#?}");
    run.gaps = Some(vec![gap(1, 100, 1_900_000, false)]);
    assert_eq!(one(&run).cause, Cause::MachineStoodStill);
}

#[test]
fn without_run_delay_nothing_is_left_over_for_the_machine() {
    let mut run = made_up::stalled(500, "emulator", 100, 3_700_000);
    run.rows.get_mut("emulator").unwrap().iter_mut().for_each(|row| row.vitals.run_delay_ns = 0);
    assert_eq!(one(&run).cause, Cause::Unexplained);
}

#[test]
fn late_cycles_in_a_row_are_one_event_and_the_worst_events_come_first() {
    let mut run = made_up::run(500);
    for (cycle, late_ns) in [(100, 400_000), (102, 700_000), (300, 900_000)] {
        made_up::stall(&mut run, "emulator", cycle, late_ns);
    }
    let mut events = events(0, &run);
    sort_by_severity(&mut events);
    let reported: Vec<_> = events.iter().map(|event| (event.cycle, event.late_ns)).collect();
    assert_eq!(reported, [(300, 900_000), (102, 700_000)]);
}

#[test]
fn waiting_that_is_no_cause_is_reported_as_it_was() {
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "emulator", 100, 3_700_000).vitals.run_delay_ns = 951_000;
    let event = one(&run);
    assert_eq!(event.cause, Cause::MachineStoodStill);
    assert!(event.sentence.contains("waited only 951.0 us of 3.70 ms"), "{}", event.sentence);
}

#[test]
fn witnesses_that_contradict_each_other_make_it_likely_only() {
    let mut run = made_up::stalled(500, "emulator", 100, 900_000);
    made_up::stall(&mut run, "controller", 100, 900_000).vitals.run_delay_ns = 850_000;
    let events = events(0, &run);
    let of = |process: &str| events.iter().find(|event| event.process == process).unwrap();
    let sentence = &of("controller").sentence;
    assert!(sentence.contains("most likely") && sentence.contains("waited 850.0 us"), "{sentence}");
}

#[test]
fn waiting_is_added_up_over_the_cycles_of_an_event() {
    let mut run = made_up::run(500);
    for cycle in 100..104 {
        made_up::stall(&mut run, "emulator", cycle, 400_000 + cycle).vitals.run_delay_ns = 390_000;
    }
    let event = one(&run);
    assert_eq!(event.cause, Cause::CpuContention);
    assert!(event.sentence.contains("had CPU 0 for 1.56 ms"), "{}", event.sentence);
}

#[test]
fn what_two_processes_suffered_at_once_takes_one_place() {
    let mut run = made_up::stalled(500, "emulator", 100, 900_000);
    made_up::stall(&mut run, "controller", 100, 800_000);
    made_up::stall(&mut run, "controller", 300, 700_000);
    let mut events = events(0, &run);
    sort_by_severity(&mut events);
    let kept = one_of_each_moment(events);
    let reported: Vec<_> = kept.iter().map(|event| (event.process.as_str(), event.cycle)).collect();
    assert_eq!(reported, [("emulator", 100), ("controller", 300)]);
    let last = kept[0].evidence.last().unwrap();
    assert!(last.starts_with("Of the same moment: The controller woke"), "{last}");
}

#[test]
fn a_watched_cpu_without_gaps_is_never_called_unwatched() {
    let mut run = made_up::stalled(500, "emulator", 100, 3_700_000);
    run.gaps = Some(vec![gap(1, 10, 200_000, false)]);
    let reported = |run: &RunFiles| one(run).evidence.join(" ");
    assert!(reported(&run).contains("does not tell whether that CPU was watched"), "{}", reported(&run));
    run.gaps = Some(vec![gap(0, 0, 0, false), gap(1, 0, 0, false)]);
    assert!(reported(&run).contains("The probe on CPU 0 saw no gap"), "{}", reported(&run));
    run.gaps = Some(vec![gap(1, 0, 0, false)]);
    assert!(reported(&run).contains("No probe watched CPU 0"), "{}", reported(&run));
}
