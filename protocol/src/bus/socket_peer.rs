//! A peer on any bus that is a packet socket: sends, receives, counts, and comes back when the bus does.
//!
//! When the bus goes, frames are dropped and counted, and the peer tries to open it again ten times a second; what
//! was dropped meanwhile is never sent later. Neither sending nor receiving blocks or allocates while the bus is up.

use super::control::{CONTROL_BYTES, Control, Kind, Role};
use super::packets::{self, Inbox, Outbox, Packet, Wait};
use super::url::BusUrl;
use super::{Bus, BusCounters, BusError, FrameSink, Received, SendError, StampClock};
use crate::can::{CAN_FRAME_BYTES, CanFrame, ERROR_FLAG};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::sockopt::Timeout;
use rustix::net::{SendFlags, send};
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::{Duration, Instant};

/// How a kind of bus opens its socket.
pub(super) trait Link: Send {
    /// Whether the embedded bus's barrier can be joined through this link.
    const HAS_BARRIER: bool;
    /// Whether the kernel counts what it drops at the receive queue.
    const COUNTS_OVERFLOW: bool;
    /// Remedy for a person when opening fails.
    const REMEDY: &'static str;

    /// Opens a non-blocking socket to the bus.
    fn connect(&self) -> io::Result<OwnedFd>;
}

/// Time between two attempts to open a bus that is gone.
const RETRY_PERIOD: Duration = Duration::from_millis(100);

/// Receive time-out of a member of the barrier.
const BARRIER_PATIENCE: Duration = Duration::from_millis(50);

/// A peer on a bus that is a packet socket.
pub(super) struct SocketPeer<L> {
    link: L,
    url: String,
    clock: StampClock,
    socket: Option<OwnedFd>,
    /// False from the moment the system says the network is down until a packet passes again.
    usable: bool,
    ever_up: bool,
    /// When the bus was last lost, by the bus's clock: what arrived before says nothing of its return.
    lost_ns: u64,
    next_attempt: Instant,
    /// Takes nothing more and does not come back.
    left: bool,
    joined: Option<Control>,
    inbox: Inbox,
    drained: bool,
    /// What a member of the barrier posts; it leaves with its `done`.
    outbox: Outbox,
    overflow_seen: u32,
    counters: BusCounters,
}

impl<L: Link> SocketPeer<L> {
    pub(super) fn open(link: L, url: &BusUrl, clock: StampClock) -> Result<Self, BusError> {
        let mut peer = Self::new(link, url, clock);
        match peer.connect() {
            Ok(()) => Ok(peer),
            Err(error) => Err(BusError::Open { url: peer.url, reason: error.to_string(), remedy: L::REMEDY }),
        }
    }

    /// Opens the bus now if it is there, else keeps trying.
    pub(super) fn lazy(link: L, url: &BusUrl, clock: StampClock) -> Self {
        let mut peer = Self::new(link, url, clock);
        peer.try_again();
        peer
    }

    fn new(link: L, url: &BusUrl, clock: StampClock) -> Self {
        Self {
            link,
            url: url.to_string(),
            clock,
            socket: None,
            usable: false,
            ever_up: false,
            lost_ns: 0,
            next_attempt: Instant::now(),
            left: false,
            joined: None,
            inbox: Inbox::new(),
            drained: false,
            outbox: Outbox::new(),
            overflow_seen: 0,
            counters: BusCounters::default(),
        }
    }

    fn connect(&mut self) -> io::Result<()> {
        let socket = self.link.connect()?;
        packets::enable_stamps(socket.as_fd(), L::COUNTS_OVERFLOW)?;
        if let Some(join) = self.joined {
            enter_barrier(&socket, &join)?;
        }
        self.socket = Some(socket);
        // What the old connection left unread, its end above all, is none of the new one's.
        self.inbox.clear();
        self.drained = false;
        self.overflow_seen = 0;
        if self.ever_up {
            self.counters.reconnects += 1;
        }
        (self.usable, self.ever_up) = (true, true);
        Ok(())
    }

    /// Opens a bus that is gone, if an attempt is due.
    fn try_again(&mut self) {
        if self.left || self.socket.is_some() {
            return;
        }
        let now = Instant::now();
        if now >= self.next_attempt && self.connect().is_err() {
            self.next_attempt = now + RETRY_PERIOD;
        }
    }

