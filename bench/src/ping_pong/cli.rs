//! The ping-pong's command line.

use crate::probe::cli::seconds;
use clap::Args;
use protocol::bus::BusUrl;
use std::path::PathBuf;

/// What is measured, how, and where the figures go.
#[derive(Args, Debug)]
pub(crate) struct PingPongArguments {
    /// Bus that both processes are peers of: can://IFACE, or unix:///PATH that somebody hosts ('emulator bus').
    #[arg(long, required_unless_present = "socketpair", conflicts_with = "socketpair")]
    pub bus: Option<BusUrl>,
    /// A bare pair of sockets between the two instead of a bus.
    #[arg(long)]
    pub socketpair: bool,
    /// FIFO priority of both processes.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=98))]
    pub priority: u8,
    /// CPU of the process that asks; not pinned without it.
    #[arg(long)]
    pub cpu: Option<usize>,
    /// CPU of the process that answers; not pinned without it.
    #[arg(long)]
    pub peer_cpu: Option<usize>,
    /// Time between two pings.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(50..=1_000_000))]
    pub interval_us: u64,
    /// How long to measure.
    #[arg(long, default_value = "10", value_parser = seconds)]
    pub seconds: f64,
    /// Ask the system for no priority, no locked memory and no latency request.
    #[arg(long)]
    pub no_realtime: bool,
    /// Write the histogram as an HdrHistogram log.
    #[arg(long, value_name = "FILE.hlog")]
    pub out: Option<PathBuf>,
    /// Add the figures to this JSON file, made if missing, under the name.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Name of the figures; by default 'socketpair' or 'bus'.
    #[arg(long)]
    pub name: Option<String>,
}

/// How to answer.
#[derive(Args, Debug)]
pub(crate) struct PongArguments {
    /// The bus; without it, standard input is one of a pair of sockets.
    #[arg(long)]
    pub bus: Option<BusUrl>,
    /// FIFO priority; without it, nothing is asked of the system.
    #[arg(long)]
    pub priority: Option<u8>,
    /// CPU to be pinned to.
    #[arg(long)]
    pub cpu: Option<usize>,
}
