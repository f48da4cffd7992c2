//! One connection to an embedded bus, for all guests of an interface.
//!
//! One, and not one for each socket: a guest that opens a thousand sockets would make the bus's host copy each frame a thousand
//! times. The copies are made here, in the guests' own time. It is no [`protocol::bus::Bus`]: that drops error frames, which a
//! guest may ask for, and frames that the queue does not take, for which a guest can wait.

use protocol::can::CAN_FRAME_BYTES;
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, connect, recv, send,
    socket_with,
};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two attempts to reach a bus that is not there.
const RETRY_PERIOD: Duration = Duration::from_millis(100);
/// Longest packet that is looked at: no frame is longer.
const LONGEST_PACKET: usize = 64;

/// A frame as it crosses the bus.
pub(crate) type FrameBytes = [u8; CAN_FRAME_BYTES];

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sent {
    /// The host has it.
    Taken,
    /// The host's queue has no room.
    Full,
    /// There is no host.
    Down,
}

/// A peer on an embedded bus.
pub(crate) struct BusPeer {
    path: PathBuf,
    socket: Option<OwnedFd>,
    next_attempt: Instant,
}

impl BusPeer {
    pub(crate) fn new(path: &Path) -> Self {
        Self { path: path.into(), socket: None, next_attempt: Instant::now() }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The socket while there is a host.
    pub(crate) fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().map(AsFd::as_fd)
    }

    /// Looks for the host, if there is none and an attempt is due; true when it has just been found.
    pub(crate) fn look_for_host(&mut self) -> bool {
        let now = Instant::now();
        if self.socket.is_some() || now < self.next_attempt {
            return false;
        }
        self.next_attempt = now + RETRY_PERIOD;
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let connected =
            socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None).and_then(|socket| {
                // The send buffer stays as the kernel makes it, some 280 frames: what waits longer for a bus that stands
                // still is of no use to anybody.
                connect(&socket, &SocketAddrUnix::new(&self.path)?)?;
                Ok(socket)
            });
        self.socket = connected.ok();
        self.socket.is_some()
    }

    pub(crate) fn send(&mut self, frame: &FrameBytes) -> Sent {
        let Some(socket) = &self.socket else { return Sent::Down };
        match send(socket, frame, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => Sent::Taken,
            Err(Errno::AGAIN | Errno::NOBUFS | Errno::INTR) => Sent::Full,
            // Its end is read where frames are received.
            Err(_) => Sent::Down,
        }
    }

    /// The next frame; `None` when none waits. Tells by [`BusPeer::socket`] when the host has gone.
    pub(crate) fn receive(&mut self) -> Option<FrameBytes> {
        loop {
            let mut packet = [0_u8; LONGEST_PACKET];
            match recv(self.socket.as_ref()?, &mut packet, RecvFlags::DONTWAIT | RecvFlags::TRUNC) {
                Ok((_, 0)) => self.socket = None,
                Ok((_, CAN_FRAME_BYTES)) => return packet[..CAN_FRAME_BYTES].try_into().ok(),
                // A packet of the barrier, which is for members only, or nothing that we know. The host may still hold frames
                // that were sent before its end, which the first error tells of.
                Ok(_) | Err(Errno::INTR | Errno::CONNRESET) => {}
                Err(Errno::AGAIN) => return None,
                Err(_) => self.socket = None,
            }
        }
    }
}
