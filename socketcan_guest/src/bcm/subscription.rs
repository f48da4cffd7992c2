//! A subscription to an identifier: reports frames with changed content, at most every `ival2`, and silence after `ival1`.
//!
//! A single frame in its list is the mask of the relevant bits. With more frames the first is the mask of a multiplexer: the
//! bits of a received frame under that mask select the frame that it is compared with.

use super::Action;
use super::message::{Head, flag, opcode};
use crate::abi::{identifier, u64_at};
use crate::bus_peer::FrameBytes;
use protocol::can::{EXTENDED_FLAG, REMOTE_FLAG};
use rustix::io::Errno;
use std::time::Instant;

/// Most frames of a list, with the mask of a multiplexer.
const MOST_FRAMES: u32 = super::MOST_FRAMES + 1;

/// The last frame received for an entry of the list.
#[derive(Clone, Copy, Debug)]
struct LastReception {
    frame: FrameBytes,
    /// Whether its report waits for the end of `ival2`.
    is_held_back: bool,
}

/// A job, by identifier and interface.
#[derive(Debug)]
pub(super) struct Subscription {
    interface: u32,
    head: Head,
    frames: Vec<FrameBytes>,
    last: Vec<Option<LastReception>>,
    silent_at: Option<Instant>,
    reported_at: Option<Instant>,
    held_back_until: Option<Instant>,
}

/// A command's head with the flags that its frames imply.
///
/// # Errors
/// `EINVAL` for too many frames, and for an answer to a remote request that is not one frame.
pub(super) fn normal(head: &Head) -> Result<Head, Errno> {
    let mut head = *head;
    if head.flags & flag::RX_FILTER_ID != 0 || head.frame_count == 0 {
        head.flags |= flag::RX_FILTER_ID;
        head.frame_count = 0;
    }
    let answers = head.flags & flag::RX_RTR_FRAME != 0;
    if head.frame_count > MOST_FRAMES || answers && (head.frame_count != 1 || head.id & REMOTE_FLAG == 0) {
        return Err(Errno::INVAL);
    }
    Ok(head)
}

impl Subscription {
    pub(super) fn new(head: &Head, interface: u32, frames: &[FrameBytes]) -> Self {
        Self {
            interface,
            // A subscription has no count; times are taken from the command where it sets them.
            head: Head { count: 0, interval_1: Default::default(), interval_2: Default::default(), ..*head },
            frames: frames.to_vec(),
            last: vec![None; frames.len().max(1)],
            silent_at: None,
            reported_at: None,
            held_back_until: None,
        }
    }

    pub(super) fn is(&self, head: &Head, interface: u32) -> bool {
        self.head.id == head.id && self.interface == interface
    }

    pub(super) fn due(&self) -> Option<Instant> {
        [self.silent_at, self.held_back_until].into_iter().flatten().min()
    }

    pub(super) fn status(&self) -> Vec<u8> {
        self.head.with(opcode::RX_STATUS, &self.frames)
    }

    pub(super) fn set_up(
        &mut self,
        head: &Head,
        frames: &[FrameBytes],
        now: Instant,
        actions: &mut Vec<Action>,
    ) -> Result<usize, Errno> {
        if frames.len() > self.last.len() || frames.len() > self.frames.len() {
            return Err(Errno::TOOBIG);
        }
        self.frames = frames.to_vec();
        if !frames.is_empty() {
            self.last = vec![None; frames.len()];
        }
        self.head.flags = head.flags;
        if head.flags & flag::RX_RTR_FRAME != 0 {
            (self.silent_at, self.held_back_until) = (None, None);
            let answer = &mut self.frames[0];
            if head.flags & flag::TX_CP_CAN_ID != 0 || identifier(answer) == head.id {
                answer[..4].copy_from_slice(&(head.id & !REMOTE_FLAG).to_ne_bytes());
            }
            return Ok(head.message_bytes());
        }
        if head.flags & flag::SETTIMER != 0 {
            (self.head.interval_1, self.head.interval_2) = (head.interval_1, head.interval_2);
            if head.interval_1.is_zero() {
                self.silent_at = None;
            }
            (self.reported_at, self.held_back_until) = (None, None);
            self.report_held_back(actions);
        }
        if head.flags & flag::STARTTIMER != 0 && !self.head.interval_1.is_zero() {
            self.silent_at = Some(now + self.head.interval_1);
        }
        Ok(head.message_bytes())
    }

