//! A job that sends: `count` times every `ival1`, then every `ival2`, one frame of its list after the other.

use super::Action;
use super::message::{Head, flag, opcode};
use crate::bus_peer::FrameBytes;
use rustix::io::Errno;
use std::time::Instant;

/// A job, by identifier and interface.
#[derive(Debug)]
pub(super) struct Transmission {
    interface: u32,
    /// Head of the last set-up; `count` is the remaining number of frames every `ival1`.
    head: Head,
    /// The list; a further set-up may not have more frames.
    frames: Vec<FrameBytes>,
    next_frame: usize,
    pub(super) due: Option<Instant>,
}

impl Transmission {
    pub(super) fn new(head: &Head, interface: u32, frames: &[FrameBytes]) -> Result<Self, Errno> {
        // Times and count are taken from the command where it sets them.
        let head = Head { count: 0, interval_1: Default::default(), interval_2: Default::default(), ..*head };
        Ok(Self { interface, head, frames: frames.to_vec(), next_frame: 0, due: None })
    }

    pub(super) fn is(&self, head: &Head, interface: u32) -> bool {
        self.head.id == head.id && self.interface == interface
    }

    pub(super) fn status(&self) -> Vec<u8> {
        self.head.with(opcode::TX_STATUS, &self.frames)
    }

    pub(super) fn set_up(
        &mut self,
        head: &Head,
        frames: &[FrameBytes],
        now: Instant,
        actions: &mut Vec<Action>,
    ) -> Result<usize, Errno> {
        if frames.len() > self.frames.len() {
            return Err(Errno::TOOBIG);
        }
        if frames.len() != self.frames.len() {
            self.next_frame = 0;
        }
        self.frames = frames.to_vec();
        if head.flags & flag::TX_CP_CAN_ID != 0 {
            self.frames.iter_mut().for_each(|frame| frame[..4].copy_from_slice(&head.id.to_ne_bytes()));
        }
        self.head.flags = head.flags;
        if head.flags & flag::TX_RESET_MULTI_IDX != 0 {
            self.next_frame = 0;
        }
        if head.flags & flag::SETTIMER != 0 {
            self.head.count = head.count;
            (self.head.interval_1, self.head.interval_2) = (head.interval_1, head.interval_2);
            if head.interval_1.is_zero() && head.interval_2.is_zero() {
                self.due = None;
            }
        }
        let starts = head.flags & flag::STARTTIMER != 0;
        if starts {
            self.head.flags |= flag::TX_ANNOUNCE;
        }
        if self.head.flags & flag::TX_ANNOUNCE != 0 {
            self.send(actions);
            self.head.count = self.head.count.saturating_sub(1);
        }
        if starts {
            self.arm(now, now);
        }
        Ok(head.message_bytes())
    }

    /// Sets the next due time from the last one.
    fn arm(&mut self, last: Instant, now: Instant) {
        let interval = if !self.head.interval_1.is_zero() && self.head.count > 0 {
            self.head.interval_1
        } else {
            self.head.interval_2
        };
        let next = last + interval;
        // After a pause of the machine missed cycles are skipped.
        let next = if next < now { now + interval } else { next };
        self.due = (!interval.is_zero()).then_some(next);
    }

    fn send(&mut self, actions: &mut Vec<Action>) {
        actions.push(Action::Send(self.interface, self.frames[self.next_frame]));
        self.next_frame = (self.next_frame + 1) % self.frames.len();
    }

    pub(super) fn advance(&mut self, now: Instant, actions: &mut Vec<Action>) {
        let Some(due) = self.due.filter(|due| *due <= now) else { return };
        if !self.head.interval_1.is_zero() && self.head.count > 0 {
            self.head.count -= 1;
            if self.head.count == 0 && self.head.flags & flag::TX_COUNTEVT != 0 {
                actions.push(Action::Notify(0, self.head.with(opcode::TX_EXPIRED, &[])));
            }
        }
        self.send(actions);
        self.arm(due, now);
    }
}
