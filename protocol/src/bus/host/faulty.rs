//! The host over a wire with faults: what the wire decides is carried out, in real time and in lockstep.
//!
//! Time is that of the run: since the host was bound, or in lockstep the barrier's cycle. A babbling node on a wire that keeps
//! time is one of its nodes and fights for the bus; on one that takes none its frames are simply there.

use super::{BABBLER, Host};
use crate::bus::lockstep::PeerId;
use crate::bus::timed::Reported;
use crate::bus::wire::{Fate, WireOrders};
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
        let Some(ns) = self.wire.patience_ns(now_ns).filter(|_| self.barrier.is_none()) else {
            return patience;
        };
        if patience.tv_sec > 0 || patience.tv_nsec as u64 > ns {
            Timespec { tv_sec: (ns / 1_000_000_000) as i64, tv_nsec: (ns % 1_000_000_000) as i64 }
        } else {
            patience
        }
    }

    /// What was ordered begins and ends; what was held is carried when its time has come, and babbling nodes babble.
    pub(super) fn advance_faults(&mut self, now_ns: u64) {
        let mut fates = std::mem::take(&mut self.fates);
        self.wire.take_orders(now_ns, &mut fates);
        if !self.wire.is_plain() || !fates.is_empty() {
            self.wire.pass_time(now_ns, &mut fates);
            self.carry_fates(&mut fates);
            self.let_babble(now_ns);
        }
        self.fates = fates;
    }

    /// Everything that is held, when the host goes.
    pub(super) fn let_all_go(&mut self) {
        let mut fates = Vec::new();
        self.wire.let_all_go(&mut fates);
        self.carry_fates(&mut fates);
    }

    /// Puts one frame on the wire, which may do something to it.
    pub(super) fn deliver(&mut self, frame: &CanFrame, from: PeerId, deaf: &[PeerId]) {
        // A babbling node is none of those whose identifier it uses.
        if from != BABBLER {
            self.wire.note_speaker(frame, from);
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
        let mut fates = std::mem::take(&mut self.fates);
        self.wire.pass(frame, from, deaf, now_ns, &mut fates);
        self.carry_fates(&mut fates);
        self.fates = fates;
    }

    fn carry_fates(&mut self, fates: &mut Vec<Fate>) {
        for fate in fates.drain(..) {
            match fate {
                Fate::Carried { frame, from, deaf } => self.carry(&frame, from, &deaf),
                Fate::Lost(frame) => {
                    self.report.frames += 1;
                    self.report.injected_loss.count(&frame);
                    if let Some(barrier) = &mut self.barrier {
                        barrier.lost(&frame, None);
                    }
                }
                // Whoever would answer it does so when it comes, in a later cycle: it does not hold up this one.
                Fate::Held(frame) => {
                    if let Some(barrier) = &mut self.barrier {
                        barrier.lost(&frame, None);
                    }
                }
            }
        }
    }

    fn let_babble(&mut self, now_ns: u64) {
        let mut babbled = std::mem::take(&mut self.babble);
        self.wire.babble(now_ns, &mut babbled);
        let space_ns = CYCLE_NS / babbled.len().max(1) as u64;
        for (frame, place) in babbled.drain(..).zip(0..) {
            let Some(timed) = &mut self.timed else {
                self.deliver(&frame, BABBLER, &[]);
                continue;
            };
            if !timed.knows(BABBLER) {
                timed.join(BABBLER, Reported::Babbler);
            }
            // In lockstep spread over the millisecond that begins; in real time the burst is there now.
            let begins_ns = if self.barrier.is_some() { now_ns + place * space_ns } else { timed.time_ns(0) };
            timed.enter(BABBLER, &frame, begins_ns);
        }
        self.babble = babbled;
    }
}
