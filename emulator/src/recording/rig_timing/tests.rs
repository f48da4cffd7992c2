//! What is kept of rows, frames and events that never ran.

use super::*;
use crate::event::EventKind;
use protocol::can::CanFrame;
use protocol::frames::Frame;
use protocol::frames::ValveCommand;
use runlog::flight_dump::{self, FrameLogFormat};
use runlog::timing::{Exchange, read as read_rows};
use runlog::timing_recorder::{Activation, FlightFigures};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

const MS: u64 = 1_000_000;

fn rig_timing(folder: &Path, full_timing: bool) -> RigTiming {
    let setup = TimingSetup {
        folder: folder.into(),
        process: Process::Emulator,
        activation: Activation::EveryPeriod,
        full_timing,
        flight_late: Some(Duration::from_micros(500)),
        log: FrameLogFormat { interface: "bus0".into(), epoch_offset_ns: 0 },
        started_unix_s: 0.0,
        started: realtime::Instant::from_nanos(0),
        copies_lines: false,
    };
    RigTiming::create(setup).unwrap()
}

/// A cycle that woke after `late_ns`, acting on a command that answers the one before.
fn record(cycle: u64, late_ns: u64) -> TimingRecord {
    let (due_ns, woke_ns) = (cycle * MS, cycle * MS + late_ns);
    let exchange = Exchange { sensors_ns: woke_ns, command_ns: due_ns - MS / 2, answers: cycle - 1 };
    let drive = AxisCycle { exchange, answered_sensors_ns: due_ns - MS + 10_000, age_cycles: 1 };
    let held = AxisCycle { age_cycles: 2, ..AxisCycle::default() };
    let row = CycleTiming { cycle, due_ns, woke_ns, done_ns: woke_ns + 50_000, ..CycleTiming::default() };
    TimingRecord::Cycle { row, axes: [drive, held] }
}

fn at(ms: u64) -> realtime::Instant {
    realtime::Instant::from_nanos(ms * MS)
}

fn dumped(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder.join(flight_dump::FOLDER)) else { return Vec::new() };
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn ages_and_round_trips_are_counted_by_axis() {
    let folder = tempfile::tempdir().unwrap();
    let mut timing = rig_timing(folder.path(), true);
    (1..=10).for_each(|cycle| timing.timing(&record(cycle, 1000)).unwrap());
    timing.round_trip(RoundTrip { axis: 1, cycle: 10, ns: 70_000 });
    let (report, written) = timing.finish(at(11));
    written.unwrap();
    assert_eq!(report.command_age_cycles.drive, BTreeMap::from([(1, 10)]));
    assert_eq!(report.command_age_cycles.load, BTreeMap::from([(2, 10)]));
    let [drive_age, load_age] = report.command_age_ns;
    assert_eq!((drive_age.count, drive_age.max.map(|ns| ns / 10_000), load_age.count), (10, Some(99), 0));
    assert_eq!(report.round_trip_ns.map(|figures| figures.count), [0, 1]);
    let table = std::fs::read_to_string(folder.path().join("emulator-timing.csv")).unwrap();
    assert_eq!(read_rows(&table).unwrap().len(), 10);
    assert_eq!((report.timing.flight, dumped(folder.path())), (FlightFigures::default(), Vec::new()));
}

#[test]
fn round_trips_that_are_taken_late_belong_to_the_second_of_their_cycle() {
    let folder = tempfile::tempdir().unwrap();
    let mut timing = rig_timing(folder.path(), false);
    // The writer stood still for 2.5 s and finds all of it.
    for cycle in 1..=2500 {
        timing.round_trip(RoundTrip { axis: 0, cycle, ns: 100_000 * (1 + cycle / 1000) });
    }
    (1..=2500).for_each(|cycle| timing.timing(&record(cycle, 1000)).unwrap());
    let (report, written) = timing.finish(at(2501));
    written.unwrap();
    assert_eq!(report.round_trip_ns[0].count, 2500);
    let log = std::fs::read_to_string(folder.path().join("emulator.hlog")).unwrap();
    let lines = log.lines().filter(|line| line.starts_with("Tag=drive-round-trip,"));
    let maxima_ns: Vec<f64> = lines.map(|line| line.split(',').nth(3).unwrap().parse().unwrap()).collect();
    let about = |got: &f64, ns: f64| (got - ns).abs() < ns / 500.0;
    let [first, second, third] = &maxima_ns[..] else { panic!("{maxima_ns:?}") };
    assert!(about(first, 1e5) && about(second, 2e5) && about(third, 3e5), "{maxima_ns:?}");
}