    pub(super) fn take_frame(
        &mut self,
        interface: u32,
        frame: &FrameBytes,
        now: Instant,
        actions: &mut Vec<Action>,
    ) {
        // Exactly this identifier; a standard one does not match an extended one.
        debug_assert!(self.head.id & EXTENDED_FLAG != 0 || self.head.id & !REMOTE_FLAG < EXTENDED_FLAG);
        if identifier(frame) != self.head.id || self.interface != 0 && self.interface != interface {
            return;
        }
        self.silent_at = None;
        if self.head.flags & flag::RX_RTR_FRAME != 0 {
            actions.push(Action::Send(interface, self.frames[0]));
            return;
        }
        let data = |frame: &FrameBytes| u64_at(frame, 8);
        match self.frames.as_slice() {
            [mask] if !self.differs(0, mask, frame) => {}
            [] | [_] => self.note_change(0, frame, now, actions),
            [mux, rest @ ..] => {
                let (mux, received) = (data(mux), data(frame));
                let entry = rest.iter().position(|entry| mux & received == mux & data(entry));
                if let Some(entry) = entry.filter(|entry| self.differs(entry + 1, &rest[*entry], frame)) {
                    self.note_change(entry + 1, frame, now, actions);
                }
            }
        }
        if self.head.flags & flag::RX_NO_AUTOTIMER == 0 && !self.head.interval_1.is_zero() {
            self.silent_at = Some(now + self.head.interval_1);
        }
    }

    /// Whether a frame differs from the last one of its entry, in bits of the mask or in its length.
    fn differs(&self, entry: usize, mask: &FrameBytes, frame: &FrameBytes) -> bool {
        let Some(last) = &self.last[entry] else { return true };
        let mask = u64_at(mask, 8);
        let by_length = self.head.flags & flag::RX_CHECK_DLC != 0 && frame[4] != last.frame[4];
        // Frames without data have nothing to compare.
        frame[4] > 0 && mask & u64_at(frame, 8) != mask & u64_at(&last.frame, 8) || by_length
    }

    fn note_change(&mut self, entry: usize, frame: &FrameBytes, now: Instant, actions: &mut Vec<Action>) {
        self.last[entry] = Some(LastReception { frame: *frame, is_held_back: true });
        if self.head.interval_2.is_zero() {
            self.report_held_back(actions);
            return;
        }
        if self.held_back_until.is_some() {
            return;
        }
        match self
            .reported_at
            .map(|reported_at| reported_at + self.head.interval_2)
            .filter(|until| now < *until)
        {
            Some(until) => self.held_back_until = Some(until),
            None => {
                self.report_held_back(actions);
                self.reported_at = Some(now);
            }
        }
    }

    /// Reports RX_CHANGED for each frame whose report waits; true when there was one.
    fn report_held_back(&mut self, actions: &mut Vec<Action>) -> bool {
        let mut reported = false;
        for last in self.last.iter_mut().flatten().filter(|last| last.is_held_back) {
            last.is_held_back = false;
            actions.push(Action::Notify(self.interface, self.head.with(opcode::RX_CHANGED, &[last.frame])));
            reported = true;
        }
        reported
    }

    pub(super) fn advance(&mut self, now: Instant, actions: &mut Vec<Action>) {
        if self.silent_at.is_some_and(|at| at <= now) {
            self.silent_at = None;
            if self.head.flags & flag::RX_ANNOUNCE_RESUME != 0 {
                self.last.fill(None);
            }
            actions.push(Action::Notify(self.interface, self.head.with(opcode::RX_TIMEOUT, &[])));
        }
        if self.held_back_until.is_some_and(|until| until <= now) {
            let reported = self.report_held_back(actions);
            self.held_back_until = reported.then_some(now + self.head.interval_2);
            if !reported {
                self.reported_at = None;
            }
        }
    }
}
