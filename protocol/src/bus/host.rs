//! Host of the embedded bus: takes each peer's frames and gives them to all others, as SocketCAN does.
//!
//! One thread, one epoll. A peer that does not read fills its socket's queue; what does not fit is dropped there
//! and counted by peer and identifier, so that it can be held against the gaps that the peer sees. A frame that the
//! wire loses (`wire`) is lost for all and counted by identifier; what else faults do to frames is carried out in `faulty`.
//! In lockstep, [`super::lockstep`] decides when frames are delivered; a wire that keeps time does in `modelled`. The socket's
//! file and its lock are in [`crate::socket_file`].

mod closing;
mod faulty;
mod modelled;
mod peer;

use super::BusError;
use super::control::{Control, Kind, Role};
use super::lockstep::{Barrier, BarrierConfig, PeerId, Release};
use super::packets::{self, Inbox, Wait};
use super::timed::{ReportTarget, TimedWire};
use super::unix_link;
use super::url::{BusUrl, WireOptions};
use super::wire::{FrameOutcome, Wire};
use crate::can::{CAN_FRAME_BYTES, CanFrame, ERROR_FLAG};
use crate::periods::CYCLE_NS;
use crate::response_time;
use crate::socket_file::SocketFile;
use crate::wire_time::WireEvent;
use peer::{Peer, SendOutcome};
use rustix::event::{Timespec, epoll};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub use super::host_report::{FramesById, HostReport, PeerReport};

/// Wall time after which the barrier is broken by a member that is not done (bus.md, Lockstep), if nothing else is asked for.
pub const BARRIER_TIMEOUT: Duration = Duration::from_secs(5);

/// Wall time that a cycle takes at least in which a foreign controller had nothing to answer: it may act on what it has read.
const UNANSWERED_CYCLE: Duration = Duration::from_millis(1);
/// How often the host looks whether such a controller has read what reached it.
const UNREAD_LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000 };

/// Queue of a peer in bytes of the kernel's accounting, some 750 for each frame: about half a second of the whole bus.
const PEER_QUEUE_BYTES: usize = 2 << 20;
/// How long the host sleeps when nothing happens, so that it sees its stop flag.
const IDLE_WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
/// Peers that are looked at in one turn; epoll brings the others in the next.
const EVENTS_A_TURN: usize = 32;
const NO_WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };
const LISTENER: u64 = u64::MAX;
/// The rig that lives in the host's process.
const RIG_HERE: PeerId = u64::MAX - 1;
/// The timer of a wire that keeps time.
const TIMER: u64 = u64::MAX - 2;
/// A peer that is gone, and of which frames were still on the wire.
const GONE: PeerId = u64::MAX - 3;
/// A node that is a fault of the wire.
const BABBLER: PeerId = u64::MAX - 4;

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
    /// Buffers for the outcomes of the wire and the frames of babbling nodes; kept to avoid allocations.
    outcomes: Vec<FrameOutcome>,
    babble: Vec<CanFrame>,
    began: Instant,
    timed: Option<TimedWire>,
    /// Buffer for the events of the timed wire; kept to avoid allocations.
    wire_events: Vec<WireEvent>,
    barrier: Option<Barrier>,
    waiting_since: Instant,
    barrier_timeout: Duration,
    inbox: Inbox,
    for_rig: Option<VecDeque<ForRig>>,
    report: HostReport,
    /// Peers that went, by their place in the report, with what had passed the wire by then.
    gone: Vec<(usize, FramesById)>,
    closing: bool,
}

