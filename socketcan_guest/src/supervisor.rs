//! The loop: answers the guests' calls, and transfers frames between their sockets and the buses. One thread, one epoll.
//!
//! It never blocks on a guest: messages that do not fit a guest's queue are dropped and counted, a call that would block is
//! kept, and a guest that writes faster than its bus is throttled by its own queue. Each turn takes a few messages of each
//! source.

use crate::caller::Caller;
use crate::interface::Interface;
use crate::netlink::LinkRequest;
use crate::notification::{Answer, Listener, Notification};
use crate::receive::WaitingCall;
use crate::send::FrameOrigin;
use crate::socket::{GuestSocket, Kind, MessageMetadata, QueueAccounting};
use crate::transport::Transport;
use rustix::event::{PollFd, PollFlags, Timespec, epoll, poll};
use rustix::io::Errno;
use rustix::time::{ClockId, clock_gettime};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Most calls answered in a turn, and most frames taken from a bus.
const EVENTS_A_SOURCE: usize = 32;
/// Most event sources of a turn; epoll returns the others in the next.
const EVENTS_A_TURN: usize = 64;
/// Longest sleep: bounds the time to detect buses and dead calls.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);
/// Longest wait for a stalled bus after the end of the program.
const BUS_DRAIN_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait for messages of the transport protocol that have not started.
const QUEUE_DRAIN_TIMEOUT: Duration = Duration::from_secs(10);
/// Most different warnings, so that a guest cannot fill a disk.
const MOST_TEXTS: usize = 200;

const LISTENER: u64 = u64::MAX;
const CHILD: u64 = u64::MAX - 1;
/// The bus of the first interface; the others have lower numbers.
const FIRST_BUS: u64 = u64::MAX - 16;
pub(crate) const MOST_INTERFACES: usize = 64;

/// State of the loop.
pub(crate) struct Supervisor {
    pub(crate) listener: Listener,
    epoll: OwnedFd,
    pub(crate) interfaces: Vec<Interface>,
    /// Guests' sockets by the inode of the guest's end.
    pub(crate) sockets: BTreeMap<u64, GuestSocket>,
    /// Sockets with timers: broadcast managers and transport protocols.
    pub(crate) timed: BTreeSet<u64>,
    /// Number of calls that wait for a message, of all sockets.
    pub(crate) waiting_calls: usize,
    pub(crate) accounting: Rc<QueueAccounting>,
    /// Frames of guests that a bus accepted.
    pub(crate) sent: u64,
    /// Native writes that the kernel would have refused.
    pub(crate) refused_late: u64,
    /// Whether the host of a bus has ended.
    pub(crate) bus_lost: bool,
    /// Requests for links with pending answers.
    pub(crate) link_requests: Vec<LinkRequest>,
    warned: BTreeSet<String>,
    last_check: Instant,
}

impl Supervisor {
    pub(crate) fn new(listener: OwnedFd, interfaces: Vec<Interface>) -> io::Result<Self> {
        let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
        epoll::add(&epoll, &listener, epoll::EventData::new_u64(LISTENER), epoll::EventFlags::IN)?;
        let mut supervisor = Self {
            listener: Listener::new(listener),
            epoll,
            interfaces,
            sockets: BTreeMap::new(),
            timed: BTreeSet::new(),
            waiting_calls: 0,
            accounting: Rc::new(QueueAccounting::new()?),
            sent: 0,
            refused_late: 0,
            bus_lost: false,
            link_requests: Vec::new(),
            warned: BTreeSet::new(),
            last_check: Instant::now(),
        };
        for place in 0..supervisor.interfaces.len() {
            if supervisor.interfaces[place].bus.socket().is_some() {
                supervisor.bus_up(place);
            }
        }
        Ok(supervisor)
    }

    /// Makes the end of this process wake the loop.
    pub(crate) fn watch_child(&self, child: BorrowedFd<'_>) -> io::Result<()> {
        let data = epoll::EventData::new_u64(CHILD);
        // Once: the descriptor of an ended process stays readable.
        Ok(epoll::add(&self.epoll, child, data, epoll::EventFlags::IN | epoll::EventFlags::ONESHOT)?)
    }

    /// Waits for events and processes them. True when the child has ended.
    ///
    /// # Errors
    /// Error of epoll when the system is out of memory.
    pub(crate) fn turn(&mut self) -> io::Result<bool> {
        self.turn_for(LONGEST_SLEEP)
    }

