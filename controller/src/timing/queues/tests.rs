//! What is recorded of rows, waits and frames that a test hands over.

use super::*;
use crossbeam_channel::{Sender, bounded};
use protocol::can::CanFrame;
use protocol::frames::{Frame, Sensors, Tick};
use realtime::{Instant, VitalCounts};
use runlog::flight_dump::{self, FrameLogFormat};
use runlog::process::Process;
use runlog::timing::{self, CycleTiming};
use runlog::timing_recorder::{Activation, FlightFigures, TimingFigures, TimingSetup};
use std::fs;
use std::time::Duration;
use tempfile::TempDir;

const MS: u64 = 1_000_000;

struct Bench {
    run: TempDir,
    measured: Sender<TimingSample>,
    frames: Sender<StampedFrame>,
    started: Instant,
    queues: TimingQueues,
}

impl Bench {
    fn new(full_timing: bool) -> Self {
        let run = tempfile::tempdir().unwrap();
        let (measured_sender, measured) = bounded(4096);
        let (frame_sender, frames) = bounded(4096);
        let started = MonotonicClock.now();
        let recorder = TimingRecorder::create(TimingSetup {
            folder: run.path().into(),
            process: Process::Controller,
            activation: Activation::OnArrival,
            full_timing,
            flight_late: Some(Duration::from_micros(500)),
            log: FrameLogFormat { interface: "bus0".into(), epoch_offset_ns: 0 },
            started_unix_s: 1.7e9,
            started,
            copies_lines: false,
        });
        let recorder = recorder.unwrap();
        let queues = TimingQueues { measured, frames, freeze: Freeze::default(), recorder };
        Self { run, measured: measured_sender, frames: frame_sender, started, queues }
    }

    /// A row that woke `late_ns` after it was due and worked for `work_ns`, one fifth of it receiving.
    fn row(&self, cycle: u64, late_ns: u64, work_ns: u64) -> CycleTiming {
        let due_ns = self.started.as_nanos() + cycle * MS;
        let woke_ns = due_ns + late_ns;
        let receive_ns = work_ns / 5;
        let step_ns = work_ns - receive_ns;
        let done_ns = woke_ns + work_ns;
        CycleTiming { cycle, due_ns, woke_ns, receive_ns, step_ns, done_ns, ..CycleTiming::default() }
    }

    fn send(&self, row: CycleTiming) {
        self.measured.send(TimingSample::Cycle(row)).unwrap();
    }

