//! The bench's command line.

use clap::{Args, Parser, Subcommand};
use protocol::exit::EXIT_CODE_HELP;
use std::path::PathBuf;

/// Works on what runs leave behind.
#[derive(Debug, Parser)]
#[command(name = "bench", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What the bench can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Join what emulator and controller left in a run's folder, judge it, draw it, and print a short table.
    Summary(SummaryArguments),
}

/// Which run to sum up.
#[derive(Args, Debug)]
pub struct SummaryArguments {
    /// The run's folder.
    pub folder: PathBuf,
}
