//! One packet from a socket, with what the kernel knows of it: arrival time, own echo, lost packets.
//!
//! `socketcan` 4.0 drops the overflow count and the message flags, rustix does not know these control messages; a
//! small `recvmsg` keeps them. The arrival stamp matters: a command is latched by when it *arrived*, not by when a
//! late loop came round to read it.
//!
//! Source: `socket(7)` (SO_TIMESTAMPNS, SO_RXQ_OVFL), Linux Documentation/networking/can.rst (MSG_CONFIRM).

#![allow(unsafe_code)] // recvmsg and setsockopt, nothing else

use std::io;
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{SystemTime, UNIX_EPOCH};

/// Longest packet that is looked at; anything longer is malformed whatever it holds.
pub(super) const LONGEST_PACKET: usize = 64;

/// A packet as the kernel handed it over.
pub(super) struct Packet {
    pub(super) bytes: [u8; LONGEST_PACKET],
    pub(super) len: usize,
    /// How long ago the packet arrived, in ns; `None` when the kernel did not stamp it.
    pub(super) age_ns: Option<u64>,
    /// Packets dropped at this socket's queue so far, modulo 2^32; only SocketCAN tells.
    pub(super) overflow: Option<u32>,
    /// Whether we sent this packet ourselves.
    pub(super) own_echo: bool,
}

/// Asks the kernel to stamp arrivals and to count what it drops.
pub(super) fn enable_stamps(socket: BorrowedFd<'_>, count_overflow: bool) -> io::Result<()> {
    set_flag(socket, libc::SO_TIMESTAMPNS)?;
    if count_overflow {
        set_flag(socket, libc::SO_RXQ_OVFL)?;
    }
    Ok(())
}

fn set_flag(socket: BorrowedFd<'_>, option: libc::c_int) -> io::Result<()> {
    let on: libc::c_int = 1;
    // SAFETY: the descriptor is borrowed for the call, and the value's size is that of the c_int it points to.
    let result = unsafe {
        libc::setsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            option,
            (&raw const on).cast(),
            size_of::<libc::c_int>() as libc::socklen_t,
        )
    };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Whether a call may sleep until a packet comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wait {
    /// Return at once.
    No,
    /// Sleep for as long as the socket's receive time-out allows.
    UntilTimeout,
}

/// Takes one packet.
///
/// # Errors
/// What `recvmsg` says; `WouldBlock` when nothing waits. A closed peer is a packet of length 0.
pub(super) fn receive(socket: BorrowedFd<'_>, wait: Wait) -> io::Result<Packet> {
    let mut packet =
        Packet { bytes: [0; LONGEST_PACKET], len: 0, age_ns: None, overflow: None, own_echo: false };
    // Aligned for cmsghdr; holds a timespec and a u32 with their headers and room to spare.
    let mut control = [0_u64; 16];
    let mut part = libc::iovec { iov_base: packet.bytes.as_mut_ptr().cast(), iov_len: LONGEST_PACKET };
    // SAFETY: msghdr is a plain C struct for which all zeros is a valid value.
    let mut header: libc::msghdr = unsafe { std::mem::zeroed() };
    header.msg_iov = &raw mut part;
    header.msg_iovlen = 1;
    header.msg_control = control.as_mut_ptr().cast();
    header.msg_controllen = size_of_val(&control);
    let flags = if wait == Wait::No { libc::MSG_DONTWAIT } else { 0 };
    // SAFETY: header points to `part` and `control`, which outlive the call and have the sizes given.
    let count = unsafe { libc::recvmsg(socket.as_raw_fd(), &raw mut header, flags) };
    if count < 0 {
        return Err(io::Error::last_os_error());
    }
    // A truncated packet is longer than any we know; saying so by its length makes it malformed.
    packet.len = if header.msg_flags & libc::MSG_TRUNC != 0 { LONGEST_PACKET } else { count as usize };
    packet.own_echo = header.msg_flags & libc::MSG_CONFIRM != 0;
    // SAFETY: the CMSG macros walk the control buffer that recvmsg just filled, within msg_controllen; each payload is
    // read unaligned with the type that its level and kind define.
    unsafe {
        let mut message = libc::CMSG_FIRSTHDR(&raw const header);
        while !message.is_null() {
            match ((*message).cmsg_level, (*message).cmsg_type) {
                (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                    let stamp = libc::CMSG_DATA(message).cast::<libc::timespec>().read_unaligned();
                    packet.age_ns = Some(age_ns(stamp));
                }
                (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => {
                    packet.overflow = Some(libc::CMSG_DATA(message).cast::<u32>().read_unaligned());
                }
                _ => {}
            }
            message = libc::CMSG_NXTHDR(&raw const header, message);
        }
    }
    Ok(packet)
}

/// How long before now `stamp` of the wall clock was, in ns. A wall clock that was stepped in between can make a
/// stamp lie in the future or far in the past: then the age is 0, as if the packet had not been stamped.
fn age_ns(stamp: libc::timespec) -> u64 {
    const LONGEST_CREDIBLE_NS: u128 = 1_000_000_000;
    let arrived = stamp.tv_sec as u128 * 1_000_000_000 + stamp.tv_nsec as u128;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let age = now.saturating_sub(arrived);
    if age > LONGEST_CREDIBLE_NS { 0 } else { age as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::net::{AddressFamily, SendFlags, SocketFlags, SocketType, send, socketpair};
    use std::os::fd::AsFd;

    fn pair() -> (std::os::fd::OwnedFd, std::os::fd::OwnedFd) {
        socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::empty(), None).unwrap()
    }

    #[test]
    fn a_unix_packet_carries_its_age() {
        let (ours, theirs) = pair();
        enable_stamps(ours.as_fd(), false).unwrap();
        send(&theirs, &[7; 16], SendFlags::empty()).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(3));
        let packet = receive(ours.as_fd(), Wait::No).unwrap();
        assert_eq!((packet.len, packet.bytes[15]), (16, 7));
        // Slept 3 ms since; sleep never returns early, so 2 ms leaves room for clock granularity alone.
        assert!(packet.age_ns.unwrap() > 2_000_000);
    }

    #[test]
    fn a_packet_too_long_keeps_a_length_that_nothing_accepts() {
        let (ours, theirs) = pair();
        send(&theirs, &[0; 100], SendFlags::empty()).unwrap();
        assert_eq!(receive(ours.as_fd(), Wait::No).unwrap().len, LONGEST_PACKET);
    }

    #[test]
    fn an_empty_queue_would_block() {
        let (ours, _theirs) = pair();
        let error = receive(ours.as_fd(), Wait::No).err().unwrap();
        assert_eq!(error.kind(), io::ErrorKind::WouldBlock);
    }
}
