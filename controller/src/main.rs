//! Process 2: the axis controllers behind a bus.

use clap::Parser;
use controller::cli::{Cli, Command};
use controller::run::RunError;
use plugin::command;
use std::process::ExitCode;

#[cfg(feature = "count-allocations")]
#[global_allocator]
static ALLOCATOR: realtime::allocations::CountingAllocator = realtime::allocations::CountingAllocator;

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Run(arguments) => controller::run::run(&arguments),
        Command::Rehearse(arguments) => controller::rehearse::run(&arguments),
        Command::Algorithms => Ok(controller::listing::print()),
        Command::Parameters(files) => controller::listing::print_parameters(&files),
        Command::A2l(arguments) => controller::listing::print_a2l(&arguments),
        Command::CheckLibrary(library) => command::check_library(&library.file).map_err(RunError::from),
        Command::ProbeLibrary(library) => Ok(command::probe_library(&library.file)),
    };
    let exit = result.unwrap_or_else(|error| {
        eprintln!("controller: {error}");
        error.exit()
    });
    exit.into()
}