    /// The same, with a bound on the wait.
    pub(crate) fn turn_for(&mut self, longest: Duration) -> io::Result<bool> {
        let mut room = [const { MaybeUninit::uninit() }; EVENTS_A_TURN];
        let patience = self.patience().min(longest);
        let mut patience = Timespec { tv_sec: 0, tv_nsec: patience.subsec_nanos().into() };
        // epoll_wait counts in ms, which is too coarse for the gaps of the transport protocol; poll waits in ns.
        if patience.tv_nsec % 1_000_000 != 0 {
            match poll(&mut [PollFd::new(&self.epoll, PollFlags::IN)], Some(&patience)) {
                Ok(_) | Err(Errno::INTR) => patience.tv_nsec = 0,
                Err(error) => return Err(error.into()),
            }
        }
        let events: Vec<(u64, epoll::EventFlags)> = match epoll::wait(&self.epoll, &mut room, Some(&patience))
        {
            Ok((events, _)) => events.iter().map(|event| (event.data.u64(), event.flags)).collect(),
            Err(Errno::INTR) => Vec::new(),
            Err(error) => return Err(error.into()),
        };
        let mut has_ended = false;
        for (source, flags) in events {
            match source {
                LISTENER => self.answer_some(),
                CHILD => has_ended = true,
                bus if bus > FIRST_BUS - MOST_INTERFACES as u64 => {
                    let place = (FIRST_BUS - bus) as usize;
                    if flags.contains(epoll::EventFlags::OUT) {
                        self.release_held(place);
                    }
                    self.take_from_bus(place);
                }
                inode => _ = self.take_from(inode),
            }
        }
        self.advance_timed();
        self.check_periodically();
        Ok(has_ended)
    }

    fn patience(&self) -> Duration {
        let now = Instant::now();
        let timed = self.timed.iter().filter_map(|inode| match &self.sockets.get(inode)?.kind {
            Kind::Bcm(manager) => manager.due(),
            Kind::Transport(transport) => transport.protocol.due(),
            Kind::Raw(_) => None,
        });
        let mut due = timed.min();
        if self.waiting_calls > 0 {
            let calls = self.sockets.values().flat_map(|socket| &socket.waiting);
            due = calls.filter_map(|call| call.deadline).chain(due).min();
        }
        due.map_or(LONGEST_SLEEP, |due| due.saturating_duration_since(now).min(LONGEST_SLEEP))
    }

    fn answer_some(&mut self) {
        for _ in 0..EVENTS_A_SOURCE {
            let Some(notification) = self.listener.next() else { return };
            let answer = self.answer_to(&notification).unwrap_or_else(Answer::Error);
            self.listener.answer(notification.id, answer);
        }
    }

    fn answer_to(&mut self, notification: &Notification) -> Result<Answer, Errno> {
        match notification.call {
            libc::SYS_socket => self.make_socket(notification),
            libc::SYS_bind => self.bind(notification),
            libc::SYS_connect => self.connect(notification),
            libc::SYS_getsockname => self.get_name(notification),
            libc::SYS_listen
            | libc::SYS_accept
            | libc::SYS_accept4
            | libc::SYS_shutdown
            | libc::SYS_getpeername => self.unsupported(notification),
            libc::SYS_ioctl => self.ioctl(notification),
            libc::SYS_setsockopt => self.set_option(notification),
            libc::SYS_getsockopt => self.get_option(notification),
            libc::SYS_recvmsg | libc::SYS_recvmmsg | libc::SYS_recvfrom => Ok(self.receive(notification)),
            libc::SYS_sendmsg | libc::SYS_sendmmsg => self.send_message(notification),
            libc::SYS_sendto => self.send_to(notification),
            libc::SYS_write => self.write(notification),
            _ => Ok(Answer::Continue),
        }
    }

    /// The guest's socket of a call's first argument, and a copy of the descriptor; `None` for any other descriptor. Native
    /// writes before the call are processed first.
    pub(crate) fn guest_socket(&mut self, notification: &Notification) -> Option<(u64, OwnedFd)> {
        let found = self.find_socket(notification)?;
        self.take_all_from(found.0);
        Some(found)
    }

    /// The same, without processing native writes.
    pub(crate) fn find_socket(&mut self, notification: &Notification) -> Option<(u64, OwnedFd)> {
        // Shortcut without sockets: most programs make most of these calls on other descriptors.
        if self.sockets.is_empty() {
            return None;
        }
        match Caller::new(notification.thread).descriptor(notification.int(0)) {
            Ok(copy) => {
                let inode = inode_of(copy.as_fd())?;
                self.sockets.contains_key(&inode).then_some((inode, copy))
            }
            // No such number, or the caller has gone: the kernel reports it.
            Err(Errno::BADF | Errno::SRCH) => None,
            Err(error) => {
                self.warn_once(&format!(
                    "process {}: its descriptors cannot be looked at ({}), so its CAN sockets do not work: it is a \
                     program that may be executed but not read, or a container allows no pidfd_getfd (docker run \
                     --cap-add SYS_PTRACE, or --security-opt seccomp=unconfined)",
                    notification.thread,
                    io::Error::from(error)
                ));
                None
            }
        }
    }

