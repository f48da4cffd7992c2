//! The broadcast manager, `CAN_BCM`: a socket that sends cyclically and reports changes and time-outs for the guest.
//!
//! ```text
//!   guest ── TX_SETUP, TX_SEND, TX_DELETE, TX_READ ──► jobs that send (transmit.rs)  ── frames ──► the interface
//!         ── RX_SETUP, RX_DELETE, RX_READ ───────────► subscriptions (subscription.rs) ◄── frames ── the interface
//!         ◄── TX_EXPIRED, TX_STATUS, RX_CHANGED, RX_TIMEOUT, RX_STATUS ── both
//! ```
//!
//! It has no socket and no clock: commands, frames and the time are inputs, [`Action`]s are outputs. It differs from the
//! kernel's in one respect: the next cycle counts from the due time of the last, not from its sending, so that a cyclic frame
//! does not drift.
//!
//! Source: Linux 6.1 `net/can/bcm.c`, `include/uapi/linux/can/bcm.h`.

mod message;
mod subscription;
mod transmit;

use crate::bus_peer::FrameBytes;
use message::{Head, opcode};
use rustix::io::Errno;
use std::time::Instant;
use subscription::Subscription;
use transmit::Transmission;

/// `MAX_NFRAMES`.
const MOST_FRAMES: u32 = 256;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    /// A frame goes to the interface of this index, and to the guests on it.
    Send(u32, FrameBytes),
    /// The frame of `TX_SEND`, whose sender gets its result.
    SendOnce(u32, FrameBytes),
    /// A message goes to the guest; the index is that of the interface of a received frame, 0 for a job that sends.
    Notify(u32, Vec<u8>),
}

/// The jobs of one socket.
#[derive(Debug, Default)]
pub(crate) struct BroadcastManager {
    transmissions: Vec<Transmission>,
    subscriptions: Vec<Subscription>,
}

impl BroadcastManager {
    /// Executes a command for the interface of this index, 0 for any; returns the number of bytes used.
    ///
    /// # Errors
    /// The kernel's errors: `EINVAL` for malformed commands and unknown jobs, `EFAULT` for fewer frames than announced, `E2BIG`
    /// for more frames than the job can hold, `ENODEV` to send on no interface.
    pub(crate) fn command(
        &mut self,
        bytes: &[u8],
        interface: u32,
        now: Instant,
        actions: &mut Vec<Action>,
    ) -> Result<usize, Errno> {
        let (head, frames) = Head::read(bytes)?;
        match head.opcode {
            opcode::TX_SETUP => self.set_up_transmission(&head, frames, interface, now, actions),
            opcode::RX_SETUP => self.subscribe(&head, frames, interface, now, actions),
            opcode::TX_DELETE => delete(&mut self.transmissions, |job| job.is(&head, interface)),
            opcode::RX_DELETE => delete(&mut self.subscriptions, |job| job.is(&head, interface)),
            opcode::TX_READ => {
                let job =
                    self.transmissions.iter().find(|job| job.is(&head, interface)).ok_or(Errno::INVAL)?;
                actions.push(Action::Notify(0, job.status()));
                Ok(message::HEAD_BYTES)
            }
            opcode::RX_READ => {
                let job =
                    self.subscriptions.iter().find(|job| job.is(&head, interface)).ok_or(Errno::INVAL)?;
                actions.push(Action::Notify(interface, job.status()));
                Ok(message::HEAD_BYTES)
            }
            opcode::TX_SEND => {
                if head.frame_count != 1 || frames.len() != 1 {
                    return Err(Errno::INVAL);
                }
                if interface == 0 {
                    return Err(Errno::NODEV);
                }
                actions.push(Action::SendOnce(interface, frames[0]));
                Ok(bytes.len())
            }
            _ => Err(Errno::INVAL),
        }
    }

    fn set_up_transmission(
        &mut self,
        head: &Head,
        frames: Vec<FrameBytes>,
        interface: u32,
        now: Instant,
        actions: &mut Vec<Action>,
    ) -> Result<usize, Errno> {
        if interface == 0 {
            return Err(Errno::NODEV);
        }
        if head.frame_count < 1 || head.frame_count > MOST_FRAMES {
            return Err(Errno::INVAL);
        }
        let frames = head.announced(frames)?;
        match self.transmissions.iter_mut().find(|job| job.is(head, interface)) {
            Some(job) => job.set_up(head, &frames, now, actions),
            None => {
                let mut job = Transmission::new(head, interface, &frames)?;
                let taken = job.set_up(head, &frames, now, actions)?;
                self.transmissions.push(job);
                Ok(taken)
            }
        }
    }

    fn subscribe(
        &mut self,
        head: &Head,
        frames: Vec<FrameBytes>,
        interface: u32,
        now: Instant,
        actions: &mut Vec<Action>,
    ) -> Result<usize, Errno> {
        let head = subscription::normal(head)?;
        let frames = head.announced(frames)?;
        match self.subscriptions.iter_mut().find(|job| job.is(&head, interface)) {
            Some(job) => job.set_up(&head, &frames, now, actions),
            None => {
                let mut job = Subscription::new(&head, interface, &frames);
                let taken = job.set_up(&head, &frames, now, actions)?;
                self.subscriptions.push(job);
                Ok(taken)
            }
        }
    }

    pub(crate) fn take_frame(
        &mut self,
        interface: u32,
        frame: &FrameBytes,
        now: Instant,
        actions: &mut Vec<Action>,
    ) {
        self.subscriptions.iter_mut().for_each(|job| job.take_frame(interface, frame, now, actions));
    }

    /// Due time of the next job.
    pub(crate) fn due(&self) -> Option<Instant> {
        let sending = self.transmissions.iter().filter_map(|job| job.due);
        sending.chain(self.subscriptions.iter().filter_map(Subscription::due)).min()
    }

    /// Executes the jobs that are due.
    pub(crate) fn advance(&mut self, now: Instant, actions: &mut Vec<Action>) {
        self.transmissions.iter_mut().for_each(|job| job.advance(now, actions));
        self.subscriptions.iter_mut().for_each(|job| job.advance(now, actions));
    }
}

fn delete<J>(jobs: &mut Vec<J>, is_meant: impl Fn(&J) -> bool) -> Result<usize, Errno> {
    let place = jobs.iter().position(is_meant).ok_or(Errno::INVAL)?;
    jobs.remove(place);
    Ok(message::HEAD_BYTES)
}

#[cfg(test)]
mod tests;
