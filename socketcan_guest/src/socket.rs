//! A guest's CAN socket: a pair of Unix sockets, one end in the guest, the other here.
//!
//! ```text
//!   guest: read, recv, poll ◄── its end ◄══ the queue ◄── here: deliver, after the filters
//!   guest: write, send      ──► its end ══► the queue ──► here: to the bus, and to the other guests
//! ```
//!
//! What the kernel knows of a frame in a queue and 16 bytes cannot hold (interface, whose it is, frames lost before it) is noted
//! here, a [`Note`] for each frame, in the queue's order. The guest reads without asking, so how many notes are still of use is
//! computed from the bytes that the kernel accounts to what we sent and the guest has not read.

#![allow(unsafe_code)] // the ioctl SIOCOUTQ, nothing else

use crate::bcm::BroadcastManager;
use crate::bus_peer::FrameBytes;
use crate::raw::RawOptions;
use crate::receive::{Message, WaitingCall};
use rustix::io::Errno;
use rustix::net::{AddressFamily, SendFlags, SocketFlags, SocketType, send, socketpair};
use std::collections::VecDeque;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};

/// Notes that are kept without looking at how many are still of use.
const FEW_NOTES: usize = 64;

/// What is known of a message in a guest's queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Note {
    /// Index of the interface on which it came.
    pub(crate) interface: u32,
    /// `MSG_DONTROUTE` for a frame of a guest, `MSG_CONFIRM` too for the reader's own.
    pub(crate) flags: u32,
    /// Frames that the queue had not taken before it, modulo 2^32.
    pub(crate) dropped: u32,
    /// When it came, ns of the wall clock.
    pub(crate) stamp_ns: u64,
    /// A message of length 0 is none: it tells of this error.
    pub(crate) error: Option<Errno>,
}

/// What a socket is.
pub(crate) enum Kind {
    Raw(RawOptions),
    Bcm(Box<BroadcastManager>),
}

/// A CAN socket of a guest.
pub(crate) struct GuestSocket {
    /// Our end.
    end: OwnedFd,
    pub(crate) kind: Kind,
    /// Index of its interface, 0 for any; `None` before `bind`.
    pub(crate) interface: Option<u32>,
    notes: VecDeque<Note>,
    /// Bytes that the kernel accounts to one message; see [`bytes_accounted_to_a_message`].
    message_bytes: usize,
    dropped: u32,
    /// Whether `SO_RXQ_OVFL` was asked for.
    pub(crate) tells_dropped: bool,
    /// When the message came that was read last, as far as it is known; ns.
    last_stamp_ns: Option<u64>,
    /// Calls that wait for a message.
    pub(crate) waiting: VecDeque<WaitingCall>,
    /// Messages that were received for a call which a signal then ended.
    pub(crate) returned: VecDeque<Message>,
    /// A frame of the guest's that waits for room at the bus.
    pub(crate) held: Option<FrameBytes>,
}

/// A new socket and the guest's end of it.
pub(crate) fn make(
    kind: Kind,
    non_blocking: bool,
    message_bytes: usize,
) -> io::Result<(GuestSocket, OwnedFd)> {
    let flags = if non_blocking { SocketFlags::NONBLOCK } else { SocketFlags::empty() };
    let (end, theirs) =
        socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, flags | SocketFlags::CLOEXEC, None)?;
    let socket = GuestSocket {
        end,
        kind,
        interface: None,
        notes: VecDeque::new(),
        message_bytes,
        dropped: 0,
        tells_dropped: false,
        last_stamp_ns: None,
        waiting: VecDeque::new(),
        returned: VecDeque::new(),
        held: None,
    };
    Ok((socket, theirs))
}

/// Bytes that this kernel accounts to one message of a frame's length, in a queue of Unix sockets: data, head, rounding.
pub(crate) fn bytes_accounted_to_a_message() -> io::Result<usize> {
    let (one, _other) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
    send(&one, &[0; 16], SendFlags::NOSIGNAL)?;
    match unread_bytes(one.as_fd()) {
        0 => Err(io::Error::other("the kernel accounts nothing to a message")),
        bytes => Ok(bytes),
    }
}

/// Bytes that the kernel accounts to what was sent here and not yet read.
fn unread_bytes(end: BorrowedFd<'_>) -> usize {
    let mut bytes: libc::c_int = 0;
    // SAFETY: the kernel writes one int.
    let done = unsafe { libc::ioctl(end.as_raw_fd(), libc::TIOCOUTQ, &raw mut bytes) };
    if done == 0 { usize::try_from(bytes).unwrap_or(0) } else { 0 }
}

