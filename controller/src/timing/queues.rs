//! The queues of the stopwatch, emptied into the [`TimingRecorder`] by the recorder's thread, which may wait for the disk.

use super::{Measured, Passed};
use crossbeam_channel::Receiver;
use realtime::flight::keep_first;
use realtime::{Clock, Freeze, MonotonicClock};
use runlog::candump::FrameRecord;
use runlog::timing_recorder::{TimingFigures, TimingRecorder};
use std::io;

/// The receiving ends of the stopwatch, and the recorder of what comes by them.
pub(crate) struct TimingQueues {
    pub(crate) measured: Receiver<Measured>,
    pub(crate) frames: Receiver<Passed>,
    /// Set by SIGUSR1.
    pub(crate) freeze: Freeze,
    pub(crate) recorder: TimingRecorder,
}

impl TimingQueues {
    /// Empties the queues, and writes what is over.
    pub(crate) fn poll(&mut self) -> io::Result<()> {
        self.empty()?;
        let now = MonotonicClock.now();
        if self.freeze.take() {
            self.recorder.signal(now);
        }
        self.recorder.advance(now)
    }

    fn empty(&mut self) -> io::Result<()> {
        // No more than wait, so that no queue is emptied for ever while the other runs over.
        for _ in 0..self.frames.len() {
            let Ok(Passed { stamp_ns, frame, sent }) = self.frames.try_recv() else { break };
            self.recorder.frame(FrameRecord { stamp_ns, frame }, !sent);
        }
        for _ in 0..self.measured.len() {
            let Ok(measured) = self.measured.try_recv() else { break };
            match measured {
                Measured::Waited { arrived_ns, woke_ns } => self.recorder.waited(arrived_ns, woke_ns),
                Measured::Cycle(row) => self.recorder.row(&row)?,
            }
        }
        Ok(())
    }

    pub(crate) fn fault(&mut self, cycle: u64) {
        self.recorder.fault(cycle, MonotonicClock.now());
    }

    pub(crate) fn write_out(&mut self) -> io::Result<()> {
        self.recorder.write_out()
    }

    /// Empties the queues a last time and writes all that is left.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        let mut written = self.empty();
        keep_first(&mut written, self.recorder.finish(MonotonicClock.now()));
        written
    }

    pub(crate) fn figures(&self) -> TimingFigures {
        self.recorder.figures()
    }
}

#[cfg(test)]
mod tests;
