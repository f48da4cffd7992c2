//! Rows and waits of wake-ups played on a clock that belongs to the test.

use super::*;
use crate::cli::{Cli, Command};
use axis_control::node::{self, ControllerNode};
use axis_control::setup::{Inputs, Mode};
use clap::Parser;
use crossbeam_channel::{Receiver, bounded};
use protocol::bus::SendError;
use protocol::frames::{Frame, Sensors, Tick, ValveCommand};
use realtime::Instant;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Time passes when the test says so.
#[derive(Clone, Default)]
struct ManualClock(Arc<AtomicU64>);

impl ManualClock {
    fn pass(&self, ns: u64) {
        self.0.fetch_add(ns, Ordering::Relaxed);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Instant {
        Instant::from_nanos(self.0.load(Ordering::Relaxed))
    }

    fn wait_until(&self, _deadline: Instant) {
        unreachable!("a stopwatch never waits");
    }
}

/// Sends in 3 ns, or not at all.
struct Wire {
    clock: ManualClock,
    full: bool,
}

impl FrameSink for Wire {
    fn send(&mut self, _frame: &CanFrame) -> Result<u64, SendError> {
        let handed_over_ns = self.clock.now().as_nanos();
        self.clock.pass(3);
        if self.full { Err(SendError::QueueFull) } else { Ok(handed_over_ns) }
    }
}

struct Bench {
    clock: ManualClock,
    wire: Wire,
    stopwatch: Stopwatch<ManualClock>,
    measured: Receiver<TimingSample>,
    frames: Receiver<StampedFrame>,
}

impl Bench {
    fn new(axes: &[Axis]) -> Self {
        let clock = ManualClock::default();
        clock.pass(1_000_000);
        let (measured_sender, measured) = bounded(64);
        let (frame_sender, frames) = bounded(64);
        let senders = TimingSenders { measured: measured_sender, frames: frame_sender };
        let stopwatch = Stopwatch::new(clock.clone(), axes, senders);
        let wire = Wire { clock: clock.clone(), full: false };
        Self { clock, wire, stopwatch, measured, frames }
    }

    /// A wake-up that takes 5 ns for taking `arrived` and 7 ns before it sends the commands that `cycles` ask for.
    fn wake_up(&mut self, arrived: &[(Axis, u64)], cycles: [Option<u64>; 2]) {
        self.stopwatch.woke();
        for (axis, stamp_ns) in arrived {
            self.stopwatch.frame_taken(&sensors(*axis, 0), *stamp_ns, Some(*axis));
        }
        self.clock.pass(5);
        self.stopwatch.batch_taken();
        self.clock.pass(7);
        for axis in Axis::ALL {
            if cycles[axis.index()].is_some() {
                let _ = self.stopwatch.bus(&mut self.wire).send(&command(axis));
            }
        }
        self.stopwatch.answered(cycles, || VitalCounts { cpu: 1, ..VitalCounts::default() });
    }

    fn now(&self) -> u64 {
        self.clock.now().as_nanos()
    }

