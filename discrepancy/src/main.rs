//! The discrepancy workflow as a program.

use clap::Parser;
use discrepancy::cli::Cli;
use protocol::exit::Exit;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    discrepancy::commands::end_when_asked();
    let exit = discrepancy::commands::run(&cli).unwrap_or_else(|error| {
        eprintln!("discrepancy: {error}");
        Exit::BadInput
    });
    exit.into()
}
