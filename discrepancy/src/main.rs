//! The discrepancy workflow as a program.

use clap::Parser;
use discrepancy::cli::Cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    let exit = discrepancy::commands::run(&Cli::parse()).unwrap_or_else(|error| {
        eprintln!("discrepancy: {error}");
        error.exit()
    });
    exit.into()
}
