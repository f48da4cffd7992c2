//! The transport protocol of ISO 15765-2, `CAN_ISOTP`: messages of up to 66000 bytes in frames of 8, on the guest's behalf.
//!
//! ```text
//!   message of at most 7 bytes   single frame
//!   longer                       first frame ──►
//!                                            ◄── flow control: continue, wait or overflow; block size, STmin
//!                                consecutive frames, STmin apart ──►
//!                                            ◄── flow control after each block …
//!
//!   sender    idle ── start ──► awaits flow control ── continue ► sends ── last frame ──► idle
//!                                       ▲                          │
//!                                       └──── end of a block ──────┘          no flow control for 1 s: ECOMM
//!   receiver  idle ── first frame ──► awaits consecutive frames ── last ──► idle      none for 1 s: ETIMEDOUT
//! ```
//!
//! It knows no socket and no clock: frames, messages and the time come in, [`Event`]s and frames go out. Frames are classic.
//!
//! Source: ISO 15765-2:2016; Linux 6.1 `net/can/isotp.c`, `include/uapi/linux/can/isotp.h`.

mod receiver;
mod sender;
mod settings;

use crate::abi::{CAN_FRAME_DATA_AT, EXTENDED_FLAG, REMOTE_FLAG, STANDARD_MASK, identifier};
use crate::bus_peer::FrameBytes;
use receiver::Receiver;
use rustix::io::Errno;
pub(crate) use sender::Progress;
use sender::Sender;
use settings::{Settings, flag};
use std::time::{Duration, Instant};

/// `MAX_MSG_LENGTH`.
pub(crate) const LONGEST_PDU: usize = 66000;
/// Bytes of a classic frame's data.
const DATA_BYTES: usize = 8;
/// `ISOTP_FC_TIMEOUT`: the other side's next frame is waited for so long.
const OTHER_SIDE: Duration = Duration::from_secs(1);
/// `ISOTP_ECHO_TIMEOUT`: and so long for the interface to take one of ours.
const INTERFACE: Duration = Duration::from_secs(2);

const EXTENDED_MASK: u32 = 0x1FFF_FFFF;

/// Kinds of frames: the high half of the byte after the extended address.
mod kind {
    pub(super) const SINGLE: u8 = 0x00;
    pub(super) const FIRST: u8 = 0x10;
    pub(super) const CONSECUTIVE: u8 = 0x20;
    pub(super) const FLOW_CONTROL: u8 = 0x30;
}

/// What came of a frame or of the time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// A flow control frame goes to the interface.
    Reply(FrameBytes),
    /// A message is complete.
    Received(Vec<u8>),
    /// A message was not received.
    ReceivingFailed(Errno),
    /// The message that was sent was not received by the other side.
    SendingFailed(Errno),
}

/// Identifiers of the frames of both directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identifiers {
    pub(crate) sent: u32,
    pub(crate) received: u32,
}

/// A frame of the channel, and what the socket wants of it.
#[derive(Clone, Copy)]
struct Incoming<'a> {
    data: &'a [u8],
    length: usize,
    settings: &'a Settings,
    now: Instant,
}

/// One socket's end of a transport channel.
#[derive(Debug, Default)]
pub(crate) struct IsoTp {
    settings: Settings,
    identifiers: Option<Identifiers>,
    sender: Sender,
    receiver: Receiver,
}

impl IsoTp {
    /// Which frames are its own, once it is bound.
    pub(crate) fn identifiers(&self) -> Option<Identifiers> {
        self.identifiers
    }

    /// Checks the identifiers of `bind`, before the interface is looked at.
    ///
    /// # Errors
    /// `EINVAL` for bits beyond an identifier.
    pub(crate) fn check(&self, wanted: Identifiers) -> Result<(), Errno> {
        let is_one = |id: u32| {
            let mask = if id & EXTENDED_FLAG != 0 { EXTENDED_FLAG | EXTENDED_MASK } else { STANDARD_MASK };
            id & !mask == 0
        };
        let listens = !self.settings.broadcasts();
        if is_one(wanted.sent) && (!listens || is_one(wanted.received)) { Ok(()) } else { Err(Errno::INVAL) }
    }

    /// Binds it to identifiers that were checked.
    ///
    /// # Errors
    /// `EINVAL` when it is bound, or wants CAN FD, which the interface has not; `EADDRNOTAVAIL` for one identifier in both
    /// directions.
    pub(crate) fn bind(&mut self, wanted: Identifiers, is_interface: bool) -> Result<(), Errno> {
        if self.identifiers.is_some() {
            return Err(Errno::INVAL);
        }
        if !self.settings.broadcasts() && wanted.sent == wanted.received {
            return Err(Errno::ADDRNOTAVAIL);
        }
        if !is_interface {
            return Err(Errno::NODEV);
        }
        if self.settings.wants_can_fd() {
            return Err(Errno::INVAL);
        }
        self.identifiers = Some(wanted);
        Ok(())
    }

