//! The controller's command line.

use axis_control::setup::FileArguments;
use clap::{Args, Parser, Subcommand, ValueEnum};
use nominal::Axis;
use protocol::bus::BusUrl;
use protocol::exit::EXIT_CODE_HELP;
use std::path::PathBuf;

/// Controls the axes of the rig over a CAN bus.
#[derive(Debug, Parser)]
#[command(name = "controller", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What the controller can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run an experiment with the rig on a bus.
    Run(Box<RunArguments>),
    /// Run an experiment with the plant model inside this process: no bus, faster than real time, the same program.
    Rehearse(Box<RehearseArguments>),
    /// List the algorithms with their parameters, and the parameters of the tasks around them.
    Algorithms,
    /// Print the parameters of both axes as a parameter set, for --parameters.
    Parameters(Box<FileArguments>),
    /// Print the A2L file of an axis, for tools that speak XCP.
    A2l(Box<A2lArguments>),
    /// Try an algorithm from a shared library and print what it offers.
    CheckLibrary(Library),
    /// Try it in this very process, which it may end; `check-library` and program files start this.
    #[command(hide = true)]
    ProbeLibrary(Library),
}

/// What an A2L file is made for.
#[derive(Args, Debug)]
pub(crate) struct A2lArguments {
    /// What is controlled.
    #[command(flatten)]
    pub(crate) files: FileArguments,
    /// Axis that the file describes.
    #[arg(long, value_enum)]
    pub(crate) axis: OneAxis,
}

/// One of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OneAxis {
    /// Position controlled.
    Drive,
    /// Force controlled.
    Load,
}

/// An algorithm as a file.
#[derive(Args, Debug)]
pub(crate) struct Library {
    /// Shared library, built against airbench_algorithm.h.
    pub(crate) file: PathBuf,
}

/// How the controllers are paced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Pace {
    /// Answer the rig's frames as they arrive.
    Real,
    /// Join the barrier of the embedded bus.
    Lockstep,
}

/// Which axes a process controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axes {
    /// The drive's alone; another process has the load.
    Drive,
    /// The load's alone; another process has the drive.
    Load,
    /// Both, which still know each other only as over the bus.
    Both,
}

impl Axes {
    /// The axes, in the order in which they are answered.
    pub(crate) fn list(self) -> &'static [Axis] {
        match self {
            Self::Drive => &[Axis::Drive],
            Self::Load => &[Axis::Load],
            Self::Both => &Axis::ALL,
        }
    }
}

/// How to run with a rig on a bus.
#[derive(Args, Debug)]
pub(crate) struct RunArguments {
    /// What is controlled.
    #[command(flatten)]
    pub(crate) files: FileArguments,
    /// Bus: can://IFACE (SocketCAN) or unix:///PATH (embedded).
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub(crate) bus: BusUrl,
    /// Which axes this process controls.
    #[arg(long, value_enum, default_value_t = Axes::Both)]
    pub(crate) axis: Axes,
    /// Run without the other axis's controller; needs --axis drive or load.
    #[arg(long)]
    pub(crate) alone: bool,
    /// real: answer frames as they arrive; lockstep: join the barrier.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    pub(crate) pace: Pace,
    /// Look for changes of the program files while running, and take over their numbers.
    #[arg(long)]
    pub(crate) watch: bool,
    /// Let XCP on CAN measure the controllers (drive 0x1E0 and 0x1E1, load 0x1E2 and 0x1E3), and change their parameters with the
    /// key of FILE; without FILE nothing can be changed. See controller/docs/xcp.md.
    #[arg(long, value_name = "FILE", num_args = 0..=1)]
    pub(crate) xcp: Option<Option<PathBuf>>,
    /// Write the time stamps of every cycle to controller-timing.csv, about 200 bytes a cycle; only with --pace real.
    #[arg(long)]
    pub(crate) full_timing: bool,
    /// Freeze the flight recorder when waking or executing takes longer than this, in us; with --pace real.
    #[arg(long, default_value_t = 500, value_name = "US", value_parser = clap::value_parser!(u64).range(1..=60_000_000))]
    pub(crate) flight_late_us: u64,
    /// Turn off the flight recorder.
    #[arg(long)]
    pub(crate) no_flight: bool,
    /// How long bus and sensors may be gone before giving up, in s.
    #[arg(long, default_value_t = 10.0, value_parser = grace)]
    pub(crate) bus_grace: f64,
    /// FIFO priority, 1 to 99.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(crate) fifo_priority: u8,
    /// CPU to be pinned to; not pinned without it.
    #[arg(long)]
    pub(crate) cpu: Option<usize>,
    /// Ask the system for no priority, no locked memory and no latency request.
    #[arg(long)]
    pub(crate) no_realtime: bool,
}

/// How to rehearse.
#[derive(Args, Debug)]
pub(crate) struct RehearseArguments {
    /// What is controlled.
    #[command(flatten)]
    pub(crate) files: FileArguments,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// End after this much of the rig's time, in s, if the experiment is not done before.
    #[arg(long, default_value_t = 600.0, value_parser = grace)]
    pub(crate) seconds: f64,
}

fn grace(text: &str) -> Result<f64, String> {
    let allowed = |seconds: &f64| (0.1..=86400.0).contains(seconds);
    text.parse().ok().filter(allowed).ok_or_else(|| format!("'{text}' is not a time of 0.1 to 86400 seconds"))
}