impl AsFd for GuestSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.end.as_fd()
    }
}

impl GuestSocket {
    /// Puts a message into the guest's queue. One for which there is no room is dropped and counted, as the kernel does.
    pub(crate) fn deliver(&mut self, message: &[u8], note: Note) {
        let note = Note { dropped: self.dropped, ..note };
        match send(&self.end, message, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => {
                if self.notes.len() >= FEW_NOTES && self.notes.len().is_power_of_two() {
                    self.forget_read_notes();
                }
                self.notes.push_back(note);
            }
            // The guest has closed it: its end is read next.
            Err(Errno::PIPE | Errno::CONNRESET) => {}
            Err(_) => self.dropped = self.dropped.wrapping_add(1),
        }
    }

    /// Forgets the notes of messages that the guest has read.
    pub(crate) fn forget_read_notes(&mut self) {
        let unread = unread_bytes(self.end.as_fd()).div_ceil(self.message_bytes);
        while self.notes.len() > unread {
            self.last_stamp_ns = self.notes.pop_front().map(|note| note.stamp_ns).or(self.last_stamp_ns);
        }
    }

    /// The note of the message that is read next.
    pub(crate) fn next_note(&mut self) -> Option<Note> {
        self.forget_read_notes();
        self.notes.front().copied()
    }

    /// When the message came that was read last, ns of the wall clock.
    pub(crate) fn last_stamp_ns(&mut self) -> Option<u64> {
        self.forget_read_notes();
        self.last_stamp_ns
    }

    /// Lets the guest's queue grow or shrink with the receive buffer that it asked for: what bounds it is our send buffer.
    pub(crate) fn resize_queue(&self, bytes: usize) {
        // The kernel bounds it as it bounds the guest's, and doubles both.
        let _ = rustix::net::sockopt::set_socket_send_buffer_size(&self.end, bytes);
    }

    /// Its options when it is a raw socket.
    pub(crate) fn raw(&self) -> Option<&RawOptions> {
        match &self.kind {
            Kind::Raw(options) => Some(options),
            Kind::Bcm(_) => None,
        }
    }

    /// Whether it is bound to this interface or to any.
    pub(crate) fn listens_on(&self, interface: u32) -> bool {
        self.interface.is_some_and(|own| own == 0 || own == interface)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::net::{RecvFlags, recv};

    const NOTE: Note = Note { interface: 7, flags: 0, dropped: 0, stamp_ns: 0, error: None };

    fn new() -> (GuestSocket, OwnedFd) {
        let bytes = bytes_accounted_to_a_message().unwrap();
        make(Kind::Raw(RawOptions::default()), false, bytes).unwrap()
    }

    #[test]
    fn notes_follow_what_the_guest_reads_without_asking() {
        let (mut socket, theirs) = new();
        for number in 0..200_u64 {
            socket.deliver(&[1; 16], Note { stamp_ns: number, ..NOTE });
        }
        for number in 0..150 {
            assert_eq!(socket.next_note().map(|note| note.stamp_ns), Some(number));
            recv(&theirs, &mut [0_u8; 16], RecvFlags::DONTWAIT).unwrap();
        }
        assert_eq!(socket.last_stamp_ns(), Some(149));
        assert!(socket.notes.len() <= 50);
    }

    #[test]
    fn what_the_queue_does_not_take_is_counted_and_told_with_the_next_frame() {
        let (mut socket, theirs) = new();
        while socket.dropped < 3 {
            socket.deliver(&[1; 16], NOTE);
        }
        while recv(&theirs, &mut [0_u8; 16], RecvFlags::DONTWAIT).is_ok() {}
        socket.deliver(&[1; 16], NOTE);
        assert_eq!(socket.next_note().map(|note| note.dropped), Some(3));
    }

    #[test]
    fn a_message_of_length_zero_is_accounted_as_one_too() {
        let (mut socket, theirs) = new();
        socket.deliver(&[], Note { error: Some(Errno::NETDOWN), ..NOTE });
        socket.deliver(&[1; 16], NOTE);
        assert_eq!(socket.next_note().and_then(|note| note.error), Some(Errno::NETDOWN));
        recv(&theirs, &mut [0_u8; 16], RecvFlags::DONTWAIT).unwrap();
        assert_eq!(socket.next_note().map(|note| note.error), Some(None));
    }
}
