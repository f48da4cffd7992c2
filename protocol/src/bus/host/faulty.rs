//! The host over a wire with faults: carries out what the wire decides, in real time and in lockstep.
//!
//! Time is that of the run: since the host was bound, or in lockstep the barrier's cycle. A babbling node on a wire that keeps
//! time is one of its nodes and fights for the bus; on one that takes none its frames are simply there.

use super::{BABBLER, Host};
use crate::bus::lockstep::PeerId;
use crate::bus::timed::ReportTarget;
use crate::bus::wire::{FrameOutcome, WireOrders};
use crate::can::CanFrame;
use crate::periods::CYCLE_NS;
use rustix::time::Timespec;

impl Host {
    /// The way in which faults are ordered from this host's wire.
    #[must_use]
    pub fn wire_orders(&self) -> WireOrders {
        self.wire.orders()
    }

    /// A host without a barrier sleeps no longer than its wire can wait.
    pub(super) fn faults_patience(&self, patience: Timespec) -> Timespec {
        let now_ns = self.began.elapsed().as_nanos() as u64;
        let Some(ns) = self.wire.longest_sleep_ns(now_ns).filter(|_| self.barrier.is_none()) else {
            return patience;
        };
        if patience.tv_sec > 0 || patience.tv_nsec as u64 > ns {
            Timespec { tv_sec: (ns / 1_000_000_000) as i64, tv_nsec: (ns % 1_000_000_000) as i64 }
        } else {
            patience
        }
    }

    /// Begins and ends faults as ordered, carries held frames that are due, and sends the frames of babbling nodes.
    pub(super) fn advance_faults(&mut self, now_ns: u64) {
        let mut outcomes = std::mem::take(&mut self.outcomes);
        self.wire.take_orders(now_ns, &mut outcomes);
        if !self.wire.is_plain() || !outcomes.is_empty() {
            self.wire.release_due(now_ns, &mut outcomes);
            self.carry_outcomes(&mut outcomes);
            self.send_babble(now_ns);
        }
        self.outcomes = outcomes;
    }

    /// Everything that is held, when the host goes.
    pub(super) fn release_all(&mut self) {
        let mut outcomes = Vec::new();
        self.wire.release_all(&mut outcomes);
        self.carry_outcomes(&mut outcomes);
    }

    /// Puts one frame on the wire, which may do something to it.
    pub(super) fn deliver(&mut self, frame: &CanFrame, from: PeerId, deaf: &[PeerId]) {
        // A babbling node is none of those whose identifier it uses.
        if from != BABBLER {
            self.wire.learn_node(frame, from);
        }
        if self.wire.is_plain() {
            self.carry(frame, from, deaf);
        } else {
            self.deliver_through_faults(frame, from, deaf);
        }
    }

    fn deliver_through_faults(&mut self, frame: &CanFrame, from: PeerId, deaf: &[PeerId]) {
        let now_ns = match &self.barrier {
            Some(barrier) => u64::from(barrier.cycle) * CYCLE_NS,
            None => self.began.elapsed().as_nanos() as u64,
        };
        let mut outcomes = std::mem::take(&mut self.outcomes);
        self.wire.pass(frame, from, deaf, now_ns, &mut outcomes);
        self.carry_outcomes(&mut outcomes);
        self.outcomes = outcomes;
    }

    fn carry_outcomes(&mut self, outcomes: &mut Vec<FrameOutcome>) {
        for outcome in outcomes.drain(..) {
            match outcome {
                FrameOutcome::Carried { frame, from, deaf } => self.carry(&frame, from, &deaf),
                FrameOutcome::Lost(frame) => {
                    self.report.frames += 1;
                    self.report.injected_loss.count(&frame);
                    if let Some(barrier) = &mut self.barrier {
                        barrier.lost(&frame, None);
                    }
                }
                // Whoever would answer it does so when it comes, in a later cycle: it does not hold up this one.
                FrameOutcome::Held(frame) => {
                    if let Some(barrier) = &mut self.barrier {
                        barrier.lost(&frame, None);
                    }
                }
            }
        }
    }

    fn send_babble(&mut self, now_ns: u64) {
        let mut babbled = std::mem::take(&mut self.babble);
        self.wire.babble(now_ns, &mut babbled);
        let space_ns = CYCLE_NS / babbled.len().max(1) as u64;
        for (frame, place) in babbled.drain(..).zip(0..) {
            let Some(timed) = &mut self.timed else {
                self.deliver(&frame, BABBLER, &[]);
                continue;
            };
            if !timed.knows(BABBLER) {
                timed.join(BABBLER, ReportTarget::Babbler);
            }
            // In lockstep spread over the millisecond that begins; in real time the burst is there now.
            let begins_ns = if self.barrier.is_some() { now_ns + place * space_ns } else { timed.time_ns(0) };
            timed.enter(BABBLER, &frame, begins_ns);
        }
        self.babble = babbled;
    }
}
