//! A guest's CAN socket: a pair of Unix sockets, one end in the guest, the other here.
//!
//! ```text
//!   guest: read, recv, poll ◄── its end ◄══ the queue ◄── here: deliver, after the filters
//!   guest: write, send      ──► its end ══► the queue ──► here: to the bus, and to the other guests
//! ```
//!
//! Metadata of a queued frame (interface, sender, frames lost before it) do not fit its 16 bytes and are kept here, a
//! [`MessageMetadata`] for each frame, in the order of the queue. Native reads are not observed, so the number of valid entries
//! is computed from the bytes that the kernel accounts as sent and unread.

#![allow(unsafe_code)] // the ioctl SIOCOUTQ, nothing else

use crate::bcm::BroadcastManager;
use crate::bus_peer::FrameBytes;
use crate::raw::RawOptions;
use crate::receive::{Message, WaitingCall};
use crate::transport::Transport;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, recv, send, socketpair};
use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::rc::Rc;

/// Number of entries of metadata that are kept without checking their validity.
const FEW_MESSAGES: usize = 64;
/// Most dropped messages of a queue that are counted.
const MOST_UNREAD: usize = 10_000;

/// Metadata of a message in a guest's queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MessageMetadata {
    /// Index of the interface on which it was received.
    pub(crate) interface: u32,
    /// `MSG_DONTROUTE` for a frame of a guest, `MSG_CONFIRM` too for the reader's own.
    pub(crate) flags: u32,
    /// Frames lost before it, modulo 2^32.
    pub(crate) dropped: u32,
    /// Time of reception, ns of the wall clock.
    pub(crate) stamp_ns: u64,
    /// An error in place of a message, which has length 0 then.
    pub(crate) error: Option<Errno>,
}

impl MessageMetadata {
    /// Metadata without flags and losses.
    pub(crate) fn new(interface: u32, stamp_ns: u64) -> Self {
        Self { interface, flags: 0, dropped: 0, stamp_ns, error: None }
    }
}

/// Type of a socket.
pub(crate) enum Kind {
    Raw(RawOptions),
    Bcm(Box<BroadcastManager>),
    Transport(Box<Transport>),
}

pub(crate) struct GuestSocket {
    /// This process's end of the pair of sockets; the guest holds the other one.
    end: OwnedFd,
    pub(crate) kind: Kind,
    /// Index of its interface, 0 for any; `None` before `bind`.
    pub(crate) interface: Option<u32>,
    /// Each with the bytes that the kernel accounts to its message.
    metadata: VecDeque<(MessageMetadata, usize)>,
    accounted_bytes: usize,
    accounting: Rc<QueueAccounting>,
    dropped: u32,
    /// Whether `SO_RXQ_OVFL` is on.
    pub(crate) reports_dropped: bool,
    /// Time of the last message read, ns, as far as it is known.
    last_stamp_ns: Option<u64>,
    pub(crate) waiting: VecDeque<WaitingCall>,
    /// Messages received for a call that a signal then ended.
    pub(crate) returned: VecDeque<Message>,
    /// A frame of the guest that waits for room at the bus.
    pub(crate) held: Option<FrameBytes>,
}

/// A new socket and the guest's end of it.
pub(crate) fn make(
    kind: Kind,
    non_blocking: bool,
    accounting: &Rc<QueueAccounting>,
) -> io::Result<(GuestSocket, OwnedFd)> {
    let flags = if non_blocking { SocketFlags::NONBLOCK } else { SocketFlags::empty() };
    let (end, guest_end) =
        socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, flags | SocketFlags::CLOEXEC, None)?;
    let socket = GuestSocket {
        end,
        kind,
        interface: None,
        metadata: VecDeque::new(),
        accounted_bytes: 0,
        accounting: Rc::clone(accounting),
        dropped: 0,
        reports_dropped: false,
        last_stamp_ns: None,
        waiting: VecDeque::new(),
        returned: VecDeque::new(),
        held: None,
    };
    Ok((socket, guest_end))
}

