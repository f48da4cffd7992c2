//! Host of the embedded bus: takes each peer's frames and gives them to all others, as SocketCAN does.
//!
//! One thread, one epoll. A peer that does not read fills its socket's queue; what does not fit is dropped there
//! and counted by peer and identifier, so that it can be held against the gaps that the peer sees. A frame that the
//! wire loses (`wire`) is lost for all and counted by identifier. In lockstep, [`super::lockstep`]
//! decides when frames are delivered. The socket's file and its lock are in `socket_file`.

use super::BusError;
use super::control::{Control, Kind, Role};
use super::lockstep::{Barrier, BarrierConfig, PeerId, Release};
use super::packets::{Inbox, Outbox, Wait};
use super::socket_file::SocketFile;
use super::url::{BusUrl, WireOptions};
use super::wire::Wire;
use crate::can::{CAN_FRAME_BYTES, CanFrame};
use rustix::event::{PollFd, PollFlags, Timespec, epoll, poll};
use rustix::net::SendFlags;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub use super::host_report::{FramesById, HostReport, PeerReport};

/// Wall time after which the barrier is broken by a member that is not done (bus.md, Lockstep).
pub const BARRIER_TIMEOUT: Duration = Duration::from_secs(5);

/// Queue of a peer in bytes of the kernel's accounting, some 750 for each frame: about half a second of the whole bus.
const PEER_QUEUE_BYTES: usize = 2 << 20;
/// How long the host sleeps when nothing happens, so that it sees its stop flag.
const IDLE_WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
/// Peers that are looked at in one turn; epoll brings the others in the next.
const EVENTS_A_TURN: usize = 32;
const LISTENER: u64 = u64::MAX;
/// The rig that lives in the host's process.
const RIG_HERE: PeerId = u64::MAX - 1;

struct Peer {
    socket: OwnedFd,
    report: usize,
    outbox: Outbox,
}

/// A packet from the rig that lives in the host's process.
pub(super) enum FromRig {
    Frame(CanFrame),
    Done(u32),
}

/// A packet for it.
pub(super) enum ForRig {
    Frame(CanFrame),
    Barrier(Control),
}

/// The embedded bus, bound to its socket and not yet serving.
pub struct Host {
    // First, so that no peer comes back to a host that is going.
    socket_file: SocketFile,
    epoll: OwnedFd,
    peers: BTreeMap<PeerId, Peer>,
    next_peer: PeerId,
    wire: Wire,
    barrier: Option<Barrier>,
    waiting_since: Instant,
    inbox: Inbox,
    for_rig: Option<VecDeque<ForRig>>,
    report: HostReport,
    /// Peers that went, by their place in the report, with what had passed the wire by then.
    gone: Vec<(usize, FramesById)>,
}

/// What became of a packet for a peer.
enum Sent {
    /// Its queue took it.
    Delivered,
    /// Its queue was full.
    Dropped,
    /// It takes no more, and is removed when its end is read.
    Gone,
}

impl Host {
    /// Takes the bus at `path` into service, with a barrier when `barrier` says so.
    ///
    /// # Errors
    /// [`BusError::HostExists`] when a live host serves it; [`BusError::Open`] when folder, lock or socket cannot be made, or
    /// when the default folder is not this user's alone.
    pub fn bind(path: &Path, wire: WireOptions, barrier: Option<BarrierConfig>) -> Result<Self, BusError> {
        let socket_file = SocketFile::bind(path, wire)?;
        let epoll = listening(&socket_file).map_err(|error| BusError::Open {
            url: BusUrl::Unix { path: path.into(), wire }.to_string(),
            reason: error.to_string(),
            remedy: "raise the limit of open files, see 'ulimit -n'",
        })?;
        Ok(Self {
            socket_file,
            epoll,
            peers: BTreeMap::new(),
            next_peer: 0,
            wire: Wire::new(&wire),
            barrier: barrier.map(Barrier::new),
            waiting_since: Instant::now(),
            inbox: Inbox::new(),
            for_rig: None,
            report: HostReport::default(),
            gone: Vec::new(),
        })
    }

    /// Serves the bus until `stop` is set, and tells what it counted.
    ///
    /// # Errors
    /// What epoll says when the system is out of memory or descriptors.
    pub fn serve(mut self, stop: &AtomicBool) -> io::Result<HostReport> {
        while !stop.load(Ordering::Relaxed) {
            self.turn(IDLE_WAIT)?;
        }
        self.close();
        Ok(std::mem::take(&mut self.report))
    }

    /// Closes the account: what peers have sent is still carried on; what they send from now on they are told is refused.
    fn close(&mut self) {
        for peer in self.peers.values() {
            // A peer that has gone meanwhile is drained and removed below like the others.
            let _ = rustix::net::shutdown(&peer.socket, rustix::net::Shutdown::Read);
        }
        while let Some(id) = self.peers.first_key_value().map(|(id, _)| *id) {
            // Its last packet is its end, at which it is removed.
            if !self.take_from(id) {
                self.remove(id);
            }
        }
        for (place, on_wire_by_then) in self.gone.drain(..) {
            self.report.peers[place].after_it_left.add_difference(&self.report.on_wire, &on_wire_by_then);
        }
    }

