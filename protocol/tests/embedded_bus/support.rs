//! A running host, connected peers, raw clients, and waits that have a limit.

use protocol::bus::control::{Control, Kind, Role};
use protocol::bus::host::{Host, HostReport};
use protocol::bus::lockstep::BarrierConfig;
use protocol::bus::{self, Bus, BusUrl, HostThread, Received, StampClock, WireOptions};
use protocol::can::CanFrame;
use rustix::net::{AddressFamily, SendFlags, SocketAddrUnix, SocketFlags, SocketType};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Far beyond what any step here takes on a loaded machine.
pub(crate) const LIMIT: Duration = Duration::from_secs(30);
/// Frames that fit each queue even where the kernel grants no more than its default of 208 KiB, some 750 bytes each.
pub(crate) const FITS_ANY_QUEUE: usize = 200;
/// Frames on this identifier only show that somebody is there; [`frames_until`] leaves them out.
pub(crate) const HELLO_ID: u16 = 0x7FF;
/// Frames on this identifier show that everything sent before has passed.
pub(crate) const FENCE_ID: u16 = 0x7FE;

/// A folder with a socket path in it; the folder goes with the value.
pub(crate) struct Place {
    pub(crate) folder: tempfile::TempDir,
}

impl Place {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder can be made") }
    }

    pub(crate) fn socket(&self) -> PathBuf {
        self.folder.path().join("bus0")
    }
}

/// A host that serves in a thread of its own.
pub(crate) struct RunningHost(HostThread);

impl RunningHost {
    pub(crate) fn start(path: &Path, wire: WireOptions, barrier: Option<BarrierConfig>) -> Self {
        Self::serve(Host::bind(path, wire, barrier).unwrap_or_else(|error| panic!("{error}")))
    }

    pub(crate) fn serve(host: Host) -> Self {
        Self(HostThread::start(host, || ()))
    }

    pub(crate) fn plain(path: &Path) -> Self {
        Self::start(path, WireOptions::default(), None)
    }

    pub(crate) fn stop(self) -> HostReport {
        self.0.stop().expect("the host serves until it is stopped")
    }
}

/// Nanoseconds since the first call, for everyone in this process.
pub(crate) fn now_ns() -> u64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_nanos() as u64
}

/// A peer as a program opens it, connected or not.
pub(crate) fn open(path: &Path) -> Box<dyn Bus> {
    // Read once before, so that no stamp lies before the clock's start.
    now_ns();
    let clock: StampClock = Box::new(|age_ns| now_ns().saturating_sub(age_ns));
    let url = BusUrl::Unix { path: path.into(), wire: WireOptions::default() };
    bus::open(&url, clock).unwrap_or_else(|error| panic!("{error}"))
}

/// A peer in the lockstep barrier.
pub(crate) fn joined(path: &Path, role: Role, name: &str) -> Box<dyn Bus> {
    let mut peer = open(path);
    peer.join_lockstep(role, name).unwrap();
    peer
}

/// `N` peers that the host has accepted: it accepts in the order of connecting, so when the last is heard, all are in.
pub(crate) fn connected<const N: usize>(path: &Path) -> [Box<dyn Bus>; N] {
    let mut peers = std::array::from_fn(|_| open(path));
    let (last, others) = peers.split_last_mut().expect("at least one peer");
    last.send(&CanFrame::new(HELLO_ID, &[])).expect("a connected peer sends");
    for peer in others {
        frames_until(peer.as_mut(), |frame| frame.standard_id() == Some(HELLO_ID));
    }
    peers
}

/// A host on a bus of its own, and `N` peers that are in.
pub(crate) fn served<const N: usize>() -> (Place, RunningHost, [Box<dyn Bus>; N]) {
    let place = Place::new();
    let host = RunningHost::plain(&place.socket());
    let peers = connected(&place.socket());
    (place, host, peers)
}

/// A host without any of our code, and a peer that is connected to it.
pub(crate) fn foreign_host() -> (Place, Box<dyn Bus>, OwnedFd) {
    let place = Place::new();
    let listener = raw_socket();
    rustix::net::bind(&listener, &SocketAddrUnix::new(place.socket()).unwrap()).unwrap();
    rustix::net::listen(&listener, 1).unwrap();
    let peer = open(&place.socket());
    let host = rustix::net::accept(&listener).unwrap();
    (place, peer, host)
}

