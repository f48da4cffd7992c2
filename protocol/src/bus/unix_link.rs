//! Link to the embedded bus: a Unix SEQPACKET socket, one `struct can_frame` a packet.

use super::socket_peer::Link;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// The embedded bus by the path of its socket.
pub(super) struct UnixLink {
    path: PathBuf,
}

impl UnixLink {
    pub(super) fn new(path: &Path) -> Self {
        Self { path: path.into() }
    }
}

impl Link for UnixLink {
    const HAS_BARRIER: bool = true;
    const COUNTS_OVERFLOW: bool = false;
    const REMEDY: &'static str = "start 'emulator run' or 'emulator bus' on it first";

    fn connect(&self) -> io::Result<OwnedFd> {
        let socket = socket_with(
            AddressFamily::UNIX,
            SocketType::SEQPACKET,
            SocketFlags::CLOEXEC | SocketFlags::NONBLOCK,
            None,
        )?;
        connect(&socket, &SocketAddrUnix::new(&self.path)?)?;
        Ok(socket)
    }
}