    fn dumps(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.run.path().join(flight_dump::FOLDER)) else { return Vec::new() };
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

#[test]
fn each_row_and_each_wait_is_a_sample() {
    let mut bench = Bench::new(true);
    let rows = [bench.row(7, 20_000, 50_000), bench.row(8, 30_000, 100_000)];
    rows.iter().for_each(|row| bench.send(*row));
    // Nobody answers after these.
    bench.measured.send(TimingSample::Waited { arrived_ns: 1000, woke_ns: 91_000 }).unwrap();
    bench.queues.finish().unwrap();
    let TimingFigures { stages, flight, .. } = bench.queues.recorder.figures();
    assert_eq!((stages.wakeup_ns.count, stages.execution_ns.count, stages.completion_ns.count), (3, 2, 3));
    let about = |value: Option<u64>, exact: u64| value.is_some_and(|ns| ns.abs_diff(exact) <= exact / 500);
    assert!(about(stages.wakeup_ns.max, 90_000), "{stages:?}");
    assert!(
        about(stages.execution_ns.max, 100_000) && about(stages.completion_ns.max, 130_000),
        "{stages:?}"
    );
    assert!(about(stages.receive_ns.max, 20_000) && about(stages.step_ns.max, 80_000), "{stages:?}");
    assert_eq!(flight, FlightFigures::default());
    let table = fs::read_to_string(bench.run.path().join("controller-timing.csv")).unwrap();
    assert_eq!(timing::read(&table).unwrap(), rows);
    let hlog = fs::read_to_string(bench.run.path().join("controller.hlog")).unwrap();
    for stage in ["wakeup", "receive", "step", "send", "execution", "completion", "period-error"] {
        assert!(hlog.contains(&format!("Tag=controller-{stage},")), "{stage} is not in\n{hlog}");
    }
}

#[test]
fn sensors_that_were_overtaken_are_answered_when_the_row_after_them_is_done() {
    let mut bench = Bench::new(false);
    let row = CycleTiming { skipped: 49, ..bench.row(57, 1_000_000, 60_000) };
    for n in (1..50).rev() {
        let arrived_ns = row.due_ns - n * MS;
        bench.measured.send(TimingSample::Waited { arrived_ns, woke_ns: row.woke_ns }).unwrap();
    }
    bench.send(row);
    bench.queues.finish().unwrap();
    let TimingFigures { stages, .. } = bench.queues.recorder.figures();
    assert_eq!((stages.wakeup_ns.count, stages.completion_ns.count), (50, 50));
    assert!(stages.completion_ns.max >= stages.wakeup_ns.max, "{stages:?}");
    let completion_ns = 50 * MS + 60_000;
    assert!(stages.completion_ns.max.unwrap().abs_diff(completion_ns) <= completion_ns / 500, "{stages:?}");
}

#[test]
fn without_full_timing_there_is_no_table() {
    let mut bench = Bench::new(false);
    bench.send(bench.row(7, 20_000, 50_000));
    bench.queues.finish().unwrap();
    assert!(!bench.run.path().join("controller-timing.csv").exists());
}

#[test]
fn late_slow_overtaken_and_faulty_freeze_the_recorder_and_the_rest_does_not() {
    let reported = |of: &dyn Fn(&mut Bench)| {
        let mut bench = Bench::new(false);
        bench.send(bench.row(6, 20_000, 50_000));
        of(&mut bench);
        bench.queues.finish().unwrap();
        bench.dumps()
    };
    assert_eq!(reported(&|bench| bench.send(bench.row(7, 500_000, 500_000))), [""; 0]);
    assert_eq!(reported(&|bench| bench.send(bench.row(7, 500_001, 0))), ["controller-0000000007-late"]);
    assert_eq!(reported(&|bench| bench.send(bench.row(7, 0, 500_001))), ["controller-0000000007-slow"]);
    let overrun = |bench: &mut Bench| {
        bench.measured.send(TimingSample::Waited { arrived_ns: 0, woke_ns: 3 * MS }).unwrap();
        bench.send(CycleTiming { skipped: 2, ..bench.row(9, 0, 0) });
    };
    assert_eq!(reported(&overrun), ["controller-0000000009-overrun"]);
    assert_eq!(reported(&|bench| bench.queues.fault(7)), ["controller-0000000007-fault"]);
}

#[test]
fn a_dump_holds_the_rows_and_the_frames_both_ways_and_how_long_the_oldest_sensors_waited() {
    let mut bench = Bench::new(false);
    let frame = Frame::DriveSensors(Sensors::default()).encode().unwrap();
    for cycle in 1..=9 {
        let stamp_ns = bench.started.as_nanos() + cycle * MS;
        for sent in [false, true] {
            let stamp_ns = stamp_ns + u64::from(sent);
            bench.frames.send(StampedFrame { stamp_ns, frame, sent }).unwrap();
        }
    }
    bench.send(bench.row(6, 0, 0));
    bench.measured.send(TimingSample::Waited { arrived_ns: MS, woke_ns: 4 * MS }).unwrap();
    bench.send(CycleTiming { skipped: 2, ..bench.row(9, 1000, 2000) });
    bench.queues.finish().unwrap();
    let dump = bench.run.path().join("flight/controller-0000000009-overrun");
    let read = |name: &str| fs::read_to_string(dump.join(name)).unwrap();
    assert_eq!(timing::read(&read("timing.csv")).unwrap().len(), 2);
    assert_eq!(read("bus.log").lines().count(), 18);
    let event: serde_json::Value = serde_json::from_str(&read("event.json")).unwrap();
    assert_eq!((&event["late_ns"], &event["slow_ns"]), (&(3 * MS).into(), &2000.into()));
    assert_eq!(event["process"], "controller");
}

#[test]
fn a_dump_that_fails_is_reported_though_the_next_one_is_good() {
    let mut bench = Bench::new(false);
    let in_its_place = bench.run.path().join("flight/controller-0000000007-fault");
    fs::create_dir_all(in_its_place.parent().unwrap()).unwrap();
    fs::write(&in_its_place, "a file").unwrap();
    for (cycle, s) in [(7, 1), (8, 5)] {
        bench.queues.recorder.fault(cycle, Instant::from_nanos(s * 1000 * MS));
    }
    let reported = bench.queues.finish().unwrap_err().to_string();
    assert!(reported.contains("controller-0000000007-fault"), "{reported}");
    assert_eq!(bench.dumps()[1], "controller-0000000008-fault");
}

#[test]
fn cyclic_frames_that_came_have_an_account_and_sent_and_broken_ones_have_none() {
    let mut bench = Bench::new(false);
    let sensors = Frame::DriveSensors(Sensors::default()).encode().unwrap();
    let tick = Frame::Tick(Tick::default()).encode().unwrap();
    let broken = CanFrame::new(sensors.standard_id().unwrap(), &[1]);
    for (ms, frame, sent) in [
        (1, sensors, false),
        (2, sensors, false),
        (2, broken, false),
        (2, sensors, true),
        (4, sensors, false),
        (5, tick, false),
    ] {
        bench.frames.send(StampedFrame { stamp_ns: ms * MS, frame, sent }).unwrap();
    }
    bench.queues.poll().unwrap();
    let arrivals = bench.queues.recorder.figures().arrivals;
    let of = |name: &str| arrivals.iter().find(|arrivals| arrivals.frame == name).unwrap();
    assert_eq!((of("DriveSensors").count, of("DriveSensors").gaps), (3, 1));
    assert_eq!(
        (of("DriveSensors").bursts, of("Tick").bursts),
        (Some(0), None),
        "a tick is sent on change too"
    );
    assert_eq!((of("Tick").count, of("Tick").period_ms, arrivals.len()), (1, 10, 2));
}

#[test]
fn vitals_count_after_the_first_second() {
    let mut bench = Bench::new(false);
    let vitals = VitalCounts { minor_faults: 1, continued: 2, ..VitalCounts::default() };
    for cycle in [1, 500, 1001, 1002, 2000] {
        bench.send(CycleTiming { vitals, ..bench.row(cycle, 0, 0) });
    }
    bench.queues.poll().unwrap();
    let counted = bench.queues.recorder.figures().vitals;
    assert_eq!((counted.minor_faults, counted.continued), (2, 4));
}

#[test]
fn a_new_run_begins_with_none_of_the_old_ones_dumps() {
    let mut bench = Bench::new(false);
    bench.send(bench.row(7, 600_000, 0));
    bench.queues.finish().unwrap();
    assert_eq!(bench.dumps().len(), 1);
    flight_dump::clear(bench.run.path(), "controller").unwrap();
    assert!(bench.dumps().is_empty());
}