    /// Waits for packets, at most for `patience`, and carries them on.
    pub(super) fn turn(&mut self, patience: Timespec) -> io::Result<()> {
        let mut room = [const { MaybeUninit::uninit() }; EVENTS_A_TURN];
        let events = match epoll::wait(&self.epoll, &mut room, Some(&patience)) {
            Ok((events, _)) => &*events,
            Err(rustix::io::Errno::INTR) => &[],
            Err(error) => return Err(error.into()),
        };
        for event in events {
            match event.data.u64() {
                LISTENER => self.let_in(),
                peer => {
                    self.take_from(peer);
                }
            }
        }
        self.advance_barrier();
        Ok(())
    }

    /// The barrier's rig lives in this process: its packets come and go without a socket.
    pub(super) fn join_rig_here(&mut self) -> bool {
        let Some(barrier) = &mut self.barrier else { return false };
        let joined = barrier.join(RIG_HERE, Role::Rig, "rig".into());
        self.for_rig = joined.then(VecDeque::new);
        joined
    }

    /// What the rig that lives here says.
    pub(super) fn take_from_rig(&mut self, packet: FromRig) {
        let Some(barrier) = &mut self.barrier else { return };
        match packet {
            FromRig::Frame(frame) => barrier.post(RIG_HERE, frame),
            FromRig::Done(cycle) => {
                barrier.done(RIG_HERE, cycle);
                self.advance_barrier();
            }
        }
    }

    /// The oldest packet for the rig that lives here.
    pub(super) fn next_for_rig(&mut self) -> Option<ForRig> {
        self.for_rig.as_mut()?.pop_front()
    }

    /// What was counted so far.
    pub(super) fn report(&self) -> &HostReport {
        &self.report
    }

    /// Takes everyone who waits.
    fn let_in(&mut self) {
        while let Some(socket) = self.socket_file.accept() {
            self.add_peer(socket);
        }
    }

    fn add_peer(&mut self, socket: OwnedFd) {
        // The kernel caps this at net.core.wmem_max; a smaller queue only loses earlier, and counts it.
        let _ = rustix::net::sockopt::set_socket_send_buffer_size(&socket, PEER_QUEUE_BYTES);
        let process = rustix::net::sockopt::socket_peercred(&socket)
            .map_or_else(|_| "unknown process".to_owned(), |peer| format!("process {}", peer.pid));
        let id = self.next_peer;
        if epoll::add(&self.epoll, &socket, epoll::EventData::new_u64(id), epoll::EventFlags::IN).is_err() {
            return;
        }
        self.next_peer += 1;
        self.peers.insert(id, Peer { socket, report: self.report.peers.len(), outbox: Outbox::new() });
        let before_it_came = self.report.on_wire.clone();
        self.report.peers.push(PeerReport { name: process, before_it_came, ..PeerReport::default() });
    }

    /// Takes a batch from a peer; false when there was none.
    fn take_from(&mut self, id: PeerId) -> bool {
        let Some(peer) = self.peers.get(&id) else { return false };
        // One batch, then the next peer has its turn; epoll tells again while more waits. Stamps are the peers' affair.
        match self.inbox.fill(peer.socket.as_fd(), Wait::No, &|_| 0) {
            Ok(()) => {}
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
            Err(_) => self.remove(id),
        }
        let mut any = false;
        while let Some(packet) = self.inbox.take() {
            any = true;
            // Length 0: the peer is gone.
            if packet.len == 0 {
                self.remove(id);
                break;
            }
            self.take(id, &packet.bytes[..packet.len]);
        }
        any
    }

    fn take(&mut self, id: PeerId, bytes: &[u8]) {
        let Some(peer) = self.peers.get(&id) else { return };
        let frame = <&[u8; CAN_FRAME_BYTES]>::try_from(bytes).ok().and_then(CanFrame::from_bytes);
        if let Some(frame) = frame {
            let report = &mut self.report.peers[peer.report];
            report.frames_received += 1;
            report.received_by_id.count(&frame);
            match &mut self.barrier {
                Some(barrier) => barrier.post(id, frame),
                None => self.deliver(&frame, id),
            }
        } else if let Some(control) = Control::from_bytes(bytes) {
            self.obey(id, &control);
        } else {
            self.report.malformed += 1;
        }
    }

    fn obey(&mut self, id: PeerId, control: &Control) {
        let obeyed = match (&mut self.barrier, control.kind) {
            (Some(barrier), Kind::Join(role)) => barrier.join(id, role, control.name()),
            (Some(barrier), Kind::Done) => {
                barrier.done(id, control.cycle);
                true
            }
            // There is no barrier here, or only its host says this.
            _ => false,
        };
        if !obeyed {
            self.report.malformed += 1;
        } else if let (Kind::Join(_), Some(peer)) = (control.kind, self.peers.get(&id)) {
            self.report.peers[peer.report].name = control.name();
        }
    }

