//! One peer of the host: its socket, and what waits to be sent to it.

use super::BARRIER_TIMEOUT;
use crate::bus::packets::{self, Outbox};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::SendFlags;
use std::io;
use std::os::fd::{AsFd, OwnedFd};

pub(super) struct Peer {
    pub(super) socket: OwnedFd,
    /// Its place in the host's report.
    pub(super) report: usize,
    outbox: Outbox,
    /// It left packets unread for longer than a member may take.
    stopped_reading: bool,
}

pub(super) enum SendOutcome {
    /// Its queue took it.
    Delivered,
    /// Its queue was full.
    Dropped,
    /// It takes no more, and is removed when its end is read.
    Gone,
}

impl Peer {
    pub(super) fn new(socket: OwnedFd, report: usize) -> Self {
        Self { socket, report, outbox: Outbox::new(), stopped_reading: false }
    }

    /// Sends without blocking.
    pub(super) fn send(&self, bytes: &[u8]) -> SendOutcome {
        match rustix::net::send(&self.socket, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => SendOutcome::Delivered,
            Err(rustix::io::Errno::PIPE | rustix::io::Errno::CONNRESET) => SendOutcome::Gone,
            Err(_) => SendOutcome::Dropped,
        }
    }

    /// Whether the kernel still holds packets that the peer has not read and may read: without `in_time` it has stopped to, until
    /// it has read everything.
    pub(super) fn may_yet_read(&mut self, in_time: bool) -> bool {
        let unread = packets::unread_bytes(self.socket.as_fd()) > 0;
        self.stopped_reading = unread && (self.stopped_reading || !in_time);
        unread && !self.stopped_reading
    }

    /// Adds a packet that must not be lost.
    pub(super) fn post(&mut self, bytes: &[u8]) {
        if self.outbox.is_full() {
            self.flush();
        }
        self.outbox.push(bytes);
    }

    /// Sends what was posted, waiting for room for as long as a member has to be done.
    pub(super) fn flush(&mut self) {
        if self.outbox.is_empty() {
            return;
        }
        while let Err(error) = self.outbox.flush(self.socket.as_fd()) {
            let timeout = Timespec { tv_sec: BARRIER_TIMEOUT.as_secs() as i64, tv_nsec: 0 };
            let full = error.kind() == io::ErrorKind::WouldBlock;
            if !full || poll(&mut [PollFd::new(&self.socket, PollFlags::OUT)], Some(&timeout)) == Ok(0) {
                // A member that is gone, or that does not read: the barrier's time-out names it.
                self.outbox.clear();
            }
        }
    }
}
