//! One connection to an embedded bus, for all guests of an interface.
//!
//! One for each interface and not for each socket: otherwise a guest that opens a thousand sockets would make the host of the
//! bus copy each frame a thousand times. The copies are made here, on behalf of the guests. It does not use
//! [`protocol::bus::Bus`], which drops error frames and frames that the queue does not accept; guests can ask for the former
//! and wait for the latter.

use protocol::can::CAN_FRAME_BYTES;
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, connect, recv, send,
    socket_with,
};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two attempts to connect to a bus without a host.
const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Longest packet that is read: longer than any frame.
const LONGEST_PACKET: usize = 64;

/// A frame as it crosses the bus.
pub(crate) type FrameBytes = [u8; CAN_FRAME_BYTES];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SendResult {
    /// The host accepted it.
    Accepted,
    /// The host's queue is full.
    Full,
    /// There is no host.
    Down,
}

pub(crate) struct BusPeer {
    pub(crate) path: PathBuf,
    socket: Option<OwnedFd>,
    next_attempt: Instant,
}

impl BusPeer {
    pub(crate) fn new(path: &Path) -> Self {
        Self { path: path.into(), socket: None, next_attempt: Instant::now() }
    }

    /// The socket while there is a host.
    pub(crate) fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().map(AsFd::as_fd)
    }

    /// Tries to connect to the host, if an attempt is due; true when the connection was made now.
    pub(crate) fn try_to_connect(&mut self) -> bool {
        let now = Instant::now();
        if self.socket.is_some() || now < self.next_attempt {
            return false;
        }
        self.next_attempt = now + RETRY_PERIOD;
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let connected =
            socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None).and_then(|socket| {
                // The send buffer keeps its default, some 280 frames: a longer queue to a stalled bus is of no use.
                connect(&socket, &SocketAddrUnix::new(&self.path)?)?;
                Ok(socket)
            });
        self.socket = connected.ok();
        self.socket.is_some()
    }

    pub(crate) fn send(&mut self, frame: &FrameBytes) -> SendResult {
        let Some(socket) = &self.socket else { return SendResult::Down };
        match send(socket, frame, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => SendResult::Accepted,
            Err(Errno::AGAIN | Errno::NOBUFS | Errno::INTR) => SendResult::Full,
            // The end of the connection is detected where frames are received.
            Err(_) => SendResult::Down,
        }
    }

    /// The next frame; `None` when none waits. After the end of the host [`BusPeer::socket`] is `None`.
    pub(crate) fn receive(&mut self) -> Option<FrameBytes> {
        loop {
            let mut packet = [0_u8; LONGEST_PACKET];
            match recv(self.socket.as_ref()?, &mut packet, RecvFlags::DONTWAIT | RecvFlags::TRUNC) {
                Ok((_, 0)) => self.socket = None,
                Ok((_, CAN_FRAME_BYTES)) => return packet[..CAN_FRAME_BYTES].try_into().ok(),
                // A packet of the barrier, which is for members only, or an unknown one. The socket may still hold frames sent
                // before the end of the host, which the first error reports.
                Ok(_) | Err(Errno::INTR | Errno::CONNRESET) => {}
                Err(Errno::AGAIN) => return None,
                Err(_) => self.socket = None,
            }
        }
    }
}