impl Host {
    /// Takes the bus at `path` into service, with a barrier when `barrier` says so.
    ///
    /// # Errors
    /// [`BusError::HostExists`] when a live host serves it; [`BusError::Open`] when folder, lock or socket cannot be made, or
    /// when the default folder is not this user's alone; [`BusError::TooSlow`] when the bit rate does not carry `rig.dbc`.
    pub fn bind(path: &Path, wire: WireOptions, barrier: Option<BarrierConfig>) -> Result<Self, BusError> {
        let url = || BusUrl::Unix { path: path.into(), wire }.to_string();
        if let Some(timing) = wire.timing {
            response_time::rig::check(timing.bits_per_s)
                .map_err(|arithmetic| BusError::TooSlow { url: url(), arithmetic })?;
        }
        let socket_file = unix_link::bind(path, wire)?;
        let timed = TimedWire::new(&wire).map_err(io::Error::from);
        let opened = timed.and_then(|timed| Ok((listening(&socket_file, timed.as_ref())?, timed)));
        let (epoll, timed) = opened.map_err(|error| BusError::Open {
            url: url(),
            reason: error.to_string(),
            remedy: "raise the limit of open files, see 'ulimit -n'",
        })?;
        Ok(Self {
            socket_file,
            epoll,
            peers: BTreeMap::new(),
            next_peer: 0,
            wire: Wire::new(&wire),
            outcomes: Vec::new(),
            babble: Vec::new(),
            began: Instant::now(),
            timed,
            wire_events: Vec::new(),
            barrier: barrier.map(Barrier::new),
            waiting_since: Instant::now(),
            barrier_timeout: BARRIER_TIMEOUT,
            inbox: Inbox::new(),
            for_rig: None,
            report: HostReport::default(),
            gone: Vec::new(),
            closing: false,
        })
    }

    /// Gives members of the barrier this much wall time for a cycle instead of [`BARRIER_TIMEOUT`]: a core at a breakpoint
    /// takes as long as the person in front of it.
    #[must_use]
    pub fn with_barrier_timeout(mut self, timeout: Duration) -> Self {
        self.barrier_timeout = timeout;
        self
    }

    /// Serves the bus until `stop` is set, and returns its report.
    ///
    /// # Errors
    /// The error of epoll when the system is out of memory or descriptors.
    pub fn serve(mut self, stop: &AtomicBool) -> io::Result<HostReport> {
        while !stop.load(Ordering::Relaxed) {
            self.turn(IDLE_WAIT)?;
        }
        self.close()?;
        Ok(self.report())
    }

    /// Waits for packets, at most for `patience`, and carries them on.
    pub(super) fn turn(&mut self, patience: Timespec) -> io::Result<()> {
        let mut room = [const { MaybeUninit::uninit() }; EVENTS_A_TURN];
        let patience = self.faults_patience(patience);
        let patience = if self.waits_for_readers() { patience.min(UNREAD_LOOK) } else { patience };
        let mut events = wait(&self.epoll, &mut room, patience)?;
        if self.barrier.is_none() {
            self.advance_faults(self.began.elapsed().as_nanos() as u64);
        }
        let wire_to_ns = self.wire_in_real_time().map(|timed| timed.time_ns(0));
        if wire_to_ns.is_some() {
            // A new connection is reported once (edge-triggered); everything else again.
            if events.iter().any(|event| event.data.u64() == LISTENER) {
                self.let_in();
            }
            // What arrived before that moment is in a queue by now: asked again, epoll reports all of them.
            events = wait(&self.epoll, &mut room, NO_WAIT)?;
        }
        for event in events {
            match event.data.u64() {
                LISTENER => self.let_in(),
                TIMER => {}
                peer => {
                    self.take_from(peer, wire_to_ns);
                }
            }
        }
        if let Some(to_ns) = wire_to_ns {
            self.advance_wire(to_ns)?;
        }
        self.advance_barrier();
        Ok(())
    }

