//! Campaigns as a program.

use campaign::cli::Cli;
use campaign::commands;
use clap::Parser;
use protocol::exit::Exit;
use std::process::ExitCode;

fn main() -> ExitCode {
    let exit = commands::run(&Cli::parse()).unwrap_or_else(|error| {
        eprintln!("campaign: {error}");
        Exit::BadInput
    });
    exit.into()
}
