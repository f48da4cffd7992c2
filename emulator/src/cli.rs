//! The emulator's command line.

use crate::pace::Pace;
use clap::{Args, Parser, Subcommand, ValueEnum};
use protocol::bus::BusUrl;
use protocol::exit::EXIT_CODE_HELP;
use protocol::frames::{DRIVE_VALVE_COMMAND, LOAD_VALVE_COMMAND};
use realtime::OverrunPolicy;
use runlog::run_folder;
use std::path::PathBuf;

/// FIFO priority of the rig loop; above most of the system, below the kernel's own threads at 99.
pub(crate) const DEFAULT_FIFO_PRIORITY: u8 = 80;

/// Lateness that freezes the flight recorder: half a cycle.
const DEFAULT_FLIGHT_LATE_US: u64 = 500;

/// Emulates the servo-pneumatic rig on a CAN bus.
#[derive(Debug, Parser)]
#[command(name = "emulator", version, about, after_help = EXIT_CODE_HELP)]
pub struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What the emulator can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the rig: simulate both axes, send sensor frames, obey valve commands, record everything.
    Run(Box<RunArguments>),
    /// Host an embedded bus alone, without a rig.
    Bus(BusArguments),
    /// Draw hidden effects at random and write them to a file for 'emulator run --sealed'.
    Seal(SealArguments),
    /// List the effects that a rig file or a sealed file can switch on: names, places, numbers with unit and range, laws,
    /// sources.
    Effects(EffectsArguments),
    /// List the faults that a script or a person at the console can put into a run: names, places, numbers with unit and range.
    Faults(FaultsArguments),
    /// Print the worst-case load of the bus and each frame's worst-case response time, computed from rig.dbc.
    BusLoad(BusLoadArguments),
}

/// What to print of the bus's load.
#[derive(Args, Debug)]
pub(crate) struct BusLoadArguments {
    /// Print a Markdown table instead: each frame's worst-case bound, the modelled response at its critical instant, and the
    /// response measured in the run of SUMMARY (a bus with a bit rate).
    #[arg(long, value_name = "SUMMARY")]
    pub(crate) markdown: Option<PathBuf>,
}

/// How to run the rig.
#[derive(Args, Debug)]
pub(crate) struct RunArguments {
    /// Bus: can://IFACE (SocketCAN) or unix:///PATH[?loss=P&seed=N&bitrate=1000000&…] (embedded, hosted here; all options:
    /// protocol/docs/bus-that-keeps-time.md).
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub(crate) bus: BusUrl,
    /// Rig file with the plant's numbers.
    #[arg(long)]
    pub(crate) rig: PathBuf,
    /// Experiment file, of which `[rig]` is read: initial state, hands, and what people do when.
    #[arg(long)]
    pub(crate) experiment: Option<PathBuf>,
    /// Sealed file with hidden effects, from 'emulator seal'. Only the plant reads it; the effects appear in truth.csv alone.
    /// Overrides the experiment's sealed file.
    #[arg(long, value_name = "FILE")]
    pub(crate) sealed: Option<PathBuf>,
    /// Script of faults: what breaks when; 'emulator faults' lists what can, emulator/docs/faults.md tells how.
    #[arg(long, value_name = "FILE")]
    pub(crate) faults: Option<PathBuf>,
    /// Folder for the run's files, made if missing; give both programs the same. Default: a new one named by the time.
    #[arg(long, default_value_os_t = run_folder::new_folder())]
    pub(crate) out: PathBuf,
    /// End after this much simulated time; without it, when the controllers are done.
    #[arg(long, value_parser = seconds)]
    pub(crate) seconds: Option<f64>,
    /// real: one cycle each millisecond; lockstep: as fast as all members allow, to the byte the same every time.
    #[arg(long, default_value_t = Pace::Real)]
    pub(crate) pace: Pace,
    /// Lockstep: controllers that will join the barrier.
    #[arg(long, default_value_t = 1)]
    pub(crate) members: usize,
    /// Lockstep: foreign controllers that join by the echo in their commands; may be given twice.
    #[arg(long, value_enum)]
    pub(crate) lockstep_echo: Vec<EchoAxis>,
    /// Lockstep: how long to wait for the members to join, in s.
    #[arg(long, default_value = "30", value_parser = seconds)]
    pub(crate) join_timeout: f64,
    /// Lockstep: how long a member may take for a cycle, in s of wall time; more for a debugger.
    #[arg(long, default_value = "5", value_parser = seconds)]
    pub(crate) lockstep_timeout: f64,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// After a late wake-up: catch-up (compute the missed cycles, send the newest) or stop.
    #[arg(long, default_value_t = OverrunPolicy::CatchUp)]
    pub(crate) overrun: OverrunPolicy,
    /// FIFO priority of the rig loop, 1 to 98; the bus host gets one more.
    #[arg(long, default_value_t = DEFAULT_FIFO_PRIORITY, value_parser = clap::value_parser!(u8).range(1..=98))]
    pub(crate) fifo_priority: u8,
    /// CPU that the rig loop is pinned to; not pinned without it.
    #[arg(long)]
    pub(crate) cpu: Option<usize>,
    /// Wake this many microseconds early and spin until the deadline.
    #[arg(long)]
    pub(crate) spin_us: Option<u64>,
    /// Ask the system for no priority, no locked memory and no latency request.
    #[arg(long)]
    pub(crate) no_realtime: bool,
    /// Write the time stamps of every cycle to emulator-timing.csv.
    #[arg(long)]
    pub(crate) full_timing: bool,
    /// Freeze the flight recorder at a missed cycle, or a wake-up latency or execution time above this, in us.
    #[arg(long, default_value_t = DEFAULT_FLIGHT_LATE_US, value_parser = clap::value_parser!(u64).range(1..=60_000_000))]
    pub(crate) flight_late_us: u64,
    /// Turn off the flight recorder.
    #[arg(long)]
    pub(crate) no_flight: bool,
    /// Ignore bench frames (hand force, link, weights) and send no FaultMark frames.
    #[arg(long)]
    pub(crate) no_bench_frames: bool,
    /// Take commands from standard input, one a line: emergency stop, linkage, weights, hands, faults; 'help' lists them.
    /// Typed commands are not reproducible, not even in lockstep.
    #[arg(long)]
    pub(crate) console: bool,
    /// Publish telemetry on a Unix socket at PATH: cycles, events, histograms; with --console, accept commands too.
    /// 'bench watch' displays it.
    #[arg(long, value_name = "PATH")]
    pub(crate) telemetry: Option<PathBuf>,
    /// How long the bus may be gone before the run ends, in s.
    #[arg(long, default_value = "5", value_parser = seconds)]
    pub(crate) bus_grace: f64,
}

