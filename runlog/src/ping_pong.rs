//! `ping-pong.json`: round trips of two small processes on the same bus, a reference beside a run.

use realtime::Percentiles;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The file: ping-pongs by name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PingPongFile {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Command line of each ping-pong.
    pub commands: BTreeMap<String, String>,
    /// Figures of each.
    #[serde(flatten)]
    pub figures: BTreeMap<String, PingPongFigures>,
}

/// Figures of a ping-pong, those of the round trip directly.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct PingPongFigures {
    /// Ping sent to pong received, ns.
    #[serde(flatten)]
    pub round_trip_ns: Percentiles,
    /// Ping sent to ping received, ns; null on a bare pair of sockets.
    pub to_arrival_ns: Option<Percentiles>,
    /// Pings sent.
    pub sent: u64,
    /// Pongs received.
    pub answered: u64,
    /// Pings without a pong.
    pub lost: u64,
    /// Pings left out because the one before was not back in time.
    pub skipped: u64,
    /// Time from one ping to the next.
    pub interval_us: u64,
    /// FIFO priority of both processes.
    pub priority: u8,
    /// CPU of the one that asks.
    pub cpu: Option<usize>,
    /// CPU of the other one.
    pub peer_cpu: Option<usize>,
    /// The bus by its URL; null on a bare pair of sockets.
    pub bus: Option<String>,
    /// What the system granted for real time.
    pub granted: Vec<realtime::Grant>,
    /// What it refused, with the remedy.
    pub refused: Vec<String>,
}