    /// The barrier's rig lives in this process: its packets come and go without a socket.
    pub(super) fn join_rig_here(&mut self) -> bool {
        let Some(barrier) = &mut self.barrier else { return false };
        let joined = barrier.join(RIG_HERE, Role::Rig, "rig".into());
        self.for_rig = joined.then(VecDeque::new);
        if let Some(timed) = self.timed.as_mut().filter(|_| joined) {
            timed.join(RIG_HERE, ReportTarget::Rig);
        }
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

    /// Counts so far.
    pub(super) fn report(&self) -> HostReport {
        let wire_time = self.timed.as_ref().map(|timed| timed.report(&self.report.peers));
        let met = self.wire.frames_by_fault.iter();
        let faults = met.map(|(name, frames)| (Cow::Borrowed(*name), frames.clone())).collect();
        HostReport { wire_time, faults, ..self.report.clone() }
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
        if let Some(timed) = &mut self.timed {
            // Without stamps its frames enter when they are read: later, and never wrongly.
            let _ = packets::enable_stamps(socket.as_fd(), false);
            timed.join(id, ReportTarget::Peer(self.report.peers.len()));
        }
        self.peers.insert(id, Peer::new(socket, self.report.peers.len()));
        let before_it_came = self.report.on_wire.clone();
        self.report.peers.push(PeerReport { name: process, before_it_came, ..PeerReport::default() });
    }

    /// Takes what a peer sent: one batch, then the next peer is served, and epoll reports again while more waits. For a wire in
    /// real time all that arrived before `wire_to_ns`. False when nothing more waits.
    fn take_from(&mut self, id: PeerId, wire_to_ns: Option<u64>) -> bool {
        // All queues were read up to where the wire's time stands.
        self.inbox.begin_another_queue(self.wire_in_real_time().map(TimedWire::read_up_to_ns));
        loop {
            let Some(peer) = self.peers.get(&id) else { return false };
            let timed = self.timed.as_ref().filter(|_| wire_to_ns.is_some());
            // Without a wire that keeps time, stamps are the peers' affair.
            let stamp = |age_ns| timed.map_or(0, |timed| timed.time_ns(age_ns));
            match self.inbox.fill(peer.socket.as_fd(), Wait::No, &stamp) {
                Ok(()) => {}
                Err(error)
                    if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
                Err(_) => self.remove(id),
            }
            let (full, mut newest_ns) = (!self.inbox.emptied_the_queue(), 0);
            while let Some(packet) = self.inbox.take() {
                // Length 0: the peer is gone, and what it sent before has been read.
                if packet.len == 0 {
                    // While the host closes, whoever is still there stays to the end of it.
                    if !self.closing {
                        self.remove(id);
                    }
                    return false;
                }
                newest_ns = packet.stamp_ns;
                self.take(id, &packet.bytes[..packet.len], packet.stamp_ns);
            }
            if !full || wire_to_ns.is_none_or(|to_ns| newest_ns > to_ns) {
                return full;
            }
        }
    }

    fn take(&mut self, id: PeerId, bytes: &[u8], stamp_ns: u64) {
        let Some(peer) = self.peers.get(&id) else { return };
        let frame = <&[u8; CAN_FRAME_BYTES]>::try_from(bytes).ok().and_then(CanFrame::from_bytes);
        if let Some(frame) = frame {
            let report = &mut self.report.peers[peer.report];
            report.frames_received += 1;
            report.received_by_id.count(&frame);
            // An error frame is none on the wire: it reports one, and passes by.
            let on_wire = frame.raw_id() & ERROR_FLAG == 0;
            match (&mut self.barrier, &mut self.timed) {
                (Some(barrier), _) => barrier.post(id, frame),
                (None, Some(timed)) if on_wire => timed.enter(id, &frame, stamp_ns),
                (None, _) => self.deliver(&frame, id, &[]),
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
        if let Some(timed) = &mut self.timed {
            timed.leave(id);
        }
        if let Some(barrier) = &mut self.barrier {
            barrier.leave(id);
        }
    }

    /// Carries a frame to everyone but its sender and the `deaf`. What a member of the barrier gets leaves with its Go.
    fn carry(&mut self, frame: &CanFrame, from: PeerId, deaf: &[PeerId]) {
        self.report.frames += 1;
        self.report.on_wire.count(frame);
        let bytes = frame.to_bytes();
        if let Some(for_rig) = &mut self.for_rig
            && from != RIG_HERE
            && !deaf.contains(&RIG_HERE)
        {
            for_rig.push_back(ForRig::Frame(*frame));
        }
        for (id, peer) in self.peers.iter_mut().filter(|(id, _)| **id != from) {
            let report = &mut self.report.peers[peer.report];
            if deaf.contains(id) {
                report.missed_in_bus_off.count(frame);
                if let Some(barrier) = &mut self.barrier {
                    barrier.lost(frame, Some(*id));
                }
                continue;
            }
            if self.barrier.as_ref().is_some_and(|barrier| barrier.must_not_lose(*id)) {
                peer.post(&bytes);
                report.delivered.count(frame);
                continue;
            }
            match peer.send(&bytes) {
                SendOutcome::Delivered => report.delivered.count(frame),
                SendOutcome::Gone => report.after_it_left.count(frame),
                SendOutcome::Dropped => {
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
        while !self.waits_for_readers()
            && let Some(release) = self.barrier.as_mut().and_then(|barrier| barrier.release(connected))
        {
            self.carry_out(release);
            self.waiting_since = Instant::now();
        }
        let Some(barrier) = &self.barrier else { return };
        let Some(name) = barrier.waits_for().filter(|_| self.waiting_since.elapsed() > self.barrier_timeout)
        else {
            return;
        };
        for peer in barrier.everyone() {
            self.send_control(peer, Control::named(Kind::TimedOut, 0, &name));
        }
        self.waiting_since = Instant::now();
    }

    /// Whether a foreign controller that has nothing to answer may have unread frames of this cycle. One that reads nothing for
    /// the barrier's time-out is not waited for again until it has read everything.
    fn waits_for_readers(&mut self) -> bool {
        let Some(barrier) = &self.barrier else { return false };
        let waited = self.waiting_since.elapsed();
        let mut waits = false;
        for peer in barrier.unanswering() {
            let peer = peer.and_then(|id| self.peers.get_mut(&id));
            waits |= waited < UNANSWERED_CYCLE
                || peer.is_some_and(|peer| peer.may_yet_read(waited < self.barrier_timeout));
        }
        waits
    }

    fn carry_out(&mut self, release: Release) {
        self.advance_faults(u64::from(release.cycle) * CYCLE_NS);
        if self.timed.is_some() {
            self.carry_through_wire(&release);
        } else {
            for (frame, from) in &release.frames {
                self.deliver(frame, *from, &[]);
            }
        }
        let members = self.barrier.as_ref().map_or(0, |barrier| barrier.member_count()) as u8;
        for id in release.go {
            self.send_control(id, Control::new(Kind::Go { members }, release.cycle));
        }
        // Members that may not act yet get their frames too, so that nothing waits in the host.
        self.peers.values_mut().for_each(Peer::flush);
    }

    fn send_control(&mut self, id: PeerId, control: Control) {
        if let (RIG_HERE, Some(for_rig)) = (id, &mut self.for_rig) {
            for_rig.push_back(ForRig::Barrier(control));
        } else if let Some(peer) = self.peers.get_mut(&id) {
            peer.post(&control.to_bytes());
            peer.flush();
        }
    }
}

/// An epoll set that reports new peers: of each once, so that one who cannot be let in does not keep the host turning. And of
/// the timer of a wire that keeps time.
fn listening(socket_file: &SocketFile, timed: Option<&TimedWire>) -> io::Result<OwnedFd> {
    let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
    let flags = epoll::EventFlags::IN | epoll::EventFlags::ET;
    epoll::add(&epoll, socket_file, epoll::EventData::new_u64(LISTENER), flags)?;
    if let Some(timed) = timed {
        epoll::add(&epoll, &timed.timer, epoll::EventData::new_u64(TIMER), epoll::EventFlags::IN)?;
    }
    Ok(epoll)
}

/// Events of the set, none when a signal came first.
fn wait<'a>(
    epoll: &OwnedFd,
    room: &'a mut [MaybeUninit<epoll::Event>],
    patience: Timespec,
) -> io::Result<&'a [epoll::Event]> {
    match epoll::wait(epoll, room, Some(&patience)) {
        Ok((events, _)) => Ok(events),
        Err(rustix::io::Errno::INTR) => Ok(&[]),
        Err(error) => Err(error.into()),
    }
}
