//! The receivers of the stopwatch, which the recorder's thread empties into the [`TimingRecorder`]; it may block on the disk.

use super::{StampedFrame, TimingSample};
use crossbeam_channel::Receiver;
use realtime::flight::keep_first;
use realtime::{Clock, Freeze, MonotonicClock};
use runlog::candump::FrameRecord;
use runlog::timing_recorder::TimingRecorder;
use std::io;

/// The receivers of the stopwatch, and the recorder of its samples.
pub(crate) struct TimingQueues {
    pub(crate) measured: Receiver<TimingSample>,
    pub(crate) frames: Receiver<StampedFrame>,
    /// Set by SIGUSR1.
    pub(crate) freeze: Freeze,
    pub(crate) recorder: TimingRecorder,
}

impl TimingQueues {
    /// Empties the queues, and writes completed intervals.
    pub(crate) fn poll(&mut self) -> io::Result<()> {
        self.empty()?;
        let now = MonotonicClock.now();
        if self.freeze.take() {
            self.recorder.signal(now);
        }
        self.recorder.advance(now)
    }

    fn empty(&mut self) -> io::Result<()> {
        // At most the samples that wait now, so that one queue does not overflow while the other is emptied.
        for _ in 0..self.frames.len() {
            let Ok(StampedFrame { stamp_ns, frame, sent }) = self.frames.try_recv() else { break };
            self.recorder.frame(FrameRecord { stamp_ns, frame }, !sent);
        }
        for _ in 0..self.measured.len() {
            let Ok(measured) = self.measured.try_recv() else { break };
            match measured {
                TimingSample::Waited { arrived_ns, woke_ns } => self.recorder.waited(arrived_ns, woke_ns),
                TimingSample::Cycle(row) => self.recorder.row(&row)?,
            }
        }
        Ok(())
    }

    pub(crate) fn fault(&mut self, cycle: u64) {
        self.recorder.fault(cycle, MonotonicClock.now());
    }

    /// Empties the queues a last time and writes everything.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        let mut written = self.empty();
        keep_first(&mut written, self.recorder.finish(MonotonicClock.now()));
        written
    }
}

#[cfg(test)]
mod tests;
