//! Link to the embedded bus: a Unix SEQPACKET socket, one `struct can_frame` a packet; and the same socket for the bus's host.

use super::BusError;
use super::socket_peer::Link;
use super::url::{BusUrl, WireOptions};
use crate::socket_file::{SocketFile, SocketFileError};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// The embedded bus by the path of its socket.
pub(super) struct UnixLink(pub(super) PathBuf);

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
        connect(&socket, &SocketAddrUnix::new(&self.0)?)?;
        Ok(socket)
    }
}

/// The socket of the bus at `path`, for its host; `wire` is for the error's text.
pub(super) fn bind(path: &Path, wire: WireOptions) -> Result<SocketFile, BusError> {
    SocketFile::bind(path, SocketType::SEQPACKET, is_default(path)).map_err(|error| {
        let url = BusUrl::Unix { path: path.into(), wire }.to_string();
        let remedy = match &error {
            SocketFileError::Taken(lock) => return BusError::HostExists { url, lock: lock.clone() },
            SocketFileError::NotPrivate(_) => "remove that folder, or choose another with --bus unix:///PATH",
            SocketFileError::System(_) => {
                "choose a socket path in a folder that you may write, with --bus unix:///PATH"
            }
        };
        BusError::Open { url, reason: error.to_string(), remedy }
    })
}

/// The default's name can be foreseen, and in a temporary folder anybody can make it first; a folder that was named with `--bus`
/// is the user's own choice.
fn is_default(path: &Path) -> bool {
    matches!(BusUrl::default_embedded(), BusUrl::Unix { path: default, .. } if default == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_default_bus_has_the_default_folder() {
        let BusUrl::Unix { path, .. } = BusUrl::default_embedded() else { unreachable!("it is embedded") };
        assert!(is_default(&path));
        assert!(!is_default(Path::new("/somewhere/else/bus0")));
    }
}
