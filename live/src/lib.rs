//! The live page: one page that shows a run while it goes on, and lets people act on it.
//!
//! ```text
//!   emulator --telemetry ── Unix stream ──► feed ──┐                       ┌── browser: page, events (SSE), controls
//!                                                  ├──► view ──► server ───┼── programs: /api/…
//!   bus ────────────────── one peer ───────► wire ─┘                       └── Prometheus: /metrics
//! ```
//!
//! One thread: it looks at bus and telemetry every 10 ms, and in between waits for clients alone, so that a bus of 8000 frames
//! a second wakes it a hundred times. Nobody waits for a client: each has a bounded queue, and misses what does not fit. The run
//! does not notice whether this program is there; when it dies, the emulator parts with its socket, and nothing more.
//!
//! | file | holds |
//! |---|---|
//! | [`view`], [`state`] | everything that was heard of the run, and what is shown of it |
//! | `feed`, [`wire`] | what the telemetry and the bus tell |
//! | [`columns`], [`rows`] | the table of the charts' columns, and their rows |
//! | [`chains`], [`rhythm`], [`light`], [`minute`] | diagrams of the chains, histograms, the claim's light, what can be saved |
//! | [`http`], `client` | requests and responses, a connection |
//! | [`control`] | what the page may ask for |
//! | [`metrics`] | the state for Prometheus |
//! | [`assets`] | the files of the page |
//! | `server` | who gets what |
//! | [`cli`] | the command line |
//!
//! The interface is described in `bench/docs/watch.md`.

mod assets;
mod chains;
pub mod cli;
pub mod client;
mod columns;
mod control;
mod feed;
mod http;
mod light;
mod metrics;
mod minute;
mod rhythm;
mod rows;
mod server;
mod state;
mod view;
mod wire;

use cli::WatchArguments;
use protocol::bus::BusError;
use protocol::exit::Exit;
use realtime::Interrupt;
use server::Server;
use std::io;
use std::net::SocketAddr;
use std::time::{SystemTime, UNIX_EPOCH};

/// What keeps the page from being served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("cannot listen at {address}: {reason}; choose another with --http, port 0 for a free one")]
    Listen { address: SocketAddr, reason: String },
    /// The system gave no signal handler, no poll, or no random numbers.
    #[error("{0}")]
    System(io::Error),
}

impl LiveError {
    pub fn exit(&self) -> Exit {
        if matches!(self, Self::Bus(_)) { Exit::BusFailed } else { Exit::BadInput }
    }
}

/// The time of day `age_ns` ago, ns since the Unix epoch, which candump's stamps are.
pub fn wall_clock_ns(age_ns: u64) -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (now.as_nanos() as u64).saturating_sub(age_ns)
}

/// Serves the page until a signal comes.
pub fn run(arguments: &WatchArguments) -> Result<Exit, LiveError> {
    let interrupt = Interrupt::watch().map_err(LiveError::System)?;
    let mut server = Server::open(arguments)?;
    server.announce();
    while !interrupt.came() {
        server.turn().map_err(LiveError::System)?;
    }
    Ok(Exit::Interrupted)
}
