//! The bench's command line.

use crate::soak::cli::{ChildArguments, SoakArguments};
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
    /// Join what emulator and controllers left in a run's folder, judge it, draw it, and print a short table.
    Summary(SummaryArguments),
    /// Lay runs of one experiment side by side: figures with their change against the first run, curves over each other.
    Compare(CompareArguments),
    /// Tell how much each figure spreads over repetitions of one experiment.
    Spread(SpreadArguments),
    /// List all figures with unit and meaning.
    Figures,
    /// Check the bounds of an experiment file: figures that exist, numbers that make sense.
    CheckExperiment(CheckArguments),
    /// Run emulator and controllers over hours, segment by segment, and account for every frame.
    Soak(Box<SoakArguments>),
    /// Become a program that ends with the one that starts it; `soak` starts this.
    #[command(hide = true)]
    SoakChild(ChildArguments),
}

/// Which run to sum up.
#[derive(Args, Debug)]
pub struct SummaryArguments {
    /// The run's folder.
    pub folder: PathBuf,
}

/// Which runs to compare.
#[derive(Args, Debug)]
pub struct CompareArguments {
    /// The runs' folders; changes are against the first.
    #[arg(required = true, num_args = 2.., value_name = "RUN")]
    pub folders: Vec<PathBuf>,
    /// Write a page that stands by itself, and its table in Markdown: a file that ends with .html, or a folder.
    #[arg(long, value_name = "FILE.html|DIR")]
    pub out: Option<PathBuf>,
    /// Compare runs of different experiments too.
    #[arg(long)]
    pub anyway: bool,
}

/// Which runs are repetitions of each other.
#[derive(Args, Debug)]
pub struct SpreadArguments {
    /// The runs' folders.
    #[arg(required = true, num_args = 2.., value_name = "RUN")]
    pub folders: Vec<PathBuf>,
    /// Write spread.md and spread.json into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Take runs of different experiments too.
    #[arg(long)]
    pub anyway: bool,
}

/// Which experiment to check.
#[derive(Args, Debug)]
pub struct CheckArguments {
    /// The experiment file.
    pub file: PathBuf,
}
