//! Time stamps of a cycle in the 1 ms path; unused in lockstep and in a rehearsal.
//!
//! ```text
//!   sensors arrive ── woke ── take(frame)* ── step ── send* ── done        one wake-up
//!        due                    receive      the rest  in bus.send
//! ```
//!
//! A row is an answered cycle. A process for both axes may wake twice for it, since the sensors of the load follow those of the
//! drive. Then the stages of both wake-ups are added in one row, and `done` excludes the wait in between, which is no work of
//! this process; `command_ns` of the load is the true time of its answer. Receive, step and send therefore add up to the time
//! from `woke` to `done`. If two cycles are answered in one wake-up (the load's, and after a stall the drive's next), each row
//! has the whole wake-up.
//!
//! Sensors that were overtaken by newer ones before the wake-up are in no row, except in its `skipped`. To show a stall with
//! all frames that waited, the wait of each such frame of the waking axis is a sample of its own.
//!
//! Frames that arrived before the loop started were not late: the earliest due time of a cycle is the start, and earlier
//! sensors are counted separately.
//!
//! This side stamps and queues; the recorder's thread ([`queues`]) does the rest. Nothing here allocates, locks, prints or
//! blocks.

pub(crate) mod queues;
pub(crate) mod setup;
mod timed_bus;

use crossbeam_channel::Sender;
use nominal::Axis;
use protocol::bus::FrameSink;
use protocol::can::CanFrame;
use realtime::{Clock, VitalCounts};
use runlog::timing::{CycleTiming, Exchange};
pub(crate) use timed_bus::TimedBus;