/// Bytes that this kernel accounts to a message in a queue of Unix sockets: data, head, rounding. Measured once for each
/// length.
pub(crate) struct QueueAccounting {
    pair: (OwnedFd, OwnedFd),
    known: RefCell<BTreeMap<usize, usize>>,
}

impl QueueAccounting {
    pub(crate) fn new() -> io::Result<Self> {
        let pair = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
        Ok(Self { pair, known: RefCell::default() })
    }

    fn of(&self, message: &[u8]) -> usize {
        *self.known.borrow_mut().entry(message.len()).or_insert_with(|| {
            let (one, other) = &self.pair;
            if send(one, message, SendFlags::DONTWAIT | SendFlags::NOSIGNAL).is_err() {
                return message.len();
            }
            let bytes = unread_bytes(one.as_fd());
            let _ = recv(other, &mut [0_u8; 1], RecvFlags::DONTWAIT);
            bytes
        })
    }
}

/// Bytes that the kernel accounts as sent here and unread.
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
    /// Puts a message into the guest's queue. Without room it is dropped and counted, as in the kernel.
    pub(crate) fn deliver(&mut self, message: &[u8], metadata: MessageMetadata) {
        let metadata = MessageMetadata { dropped: self.dropped, ..metadata };
        match send(&self.end, message, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => {
                if self.metadata.len() >= FEW_MESSAGES && self.metadata.len().is_power_of_two() {
                    self.forget_read_notes();
                }
                let bytes = self.accounting.of(message);
                self.metadata.push_back((metadata, bytes));
                self.accounted_bytes += bytes;
            }
            // The guest has closed it: its end is read next.
            Err(Errno::PIPE | Errno::CONNRESET) => {}
            Err(_) => self.dropped = self.dropped.wrapping_add(1),
        }
    }

    /// Drops the metadata of messages that the guest has read.
    pub(crate) fn forget_read_notes(&mut self) {
        let unread = unread_bytes(self.end.as_fd());
        while self.accounted_bytes > unread {
            let Some((metadata, bytes)) = self.metadata.pop_front() else { break };
            self.accounted_bytes -= bytes;
            self.last_stamp_ns = Some(metadata.stamp_ns);
        }
    }

    pub(crate) fn next_metadata(&mut self) -> Option<MessageMetadata> {
        self.forget_read_notes();
        self.metadata.front().map(|(metadata, _)| *metadata)
    }

    /// Takes an error out of the guest's queue, by a copy of the guest's end, if it is the next to be read.
    pub(crate) fn take_error(&mut self, end: BorrowedFd<'_>) -> Option<Errno> {
        let error = self.next_metadata()?.error?;
        let mut byte = [0_u8; 1];
        match recv(end, &mut byte, RecvFlags::DONTWAIT | RecvFlags::PEEK) {
            Ok((_, 0)) => recv(end, &mut byte, RecvFlags::DONTWAIT).is_ok().then_some(error),
            _ => None,
        }
    }

    /// Time of the last message read, ns of the wall clock.
    pub(crate) fn last_stamp_ns(&mut self) -> Option<u64> {
        self.forget_read_notes();
        self.last_stamp_ns
    }

    /// Resizes the guest's queue to the requested receive buffer; our send buffer bounds it.
    pub(crate) fn resize_queue(&self, bytes: usize) {
        // The kernel limits and doubles it as it does for the guest.
        let _ = rustix::net::sockopt::set_socket_send_buffer_size(&self.end, bytes);
    }

    pub(crate) fn raw(&self) -> Option<&RawOptions> {
        match &self.kind {
            Kind::Raw(options) => Some(options),
            Kind::Bcm(_) | Kind::Transport(_) => None,
        }
    }

    /// Whether native writes are taken now.
    pub(crate) fn takes_more(&self) -> bool {
        self.held.is_none() && !self.transport().is_some_and(Transport::is_full)
    }

    /// Drops native writes that no bus has taken; returns their number, up to some ten thousand.
    pub(crate) fn forget_unsent(&mut self) -> u64 {
        let mut forgotten = u64::from(self.held.take().is_some());
        if let Some(transport) = self.transport_mut() {
            forgotten += u64::from(transport.protocol.is_sending()) + transport.forget_native() as u64;
            transport.protocol.give_up();
        }
        let unread = (0..MOST_UNREAD).take_while(|_| {
            let read = recv(&self.end, &mut [0_u8; 1], RecvFlags::DONTWAIT | RecvFlags::TRUNC);
            read.is_ok_and(|(_, length)| length > 0)
        });
        forgotten + unread.count() as u64
    }

    /// Whether all guests have closed it.
    pub(crate) fn has_hung_up(&self) -> bool {
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        let mut set = [PollFd::new(self, PollFlags::empty())];
        poll(&mut set, Some(&now)) == Ok(1) && set[0].revents().contains(PollFlags::HUP)
    }

    /// Whether it is bound to this interface or to any.
    pub(crate) fn listens_on(&self, interface: u32) -> bool {
        self.interface.is_some_and(|bound| bound == 0 || bound == interface)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const METADATA: MessageMetadata =
        MessageMetadata { interface: 7, flags: 0, dropped: 0, stamp_ns: 0, error: None };

    fn new() -> (GuestSocket, OwnedFd) {
        let accounting = Rc::new(QueueAccounting::new().unwrap());
        make(Kind::Raw(RawOptions::default()), false, &accounting).unwrap()
    }

    #[test]
    fn notes_follow_what_the_guest_reads_without_asking() {
        let (mut socket, guest_end) = new();
        for number in 0..200_u64 {
            socket.deliver(&[1; 16], MessageMetadata { stamp_ns: number, ..METADATA });
        }
        for number in 0..150 {
            assert_eq!(socket.next_metadata().map(|metadata| metadata.stamp_ns), Some(number));
            recv(&guest_end, &mut [0_u8; 16], RecvFlags::DONTWAIT).unwrap();
        }
        assert_eq!(socket.last_stamp_ns(), Some(149));
        assert!(socket.metadata.len() <= 50);
    }

    #[test]
    fn notes_follow_messages_of_any_length() {
        let (mut socket, guest_end) = new();
        let length = |number: usize| [16, 4152, 72, 0, 300, 9000][number % 6];
        for number in 0..12 {
            socket.deliver(&vec![1; length(number)], MessageMetadata { stamp_ns: number as u64, ..METADATA });
        }
        for number in 0..12 {
            assert_eq!(socket.next_metadata().map(|metadata| metadata.stamp_ns), Some(number as u64));
            assert_eq!(recv(&guest_end, &mut [0_u8; 9000], RecvFlags::DONTWAIT).unwrap().1, length(number));
        }
        assert_eq!(socket.next_metadata(), None);
    }

    #[test]
    fn frames_dropped_at_the_queue_are_counted_and_reported_with_the_next_frame() {
        let (mut socket, guest_end) = new();
        while socket.dropped < 3 {
            socket.deliver(&[1; 16], METADATA);
        }
        while recv(&guest_end, &mut [0_u8; 16], RecvFlags::DONTWAIT).is_ok() {}
        socket.deliver(&[1; 16], METADATA);
        assert_eq!(socket.next_metadata().map(|metadata| metadata.dropped), Some(3));
    }

    #[test]
    fn a_message_of_length_zero_is_accounted_as_one_too() {
        let (mut socket, guest_end) = new();
        socket.deliver(&[], MessageMetadata { error: Some(Errno::NETDOWN), ..METADATA });
        socket.deliver(&[1; 16], METADATA);
        assert_eq!(socket.next_metadata().and_then(|metadata| metadata.error), Some(Errno::NETDOWN));
        recv(&guest_end, &mut [0_u8; 16], RecvFlags::DONTWAIT).unwrap();
        assert_eq!(socket.next_metadata().map(|metadata| metadata.error), Some(None));
    }
}
