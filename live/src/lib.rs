//! The live page: a web page that shows a run in progress and lets users act on it.
//!
//! ```text
//!   emulator --telemetry ── Unix stream ──► feed ──┐                       ┌── browser: page, events (SSE), controls
//!                                                  ├──► view ──► server ───┼── programs: /api/…
//!   bus ────────────────── one peer ───────► wire ─┘                       └── Prometheus: /metrics
//! ```
//!
//! One thread: it polls bus and telemetry every 10 ms and blocks on clients alone in between, so that a bus of 8000 frames per
//! second wakes it a hundred times per second. Each client has a bounded queue and misses what does not fit. The run is
//! unaffected by this program; when it dies, the emulator closes its socket.
//!
//! | file | holds |
//! |---|---|
//! | [`view`], [`state`] | the data of the run, and what the page shows of it |
//! | `feed`, [`wire`] | input from telemetry and bus |
//! | [`columns`], [`rows`] | the table of the charts' columns, and their rows |
//! | [`chains`], [`rhythm`], [`light`], [`minute`] | chain diagrams, histograms, the latency claim, records of the last minute |
//! | [`http`], `client` | requests and responses, a connection |
//! | [`control`] | the requests of the page |
//! | [`metrics`] | the state for Prometheus |
//! | [`assets`] | the files of the page |
//! | `server` | the loop, the paths and the clients |
//! | [`cli`] | the command line |
//!
//! The interface is described in `bench/docs/watch.md`.

#![warn(missing_docs)] // an interface of other crates

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
use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::time::{SystemTime, UNIX_EPOCH};

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The bus cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The port of the page cannot be opened.
    #[error("cannot listen at {address}: {reason}; choose another with --http, port 0 for a free one")]
    Listen {
        /// Address and port that were asked for.
        address: SocketAddr,
        /// Message of the system.
        reason: String,
    },
    /// The system gave no signal handler, no poll, or no random numbers.
    #[error("{0}")]
    System(io::Error),
}

impl LiveError {
    /// Exit code of a program that ends with this error.
    pub fn exit(&self) -> Exit {
        if matches!(self, Self::Bus(_)) { Exit::BusFailed } else { Exit::BadInput }
    }
}

/// The time of day `age_ns` ago, ns since the Unix epoch, as candump stamps frames.
pub fn wall_clock_ns(age_ns: u64) -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (now.as_nanos() as u64).saturating_sub(age_ns)
}

/// Adds to a queue that holds the newest `most`.
fn push_newest<T>(queue: &mut VecDeque<T>, most: usize, newest: T) {
    queue.push_back(newest);
    if queue.len() > most {
        queue.pop_front();
    }
}

/// Serves the page until SIGINT or SIGTERM; returns the exit code of the program.
///
/// # Errors
/// [`LiveError`] when bus, port or system fail.
pub fn run(arguments: &WatchArguments) -> Result<Exit, LiveError> {
    let interrupt = Interrupt::install().map_err(LiveError::System)?;
    let mut server = Server::open(arguments)?;
    server.announce();
    while !interrupt.came() {
        server.turn().map_err(LiveError::System)?;
    }
    Ok(Exit::Interrupted)
}