#[test]
fn a_late_cycle_a_fault_and_a_signal_leave_a_dump_each() {
    let folder = tempfile::tempdir().unwrap();
    let mut timing = rig_timing(folder.path(), false);
    let mut cycle = 0;
    let mut run_until = |timing: &mut RigTiming, end, late| {
        while cycle < end {
            cycle += 1;
            timing.timing(&record(cycle, if cycle == late { 600_000 } else { 1000 })).unwrap();
            timing.poll(at(cycle), false).unwrap();
        }
    };
    run_until(&mut timing, 2000, 1500);
    timing.event(&Event { cycle: 2000, kind: EventKind::Linked });
    timing.event(&Event { cycle: 2000, kind: EventKind::TwoSources(runlog::Axis::Drive) });
    run_until(&mut timing, 3000, 0);
    timing.poll(at(3000), true).unwrap();
    // The last window is not over: the end of the run hands it out.
    let (report, written) = timing.finish(at(3001));
    written.unwrap();
    let expected = ["emulator-0000001500-late", "emulator-0000002000-fault", "emulator-0000003000-signal"];
    assert_eq!(dumped(folder.path()), expected);
    assert_eq!(report.timing.flight, FlightFigures { dumps: 3, dropped: 0 });
    let rows =
        std::fs::read_to_string(folder.path().join("flight").join(expected[0]).join("timing.csv")).unwrap();
    // From 1 s before it was due to 0.3 s after it woke.
    let rows = read_rows(&rows).unwrap();
    assert_eq!((rows[0].cycle, rows[rows.len() - 1].cycle), (500, 1800));
}

#[test]
fn an_overrun_that_ends_the_run_is_counted_and_dumped() {
    let folder = tempfile::tempdir().unwrap();
    let mut timing = rig_timing(folder.path(), false);
    timing.timing(&record(1, 0)).unwrap();
    let stopped =
        TimingRecord::Stopped { first: 2, skipped: 5, late_ns: 5 * MS + 7000, woke_ns: 7 * MS + 7000 };
    timing.timing(&stopped).unwrap();
    let (report, _) = timing.finish(at(8));
    let stages = report.timing.stages;
    assert_eq!((stages.wakeup_ns.count, stages.completion_ns.count), (6, 6));
    assert!(stages.completion_ns.max >= stages.wakeup_ns.max, "{stages:?}");
    assert_eq!(dumped(folder.path()), ["emulator-0000000002-overrun"]);
}

#[test]
fn only_good_cyclic_frames_of_others_are_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    let mut timing = rig_timing(folder.path(), false);
    let command = ValveCommand { opening: 0.0, alive: 0, echo: 0, enable: true };
    let good = Frame::DriveValveCommand(command).encode().unwrap();
    let frames =
        [good, CanFrame::new(0x110, &[1, 2, 3]), CanFrame::new(0x120, &[0; 8]), CanFrame::new(0x7FF, &[])];
    for ms in 1..=10 {
        frames.iter().for_each(|frame| timing.frame(&FrameRecord { stamp_ns: ms * MS, frame: *frame }));
    }
    let (report, _) = timing.finish(at(11));
    let [arrivals] = &report.timing.arrivals[..] else { panic!("{:?}", report.timing.arrivals) };
    assert_eq!(arrivals.bursts, Some(0));
    assert_eq!(
        (arrivals.frame.as_ref(), arrivals.period_ms, arrivals.count, arrivals.gaps),
        ("DriveValveCommand", 1, 10, 0)
    );
}