/// What to draw.
#[derive(Args, Debug)]
pub(crate) struct SealArguments {
    /// Seed of the draw; whoever knows it can draw the same again.
    #[arg(long)]
    pub(crate) seed: u64,
    /// How many different effects.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    pub(crate) effects: u8,
    /// Axis of the effects; linkage effects are drawn only with 'both'.
    #[arg(long, value_enum, default_value_t = SealedAxis::Both)]
    pub(crate) axis: SealedAxis,
    /// File to write; an existing file is refused.
    #[arg(long, default_value = "sealed.toml")]
    pub(crate) out: PathBuf,
}

/// Axes that an effect is drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SealedAxis {
    /// The drive axis, and the supply that feeds it.
    Drive,
    /// The load axis, and the supply that feeds it.
    Load,
    /// Either, and what they share.
    Both,
}

/// How to list the effects.
#[derive(Args, Debug)]
pub(crate) struct EffectsArguments {
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}

/// How to list the faults.
#[derive(Args, Debug)]
pub(crate) struct FaultsArguments {
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
    /// Print the table of emulator/docs/faults.md instead.
    #[arg(long, conflicts_with = "json")]
    pub(crate) markdown: bool,
    /// Print nothing of the table, but check a script.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["json", "markdown"])]
    pub(crate) check: Option<PathBuf>,
}

/// How to host a bus.
#[derive(Args, Debug)]
pub(crate) struct BusArguments {
    /// The embedded bus: unix:///PATH[?loss=P&seed=N&bitrate=1000000&…].
    #[arg(long, default_value_t = BusUrl::default_embedded())]
    pub(crate) bus: BusUrl,
    /// End after this time; without it, on Ctrl-C.
    #[arg(long, value_parser = seconds)]
    pub(crate) seconds: Option<f64>,
}

/// An axis whose foreign controller joins the barrier by its echo.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum EchoAxis {
    /// Commands of the drive axis.
    Drive,
    /// Commands of the load axis.
    Load,
}

impl EchoAxis {
    /// Identifier of the axis's command frame.
    pub(crate) fn command_id(self) -> u16 {
        match self {
            Self::Drive => DRIVE_VALVE_COMMAND.id,
            Self::Load => LOAD_VALVE_COMMAND.id,
        }
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    const LONGEST_S: f64 = 1e7;
    text.parse()
        .ok()
        .filter(|seconds: &f64| *seconds > 0.0 && *seconds <= LONGEST_S)
        .ok_or_else(|| format!("'{text}' is not a time in seconds above 0, at most {LONGEST_S}"))
}
