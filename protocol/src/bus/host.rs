//! Host of the embedded bus: takes each peer's frames and gives them to all others, as SocketCAN does.
//!
//! One thread, one epoll. A peer that does not read fills its socket's queue; what does not fit is dropped there
//! and counted by peer and identifier, so that it can be held against the gaps that the peer sees. A frame that the
//! wire loses ([`super::wire`]) is lost for all and counted by identifier. In lockstep, [`super::lockstep`]
//! decides when frames are delivered.
//!
//! The socket is guarded by a lock file beside it: whoever holds the lock may remove a stale socket; a second host is
//! refused. The lock goes with the process that holds it, however it ends.

use super::control::{Control, Kind, Role};
use super::lockstep::{Barrier, BarrierConfig, PeerId, Release};
use super::packets::{Inbox, Outbox, Wait};
use super::url::{BusUrl, WireOptions};
use super::wire::Wire;
use super::{BusError, unix_link};
use crate::can::{CAN_FRAME_BYTES, CanFrame};
use rustix::event::{PollFd, PollFlags, Timespec, epoll, poll};
use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::net::{AddressFamily, SendFlags, SocketAddrUnix, SocketFlags, SocketType};
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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

/// Frames by identifier, as candump writes it.
pub type FramesById = BTreeMap<String, u64>;

/// What the host saw of one peer.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct PeerReport {
    /// Name in the barrier, else the process number.
    pub name: String,
    /// Frames taken from the peer.
    pub frames_received: u64,
    /// Frames that its full queue did not take, by identifier.
    pub dropped_at_queue: FramesById,
}

/// What the host counted.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct HostReport {
    /// Frames that reached the wire, lost ones included.
    pub frames: u64,
    /// Frames that the wire lost on purpose, by identifier.
    pub injected_loss: FramesById,
    /// Packets that were neither frame nor control packet.
    pub malformed: u64,
    /// The peers in the order in which they came.
    pub peers: Vec<PeerReport>,
}

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
    listener: OwnedFd,
    path: PathBuf,
    epoll: OwnedFd,
    peers: BTreeMap<PeerId, Peer>,
    next_peer: PeerId,
    wire: Wire,
    barrier: Option<Barrier>,
    waiting_since: Instant,
    inbox: Inbox,
    for_rig: Option<VecDeque<ForRig>>,
    report: HostReport,
    // Last, so that the lock outlives the socket file, which `drop` removes.
    _lock: OwnedFd,
}

