//! Process 2: the axis controllers behind a bus.

use clap::Parser;
use controller::cli::{Cli, Command};
use controller::plugin::command;
use protocol::exit::Exit;
use std::process::ExitCode;

#[cfg(feature = "count-allocations")]
#[global_allocator]
static ALLOCATOR: realtime::allocations::CountingAllocator = realtime::allocations::CountingAllocator;

fn main() -> ExitCode {
    let exit = match Cli::parse().command {
        Command::Run(arguments) => controller::run::run(&arguments).unwrap_or_else(|error| {
            eprintln!("controller: {error}");
            error.exit()
        }),
        Command::CheckLibrary(library) => command::check_library(&library.file).unwrap_or_else(|error| {
            eprintln!("controller: {error}");
            Exit::BadInput
        }),
        Command::ProbeLibrary(library) => command::probe_library(&library.file),
    };
    exit.into()
}
