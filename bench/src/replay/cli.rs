//! The replay's command line.

use super::kind::Exclusion;
use clap::Args;
use protocol::bus::BusUrl;
use std::path::PathBuf;

/// What is put back on which bus, and how.
#[derive(Args, Debug)]
pub(crate) struct ReplayArguments {
    /// A run's folder, or a log of 'candump -L'.
    #[arg(value_name = "RUN|LOG")]
    pub source: PathBuf,
    /// The bus: can://IFACE, or unix:///PATH that somebody hosts ('emulator bus').
    #[arg(long)]
    pub bus: BusUrl,
    /// Leave out what controllers, console and bench sent (commands), what the rig sent (rig), or identifiers in hexadecimal
    /// (120, or 8 digits); several, with commas between.
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    pub leave_out: Vec<Exclusion>,
    /// Take what was seen at this interface alone.
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// How long to listen for a live rig before anything is sent.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u64).range(50..=60_000))]
    pub listen_ms: u64,
    /// How long to wait for the bus.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(0..=3600))]
    pub wait_s: u64,
    /// Write replay.json and replay.hlog into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// FIFO priority; without it, nothing is asked of the system.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=98))]
    pub priority: Option<u8>,
    /// CPU to be pinned to.
    #[arg(long)]
    pub cpu: Option<usize>,
    /// Wake up so much earlier and look at the clock until a frame is due.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=1000))]
    pub spin_us: u64,
}
