//! The command line of `bench can`.

use clap::Args;
use protocol::bus::BusUrl;
use std::ffi::OsString;
use std::str::FromStr;

/// An interface for the program, and its bus.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct InterfaceArgument {
    /// Name of the interface.
    pub name: String,
    /// The bus that it stands for.
    pub bus: BusUrl,
}

impl FromStr for InterfaceArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, url) = text.split_once('=').ok_or("NAME=URL, as in can1=unix:///tmp/bus1")?;
        // What an interface may be called is what its URL may hold.
        match format!("can://{name}").parse() {
            Ok(BusUrl::Can { interface }) => {
                Ok(Self { name: interface, bus: url.parse().map_err(|error| format!("{error}"))? })
            }
            Ok(BusUrl::Unix { .. }) => unreachable!("it was made with can://"),
            Err(error) => Err(format!("{error}")),
        }
    }
}

/// Which program on which buses.
#[derive(Args, Debug)]
pub(crate) struct CanArguments {
    /// The embedded bus that the program sees as vcan0.
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub bus: BusUrl,
    /// An interface of another name, in place of vcan0; may be repeated.
    #[arg(long = "interface", value_name = "NAME=URL", conflicts_with = "pair")]
    pub interfaces: Vec<InterfaceArgument>,
    /// Host the bus too, for programs without a rig; without a command until Ctrl-C.
    #[arg(long)]
    pub pair: bool,
    /// How long to wait for the host of a bus before the program starts, s.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub wait_s: u16,
    /// Send the program SIGTERM when the host of a bus ends, for one that does not notice.
    #[arg(long)]
    pub end_with_bus: bool,
    /// The program and its arguments, unmodified.
    #[arg(last = true, value_name = "COMMAND")]
    pub command: Vec<OsString>,
}
