//! Buses: one trait, chosen by URL, frames time-stamped both ways, every loss counted.
//!
//! ```text
//!   emulator ──┐                          ┌── can://vcan0     the kernel's bus (hardware and vcan alike)
//!              ├── Bus ── SocketPeer ─────┤
//!   controller ┘                          └── unix:///path    the embedded bus ── Host (one for each bus)
//! ```
//!
//! Both kinds are sockets that carry one `struct can_frame` a packet, so one peer serves both; what differs
//! is how the socket is opened (`can_link`, `unix_link`). The wire of the embedded bus, its injected loss
//! and the lockstep barrier live in [`host`] and nowhere else.
//!
//! A bus takes its stamps from a clock that is handed to it ([`StampClock`]), so that it knows neither a
//! real nor a simulated time.

mod can_link;
pub mod control;
pub mod host;
mod host_report;
mod host_thread;
mod hosted_rig;
pub mod lockstep;
mod packets;
mod socket_peer;
mod tally;
mod timed;
mod unix_link;
mod url;
mod wire;

use crate::can::CanFrame;
use crate::response_time::rig::TooSlow;
use std::os::fd::BorrowedFd;
use std::time::Duration;

pub use host_thread::HostThread;
pub use hosted_rig::HostedRig;
pub use tally::{FrameTally, OTHERS};
pub use url::{BusUrl, LONGEST_NAME, UrlError, WireOptions};
pub use wire::{Frames, WireFault, WireNode, WireOrder, WireOrders};

/// The clock that stamps frames: the time of what happened so many ns ago, in ns since an epoch of the caller's choice.
///
/// A real clock subtracts the age that the kernel reports of an arrival; a simulated one, for which no time passes between
/// arrival and reading, ignores it.
pub type StampClock = Box<dyn Fn(u64) -> u64 + Send>;

/// Result of [`Bus::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A frame, and when it arrived at this peer's queue, in ns of the bus's [`StampClock`].
    Frame(CanFrame, u64),
    /// A packet of the lockstep barrier; only peers that joined receive any.
    Barrier(control::Control),
    /// Nothing more in this round: the queue was empty when it was last looked at, or the bus is down (see [`Bus::is_up`]).
    Nothing,
}

/// Why a frame did not leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// The transmit queue is full: the frame is dropped and counted, never retried in the cycle.
    #[error("transmit queue is full, frame dropped")]
    QueueFull,
    /// The bus is down; the peer keeps trying to come back.
    #[error("bus is down, frame dropped")]
    Down,
}

/// Why a bus could not be opened, or cannot do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The interface or socket is not there or not for us.
    #[error("cannot open bus {url}: {reason}; {remedy}")]
    Open {
        /// The bus as it was asked for.
        url: String,
        /// Error of the system.
        reason: String,
        /// Remedy for a person.
        remedy: &'static str,
    },
    /// Another host serves this embedded bus already.
    #[error("bus {url} has a host already (lock file {lock}); connect to it, or choose another path")]
    HostExists {
        /// The bus as it was asked for.
        url: String,
        /// The lock file that the other host holds.
        lock: String,
    },
    /// The wire's bit rate does not carry the frames of `rig.dbc`.
    #[error("bus {url} is refused: {arithmetic}; use bitrate=1000000, or none for a wire that takes no time")]
    TooSlow {
        /// The bus as it was asked for.
        url: String,
        /// Each frame's share and response time.
        arithmetic: TooSlow,
    },
    /// SocketCAN has no barrier.
    #[error("{url} cannot run in lockstep: the barrier lives in the embedded bus; use --bus unix:///PATH")]
    NoBarrier {
        /// The bus as it was asked for.
        url: String,
    },
}

/// Counters of a peer since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct BusCounters {
    /// Frames handed to the bus.
    pub sent: u64,
    /// Well-formed frames taken from the bus.
    pub received: u64,
    /// Frames that the transmit queue, or a bus that was down, did not take.
    pub dropped_on_send: u64,
    /// Frames that the kernel dropped at our receive queue (SocketCAN's overflow count).
    pub dropped_on_receive: u64,
    /// Packets that are no `struct can_frame`.
    pub malformed: u64,
    /// Error frames of a SocketCAN interface.
    pub error_frames: u64,
    /// Times the bus went away.
    pub disconnects: u64,
    /// Times it came back.
    pub reconnects: u64,
    /// Frames handed to the bus, by identifier.
    pub sent_by_id: FrameTally,
    /// Frames that it did not take, by identifier.
    pub dropped_on_send_by_id: FrameTally,
    /// Well-formed frames taken from the bus, by identifier.
    pub received_by_id: FrameTally,
}

/// A destination of frames.
pub trait FrameSink {
    /// Puts a frame on the bus and returns when it was handed over, in ns of the bus's clock.
    ///
    /// # Errors
    /// [`SendError`] when the frame was dropped; it is counted and never queued for later, since a command that
    /// arrives late is worse than none.
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError>;
}

/// A CAN bus as a peer sees it. Nothing here blocks but [`Bus::wait_readable`], and [`Bus::receive`] in a barrier.
pub trait Bus: FrameSink + Send {
    /// Takes the oldest waiting frame. Tries to come back when the bus was down. A member of the lockstep barrier, which has
    /// nothing to do before its turn, waits a little for a packet.
    fn receive(&mut self) -> Received;

    /// Waits until something can be received, or for `timeout`.
    fn wait_readable(&mut self, timeout: Duration);

    /// Whether the bus is there.
    fn is_up(&self) -> bool;

    /// Counters since opening.
    fn counters(&self) -> &BusCounters;

    /// Joins the lockstep barrier under `name`, or as the rig.
    ///
    /// # Errors
    /// [`BusError::NoBarrier`] on `can://`.
    fn join_lockstep(&mut self, role: control::Role, name: &str) -> Result<(), BusError>;

    /// Reports to the barrier that this member has posted its frames of `cycle`.
    fn done(&mut self, cycle: u32);

    /// Refuses what arrives from now on; frames that arrived before can still be received, then [`Received::Nothing`] follows.
    /// The host's count of delivered frames then equals the peer's count of received ones. On `can://` it does nothing, since
    /// frames left unread are not counted there.
    fn leave(&mut self) {}

    /// The socket of a peer that is up, to be polled together with others; polling does not see packets that were read and
    /// not yet received, so receive to [`Received::Nothing`] first. `None` while the bus is down, or for a peer without one.
    fn socket(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// Report of the bus's host, when this peer is the host as well.
    fn host_report(&self) -> Option<host::HostReport> {
        None
    }
}

/// Opens the bus that `url` names, stamping frames with `clock`.
///
/// An embedded bus whose host is not there yet is not an error: the peer keeps trying, see [`Bus::is_up`].
///
/// # Errors
/// [`BusError::Open`] when a `can://` interface does not exist, is down, or may not be used.
pub fn open(url: &BusUrl, clock: StampClock) -> Result<Box<dyn Bus>, BusError> {
    match url {
        BusUrl::Can { interface } => {
            Ok(Box::new(socket_peer::SocketPeer::open(can_link::CanLink(interface.clone()), url, clock)?))
        }
        BusUrl::Unix { path, .. } => {
            Ok(Box::new(socket_peer::SocketPeer::lazy(unix_link::UnixLink(path.clone()), url, clock)))
        }
    }
}
