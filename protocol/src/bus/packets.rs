//! Packets from and to a socket in batches, with what the kernel knows of each: arrival time, whether we sent it, lost packets.
//!
//! `socketcan` 4.0 drops the overflow count and the message flags, rustix does not know these control messages; a
//! small `recvmmsg` keeps them. The arrival stamp matters: a command is latched by when it *arrived*, not by when a
//! late loop came round to read it. Batches matter too: one system call empties a queue and knows that it is empty.
//!
//! The kernel stamps arrivals by the wall clock, which may be stepped at any time. [`arrival_ns`] converts a stamp to the
//! monotonic clock by the offset of the clocks, now or at the last batch: the one that puts the arrival between the time at
//! which the queue was last seen empty and now.
//!
//! Source: `socket(7)` (SO_TIMESTAMPNS, SO_RXQ_OVFL), `recvmmsg(2)`, Linux Documentation/networking/can.rst (MSG_CONFIRM).

#![allow(unsafe_code)] // recvmmsg, sendmmsg, setsockopt and the ioctl SIOCOUTQ, nothing else

use rustix::time::{ClockId, clock_gettime};
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd};

/// Longest packet that is looked at; anything longer is malformed whatever it holds.
pub(super) const LONGEST_PACKET: usize = 64;
/// Packets that one system call moves at most.
pub(super) const BATCH: usize = 16;
/// Room for the control messages of one packet, in words: a timespec and a u32 with their headers take 56 bytes.
const CONTROL_WORDS: usize = 8;

/// A packet as the kernel handed it over.
#[derive(Clone, Copy)]
pub(super) struct Packet {
    pub(super) bytes: [u8; LONGEST_PACKET],
    pub(super) len: usize,
    /// When the packet arrived, in ns of the clock that [`Inbox::fill`] was given.
    pub(super) stamp_ns: u64,
    /// Packets dropped at this socket's queue so far, modulo 2^32; only SocketCAN reports it.
    pub(super) overflow: Option<u32>,
    /// Whether we sent this packet ourselves.
    pub(super) sent_here: bool,
}

const NO_PACKET: Packet =
    Packet { bytes: [0; LONGEST_PACKET], len: 0, stamp_ns: 0, overflow: None, sent_here: false };

/// Whether a call may sleep until a packet comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wait {
    /// Return at once.
    No,
    /// Sleep for as long as the socket's receive time-out allows.
    UntilTimeout,
}

/// Packets that were received together and are taken one by one.
pub(super) struct Inbox {
    packets: [Packet; BATCH],
    count: usize,
    next: usize,
    newest_ns: u64,
    clocks: Clocks,
}

impl Inbox {
    pub(super) const fn new() -> Self {
        Self { packets: [NO_PACKET; BATCH], count: 0, next: 0, newest_ns: 0, clocks: Clocks::NEW }
    }

    /// The next batch is of another queue, which was last seen empty at `empty_ns` of the monotonic clock, if that is known.
    pub(super) fn begin_another_queue(&mut self, empty_ns: Option<u64>) {
        (self.newest_ns, self.clocks.empty_ns) = (0, empty_ns);
    }

    /// The oldest packet not yet taken. A packet of length 0 says that the peer is gone.
    pub(super) fn take(&mut self) -> Option<Packet> {
        let packet = self.packets[..self.count].get(self.next)?;
        self.next += 1;
        Some(*packet)
    }

    /// Whether everything was taken.
    pub(super) fn is_empty(&self) -> bool {
        self.next == self.count
    }

    /// Forgets what was not taken.
    pub(super) fn clear(&mut self) {
        (self.count, self.next) = (0, 0);
    }

    /// Whether the last batch was smaller than it could be: then the socket's queue was empty.
    pub(super) fn emptied_the_queue(&self) -> bool {
        self.count < BATCH
    }

