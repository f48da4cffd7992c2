//! The gateway's command line.

use clap::Args;
use protocol::bus::BusUrl;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Which bus for whom.
#[derive(Args, Debug)]
pub(crate) struct GatewayArguments {
    /// Bus to serve: can://IFACE or unix:///PATH.
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub bus: BusUrl,
    /// Address and port to listen at; port 0 takes a free one and prints it. Whoever reaches an address beyond loopback can move
    /// the rig: the protocol knows no password.
    #[arg(long, default_value = "127.0.0.1:29536", value_name = "ADDRESS:PORT")]
    pub listen: SocketAddr,
    /// Name by which clients open the bus [default: the interface, or the file name of the embedded bus].
    #[arg(long, value_parser = bus_name)]
    pub name: Option<String>,
    /// Maximum number of clients; a further one gets an error and is disconnected.
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub clients: u16,
    /// Frames that wait for a client that reads slowly; what does not fit is lost to it, and counted.
    #[arg(long, default_value_t = 8192, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub queue_frames: u32,
    /// Clients hear the bus and send nothing.
    #[arg(long)]
    pub read_only: bool,
    /// Write what was counted of each client to this file when the gateway ends.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
}

fn bus_name(text: &str) -> Result<String, String> {
    let allowed = |c: char| c.is_ascii_graphic() && c != '<' && c != '>';
    if (1..=protocol::bus::LONGEST_NAME).contains(&text.len()) && text.chars().all(allowed) {
        return Ok(text.into());
    }
    Err("a name has 1 to 64 printable ASCII characters without spaces, '<' and '>'".into())
}