    fn rows(&self) -> Vec<CycleTiming> {
        let rows = self.measured.try_iter().filter_map(|measured| match measured {
            TimingSample::Cycle(row) => Some(row),
            TimingSample::Waited { .. } => None,
        });
        rows.collect()
    }
}

fn sensors(axis: Axis, alive: u8) -> CanFrame {
    let sensors = Sensors { alive, ..Sensors::default() };
    let frame = match axis {
        Axis::Drive => Frame::DriveSensors(sensors),
        Axis::Load => Frame::LoadSensors(sensors),
    };
    frame.encode().unwrap()
}

fn command(axis: Axis) -> CanFrame {
    let command = ValveCommand::default();
    let frame = match axis {
        Axis::Drive => Frame::DriveValveCommand(command),
        Axis::Load => Frame::LoadValveCommand(command),
    };
    frame.encode().unwrap()
}

#[test]
fn both_axes_in_one_wake_up_are_one_row_whose_stages_leave_no_gap() {
    let mut bench = Bench::new(&Axis::ALL);
    let woke = bench.now();
    bench.wake_up(&[(Axis::Drive, woke - 40), (Axis::Load, woke - 30)], [Some(7), Some(7)]);
    let sent = woke + 12;
    let expected = CycleTiming {
        cycle: 7,
        due_ns: woke - 40,
        woke_ns: woke,
        receive_ns: 5,
        step_ns: 7,
        send_ns: 6,
        done_ns: woke + 18,
        drive: Exchange { sensors_ns: woke - 40, command_ns: sent, answers: 7 },
        load: Exchange { sensors_ns: woke - 30, command_ns: sent + 3, answers: 7 },
        vitals: VitalCounts { cpu: 1, ..VitalCounts::default() },
        ..CycleTiming::default()
    };
    assert_eq!(bench.rows(), [expected]);
    let sent: Vec<_> = bench.frames.try_iter().map(|passed| (passed.sent, passed.stamp_ns)).collect();
    assert_eq!(
        sent,
        [(false, woke - 40), (false, woke - 30), (true, woke + 12), (true, woke + 15)],
        "the frames of the wake-up"
    );
}

#[test]
fn a_cycle_that_took_two_wake_ups_is_one_row_without_the_wait_between() {
    let mut bench = Bench::new(&Axis::ALL);
    let woke = bench.now();
    bench.wake_up(&[(Axis::Drive, woke - 40)], [Some(7), None]);
    assert!(bench.rows().is_empty(), "the load is to come");
    bench.clock.pass(1000);
    bench.wake_up(&[(Axis::Load, bench.now() - 10)], [None, Some(7)]);
    let [row] = bench.rows()[..] else { panic!("one row") };
    assert_eq!(
        (row.due_ns, row.woke_ns, row.receive_ns, row.step_ns, row.send_ns),
        (woke - 40, woke, 10, 14, 6)
    );
    assert_eq!(row.done_ns - row.woke_ns, 30, "the wait between is no work");
}

#[test]
fn a_stall_is_a_row_that_skips_and_a_wait_for_each_frame_of_the_axis_that_wakes() {
    let mut bench = Bench::new(&Axis::ALL);
    bench.wake_up(&[(Axis::Drive, bench.now()), (Axis::Load, bench.now())], [Some(7), Some(7)]);
    assert_eq!(bench.rows().len(), 1);
    let began_ns = bench.now();
    let arrived: Vec<_> = (0..50)
        .flat_map(|cycle| [(Axis::Drive, began_ns + cycle * 1000), (Axis::Load, began_ns + cycle * 1000 + 1)])
        .collect();
    bench.clock.pass(50_000);
    bench.wake_up(&arrived, [Some(57), Some(57)]);
    let (mut rows, mut waits_ns) = (Vec::new(), Vec::new());
    for measured in bench.measured.try_iter() {
        match measured {
            TimingSample::Cycle(row) => rows.push(row),
            TimingSample::Waited { arrived_ns, woke_ns } => waits_ns.push(woke_ns - arrived_ns),
        }
    }
    assert_eq!(waits_ns, (0..49).map(|cycle| 50_000 - cycle * 1000).collect::<Vec<_>>());
    let [row] = rows[..] else { panic!("one row of {rows:?}") };
    assert_eq!((row.cycle, row.skipped, row.due_ns), (57, 49, began_ns + 49_000), "the newest is answered");
}

#[test]
fn an_axis_whose_sensors_do_not_come_holds_its_cycle_up_until_the_next() {
    let mut bench = Bench::new(&Axis::ALL);
    bench.wake_up(&[(Axis::Drive, bench.now())], [Some(7), None]);
    bench.wake_up(&[(Axis::Drive, bench.now()), (Axis::Load, bench.now())], [Some(8), Some(8)]);
    let rows = bench.rows();
    assert_eq!(rows.iter().map(|row| (row.cycle, row.skipped)).collect::<Vec<_>>(), [(7, 0), (8, 0)]);
    assert_eq!(rows[0].load, Exchange::default());
    assert_eq!((rows[0].vitals.cpu, rows[1].vitals.cpu), (0, 1), "what was counted stands in the next row");
}

#[test]
fn the_load_may_lag_a_cycle_behind_the_drive() {
    let mut bench = Bench::new(&Axis::ALL);
    bench.wake_up(&[(Axis::Drive, bench.now())], [Some(7), None]);
    // The load's sensors of 7 come together with the drive's of 8.
    bench.wake_up(&[(Axis::Load, bench.now()), (Axis::Drive, bench.now())], [Some(8), Some(7)]);
    bench.wake_up(&[(Axis::Load, bench.now())], [None, Some(8)]);
    let rows = bench.rows();
    let answers: Vec<_> = rows.iter().map(|row| (row.cycle, row.drive.answers, row.load.answers)).collect();
    assert_eq!(answers, [(7, 7, 7), (8, 8, 8)]);
}

#[test]
fn an_axis_alone_has_rows_and_waits_of_its_own() {
    let mut bench = Bench::new(&[Axis::Load]);
    bench.clock.pass(100);
    bench.wake_up(&[(Axis::Drive, bench.now() - 50)], [None, None]);
    bench.wake_up(&[(Axis::Load, bench.now() - 20)], [None, Some(7)]);
    let measured: Vec<_> = bench.measured.try_iter().collect();
    let [TimingSample::Cycle(row)] = measured[..] else { panic!("a row alone in {measured:?}") };
    assert_eq!((row.woke_ns - row.due_ns, row.drive, row.load.answers), (20, Exchange::default(), 7));
}

#[test]
fn sensors_that_nobody_answers_have_waited_too() {
    let mut bench = Bench::new(&[Axis::Drive]);
    // Before the first tick there is no cycle to answer; the tick comes in a wake-up of its own.
    bench.wake_up(&[(Axis::Drive, bench.now() - 20)], [None, None]);
    bench.wake_up(&[(Axis::Drive, bench.now() - 10)], [None, None]);
    bench.wake_up(&[], [Some(7), None]);
    bench.wake_up(&[(Axis::Drive, bench.now() - 30)], [None, None]);
    let Bench { stopwatch, measured, .. } = bench;
    assert_eq!(stopwatch.finish(), StopwatchAccount::default());
    let waits: Vec<_> = measured
        .try_iter()
        .map(|measured| match measured {
            TimingSample::Waited { arrived_ns, woke_ns } => woke_ns - arrived_ns,
            TimingSample::Cycle(row) => row.woke_ns - row.due_ns,
        })
        .collect();
    assert_eq!(waits, [20, 10 + 12, 30]);
}

#[test]
fn what_arrived_before_the_loop_began_was_not_late() {
    let mut bench = Bench::new(&Axis::ALL);
    let before = bench.now();
    bench.clock.pass(80_000_000);
    bench.stopwatch.begin();
    bench.clock.pass(20);
    bench.wake_up(
        &[(Axis::Drive, before), (Axis::Drive, before + 1), (Axis::Load, before)],
        [Some(7), Some(7)],
    );
    bench.wake_up(&[(Axis::Drive, bench.now() - 5), (Axis::Load, bench.now() - 4)], [Some(8), Some(8)]);
    let rows = bench.rows();
    let late: Vec<_> = rows.iter().map(|row| row.woke_ns - row.due_ns).collect();
    assert_eq!((late, rows[0].drive.sensors_ns), (vec![20, 5], before + 1));
    assert_eq!(bench.stopwatch.finish(), StopwatchAccount { dropped: 0, before_start: 1 });
}

#[test]
fn sensors_that_arrive_while_others_are_taken_wait_for_nobody() {
    let mut bench = Bench::new(&[Axis::Drive]);
    let woke = bench.now();
    bench.wake_up(&[(Axis::Drive, woke + 2)], [Some(7), None]);
    let [row] = bench.rows()[..] else { panic!("one row") };
    assert_eq!((row.due_ns, row.woke_ns, row.receive_ns), (woke + 2, woke + 2, 3));
    assert_eq!(row.done_ns - row.woke_ns, row.receive_ns + row.step_ns + row.send_ns);
}

#[test]
fn the_load_may_come_first() {
    let mut bench = Bench::new(&Axis::ALL);
    bench.wake_up(&[(Axis::Load, bench.now() - 5)], [None, Some(7)]);
    bench.wake_up(&[(Axis::Drive, bench.now() - 10)], [Some(7), None]);
    let measured: Vec<_> = bench.measured.try_iter().collect();
    let [TimingSample::Waited { arrived_ns, woke_ns }, TimingSample::Cycle(row)] = measured[..] else {
        panic!("a wait and a row in {measured:?}")
    };
    assert_eq!((woke_ns - arrived_ns, row.woke_ns - row.due_ns), (10, 5));
}

#[test]
fn a_command_that_the_bus_did_not_take_was_handed_over_at_no_time() {
    let mut bench = Bench::new(&[Axis::Drive]);
    bench.wire.full = true;
    bench.wake_up(&[(Axis::Drive, bench.now())], [Some(7), None]);
    let [row] = bench.rows()[..] else { panic!("one row") };
    assert_eq!((row.drive.command_ns, row.send_ns), (0, 3));
    assert!(bench.frames.try_iter().all(|passed| !passed.sent));
}

#[test]
fn a_rig_that_begins_anew_begins_new_rows() {
    let mut bench = Bench::new(&[Axis::Drive]);
    for cycle in [5000, 0, 1] {
        bench.wake_up(&[(Axis::Drive, bench.now())], [Some(cycle), None]);
    }
    let rows = bench.rows();
    assert_eq!(
        rows.iter().map(|row| (row.cycle, row.skipped)).collect::<Vec<_>>(),
        [(5000, 0), (0, 0), (1, 0)]
    );
}

#[test]
fn the_last_row_is_handed_over_whole_or_not() {
    let mut bench = Bench::new(&Axis::ALL);
    bench.wake_up(&[(Axis::Drive, bench.now())], [Some(7), None]);
    let Bench { stopwatch, measured, .. } = bench;
    assert_eq!(stopwatch.finish(), StopwatchAccount::default());
    assert!(measured.try_iter().any(|measured| matches!(measured, TimingSample::Cycle(_))));
}

#[test]
fn what_finds_no_room_is_counted() {
    let mut bench = Bench::new(&[Axis::Drive]);
    for cycle in 0..40 {
        bench.wake_up(&[(Axis::Drive, bench.now())], [Some(cycle), None]);
    }
    // 40 rows; 40 frames each way, 16 too many.
    assert_eq!(bench.stopwatch.finish(), StopwatchAccount { dropped: 16, before_start: 0 });
}

fn both_axes() -> ControllerNode {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = |name: &str| root.join(name).display().to_string();
    let [rig, experiment] = [path("../plant/rig.toml"), path("experiments/load-step.toml")];
    let line = ["controller", "rehearse", "--rig", &rig, "--experiment", &experiment];
    let Command::Rehearse(arguments) = Cli::parse_from(line).command else {
        unreachable!("the line above asks for a rehearsal")
    };
    let inputs = Inputs::read(&arguments.files).unwrap();
    let mode = Mode { partner_needed: true, real_time: true, forever: true };
    let controllers = Axis::ALL.map(|axis| inputs.controller(axis, mode).unwrap());
    let (records, _) = bounded(64);
    let (news, _) = bounded(64);
    let (_, changes) = bounded(1);
    ControllerNode::new(controllers.into(), node::NodeQueues { records, news, changes, waits: false })
}

#[test]
fn a_cycle_that_one_axis_alone_answered_is_a_row_and_a_cycle_answered() {
    use Axis::{Drive, Load};
    let mut bench = Bench::new(&Axis::ALL);
    let mut node = both_axes();
    let tick = Frame::Tick(Tick { cycle: 0, ..Tick::default() }).encode().unwrap();
    assert_eq!(node.take(&tick), None);
    let wake_ups: [&[(Axis, u8)]; 7] = [
        &[(Drive, 0), (Load, 0)],
        &[(Drive, 1)],
        &[(Load, 1), (Drive, 2), (Load, 2)], // the load's of 1 are overtaken
        &[(Drive, 3), (Load, 3)],
        &[(Drive, 4), (Load, 4), (Drive, 5)], // and the drive's of 4
        &[(Load, 5)],
        &[(Drive, 6), (Load, 6)],
    ];
    for arrived in wake_ups {
        bench.stopwatch.woke();
        for (axis, alive) in arrived {
            let frame = sensors(*axis, *alive);
            let whose = node.take(&frame);
            bench.stopwatch.frame_taken(&frame, bench.now(), whose);
            bench.clock.pass(1);
        }
        bench.stopwatch.batch_taken();
        let cycles = node.answer(&mut bench.stopwatch.bus(&mut bench.wire));
        bench.stopwatch.answered(cycles, VitalCounts::default);
    }
    let rows = bench.rows();
    for row in &rows {
        assert!(row.due_ns <= row.woke_ns && row.woke_ns < row.done_ns, "{row:?}");
        assert_eq!(row.receive_ns + row.step_ns + row.send_ns, row.done_ns - row.woke_ns, "{row:?}");
    }
    let answered: Vec<_> =
        rows.iter().map(|row| (row.cycle, row.drive.sensors_ns != 0, row.load.sensors_ns != 0)).collect();
    let both = |cycle| (cycle, true, true);
    assert_eq!(
        answered,
        [both(0), (1, true, false), both(2), both(3), (4, false, true), both(5), both(6)],
        "cycles with the axes that answered them"
    );
    assert_eq!(Axis::ALL.map(|axis| node.answered_by(axis)), [6, 6]);
    assert_eq!(node.answered, rows.len() as u64);
}