    /// Receives the next batch; what was not taken of the last one is gone. `clock` gives the time of what happened so many
    /// ns ago.
    ///
    /// # Errors
    /// The error of `recvmmsg`; `WouldBlock` when nothing waits.
    pub(super) fn fill(
        &mut self,
        socket: BorrowedFd<'_>,
        wait: Wait,
        clock: &dyn Fn(u64) -> u64,
    ) -> io::Result<()> {
        (self.count, self.next) = (0, 0);
        let mut control = [[0_u64; CONTROL_WORDS]; BATCH];
        // SAFETY: iovec and mmsghdr are plain C structs for which all zeros is a valid value.
        let mut parts: [libc::iovec; BATCH] = unsafe { std::mem::zeroed() };
        // SAFETY: as above.
        let mut headers: [libc::mmsghdr; BATCH] = unsafe { std::mem::zeroed() };
        for (index, header) in headers.iter_mut().enumerate() {
            let bytes = self.packets[index].bytes.as_mut_ptr().cast();
            parts[index] = libc::iovec { iov_base: bytes, iov_len: LONGEST_PACKET };
            header.msg_hdr.msg_iov = &raw mut parts[index];
            header.msg_hdr.msg_iovlen = 1;
            header.msg_hdr.msg_control = control[index].as_mut_ptr().cast();
            header.msg_hdr.msg_controllen = size_of_val(&control[index]);
        }
        let flags = if wait == Wait::No { libc::MSG_DONTWAIT } else { libc::MSG_WAITFORONE };
        let mut take = || {
            // SAFETY: each header points to a part and a control buffer that outlive the call and have the sizes given.
            unsafe {
                libc::recvmmsg(
                    socket.as_raw_fd(),
                    headers.as_mut_ptr(),
                    BATCH as libc::c_uint,
                    flags,
                    std::ptr::null_mut(),
                )
            }
        };
        let began_ns = ns_of(ClockId::Monotonic);
        let mut count = take();
        // The kernel reports first, and once, that the other end closed with packets unread; what it had sent comes after.
        if count < 0 && io::Error::last_os_error().raw_os_error() == Some(libc::ECONNRESET) {
            count = take();
        }
        let taken = usize::try_from(count).map_err(|_| io::Error::last_os_error());
        self.count = *taken.as_ref().unwrap_or(&0);
        if self.count > 0 {
            self.clocks.read();
        }
        for (packet, header) in self.packets.iter_mut().zip(&headers[..self.count]) {
            // SAFETY: the kernel has just filled this header and the control buffer that it points to.
            let arrived = unsafe { note(packet, header) };
            // The queue is in order of arrival; so are its stamps, whatever the two clocks of a stamp did.
            let arrived_ns = arrived.map(|arrived| self.clocks.arrival_ns(arrived));
            packet.stamp_ns = stamp_of(arrived_ns, clock).max(self.newest_ns);
            self.newest_ns = packet.stamp_ns;
        }
        if self.emptied_the_queue() {
            self.clocks.empty_ns = Some(began_ns);
        }
        taken.map(drop)
    }
}

