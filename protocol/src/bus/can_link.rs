//! Link to a SocketCAN interface, hardware and vcan alike.

use super::socket_peer::Link;
use socketcan::{CanSocket, Socket, SocketOptions};
use std::io;
use std::os::fd::{AsFd, OwnedFd};

/// Receive buffer asked for, in bytes: 2 000 frames of some 900 bytes with the kernel's bookkeeping.
const RECEIVE_BUFFER_BYTES: usize = 2 << 20;
/// `IFF_UP` of `<net/if.h>`.
const INTERFACE_UP: u32 = 1;

/// A SocketCAN interface by name.
pub(super) struct CanLink {
    interface: String,
}

impl CanLink {
    pub(super) fn new(interface: &str) -> Self {
        Self { interface: interface.into() }
    }

    /// A socket on an interface that is down opens without a word and then drops everything, so ask first.
    fn check_up(&self) -> io::Result<()> {
        let flags = std::fs::read_to_string(format!("/sys/class/net/{}/flags", self.interface))
            .map_err(|_| io::Error::new(io::ErrorKind::NotFound, "no such network interface"))?;
        let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).unwrap_or(INTERFACE_UP);
        if flags & INTERFACE_UP == 0 {
            return Err(io::Error::new(io::ErrorKind::NetworkDown, "the interface is down"));
        }
        Ok(())
    }
}

impl Link for CanLink {
    const HAS_BARRIER: bool = false;
    const COUNTS_OVERFLOW: bool = true;
    const REMEDY: &'static str = "make it with 'ip link add dev vcan0 type vcan' and 'ip link set vcan0 up', or use --bus unix:///PATH";

    fn connect(&self) -> io::Result<OwnedFd> {
        self.check_up()?;
        let socket = CanSocket::open(&self.interface)?;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        // The crate gives up its descriptor as a raw number only; a duplicate is the same socket, and safe.
        let socket = socket.as_fd().try_clone_to_owned()?;
        // The kernel caps this at net.core.rmem_max; a smaller buffer works, and what it loses is counted.
        let _ = rustix::net::sockopt::set_socket_recv_buffer_size(&socket, RECEIVE_BUFFER_BYTES);
        Ok(socket)
    }
}