impl Host {
    /// Takes the bus at `path` into service, with a barrier when `barrier` says so.
    ///
    /// # Errors
    /// [`BusError::HostExists`] when a live host serves it; [`BusError::Open`] when folder, lock or socket cannot be made.
    pub fn bind(path: &Path, wire: WireOptions, barrier: Option<BarrierConfig>) -> Result<Self, BusError> {
        let url = BusUrl::Unix { path: path.into(), wire }.to_string();
        let opened = |error: io::Error| BusError::Open {
            url: url.clone(),
            reason: error.to_string(),
            remedy: "choose a socket path in a folder that you may write, with --bus unix:///PATH",
        };
        make_private_folder(path).map_err(opened)?;
        let (lock, lock_path) = open_lock(path).map_err(opened)?;
        if rustix::fs::flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return Err(BusError::HostExists { url, lock: lock_path.display().to_string() });
        }
        let (listener, epoll) = listen(path).map_err(opened)?;
        Ok(Self {
            listener,
            path: path.into(),
            epoll,
            peers: BTreeMap::new(),
            next_peer: 0,
            wire: Wire::new(&wire),
            barrier: barrier.map(Barrier::new),
            waiting_since: Instant::now(),
            inbox: Inbox::new(),
            for_rig: None,
            report: HostReport::default(),
            _lock: lock,
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
        Ok(std::mem::take(&mut self.report))
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
                LISTENER => self.accept(),
                peer => self.take_from(peer),
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

    fn accept(&mut self) {
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let Ok(socket) = rustix::net::accept_with(&self.listener, flags) else { return };
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
        self.report.peers.push(PeerReport { name: process, ..PeerReport::default() });
    }

    fn take_from(&mut self, id: PeerId) {
        let Some(peer) = self.peers.get(&id) else { return };
        // One batch, then the next peer has its turn; epoll tells again while more waits. Stamps are the peers' affair.
        match self.inbox.fill(peer.socket.as_fd(), Wait::No, &|_| 0) {
            Ok(()) => {}
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
            Err(_) => self.remove(id),
        }
        while let Some(packet) = self.inbox.take() {
            // Length 0: the peer is gone.
            if packet.len == 0 {
                return self.remove(id);
            }
            self.take(id, &packet.bytes[..packet.len]);
        }
    }

    fn take(&mut self, id: PeerId, bytes: &[u8]) {
        let Some(peer) = self.peers.get(&id) else { return };
        let frame = <&[u8; CAN_FRAME_BYTES]>::try_from(bytes).ok().and_then(CanFrame::from_bytes);
        if let Some(frame) = frame {
            self.report.peers[peer.report].frames_received += 1;
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
        self.peers.remove(&id);
        if let Some(barrier) = &mut self.barrier {
            barrier.leave(id);
        }
    }

    /// Puts one frame on the wire: to everyone but its sender. What a member of the barrier gets leaves with its Go.
    fn deliver(&mut self, frame: &CanFrame, from: PeerId) {
        self.report.frames += 1;
        if self.wire.loses_next() {
            count(&mut self.report.injected_loss, frame);
            return;
        }
        let bytes = frame.to_bytes();
        if let Some(for_rig) = &mut self.for_rig
            && from != RIG_HERE
        {
            for_rig.push_back(ForRig::Frame(*frame));
        }
        for (id, peer) in self.peers.iter_mut().filter(|(id, _)| **id != from) {
            if self.barrier.as_ref().is_some_and(|barrier| barrier.must_not_lose(*id)) {
                peer.post(&bytes);
            } else if !peer.send(&bytes) {
                count(&mut self.report.peers[peer.report].dropped_at_queue, frame);
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

impl Drop for Host {
    fn drop(&mut self) {
        // Gone already is as good as removed.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Peer {
    /// Sends without blocking; false when the queue did not take the packet.
    fn send(&self, bytes: &[u8]) -> bool {
        match rustix::net::send(&self.socket, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
            // A peer that just went is removed when its end is read; nothing is lost by it.
            Ok(_) | Err(rustix::io::Errno::PIPE | rustix::io::Errno::CONNRESET) => true,
            Err(_) => false,
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

fn count(table: &mut FramesById, frame: &CanFrame) {
    let id = frame.standard_id().map_or_else(|| format!("{:08X}", frame.raw_id()), |id| format!("{id:03X}"));
    *table.entry(id).or_default() += 1;
}

/// Makes the socket's folder for this user alone; one that exists is left as it is.
fn make_private_folder(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::DirBuilderExt;
    match path.parent() {
        Some(folder) if !folder.exists() => {
            std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
        }
        _ => Ok(()),
    }
}

fn open_lock(path: &Path) -> io::Result<(OwnedFd, PathBuf)> {
    // Added, not in place of an extension: buses `rig.a` and `rig.b` are two.
    let mut lock_path = path.as_os_str().to_owned();
    lock_path.push(".lock");
    let lock_path = PathBuf::from(lock_path);
    let flags = OFlags::CREATE | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW;
    let lock = rustix::fs::open(&lock_path, flags, Mode::RUSR | Mode::WUSR)?;
    Ok((lock, lock_path))
}

fn listen(path: &Path) -> io::Result<(OwnedFd, OwnedFd)> {
    // We hold the lock, so a socket file that is still there belongs to a host that is gone. Anything else stays.
    match std::fs::symlink_metadata(path) {
        Ok(found) if std::os::unix::fs::FileTypeExt::is_socket(&found.file_type()) => {
            std::fs::remove_file(path)?
        }
        Ok(_) => {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "the path is taken by another file"));
        }
        Err(_) => {}
    }
    let listener = rustix::net::socket_with(
        AddressFamily::UNIX,
        SocketType::SEQPACKET,
        SocketFlags::CLOEXEC | SocketFlags::NONBLOCK,
        None,
    )?;
    rustix::net::bind(&listener, &SocketAddrUnix::new(path)?)?;
    rustix::fs::chmod(path, Mode::RUSR | Mode::WUSR)?;
    rustix::net::listen(&listener, 64)?;
    let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
    epoll::add(&epoll, &listener, epoll::EventData::new_u64(LISTENER), epoll::EventFlags::IN)?;
    Ok((listener, epoll))
}

/// Whether somebody serves the embedded bus at `path` now.
#[must_use]
pub fn is_served(path: &Path) -> bool {
    use super::socket_peer::Link as _;
    unix_link::UnixLink::new(path).connect().is_ok()
}
