//! A model of the CAN wire that keeps time: how long each frame is on it, who sends first, what an error costs.
//!
//! ```text
//!   frames entered, each with its time ──► queue of its node ──► arbitration ──► transmission ──► events, each with its time
//!                                                   ▲                                 │ error: flag, delimiter, counters
//!                                                   └─────────────────────────────────┘ again
//! ```
//!
//! The model has no clock, no thread and no socket: it is given when frames enter and how far time has come, and answers with
//! what happened by then, in ns of whatever clock the caller uses. The host of the embedded bus drives it in real time and in
//! lockstep (`bus/timed.rs`); tests drive it alone.
//!
//! `bits` counts a frame's bits, `node` holds error counters and bus-off, `model` puts frames in order and in time, `report`
//! is what it counted. What the analysis says beforehand is [`crate::response_time`].
//!
//! Modelled: bits with real stuffing, arbitration by identifier, queues, errors and their cost, error counters, error-passive and
//! bus-off nodes with their recovery. Not modelled: propagation delay and clock tolerance, missing acknowledgement (a node
//! alone on the bus is heard by nobody and gets no error frame), overload frames, two nodes that send one identifier at once (the
//! one that was queued first goes first), and controllers that hold fewer mailboxes than frames.
//!
//! Source: ISO 11898-1; Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: Refuted,
//! revisited and revised", Real-Time Systems 35 (2007).

pub mod bits;
mod errors;
mod model;
mod node;
mod report;

pub use errors::WORST_ERROR_BITS;
pub use model::{NodeId, WireEvent, WireModel};
pub use report::{ArrivalReport, IdentifierReport, Lateness, NodeReport, ResponseReport, WireTimeReport};

/// Slowest bit rate that can be modelled, bits/s.
pub const SLOWEST_BITS_PER_S: u32 = 10_000;
/// Fastest bit rate of classic CAN, bits/s.
pub const FASTEST_BITS_PER_S: u32 = 1_000_000;

/// How the wire keeps time, and which errors it suffers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WireTiming {
    /// Bit rate, [`SLOWEST_BITS_PER_S`] to [`FASTEST_BITS_PER_S`].
    pub bits_per_s: u32,
    /// Probability that an attempt at sending a frame is hit by an error, 0 to 1.
    pub error_rate: f64,
    /// Identifier, with the kernel's flags, whose frames alone are hit; `None` for all.
    pub errors_id: Option<u32>,
    /// Time of the model from which on errors occur, ms.
    pub errors_from_ms: u64,
    /// Time of the model up to which errors occur, ms; `None` for ever.
    pub errors_to_ms: Option<u64>,
    /// How long a node in bus-off waits until it begins to recover, ms, as `restart-ms` of a SocketCAN interface.
    pub restart_ms: u32,
}

impl WireTiming {
    /// Time that a bus-off node waits by default, ms.
    pub const DEFAULT_RESTART_MS: u32 = 100;

    /// A wire without errors.
    #[must_use]
    pub const fn at(bits_per_s: u32) -> Self {
        Self {
            bits_per_s,
            error_rate: 0.0,
            errors_id: None,
            errors_from_ms: 0,
            errors_to_ms: None,
            restart_ms: Self::DEFAULT_RESTART_MS,
        }
    }

    /// Time that so many bits take, rounded up to a whole ns.
    #[must_use]
    pub const fn duration_ns(&self, bits: u32) -> u64 {
        duration_ns(bits, self.bits_per_s)
    }
}

/// Time that so many bits take at `bits_per_s`, rounded up to a whole ns.
#[must_use]
pub const fn duration_ns(bits: u32, bits_per_s: u32) -> u64 {
    (bits as u64 * 1_000_000_000).div_ceil(bits_per_s as u64)
}
