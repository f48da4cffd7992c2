//! The program: parses the command line, runs its command, returns its exit code.

use crate::bus_load;
use crate::cli::{BusArguments, Cli, Command, DEFAULT_FIFO_PRIORITY};
use crate::run::{self, RunError};
use crate::{catalogue, faults, seal};
use clap::Parser;
use protocol::bus::BusUrl;
use protocol::bus::host::Host;
use protocol::exit::Exit;
use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Runs the command that the process's arguments name; returns the exit code of the process.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Bus(arguments) => host_bus(&arguments),
        Command::Seal(arguments) => seal::seal(&arguments).map(print),
        Command::Effects(arguments) => Ok(print(catalogue::text(&arguments))),
        Command::Faults(arguments) => faults::listing::text(&arguments).map(print),
        Command::BusLoad(arguments) => bus_load::text(&arguments).map(print),
    };
    let exit = result.unwrap_or_else(|error| {
        protocol::say!("emulator: {error}");
        error.exit()
    });
    exit.into()
}

/// Prints a result; a closed pipe, as of `| head`, is no error.
fn print(text: String) -> Exit {
    let _ = writeln!(std::io::stdout(), "{text}");
    Exit::Good
}

fn host_bus(arguments: &BusArguments) -> Result<Exit, RunError> {
    let BusUrl::Unix { path, wire } = &arguments.bus else {
        return Err(RunError::Input("only an embedded bus, unix:///PATH, needs a host".into()));
    };
    let interrupt = run::install_interrupt()?;
    let host = run::start_host(Host::bind(path, *wire, None)?, Some(DEFAULT_FIFO_PRIORITY + 1));
    protocol::say!("emulator: hosting {}; Ctrl-C ends it", arguments.bus);
    let began = Instant::now();
    let time_up = || arguments.seconds.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds);
    while !interrupt.came() && !time_up() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let Some(report) = run::stop_host(host) else { return Ok(Exit::BusFailed) };
    // A closed pipe is no error.
    let _ = writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&report).unwrap_or_default());
    Ok(if time_up() { Exit::Good } else { Exit::Interrupted })
}