/// Notes what the kernel said of one received packet, whose bytes are in place; returns its stamp of the wall clock.
///
/// # Safety
/// `header` was filled by `recvmmsg`, and its control buffer is alive.
unsafe fn note(packet: &mut Packet, header: &libc::mmsghdr) -> Option<libc::timespec> {
    let truncated = header.msg_hdr.msg_flags & libc::MSG_TRUNC != 0;
    // A truncated packet is longer than any we know; saying so by its length makes it malformed.
    packet.len = if truncated { LONGEST_PACKET } else { header.msg_len as usize };
    packet.sent_here = header.msg_hdr.msg_flags & libc::MSG_CONFIRM != 0;
    packet.overflow = None;
    let mut arrived = None;
    // SAFETY: the CMSG macros walk the control buffer within msg_controllen; each payload is read unaligned with the type
    // that its level and kind define.
    unsafe {
        let mut message = libc::CMSG_FIRSTHDR(&raw const header.msg_hdr);
        while !message.is_null() {
            match ((*message).cmsg_level, (*message).cmsg_type) {
                (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                    arrived = Some(libc::CMSG_DATA(message).cast::<libc::timespec>().read_unaligned());
                }
                (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => {
                    packet.overflow = Some(libc::CMSG_DATA(message).cast::<u32>().read_unaligned());
                }
                _ => {}
            }
            message = libc::CMSG_NXTHDR(&raw const header.msg_hdr, message);
        }
    }
    arrived
}

/// Two clocks that are read one after the other are read again when that took longer: their distance would be wrong by as much.
const LONGEST_READING_NS: u64 = 20_000;
/// Times that it is tried at most.
const READINGS: usize = 4;

/// Readings of the wall clock and the monotonic clock, from which stamps are converted.
struct Clocks {
    /// Wall clock less monotonic clock: now, and when the last batch was taken, ns.
    offsets_ns: [i64; 2],
    /// The monotonic clock now, ns.
    now_ns: u64,
    /// When the queue was last seen empty, by the monotonic clock, ns.
    empty_ns: Option<u64>,
}

impl Clocks {
    const NEW: Self = Self { offsets_ns: [0; 2], now_ns: 0, empty_ns: None };

    fn read(&mut self) {
        let before_ns = self.offsets_ns[0];
        for _ in 0..READINGS {
            let began_ns = ns_of(ClockId::Monotonic);
            let wall_ns = ns_of(ClockId::Realtime);
            self.now_ns = ns_of(ClockId::Monotonic);
            self.offsets_ns[0] = wall_ns as i64 - self.now_ns as i64;
            if self.now_ns - began_ns < LONGEST_READING_NS {
                break;
            }
        }
        self.offsets_ns[1] = before_ns;
    }

    fn arrival_ns(&self, stamp: libc::timespec) -> u64 {
        let stamp_ns = stamp.tv_sec * 1_000_000_000 + stamp.tv_nsec;
        arrival_ns(stamp_ns, self.offsets_ns, self.empty_ns, self.now_ns)
    }
}

pub(super) fn ns_of(clock: ClockId) -> u64 {
    let now = clock_gettime(clock);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// When a packet arrived by the monotonic clock, which stands at `now_ns`: its `stamp_ns` of the wall clock less the
/// `offsets_ns` of that clock, the newest first, whichever puts it between the time in which the queue was last seen empty
/// and now. A queue never seen empty may hold a packet for a second. When none does, it is taken as if it had not been
/// stamped: it arrived now.
///
/// Of a step that is shorter than the time since the queue was empty both offsets may be plausible; then the stamp is wrong
/// by the step at most, and still within that time.
fn arrival_ns(stamp_ns: i64, offsets_ns: [i64; 2], empty_ns: Option<u64>, now_ns: u64) -> u64 {
    const LONGEST_CREDIBLE_NS: u64 = 1_000_000_000;
    let since_ns = empty_ns.unwrap_or(now_ns.saturating_sub(LONGEST_CREDIBLE_NS));
    let slack_ns = LONGEST_READING_NS as i64;
    let plausible = since_ns as i64 - slack_ns..=now_ns as i64 + slack_ns;
    let arrivals = offsets_ns.map(|offset_ns| stamp_ns.saturating_sub(offset_ns));
    let arrived = arrivals.into_iter().find(|arrival_ns| plausible.contains(arrival_ns));
    arrived.map_or(now_ns, |arrived_ns| (arrived_ns.max(0) as u64).clamp(since_ns, now_ns))
}

/// A time of the monotonic clock by `clock`; now for what has none. A thread that is held up between reading the one and the
/// other would stamp the packet too late, so a reading that took long is made again.
fn stamp_of(arrived_ns: Option<u64>, clock: &dyn Fn(u64) -> u64) -> u64 {
    let Some(arrived_ns) = arrived_ns else { return clock(0) };
    let mut stamp_ns = 0;
    for _ in 0..READINGS {
        let began_ns = clock(0);
        stamp_ns = clock(ns_of(ClockId::Monotonic).saturating_sub(arrived_ns));
        if clock(0).saturating_sub(began_ns) < LONGEST_READING_NS {
            break;
        }
    }
    stamp_ns
}

/// Packets that leave together.
pub(super) struct Outbox {
    packets: [([u8; LONGEST_PACKET], usize); BATCH],
    count: usize,
    sent: usize,
}

impl Outbox {
    pub(super) const fn new() -> Self {
        Self { packets: [([0; LONGEST_PACKET], 0); BATCH], count: 0, sent: 0 }
    }

    /// Whether the next packet needs a [`Outbox::flush`] first.
    pub(super) fn is_full(&self) -> bool {
        self.count == BATCH
    }

    /// Adds a packet of at most [`LONGEST_PACKET`] bytes.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        let (slot, len) = &mut self.packets[self.count];
        slot[..bytes.len()].copy_from_slice(bytes);
        *len = bytes.len();
        self.count += 1;
    }

    /// Whether nothing waits to be sent.
    pub(super) fn is_empty(&self) -> bool {
        self.count == self.sent
    }

    /// Forgets what waits.
    pub(super) fn clear(&mut self) {
        (self.count, self.sent) = (0, 0);
    }

    /// Sends all packets; the outbox is empty afterwards.
    ///
    /// # Errors
    /// The error of `sendmmsg`, `WouldBlock` for a full queue; frames that it did not take wait for the next call.
    pub(super) fn flush(&mut self, socket: BorrowedFd<'_>) -> io::Result<()> {
        let count = self.count;
        // SAFETY: iovec and mmsghdr are plain C structs for which all zeros is a valid value.
        let mut parts: [libc::iovec; BATCH] = unsafe { std::mem::zeroed() };
        // SAFETY: as above.
        let mut headers: [libc::mmsghdr; BATCH] = unsafe { std::mem::zeroed() };
        for (index, header) in headers[..count].iter_mut().enumerate() {
            let (bytes, len) = &mut self.packets[index];
            parts[index] = libc::iovec { iov_base: bytes.as_mut_ptr().cast(), iov_len: *len };
            header.msg_hdr.msg_iov = &raw mut parts[index];
            header.msg_hdr.msg_iovlen = 1;
        }
        while self.sent < count {
            let rest = &mut headers[self.sent..count];
            // SAFETY: each header points to a part whose bytes outlive the call.
            let taken = unsafe {
                libc::sendmmsg(
                    socket.as_raw_fd(),
                    rest.as_mut_ptr(),
                    rest.len() as libc::c_uint,
                    libc::MSG_NOSIGNAL,
                )
            };
            match usize::try_from(taken) {
                Ok(taken) => self.sent += taken,
                Err(_) => match io::Error::last_os_error() {
                    error if error.kind() == io::ErrorKind::Interrupted => {}
                    error => return Err(error),
                },
            }
        }
        self.clear();
        Ok(())
    }
}

/// Asks the kernel to stamp arrivals and to count what it drops.
pub(super) fn enable_stamps(socket: BorrowedFd<'_>, count_overflow: bool) -> io::Result<()> {
    set_flag(socket, libc::SO_TIMESTAMPNS)?;
    if count_overflow {
        set_flag(socket, libc::SO_RXQ_OVFL)?;
    }
    Ok(())
}

/// Bytes, as the kernel accounts for them, sent through this Unix socket and not yet read; 0 when the other end is gone.
pub(super) fn unread_bytes(socket: BorrowedFd<'_>) -> usize {
    let mut bytes: libc::c_int = 0;
    // SAFETY: SIOCOUTQ (the number of TIOCOUTQ) writes one int, and the descriptor is open.
    let result = unsafe { libc::ioctl(socket.as_raw_fd(), libc::TIOCOUTQ, &raw mut bytes) };
    if result == 0 { bytes.unsigned_abs() as usize } else { 0 }
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

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::net::{AddressFamily, SendFlags, SocketFlags, SocketType, send, socketpair};
    use std::os::fd::{AsFd, OwnedFd};

    fn pair() -> (OwnedFd, OwnedFd) {
        socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::empty(), None).unwrap()
    }

    #[test]
    fn a_unix_packet_carries_its_age() {
        let (ours, theirs) = pair();
        enable_stamps(ours.as_fd(), false).unwrap();
        send(&theirs, &[7; 16], SendFlags::empty()).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(3));
        let mut inbox = Inbox::new();
        inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        let packet = inbox.take().unwrap();
        assert_eq!((packet.len, packet.bytes[15]), (16, 7));
        // Slept 3 ms since; sleep never returns early, so 2 ms leaves room for clock granularity alone.
        assert!(packet.stamp_ns > 2_000_000, "the clock of this test tells the age itself");
    }

    /// The machine has run for 100 s; the queue was empty 1 ms ago; the packet arrived 0.4 ms ago.
    #[test]
    fn a_step_of_the_wall_clock_changes_no_arrival() {
        const MS: i64 = 1_000_000;
        let (now_ns, offset) = (100_000 * MS, 1_700_000_000_000 * MS);
        let arrived_ns = now_ns - 400_000;
        let empty = Some((now_ns - MS) as u64);
        for step in [0, 500 * MS, -500 * MS, 5_000 * MS, -5_000 * MS, 2 * MS, -2 * MS] {
            // Stamped before the step, and after it.
            for stamp in [arrived_ns + offset, arrived_ns + offset + step] {
                let arrival = arrival_ns(stamp, [offset + step, offset], empty, now_ns as u64);
                assert_eq!(arrival, arrived_ns as u64, "step {step} ns");
            }
        }
        // A queue of which nothing is known: right as long as the clock was not set.
        let known_ns = arrival_ns(arrived_ns + offset, [offset; 2], None, now_ns as u64);
        assert_eq!(known_ns, arrived_ns as u64);
        // Neither offset fits, after two steps: as if not stamped.
        let lost_ns = arrival_ns(arrived_ns, [offset, offset + MS], empty, now_ns as u64);
        assert_eq!(lost_ns, now_ns as u64);
        // It waited for five seconds, which a process that was stopped lets happen.
        let long_ago = Some((now_ns - 6_000 * MS) as u64);
        let waited_ns = arrival_ns(now_ns - 5_000 * MS + offset, [offset; 2], long_ago, now_ns as u64);
        assert_eq!(waited_ns, (now_ns - 5_000 * MS) as u64);
    }

    #[test]
    fn batches_keep_number_order_and_length() {
        let (ours, theirs) = pair();
        let (mut outbox, mut inbox) = (Outbox::new(), Inbox::new());
        for len in 1..=BATCH {
            outbox.push(&vec![len as u8; len]);
        }
        assert!(outbox.is_full());
        outbox.flush(theirs.as_fd()).unwrap();
        send(&theirs, &[99], SendFlags::empty()).unwrap();

        inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        assert!(!inbox.emptied_the_queue(), "one more waits");
        for len in 1..=BATCH {
            let packet = inbox.take().unwrap();
            assert_eq!((packet.len, packet.bytes[len - 1]), (len, len as u8));
        }
        assert!(inbox.take().is_none());
        inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        assert!(inbox.emptied_the_queue());
        assert_eq!(inbox.take().unwrap().bytes[0], 99);
    }

    #[test]
    fn a_packet_too_long_keeps_a_length_that_nothing_accepts() {
        let (ours, theirs) = pair();
        send(&theirs, &[0; 100], SendFlags::empty()).unwrap();
        let mut inbox = Inbox::new();
        inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        assert_eq!(inbox.take().unwrap().len, LONGEST_PACKET);
    }

    #[test]
    fn an_empty_queue_would_block_and_a_closed_one_has_length_zero() {
        let (ours, theirs) = pair();
        let mut inbox = Inbox::new();
        assert_eq!(
            inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap_err().kind(),
            io::ErrorKind::WouldBlock
        );
        drop(theirs);
        inbox.fill(ours.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        assert_eq!(inbox.take().unwrap().len, 0);
    }

    #[test]
    fn what_the_other_end_has_not_read_is_known() {
        let (ours, theirs) = pair();
        assert_eq!(unread_bytes(ours.as_fd()), 0);
        send(&ours, &[7; 16], SendFlags::empty()).unwrap();
        assert!(unread_bytes(ours.as_fd()) >= 16);
        let mut inbox = Inbox::new();
        inbox.fill(theirs.as_fd(), Wait::No, &|age_ns| age_ns).unwrap();
        assert_eq!(unread_bytes(ours.as_fd()), 0);
        send(&ours, &[7; 16], SendFlags::empty()).unwrap();
        drop(theirs);
        assert_eq!(unread_bytes(ours.as_fd()), 0);
    }
}