/// A connection without any of our code on this side.
pub(crate) fn raw_client(path: &Path) -> OwnedFd {
    let socket = raw_socket();
    rustix::net::connect(&socket, &SocketAddrUnix::new(path).unwrap()).unwrap();
    socket
}

/// A socket of the embedded bus's kind.
pub(crate) fn raw_socket() -> OwnedFd {
    rustix::net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None).unwrap()
}

/// Whether somebody serves the bus at `path` now.
pub(crate) fn is_served(path: &Path) -> bool {
    rustix::net::connect(raw_socket(), &SocketAddrUnix::new(path).unwrap()).is_ok()
}

pub(crate) fn send_raw(socket: &OwnedFd, bytes: &[u8]) {
    assert_eq!(rustix::net::send(socket, bytes, SendFlags::NOSIGNAL).unwrap(), bytes.len());
}

/// Calls `look` until it finds something.
///
/// # Panics
/// When nothing was found within [`LIMIT`].
pub(crate) fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(started.elapsed() < LIMIT, "waited {LIMIT:?} in vain for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Waits until the peer sees that its host is there.
pub(crate) fn wait_until_up(peer: &mut dyn Bus) {
    wait_for("the peer to connect", || {
        peer.receive();
        peer.is_up().then_some(())
    });
}

/// Waits until the peer sees that its host is gone.
pub(crate) fn wait_until_down(peer: &mut dyn Bus) {
    wait_for("the peer to see that the host is gone", || {
        peer.receive();
        (!peer.is_up()).then_some(())
    });
}

pub(crate) fn next(peer: &mut dyn Bus) -> Received {
    let started = Instant::now();
    loop {
        match peer.receive() {
            Received::Nothing => peer.wait_readable(Duration::from_millis(100)),
            received => return received,
        }
        assert!(started.elapsed() < LIMIT, "waited {LIMIT:?} in vain for a packet");
    }
}

pub(crate) fn next_frame(peer: &mut dyn Bus) -> (CanFrame, u64) {
    match next(peer) {
        Received::Frame(frame, stamp_ns) => (frame, stamp_ns),
        other => panic!("expected a frame, received {other:?}"),
    }
}

/// Frames up to the next word of the barrier, and that word.
pub(crate) fn until_word(peer: &mut dyn Bus) -> (Vec<CanFrame>, Control) {
    let mut frames = Vec::new();
    loop {
        match next(peer) {
            Received::Frame(frame, _) => frames.push(frame),
            Received::Barrier(control) => return (frames, control),
            Received::Nothing => unreachable!("next waits"),
        }
    }
}

/// Frames up to the turn of `cycle`.
pub(crate) fn go(peer: &mut dyn Bus, cycle: u32) -> Vec<CanFrame> {
    let (frames, control) = until_word(peer);
    assert!(
        matches!(control.kind, Kind::Go { .. }) && control.cycle == cycle,
        "expected Go({cycle}): {control:?}"
    );
    frames
}

/// Frames up to the one that is the `last`, which is left out, as are all hellos.
pub(crate) fn frames_until(peer: &mut dyn Bus, last: impl Fn(&CanFrame) -> bool) -> Vec<CanFrame> {
    let mut frames = Vec::new();
    loop {
        let (frame, _) = next_frame(peer);
        if last(&frame) {
            return frames;
        }
        if frame.standard_id() != Some(HELLO_ID) {
            frames.push(frame);
        }
    }
}

pub(crate) fn frames_until_fence(peer: &mut dyn Bus) -> Vec<CanFrame> {
    frames_until(peer, |frame| frame.standard_id() == Some(FENCE_ID))
}

pub(crate) fn send_fence(peer: &mut dyn Bus) {
    peer.send(&CanFrame::new(FENCE_ID, &[])).expect("a connected peer sends");
}

/// A frame that carries its number.
pub(crate) fn numbered(id: u16, number: usize) -> CanFrame {
    CanFrame::new(id, &(number as u64).to_le_bytes())
}