    /// Adds a socket to the loop.
    pub(crate) fn add_socket(&mut self, inode: u64, socket: GuestSocket) -> io::Result<()> {
        epoll::add(&self.epoll, &socket, epoll::EventData::new_u64(inode), epoll::EventFlags::IN)?;
        if socket.raw().is_none() {
            self.timed.insert(inode);
        }
        self.sockets.insert(inode, socket);
        Ok(())
    }

    /// Removes a socket that all guests have closed, with its cyclic frames.
    pub(crate) fn remove_socket(&mut self, inode: u64) {
        // Closing the descriptor removes it from the epoll set.
        if let Some(socket) = self.sockets.remove(&inode) {
            self.waiting_calls -= socket.waiting.len();
            for call in socket.waiting {
                self.listener.answer(call.notification.id, Answer::Error(Errno::BADF));
            }
        }
        self.timed.remove(&inode);
    }

    /// Sets whether native writes are taken.
    pub(crate) fn watch_socket(&self, inode: u64, takes: bool) {
        let Some(socket) = self.sockets.get(&inode) else { return };
        // Out of the set while its frame is held: epoll would report its end again and again, and the frame goes first.
        let _ = if takes {
            epoll::add(&self.epoll, socket, epoll::EventData::new_u64(inode), epoll::EventFlags::IN)
        } else {
            epoll::delete(&self.epoll, socket)
        };
    }

    /// Waits for room at a bus while a guest's frame waits for it.
    pub(crate) fn watch_bus(&self, place: usize) {
        let interface = &self.interfaces[place];
        let mut flags = epoll::EventFlags::IN;
        flags.set(epoll::EventFlags::OUT, !interface.waiting.is_empty());
        if let Some(socket) = interface.bus.socket() {
            let data = epoll::EventData::new_u64(FIRST_BUS - place as u64);
            let _ = epoll::modify(&self.epoll, socket, data, flags);
        }
    }

    fn take_from_bus(&mut self, place: usize) {
        for _ in 0..EVENTS_A_SOURCE {
            let interface = &mut self.interfaces[place];
            let index = interface.index;
            match interface.bus.receive() {
                Some(frame) => self.distribute(index, &frame, FrameOrigin::Bus),
                None => break,
            }
        }
        if self.interfaces[place].bus.socket().is_none() {
            self.bus_down(place);
        }
    }

    fn bus_up(&mut self, place: usize) {
        let interface = &mut self.interfaces[place];
        interface.is_up = true;
        if let Some(socket) = interface.bus.socket() {
            let data = epoll::EventData::new_u64(FIRST_BUS - place as u64);
            // Without memory for it the interface is up and silent.
            let _ = epoll::add(&self.epoll, socket, data, epoll::EventFlags::IN);
        }
    }

    /// The interface goes down: sockets bound to it are notified, those of any interface are not, as in the kernel.
    fn bus_down(&mut self, place: usize) {
        let interface = &mut self.interfaces[place];
        if !std::mem::replace(&mut interface.is_up, false) {
            return;
        }
        let (index, name) = (interface.index, interface.name.clone());
        self.bus_lost = true;
        eprintln!("bench can: {name} is down: its bus has gone; looking for it");
        self.release_held(place);
        let bound: Vec<u64> = self
            .sockets
            .iter()
            .filter(|(_, socket)| socket.interface == Some(index))
            .map(|(inode, _)| *inode)
            .collect();
        for inode in bound {
            self.deliver_error(inode, index, Errno::NETDOWN);
        }
    }

    /// Lets the next receiving call fail with this error; a native read returns length 0.
    pub(crate) fn deliver_error(&mut self, inode: u64, interface: u32, error: Errno) {
        self.deliver(
            inode,
            &[],
            MessageMetadata { error: Some(error), ..MessageMetadata::new(interface, wall_clock_ns()) },
        );
    }

    /// Delivers a message to a guest's socket, and serves the calls that wait for one.
    pub(crate) fn deliver(&mut self, inode: u64, message: &[u8], metadata: MessageMetadata) {
        if let Some(socket) = self.sockets.get_mut(&inode) {
            socket.deliver(message, metadata);
        }
        self.serve_waiting(inode);
    }

