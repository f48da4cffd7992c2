//! Process beside plant and controller: sums up, judges and draws what they left behind.

use bench::cli::{Cli, Command};
use bench::{SummaryError, join, picture, table};
use clap::Parser;
use protocol::exit::Exit;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Command::Summary(arguments) = Cli::parse().command;
    let exit = sum_up(&arguments.folder).unwrap_or_else(|error| {
        eprintln!("bench: {error}");
        Exit::BadInput
    });
    exit.into()
}

#[allow(clippy::print_stdout)] // the table is the command's result
fn sum_up(folder: &Path) -> Result<Exit, SummaryError> {
    let joined = join::join(folder)?;
    picture::draw(folder, joined.has_controller)?;
    println!("{}", table::table(&joined));
    println!(
        "  files in {}: picture.svg, summary.json, measurement.csv, truth.csv, bus.log, …",
        folder.display()
    );
    Ok(if joined.passed() { Exit::Good } else { Exit::BoundBroken })
}
