//! Link to a SocketCAN interface, hardware and vcan alike.

#![allow(unsafe_code)] // the ioctl SIOCGIFFLAGS, nothing else

use super::socket_peer::Link;
use socketcan::{CanSocket, Socket, SocketOptions};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};

/// Receive buffer asked for, in bytes: 2 000 frames of some 900 bytes with the kernel's bookkeeping.
const RECEIVE_BUFFER_BYTES: usize = 2 << 20;

/// A SocketCAN interface by name.
pub(super) struct CanLink(pub(super) String);

impl CanLink {
    /// A socket on an interface that is down opens without a word and then drops everything, so ask first. The socket is asked,
    /// and not /sys, where an interface of `bench can` does not stand.
    fn check_up(&self, socket: BorrowedFd<'_>) -> io::Result<()> {
        // SAFETY: a plain C structure for which all zeros is a valid value.
        let mut request: libc::ifreq = unsafe { std::mem::zeroed() };
        for (to, from) in request.ifr_name.iter_mut().zip(self.0.bytes()) {
            *to = from as libc::c_char;
        }
        // SAFETY: the kernel reads the name, which ends with a zero, and writes the flags.
        if unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS as _, &raw mut request) } != 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: the kernel has written this member.
        let flags = unsafe { request.ifr_ifru.ifru_flags };
        if i32::from(flags) & libc::IFF_UP == 0 {
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
        let socket = CanSocket::open(&self.0).map_err(|error| match error.raw_os_error() {
            Some(libc::ENODEV) => io::Error::new(io::ErrorKind::NotFound, "no such network interface"),
            _ => error,
        })?;
        self.check_up(socket.as_fd())?;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        // The crate gives up its descriptor as a raw number only; a duplicate is the same socket, and safe.
        let socket = socket.as_fd().try_clone_to_owned()?;
        // The kernel caps this at net.core.rmem_max; a smaller buffer works, and what it loses is counted.
        let _ = rustix::net::sockopt::set_socket_recv_buffer_size(&socket, RECEIVE_BUFFER_BYTES);
        Ok(socket)
    }
}