    fn went_away(&mut self, error: rustix::io::Errno) {
        if self.usable {
            self.counters.disconnects += 1;
            self.lost_ns = (self.clock)(0);
        }
        self.usable = false;
        self.outbox.clear();
        // An interface that is merely down keeps its socket; one that is gone, or a host that is, needs a new one. A host that
        // takes no more may have delivered something: it is read first, and its end after it.
        if !matches!(error, rustix::io::Errno::NETDOWN | rustix::io::Errno::PIPE) {
            self.socket = None;
            self.next_attempt = Instant::now() + RETRY_PERIOD;
        }
    }

    fn passed(&mut self) {
        if !self.usable {
            self.usable = true;
            self.counters.reconnects += 1;
        }
    }

    fn sort(&mut self, packet: &Packet) -> Option<Received> {
        if let Some(overflow) = packet.overflow {
            self.counters.dropped_on_receive += u64::from(overflow.wrapping_sub(self.overflow_seen));
            self.overflow_seen = overflow;
        }
        if packet.sent_here {
            return None;
        }
        if packet.len == CONTROL_BYTES
            && self.joined.is_some()
            && let Some(control) = Control::from_bytes(&packet.bytes[..CONTROL_BYTES])
        {
            return Some(Received::Barrier(control));
        }
        let frame = packet.bytes[..packet.len]
            .try_into()
            .ok()
            .and_then(|bytes: &[u8; CAN_FRAME_BYTES]| CanFrame::from_bytes(bytes));
        match frame {
            Some(frame) if frame.raw_id() & ERROR_FLAG != 0 => {
                self.counters.error_frames += 1;
                None
            }
            Some(frame) => {
                self.counters.received += 1;
                self.counters.received_by_id.count(&frame);
                Some(Received::Frame(frame, packet.stamp_ns))
            }
            None => {
                self.counters.malformed += 1;
                None
            }
        }
    }

    /// Receives the next batch; false when there is none.
    fn fill(&mut self) -> bool {
        self.try_again();
        let Some(socket) = &self.socket else { return false };
        let wait = if self.joined.is_some() { Wait::UntilTimeout } else { Wait::No };
        let Err(error) = self.inbox.fill(socket.as_fd(), wait, &self.clock) else { return true };
        match rustix::io::Errno::from_io_error(&error) {
            Some(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) | None => {}
            Some(errno) => self.went_away(errno),
        }
        false
    }

    /// Sends a member's packets.
    fn flush(&mut self) -> Result<(), SendError> {
        let Some(socket) = &self.socket else { return Err(SendError::Down) };
        self.outbox.flush(socket.as_fd()).map_err(|error| {
            self.went_away(rustix::io::Errno::from_io_error(&error).unwrap_or(rustix::io::Errno::IO));
            SendError::Down
        })
    }

    /// Posts a member's packet; while the bus is down it is dropped, so that nothing old is sent later.
    fn post(&mut self, bytes: &[u8]) -> Result<(), SendError> {
        self.try_again();
        if self.socket.is_none() {
            return Err(SendError::Down);
        }
        if self.outbox.is_full() {
            self.flush()?;
        }
        self.outbox.push(bytes);
        Ok(())
    }

    fn send_packet(&mut self, bytes: &[u8]) -> Result<(), SendError> {
        self.try_again();
        let Some(socket) = &self.socket else { return Err(SendError::Down) };
        match send(socket, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => {
                self.passed();
                Ok(())
            }
            Err(rustix::io::Errno::NOBUFS | rustix::io::Errno::AGAIN) => Err(SendError::QueueFull),
            Err(error) => {
                self.went_away(error);
                Err(SendError::Down)
            }
        }
    }
}

/// Joins the barrier. From then on a peer does nothing but wait for its turn, so its receiving sleeps in the kernel:
/// one system call in place of three.
fn enter_barrier(socket: &OwnedFd, join: &Control) -> rustix::io::Result<()> {
    rustix::io::ioctl_fionbio(socket, false)?;
    rustix::net::sockopt::set_socket_timeout(socket, Timeout::Recv, Some(BARRIER_PATIENCE))?;
    send(socket, &join.to_bytes(), SendFlags::DONTWAIT).map(drop)
}

