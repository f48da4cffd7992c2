//! The command line of the live page.

use clap::Args;
use protocol::bus::BusUrl;
use std::net::SocketAddr;
use std::path::PathBuf;

/// What to show to whom.
#[derive(Args, Debug)]
pub struct WatchArguments {
    /// Bus to watch: can://IFACE or unix:///PATH.
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub(crate) bus: BusUrl,
    /// Socket that the emulator was given with --telemetry; without it the page shows what is on the bus.
    #[arg(long, value_name = "PATH")]
    pub(crate) telemetry: Option<PathBuf>,
    /// Address and port of the page; port 0 takes a free one and prints it. Whoever reaches an address beyond loopback sees
    /// the run.
    #[arg(long, default_value = "127.0.0.1:8080", value_name = "ADDRESS:PORT")]
    pub(crate) http: SocketAddr,
    /// Let the page act: emergency stop, start, faults. It needs the token that is printed with the address; what acts on the rig
    /// itself also needs 'emulator run --console'.
    #[arg(long)]
    pub(crate) control: bool,
    /// The run's folder, whose run.json tells what was granted [default: the one that the telemetry names].
    #[arg(long, value_name = "DIR")]
    pub(crate) run: Option<PathBuf>,
    /// Folder in which records are saved [default: the run's].
    #[arg(long, value_name = "DIR")]
    pub(crate) save: Option<PathBuf>,
    /// Maximum number of browsers and other clients; a further one is refused.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) clients: u16,
}