    fn remove(&mut self, id: PeerId) {
        // Closing the descriptor takes it out of the epoll set.
        if let Some(peer) = self.peers.remove(&id) {
            self.gone.push((peer.report, self.report.on_wire.clone()));
        }
        if let Some(barrier) = &mut self.barrier {
            barrier.leave(id);
        }
    }

    /// Puts one frame on the wire: to everyone but its sender. What a member of the barrier gets leaves with its Go.
    fn deliver(&mut self, frame: &CanFrame, from: PeerId) {
        self.report.frames += 1;
        if self.wire.loses_next() {
            self.report.injected_loss.count(frame);
            if let Some(barrier) = &mut self.barrier {
                barrier.lost(frame, None);
            }
            return;
        }
        self.report.on_wire.count(frame);
        let bytes = frame.to_bytes();
        if let Some(for_rig) = &mut self.for_rig
            && from != RIG_HERE
        {
            for_rig.push_back(ForRig::Frame(*frame));
        }
        for (id, peer) in self.peers.iter_mut().filter(|(id, _)| **id != from) {
            let report = &mut self.report.peers[peer.report];
            if self.barrier.as_ref().is_some_and(|barrier| barrier.must_not_lose(*id)) {
                peer.post(&bytes);
                report.delivered.count(frame);
                continue;
            }
            match peer.send(&bytes) {
                Sent::Delivered => report.delivered.count(frame),
                Sent::Gone => report.after_it_left.count(frame),
                Sent::Dropped => {
                    report.dropped_at_queue.count(frame);
                    if let Some(barrier) = &mut self.barrier {
                        barrier.lost(frame, Some(*id));
                    }
                }
            }
        }
    }

    fn advance_barrier(&mut self) {
        let connected = self.peers.len() + usize::from(self.for_rig.is_some());
        while let Some(release) = self.barrier.as_mut().and_then(|barrier| barrier.release(connected)) {
            self.carry_out(release);
            self.waiting_since = Instant::now();
        }
        let Some(barrier) = &self.barrier else { return };
        let Some(name) = barrier.waits_for().filter(|_| self.waiting_since.elapsed() > BARRIER_TIMEOUT)
        else {
            return;
        };
        for peer in barrier.everyone() {
            self.tell(peer, Control::named(Kind::TimedOut, 0, &name));
        }
        self.waiting_since = Instant::now();
    }

    fn carry_out(&mut self, release: Release) {
        for (frame, from) in &release.frames {
            self.deliver(frame, *from);
        }
        let members = self.barrier.as_ref().map_or(0, |barrier| barrier.member_count()) as u8;
        for id in release.go {
            self.tell(id, Control::new(Kind::Go { members }, release.cycle));
        }
        // Members that may not act yet get their frames too, so that nothing waits in the host.
        self.peers.values_mut().for_each(Peer::flush);
    }

    fn tell(&mut self, id: PeerId, control: Control) {
        if let (RIG_HERE, Some(for_rig)) = (id, &mut self.for_rig) {
            for_rig.push_back(ForRig::Barrier(control));
        } else if let Some(peer) = self.peers.get_mut(&id) {
            peer.post(&control.to_bytes());
            peer.flush();
        }
    }
}

impl Peer {
    /// Sends without blocking.
    fn send(&self, bytes: &[u8]) -> Sent {
        match rustix::net::send(&self.socket, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            Ok(_) => Sent::Delivered,
            Err(rustix::io::Errno::PIPE | rustix::io::Errno::CONNRESET) => Sent::Gone,
            Err(_) => Sent::Dropped,
        }
    }

    /// Adds a packet that must not be lost.
    fn post(&mut self, bytes: &[u8]) {
        if self.outbox.is_full() {
            self.flush();
        }
        self.outbox.push(bytes);
    }

    /// Sends what was posted, waiting for room for as long as a member has to be done.
    fn flush(&mut self) {
        if self.outbox.is_empty() {
            return;
        }
        while let Err(error) = self.outbox.flush(self.socket.as_fd()) {
            let timeout = Timespec { tv_sec: BARRIER_TIMEOUT.as_secs() as i64, tv_nsec: 0 };
            let full = error.kind() == io::ErrorKind::WouldBlock;
            if !full || poll(&mut [PollFd::new(&self.socket, PollFlags::OUT)], Some(&timeout)) == Ok(0) {
                // A member that is gone, or that does not read: the barrier's time-out names it.
                self.outbox.clear();
            }
        }
    }
}

/// An epoll set that tells of new peers: of each once, so that one who cannot be let in does not keep the host turning.
fn listening(socket_file: &SocketFile) -> io::Result<OwnedFd> {
    let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
    let flags = epoll::EventFlags::IN | epoll::EventFlags::ET;
    epoll::add(&epoll, socket_file, epoll::EventData::new_u64(LISTENER), flags)?;
    Ok(epoll)
}
