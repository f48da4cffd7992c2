//! The bench's command line.

use crate::can::cli::CanArguments;
use crate::conformance::cli::ConformanceArguments;
use crate::export::cli::ExportArguments;
use crate::export_fmu::ExportFmuArguments;
use crate::gateway::cli::GatewayArguments;
use crate::ping_pong::cli::{PingPongArguments, PongArguments};
use crate::probe::cli::ProbeArguments;
use crate::replay::cli::ReplayArguments;
use crate::soak::cli::{ChildArguments, SoakArguments};
use clap::{Args, Parser, Subcommand};
use latency::table::LatencyTableArguments;
use live::cli::WatchArguments;
use protocol::exit::EXIT_CODE_HELP;
use std::path::PathBuf;

/// Tools around emulator and controller: evaluate runs, measure latency, serve and check the bus.
#[derive(Debug, Parser)]
#[command(name = "bench", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What the bench can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Join what emulator and controllers left in a run's folder, judge it, draw it, and print a short table.
    Summary {
        /// Folder that emulator and controllers of one run wrote.
        folder: PathBuf,
    },
    /// Lay runs of one experiment side by side: figures with their change against the first run, curves over each other.
    Compare(CompareArguments),
    /// Print the spread of each figure over repetitions of one experiment.
    Spread(SpreadArguments),
    /// List all figures with unit and meaning.
    Figures,
    /// Report the latencies of runs: percentiles, worst events with their causes, a reference beside them, groups side by side.
    Report(ReportArguments),
    /// Name the one cause that a latency report gives for what went wrong in its runs: on stdout its name, or `nothing`.
    Cause {
        /// Written by `bench report`.
        #[arg(value_name = "REPORT.json")]
        file: PathBuf,
    },
    /// Check the bounds of an experiment file: figures that exist, numbers that make sense.
    CheckExperiment {
        /// Experiment file in TOML, such as controller/experiments/point-to-point.toml.
        file: PathBuf,
    },
    /// Run emulator and controllers over hours, segment by segment, and account for every frame.
    Soak(Box<SoakArguments>),
    /// Become a program that ends with the one that starts it; `soak` starts this.
    #[command(hide = true)]
    SoakChild(ChildArguments),
    /// Detect scheduling gaps: a spinning thread on each CPU records every interval in which it did not run.
    Probe(ProbeArguments),
    /// Measure round trips of 16 bytes between two processes, as a reference for those of rig and controller.
    PingPong(PingPongArguments),
    /// Serve a bus over TCP by the socketcand protocol, for python-can, cantools and SavvyCAN.
    Gateway(GatewayArguments),
    /// Run any SocketCAN program, unmodified, with an embedded bus as its interface vcan0; the kernel needs no CAN. The exit
    /// code is the program's.
    Can(Box<CanArguments>),
    /// Show a run while it goes on, as a page for browsers, as JSON and for Prometheus; and act on it, if it is allowed.
    Watch(WatchArguments),
    /// Check whether a foreign controller keeps the contract of the bus: timing, counters, checksums, reaction to faults.
    CheckController(Box<ConformanceArguments>),
    /// Print the table of ratios of a latency report, in Markdown.
    LatencyTable(LatencyTableArguments),
    /// Write a log of the bus as CSV, MDF4, ASC or BLF, or a whole run as MCAP or a trace.
    Export(ExportArguments),
    /// Put a recorded log back on a bus by absolute time, and report the timing error.
    Replay(ReplayArguments),
    /// Write the plant as a Functional Mock-up Unit, FMI 2.0 for co-simulation.
    ExportFmu(ExportFmuArguments),
    /// The process that answers; ping-pong starts it.
    #[command(hide = true)]
    Pong(PongArguments),
}

/// Which runs to compare.
#[derive(Args, Debug)]
pub(crate) struct CompareArguments {
    /// The runs' folders; changes are against the first.
    #[arg(required = true, num_args = 2.., value_name = "RUN")]
    pub(crate) folders: Vec<PathBuf>,
    /// Write a self-contained page, and its table in Markdown: a file that ends with .html, or a folder.
    #[arg(long, value_name = "FILE.html|DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Compare runs of different experiments too.
    #[arg(long)]
    pub(crate) anyway: bool,
    /// Show each signal's difference from the first run, instead of figures and curves.
    #[arg(long)]
    pub(crate) differences: bool,
}

/// Which runs are repetitions of each other.
#[derive(Args, Debug)]
pub(crate) struct SpreadArguments {
    /// The runs' folders.
    #[arg(required = true, num_args = 2.., value_name = "RUN")]
    pub(crate) folders: Vec<PathBuf>,
    /// Write spread.md and spread.json into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Take runs of different experiments too.
    #[arg(long)]
    pub(crate) anyway: bool,
}

/// What to report on.
#[derive(Args, Debug)]
pub(crate) struct ReportArguments {
    /// Folders of runs, or folders that hold some.
    #[arg(required_unless_present = "group", value_name = "RUN")]
    pub(crate) folders: Vec<PathBuf>,
    /// Write report.html, report.md, report.json, latency.hlog and jitterdebugger.json here [default: the run's folder, or
    /// `report` beside several].
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Heading of the report.
    #[arg(long)]
    pub(crate) title: Option<String>,
    /// Compare runs by the group named in their conditions.json; the first run's group is the reference. If there is only one
    /// group, each run is its own group.
    #[arg(long)]
    pub(crate) compare: bool,
    /// Put a run, or the runs in a folder, into a group to be set beside others; may be repeated.
    #[arg(long, value_name = "NAME=FOLDER")]
    pub(crate) group: Vec<String>,
    /// Hold the report against the bounds of a threshold file; exit with 1 when one is broken. A ratio whose interval crosses
    /// its bound is not resolved, which is no reason for 1.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) bounds: Option<PathBuf>,
    /// Write report.md only.
    #[arg(long)]
    pub(crate) markdown_only: bool,
}