    /// `setsockopt`.
    ///
    /// # Errors
    /// `EISCONN` once it is bound; else as [`Settings::set`].
    pub(crate) fn set(&mut self, option: i32, value: &[u8]) -> Result<(), Errno> {
        if self.identifiers.is_some() { Err(Errno::ISCONN) } else { self.settings.set(option, value) }
    }

    /// `getsockopt`.
    ///
    /// # Errors
    /// `ENOPROTOOPT`.
    pub(crate) fn get(&self, option: i32) -> Result<Vec<u8>, Errno> {
        self.settings.get(option)
    }

    /// Whether who sends waits until the other side has it all.
    pub(crate) fn waits_for_the_end(&self) -> bool {
        self.settings.has(flag::WAIT_TX_DONE)
    }

    /// Whether a message is being sent.
    pub(crate) fn is_sending(&self) -> bool {
        self.sender.is_busy()
    }

    /// Begins to send a message; gives its first frame. If the interface does not take that, [`IsoTp::give_up`] takes it back.
    ///
    /// # Errors
    /// `EADDRNOTAVAIL` before `bind`; `EINVAL` for a length of 0, above [`LONGEST_PDU`], or above one frame's for a broadcast of
    /// single frames.
    pub(crate) fn start(&mut self, message: &[u8], now: Instant) -> Result<FrameBytes, Errno> {
        let id = self.identifiers.ok_or(Errno::ADDRNOTAVAIL)?.sent;
        let data = self.sender.start(message, &self.settings, now)?;
        Ok(frame(id, &data))
    }

    /// Forgets the message that is being sent.
    pub(crate) fn give_up(&mut self) {
        self.sender = Sender::default();
    }

    /// The consecutive frame that is due, which counts as sent: the other side may answer it before the interface has
    /// returned. What comes with it takes it back by [`IsoTp::put_back`].
    pub(crate) fn take_due(&mut self, now: Instant) -> Option<(FrameBytes, Progress)> {
        let id = self.identifiers?.sent;
        self.sender.take_due(&self.settings, now).map(|(data, before)| (frame(id, &data), before))
    }

    /// The interface has no room for it: it is tried again.
    pub(crate) fn put_back(&mut self, before: Progress, now: Instant, events: &mut Vec<Event>) {
        self.sender.put_back(before, now, events);
    }

    /// Processes a frame of another socket or of the bus.
    pub(crate) fn take_frame(&mut self, frame: &FrameBytes, now: Instant, events: &mut Vec<Event>) {
        let Some(Identifiers { received, sent }) = self.identifiers.filter(|_| !self.settings.broadcasts())
        else {
            return;
        };
        let low = if received & EXTENDED_FLAG != 0 { EXTENDED_MASK } else { STANDARD_MASK };
        let mask = low | EXTENDED_FLAG | REMOTE_FLAG | crate::abi::ERROR_FLAG;
        let data = &frame[CAN_FRAME_DATA_AT..];
        let at = self.settings.address_bytes();
        if identifier(frame) & mask != received || at == 1 && data[0] != self.settings.received_address() {
            return;
        }
        // Bytes beyond the length are what the sender left there, and count as the kernel lets them count.
        let length = usize::from(frame[4]).min(DATA_BYTES);
        let kind = data[at] & 0xF0;
        if self.settings.has(flag::HALF_DUPLEX)
            && (self.sender.is_busy() && kind != kind::FLOW_CONTROL
                || self.receiver.is_busy() && kind == kind::FLOW_CONTROL)
        {
            return;
        }
        let incoming = Incoming { data, length, settings: &self.settings, now };
        let mut replies = Vec::new();
        match kind {
            kind::FLOW_CONTROL => self.sender.take_flow_control(incoming, events),
            kind::SINGLE => self.receiver.take_single(incoming, events),
            kind::FIRST => replies.extend(self.receiver.take_first(incoming)),
            kind::CONSECUTIVE => replies.extend(self.receiver.take_consecutive(incoming, events)),
            _ => {}
        }
        events.extend(replies.iter().map(|data| Event::Reply(self::frame(sent, data))));
    }

    /// When something is to be done without a frame.
    pub(crate) fn due(&self) -> Option<Instant> {
        [self.sender.due(), self.receiver.due()].into_iter().flatten().min()
    }

    /// Ends what has waited too long.
    pub(crate) fn advance(&mut self, now: Instant, events: &mut Vec<Event>) {
        self.sender.advance(now, events);
        self.receiver.advance(now, events);
    }
}

/// A frame with these data.
fn frame(id: u32, data: &[u8]) -> FrameBytes {
    let mut frame = FrameBytes::default();
    frame[..4].copy_from_slice(&id.to_ne_bytes());
    frame[4] = data.len() as u8;
    frame[CAN_FRAME_DATA_AT..CAN_FRAME_DATA_AT + data.len()].copy_from_slice(data);
    frame
}

#[cfg(test)]
mod tests;