/// Largest age of an answer in cycles; an older one means that the rig restarted.
const SAME_RIG: u64 = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TimingSample {
    /// Sensors of the waking axis that begin no row.
    Waited {
        /// Arrival at our queue, ns.
        arrived_ns: u64,
        woke_ns: u64,
    },
    Cycle(CycleTiming),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StampedFrame {
    /// Time of arrival or of sending, ns.
    pub(crate) stamp_ns: u64,
    pub(crate) frame: CanFrame,
    pub(crate) sent: bool,
}

pub(crate) struct TimingSenders {
    pub(crate) measured: Sender<TimingSample>,
    pub(crate) frames: Sender<StampedFrame>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StopwatchAccount {
    /// Samples and frames lost to a full queue.
    pub(crate) dropped: u64,
    /// Sensors of the waking axis that arrived before the loop started and that no row answers.
    pub(crate) before_start: u64,
}

#[derive(Clone, Copy, Default)]
struct WakeUp {
    woke_ns: u64,
    received_ns: u64,
    /// Sum over the frames sent.
    send_ns: u64,
    /// Time of sending of the command of each axis; 0: not sent.
    handed_ns: [u64; 2],
}

/// Stamps wake-ups and assembles the rows.
pub(crate) struct Stopwatch<C> {
    clock: C,
    controlled: [bool; 2],
    wakes: Axis,
    senders: TimingSenders,
    account: StopwatchAccount,
    began_ns: u64,
    wake_up: WakeUp,
    /// Arrival of the newest sensors of each axis of this process; 0: answered.
    arrived_ns: [u64; 2],
    /// The newest sensors of the waking axis, until they are in a row.
    waiting: Option<TimingSample>,
    pending: Option<CycleTiming>,
    newest: Option<u64>,
}

impl<C: Clock> Stopwatch<C> {
    /// A stopwatch for a process with these axes, of which the first wakes it.
    ///
    /// # Panics
    /// Without axes.
    pub(crate) fn new(clock: C, axes: &[Axis], senders: TimingSenders) -> Self {
        let wakes = *axes.first().expect("a process controls an axis");
        let controlled = Axis::ALL.map(|axis| axes.contains(&axis));
        Self {
            clock,
            controlled,
            wakes,
            senders,
            account: StopwatchAccount::default(),
            began_ns: 0,
            wake_up: WakeUp::default(),
            arrived_ns: [0; 2],
            waiting: None,
            pending: None,
            newest: None,
        }
    }

    pub(crate) fn begin(&mut self) {
        self.began_ns = self.now_ns();
    }

    pub(crate) fn woke(&mut self) {
        self.wake_up = WakeUp { woke_ns: self.now_ns(), ..WakeUp::default() };
    }

    /// A frame was taken that had arrived at `stamp_ns`; `sensors` is the axis whose sensors it carries.
    pub(crate) fn frame_taken(&mut self, frame: &CanFrame, stamp_ns: u64, sensors: Option<Axis>) {
        self.queue_frame(StampedFrame { stamp_ns, frame: *frame, sent: false });
        let Some(axis) = sensors.filter(|axis| self.controlled[axis.index()]) else { return };
        self.arrived_ns[axis.index()] = stamp_ns;
        if axis == self.wakes && stamp_ns < self.began_ns {
            self.account.before_start += 1;
        } else if axis == self.wakes {
            let waited = TimingSample::Waited { arrived_ns: stamp_ns, woke_ns: self.wake_up.woke_ns };
            if let Some(overtaken) = self.waiting.replace(waited) {
                self.queue_sample(overtaken);
            }
        }
    }

    pub(crate) fn batch_taken(&mut self) {
        self.wake_up.received_ns = self.now_ns();
    }

    pub(crate) fn bus<'a>(&'a mut self, bus: &'a mut dyn FrameSink) -> TimedBus<'a, C> {
        TimedBus { stopwatch: self, bus }
    }

    /// The axes answered these cycles. When that completes a row, `vitals` returns the kernel counters since its last call.
    pub(crate) fn answered(&mut self, cycles: [Option<u64>; 2], vitals: impl FnOnce() -> VitalCounts) {
        if cycles == [None; 2] {
            return;
        }
        let done_ns = self.now_ns();
        // After a stall the drive may be a cycle ahead of the load.
        let ahead = matches!(cycles, [Some(drive), Some(load)] if load < drive);
        let mut worked_for = None;
        for axis in if ahead { [Axis::Load, Axis::Drive] } else { Axis::ALL } {
            if let Some(cycle) = cycles[axis.index()] {
                self.put_into_row(axis, cycle);
                self.work_for_row(done_ns, &mut worked_for);
            }
        }
        if let Some(row) = &mut self.pending {
            let missing = [row.drive, row.load].map(|exchange| exchange.sensors_ns == 0);
            if self.controlled.iter().zip(missing).all(|(controlled, missing)| !controlled || !missing) {
                row.vitals = vitals();
                self.flush();
            }
        }
    }

    /// Adds the wake-up to the row, once.
    fn work_for_row(&mut self, done_ns: u64, worked_for: &mut Option<u64>) {
        let WakeUp { woke_ns, received_ns, send_ns, .. } = self.wake_up;
        let Some(row) = self.pending.as_mut().filter(|row| *worked_for != Some(row.cycle)) else { return };
        *worked_for = Some(row.cycle);
        row.receive_ns += received_ns.saturating_sub(woke_ns);
        row.send_ns += send_ns;
        row.step_ns += done_ns.saturating_sub(received_ns).saturating_sub(send_ns);
        row.done_ns = row.woke_ns + row.receive_ns + row.step_ns + row.send_ns;
    }

    fn put_into_row(&mut self, axis: Axis, cycle: u64) {
        let waited = if axis == self.wakes { self.waiting.take() } else { None };
        let begins = self.pending.is_none_or(|row| row.cycle != cycle);
        let arrived_ns = std::mem::take(&mut self.arrived_ns[axis.index()]);
        let handed_ns = self.wake_up.handed_ns[axis.index()];
        let older = self.newest.is_some_and(|newest| cycle <= newest && newest - cycle < SAME_RIG);
        if let Some(waited) = waited.filter(|_| !begins || older) {
            self.queue_sample(waited);
        }
        if begins {
            if older {
                // The other axis was a cycle ahead, and the row is complete.
                return;
            }
            self.flush();
            let skipped = self.newest.map_or(0, |newest| cycle.saturating_sub(newest + 1));
            self.newest = Some(cycle);
            let due_ns = arrived_ns.max(self.began_ns);
            if axis == self.wakes && (1..self.began_ns).contains(&arrived_ns) {
                // It was answered all the same; in its row the wait counts from the start of the loop.
                self.account.before_start -= 1;
            }
            // Sensors that arrive while others are taken have no wait.
            let woke_ns = self.wake_up.woke_ns.max(due_ns);
            self.wake_up.woke_ns = woke_ns;
            self.pending = Some(CycleTiming { cycle, skipped, due_ns, woke_ns, ..CycleTiming::default() });
        }
        if let Some(row) = &mut self.pending {
            *exchange(row, axis) = Exchange { sensors_ns: arrived_ns, command_ns: handed_ns, answers: cycle };
        }
    }

    /// Queues what is left; ends the measurement.
    pub(crate) fn finish(mut self) -> StopwatchAccount {
        self.flush();
        if let Some(waited) = self.waiting.take() {
            self.queue_sample(waited);
        }
        self.account
    }

    fn flush(&mut self) {
        if let Some(row) = self.pending.take() {
            self.queue_sample(TimingSample::Cycle(row));
        }
    }

    fn queue_sample(&mut self, measured: TimingSample) {
        self.account.dropped += u64::from(self.senders.measured.try_send(measured).is_err());
    }

    fn queue_frame(&mut self, passed: StampedFrame) {
        self.account.dropped += u64::from(self.senders.frames.try_send(passed).is_err());
    }

    fn now_ns(&self) -> u64 {
        self.clock.now().as_nanos()
    }
}

fn exchange(row: &mut CycleTiming, axis: Axis) -> &mut Exchange {
    match axis {
        Axis::Drive => &mut row.drive,
        Axis::Load => &mut row.load,
    }
}

#[cfg(test)]
mod tests;
