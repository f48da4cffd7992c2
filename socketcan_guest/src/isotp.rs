//! The transport protocol of ISO 15765-2, `CAN_ISOTP`: messages of up to 66000 bytes in frames of 8, for the guest.
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
//! It has no socket and no clock: frames, messages and the time are inputs, [`Event`]s and frames are outputs. Frames are
//! classic.
//!
//! Source: ISO 15765-2:2016; Linux 6.1 `net/can/isotp.c`, `include/uapi/linux/can/isotp.h`.

mod receiver;
mod sender;
mod settings;

use crate::abi::{self, CAN_FRAME_DATA_AT, frame, identifier};
use crate::bus_peer::FrameBytes;
use protocol::can::{ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, REMOTE_FLAG, STANDARD_MASK};
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
/// `ISOTP_FC_TIMEOUT`: longest wait for the peer's next frame.
const PEER_TIMEOUT: Duration = Duration::from_secs(1);
/// `ISOTP_ECHO_TIMEOUT`: longest wait for the interface to accept a frame.
const INTERFACE_TIMEOUT: Duration = Duration::from_secs(2);

/// Kinds of frames: the high half of the byte after the extended address.
mod kind {
    pub(super) const SINGLE: u8 = 0x00;
    pub(super) const FIRST: u8 = 0x10;
    pub(super) const CONSECUTIVE: u8 = 0x20;
    pub(super) const FLOW_CONTROL: u8 = 0x30;
}

/// Result of a frame or of the passage of time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// A flow control frame goes to the interface.
    Reply(FrameBytes),
    /// A message is complete.
    Received(Vec<u8>),
    ReceivingFailed(Errno),
    SendingFailed(Errno),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identifiers {
    pub(crate) sent: u32,
    pub(crate) received: u32,
}

/// A frame of the channel, with the settings of the socket.
#[derive(Clone, Copy)]
struct Incoming<'a> {
    data: &'a [u8],
    length: usize,
    settings: &'a Settings,
    now: Instant,
}

/// One end of a transport channel.
#[derive(Debug, Default)]
pub(crate) struct IsoTp {
    settings: Settings,
    /// Identifiers of its frames, once it is bound.
    pub(crate) identifiers: Option<Identifiers>,
    sender: Sender,
    receiver: Receiver,
}

impl IsoTp {
    /// Checks the identifiers of `bind`, before the interface is checked.
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

    /// Binds it to checked identifiers.
    ///
    /// # Errors
    /// `EINVAL` when it is bound, or for CAN FD, which the interface lacks; `EADDRNOTAVAIL` for one identifier in both
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
    /// `EISCONN` once it is bound; otherwise as [`Settings::set`].
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

    /// Whether a sender waits until the peer has received the whole message.
    pub(crate) fn waits_for_the_end(&self) -> bool {
        self.settings.has(flag::WAIT_TX_DONE)
    }

    /// Whether a message is being sent.
    pub(crate) fn is_sending(&self) -> bool {
        self.sender.is_busy()
    }

    /// Starts to send a message; returns its first frame. If the interface does not accept that, [`IsoTp::give_up`] cancels the
    /// message.
    ///
    /// # Errors
    /// `EADDRNOTAVAIL` before `bind`; `EINVAL` for a length of 0, above [`LONGEST_PDU`], or above that of one frame for a
    /// broadcast of single frames.
    pub(crate) fn start(&mut self, message: &[u8], now: Instant) -> Result<FrameBytes, Errno> {
        let id = self.identifiers.ok_or(Errno::ADDRNOTAVAIL)?.sent;
        let data = self.sender.start(message, &self.settings, now)?;
        Ok(frame(id, &data))
    }

    /// Cancels the message that is being sent.
    pub(crate) fn give_up(&mut self) {
        self.sender = Sender::default();
    }

    /// The consecutive frame that is due. It counts as sent, since the peer may answer it before the interface has returned;
    /// the returned progress undoes that by [`IsoTp::put_back`].
    pub(crate) fn take_due(&mut self, now: Instant) -> Option<(FrameBytes, Progress)> {
        let id = self.identifiers?.sent;
        self.sender.take_due(&self.settings, now).map(|(data, before)| (frame(id, &data), before))
    }

    /// The interface is full: the frame will be sent again.
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
        let mask = low | EXTENDED_FLAG | REMOTE_FLAG | ERROR_FLAG;
        let data = &frame[CAN_FRAME_DATA_AT..];
        let at = self.settings.address_bytes();
        if identifier(frame) & mask != received || at == 1 && data[0] != self.settings.received_address {
            return;
        }
        // Bytes beyond the length are accepted with their content, as by the kernel.
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
        events.extend(replies.iter().map(|data| Event::Reply(abi::frame(sent, data))));
    }

    /// Time of the next action without a frame.
    pub(crate) fn due(&self) -> Option<Instant> {
        [self.sender.due(), self.receiver.due()].into_iter().flatten().min()
    }

    /// Ends expired transfers.
    pub(crate) fn advance(&mut self, now: Instant, events: &mut Vec<Event>) {
        self.sender.advance(now, events);
        self.receiver.advance(now, events);
    }
}

#[cfg(test)]
mod tests;
