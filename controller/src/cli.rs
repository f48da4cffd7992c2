//! The controller's command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use protocol::bus::BusUrl;
use protocol::exit::EXIT_CODE_HELP;
use protocol::run_folder;
use std::path::PathBuf;

/// Controls the axes of the rig over a CAN bus.
#[derive(Debug, Parser)]
#[command(name = "controller", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What the controller can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run an experiment: position the drive axis, hold the load's valve shut.
    Run(Box<RunArguments>),
    /// Try an algorithm from a shared library and print what it offers.
    CheckLibrary(Library),
    /// Try it in this very process, which it may end; `check-library` and program files start this.
    #[command(hide = true)]
    ProbeLibrary(Library),
}

/// An algorithm as a file.
#[derive(Args, Debug)]
pub struct Library {
    /// Shared library, built against airbench_algorithm.h.
    pub file: PathBuf,
}

/// How the controllers are paced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pace {
    /// Answer the rig's frames as they arrive.
    Real,
    /// Join the barrier of the embedded bus.
    Lockstep,
}

/// How to run.
#[derive(Args, Debug)]
pub struct RunArguments {
    /// Bus: can://IFACE (SocketCAN) or unix:///PATH (embedded).
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub bus: BusUrl,
    /// Rig file, of which nominal numbers are read: valve characteristic, areas, stroke.
    #[arg(long)]
    pub rig: PathBuf,
    /// Experiment file: motion, repetitions, algorithm and gains.
    #[arg(long)]
    pub experiment: PathBuf,
    /// Folder for the run's files, made if missing; give both programs the same. Default: a new one named by the time.
    #[arg(long, default_value_os_t = run_folder::new_folder())]
    pub out: PathBuf,
    /// real: answer frames as they arrive; lockstep: join the barrier.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    pub pace: Pace,
    /// Repeat the experiment until the rig ends, instead of saying Done.
    #[arg(long)]
    pub repeat: bool,
    /// How long bus and sensors may be gone before giving up, in s.
    #[arg(long, default_value_t = 10.0, value_parser = grace)]
    pub bus_grace: f64,
    /// FIFO priority, 1 to 99.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    pub fifo_priority: u8,
    /// CPU to be pinned to; not pinned without it.
    #[arg(long)]
    pub cpu: Option<usize>,
    /// Ask the system for no priority, no locked memory and no latency request.
    #[arg(long)]
    pub no_realtime: bool,
}

fn grace(text: &str) -> Result<f64, String> {
    let allowed = |seconds: &f64| (0.1..=86400.0).contains(seconds);
    text.parse().ok().filter(allowed).ok_or_else(|| format!("'{text}' is not a time of 0.1 to 86400 seconds"))
}