    fn advance_timed(&mut self) {
        let now = Instant::now();
        for inode in self.timed.iter().copied().collect::<Vec<_>>() {
            let mut actions = Vec::new();
            if let Some(Kind::Bcm(manager)) = self.sockets.get_mut(&inode).map(|socket| &mut socket.kind) {
                manager.advance(now, &mut actions);
            }
            self.carry_out(inode, actions);
            self.advance_transport(inode, now);
        }
    }

    /// Connects to missing buses, and ends waiting calls that are expired or dead.
    fn check_periodically(&mut self) {
        let now = Instant::now();
        if self.waiting_calls > 0 {
            self.end_waiting(|listener, call| {
                let is_over = call.deadline.is_some_and(|deadline| deadline <= now);
                is_over && listener.answer(call.notification.id, Answer::Error(Errno::AGAIN))
            });
        }
        if now - self.last_check < LONGEST_SLEEP {
            return;
        }
        self.last_check = now;
        for place in 0..self.interfaces.len() {
            if self.interfaces[place].bus.try_to_connect() {
                eprintln!("bench can: {} is up", self.interfaces[place].name);
                self.bus_up(place);
            }
        }
        if self.waiting_calls > 0 {
            self.end_waiting(|listener, call| !listener.is_alive(call.notification.id));
        }
        self.forget_dead_senders();
    }

    fn end_waiting(&mut self, is_over: impl Fn(&Listener, &WaitingCall) -> bool) {
        let mut left = 0;
        for socket in self.sockets.values_mut() {
            socket.waiting.retain(|call| !is_over(&self.listener, call));
            left += socket.waiting.len();
        }
        self.waiting_calls = left;
    }

    /// After the end of the child: sends what the guests wrote, including messages of guests that have ended. A transport
    /// message in transfer is completed; those behind it have [`QUEUE_DRAIN_TIMEOUT`]. Dropped messages are counted and
    /// reported.
    ///
    /// # Errors
    /// As [`Supervisor::turn`].
    pub(crate) fn finish(&mut self, is_over: impl Fn() -> bool) -> io::Result<()> {
        let began = Instant::now();
        loop {
            let mut is_held = false;
            for inode in self.sockets.keys().copied().collect::<Vec<_>>() {
                is_held |= self.take_all_from(inode);
            }
            is_held |= self.interfaces.iter().any(|interface| !interface.waiting.is_empty());
            let mut closed = self.sockets.values().filter(|socket| socket.has_hung_up());
            let is_queued = closed.clone().any(GuestSocket::has_more_to_send);
            let is_sending = closed
                .any(|socket| socket.transport().is_some_and(|transport| transport.protocol.is_sending()));
            if !is_held && !is_queued {
                return Ok(());
            }
            let waited = began.elapsed();
            let is_late = waited >= QUEUE_DRAIN_TIMEOUT || is_held && waited >= BUS_DRAIN_TIMEOUT;
            if is_over() || is_late && !is_sending {
                self.drop_unsent();
                return Ok(());
            }
            if waited >= QUEUE_DRAIN_TIMEOUT {
                let transports = self.sockets.values_mut().filter_map(GuestSocket::transport_mut);
                let dropped = transports.map(Transport::forget_native).sum::<usize>();
                self.count_dropped(dropped as u64);
            }
            self.turn_for(LONGEST_SLEEP)?;
        }
    }

    fn drop_unsent(&mut self) {
        let dropped = self.sockets.values_mut().map(GuestSocket::forget_unsent).sum();
        self.count_dropped(dropped);
    }

    fn count_dropped(&mut self, messages: u64) {
        if messages > 0 {
            self.refused_late += messages;
            self.warn_once(
                "the program has ended and a bus accepts no more frames; the unsent ones are dropped",
            );
        }
    }

    /// Reports deviations from the kernel's behaviour at the end.
    pub(crate) fn account(&self) {
        if self.refused_late > 0 {
            eprintln!(
                "bench can: {} messages of the program were accepted and dropped; {} frames reached a bus",
                self.refused_late, self.sent
            );
        }
    }

    pub(crate) fn warn_once(&mut self, text: &str) {
        if self.warned.len() < MOST_TEXTS && self.warned.insert(text.to_owned()) {
            eprintln!("bench can: {text}");
        }
    }
}

/// The inode of a descriptor, unique as long as a socket is open.
pub(crate) fn inode_of(descriptor: BorrowedFd<'_>) -> Option<u64> {
    rustix::fs::fstat(descriptor).ok().map(|found| found.st_ino)
}

pub(crate) fn wall_clock_ns() -> u64 {
    let now = clock_gettime(ClockId::Realtime);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}
