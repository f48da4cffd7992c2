//! The command line.

use crate::shard::ShardArgument;
use clap::{Args, Parser, Subcommand};
use protocol::exit::EXIT_CODE_HELP;
use std::path::PathBuf;

/// Thousands of simulated runs from one file: shared out over cores and machines, merged into one table and one page.
#[derive(Parser, Debug)]
#[command(version, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What can be done with a campaign.
#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Print the number of runs and the values of the first ones; runs nothing.
    Plan(PlanArguments),
    /// Make the missing runs of a campaign or of one shard; a complete campaign is merged at the end.
    Run(RunArguments),
    /// Merge parts, of one folder or of several, into runs.csv and report.html.
    Merge(MergeArguments),
    /// Repeat one run: an experiment as emulator and controller in lockstep, with all files of a run; a program as it was.
    Repeat(RepeatArguments),
}

/// Where things are.
#[derive(Args, Clone, Debug)]
pub(crate) struct CommonArguments {
    /// Path of the campaign file, a TOML file as in campaign/campaigns; required, no default.
    pub(crate) file: PathBuf,
    /// Folder with the shipped experiments and programs.
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../controller"))]
    pub(crate) shipped: PathBuf,
    /// Folder of the programs emulator and controller; default: that of this one.
    #[arg(long)]
    pub(crate) programs: Option<PathBuf>,
}

/// Arguments of `plan`.
#[derive(Args, Debug)]
pub(crate) struct PlanArguments {
    #[command(flatten)]
    pub(crate) common: CommonArguments,
    /// How many of the first runs to print.
    #[arg(long, default_value_t = 5)]
    pub(crate) first: u64,
    /// As JSON, for programs, on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `run`.
#[derive(Args, Debug)]
pub(crate) struct RunArguments {
    #[command(flatten)]
    pub(crate) common: CommonArguments,
    /// Folder of its parts and results; default: runs/campaigns/NAME.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Shard to run: INDEX/COUNT, INDEX from 0; COUNT alone takes the index from Slurm or Kubernetes.
    #[arg(long, value_name = "INDEX/COUNT")]
    pub(crate) shard: Option<ShardArgument>,
    /// Runs at once; default: as many as there are cores.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub(crate) jobs: Option<u64>,
    /// Exit with 1 unless every run came to its end and kept its experiment's bounds.
    #[arg(long, conflicts_with = "shard")]
    pub(crate) expect_passed: bool,
}

/// Arguments of `merge`.
#[derive(Args, Debug)]
pub(crate) struct MergeArguments {
    #[command(flatten)]
    pub(crate) common: CommonArguments,
    /// Folders with its parts; default: runs/campaigns/NAME.
    pub(crate) folders: Vec<PathBuf>,
    /// Folder of the results; default: the first of the folders.
    #[arg(long)]
    pub(crate) to: Option<PathBuf>,
    /// Exit with 1 unless every run came to its end and kept its experiment's bounds.
    #[arg(long)]
    pub(crate) expect_passed: bool,
}

/// Arguments of `repeat`.
#[derive(Args, Debug)]
pub(crate) struct RepeatArguments {
    #[command(flatten)]
    pub(crate) common: CommonArguments,
    /// Number of the run.
    pub(crate) run: u64,
    /// Folder of its files; default: runs/NAME-run-NUMBER.
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}