impl<L: Link> FrameSink for SocketPeer<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError> {
        let bytes = frame.to_bytes();
        // Before the frame leaves: a host of higher priority may run, and its answer arrive, before the call returns.
        let handed_over_ns = (self.clock)(0);
        let result = if self.joined.is_some() { self.post(&bytes) } else { self.send_packet(&bytes) };
        match result {
            Ok(()) => {
                self.counters.sent += 1;
                self.counters.sent_by_id.count(frame);
            }
            Err(_) => {
                self.counters.dropped_on_send += 1;
                self.counters.dropped_on_send_by_id.count(frame);
            }
        }
        result.map(|()| handed_over_ns)
    }
}

impl<L: Link> Bus for SocketPeer<L> {
    fn receive(&mut self) -> Received {
        loop {
            while let Some(packet) = self.inbox.take() {
                if packet.len == 0 {
                    if !self.left {
                        self.went_away(rustix::io::Errno::CONNRESET);
                    }
                    return Received::Nothing;
                }
                if packet.stamp_ns > self.lost_ns {
                    self.passed();
                }
                if let Some(received) = self.sort(&packet) {
                    return received;
                }
            }
            // A batch that was not full has emptied the queue; what came since is for the next round.
            if self.drained || !self.fill() {
                self.drained = false;
                return Received::Nothing;
            }
            self.drained = self.inbox.emptied_the_queue();
        }
    }

    fn wait_readable(&mut self, timeout: Duration) {
        if !self.inbox.is_empty() {
            return;
        }
        let Some(socket) = self.socket.as_ref().filter(|_| self.usable) else {
            // Down: nothing will wake us, so sleep the time to the next attempt.
            std::thread::sleep(timeout.min(RETRY_PERIOD / 10));
            return;
        };
        let timeout =
            Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: i64::from(timeout.subsec_nanos()) };
        // An interrupted wait is a wait that ended early, which the caller's loop absorbs.
        let _ = poll(&mut [PollFd::new(socket, PollFlags::IN)], Some(&timeout));
    }

    fn is_up(&self) -> bool {
        self.usable
    }

    fn counters(&self) -> &BusCounters {
        &self.counters
    }

    fn join_lockstep(&mut self, role: Role, name: &str) -> Result<(), BusError> {
        if !L::HAS_BARRIER {
            return Err(BusError::NoBarrier { url: self.url.clone() });
        }
        let join = Control::named(Kind::Join(role), 0, name);
        self.joined = Some(join);
        if let Some(socket) = &self.socket
            && let Err(error) = enter_barrier(socket, &join)
        {
            // Shows as a bus that is down; joining is tried again when it is back.
            self.went_away(error);
        }
        Ok(())
    }

    fn socket(&self) -> Option<BorrowedFd<'_>> {
        self.socket.as_ref().filter(|_| self.usable).map(AsFd::as_fd)
    }

    fn done(&mut self, cycle: u32) {
        // A failure shows as a bus that is down, and as a time-out of the barrier.
        let _ = self.post(&Control::new(Kind::Done, cycle).to_bytes()).and_then(|()| self.flush());
    }

    fn leave(&mut self) {
        // The kernel decides on each packet under one lock: it is in our queue, or its sender gets the error that we have gone.
        // SocketCAN refuses; its peers go on as before.
        if let Some(socket) = &self.socket {
            self.left = rustix::net::shutdown(socket, rustix::net::Shutdown::Read).is_ok();
            self.drained = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::WireOptions;
    use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};

    /// One end of a pair of sockets.
    struct PairLink(OwnedFd);

    impl Link for PairLink {
        const HAS_BARRIER: bool = true;
        const COUNTS_OVERFLOW: bool = false;
        const REMEDY: &'static str = "";

        fn connect(&self) -> io::Result<OwnedFd> {
            self.0.try_clone()
        }
    }

    /// Taken afterwards, stamps once came late by the time that the host preempted the sender, and round trips too short.
    #[test]
    fn a_frame_is_stamped_before_it_is_on_its_way() {
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let (ours, host) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None).unwrap();
        let at_host = host.try_clone().unwrap();
        // A clock that shows the bytes that have reached the host.
        let clock = Box::new(move |_age_ns| rustix::io::ioctl_fionread(&at_host).unwrap());
        let url = BusUrl::Unix { path: "/pair".into(), wire: WireOptions::default() };
        let mut peer = SocketPeer::open(PairLink(ours), &url, clock).unwrap();
        assert_eq!(peer.send(&CanFrame::new(0x110, &[])), Ok(0));
        assert_eq!(rustix::io::ioctl_fionread(&host).unwrap(), CAN_FRAME_BYTES as u64);
    }
}
