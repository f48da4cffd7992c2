//! Process 2: the axis controllers behind a bus.

use clap::Parser;
use controller::cli::{Cli, Command};
use std::process::ExitCode;

#[cfg(feature = "count-allocations")]
#[global_allocator]
static ALLOCATOR: realtime::allocations::CountingAllocator = realtime::allocations::CountingAllocator;

fn main() -> ExitCode {
    let Command::Run(arguments) = Cli::parse().command;
    let exit = controller::run::run(&arguments).unwrap_or_else(|error| {
        eprintln!("controller: {error}");
        error.exit()
    });
    exit.into()
}
