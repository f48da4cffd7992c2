//! The command line of `airbench`.

use clap::{Args, CommandFactory, Parser, Subcommand};
use protocol::exit::EXIT_CODE_HELP;
use std::ffi::OsString;
use std::path::PathBuf;

/// A hardware-in-the-loop bench for motion controllers: runs, measurements and searches, and a way to each of its programs.
#[derive(Debug, Parser)]
#[command(name = "airbench", version, about, after_help = EXIT_CODE_HELP)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run an experiment: emulator and controller as two processes on one bus, a table, a picture and a folder.
    Run(Box<RunArguments>),
    /// Measure latency beside cyclictest and ping-pongs, and report the ratios.
    Latency(Box<LatencyArguments>),
    /// Hide an effect in the rig, measure, have it found, show the gap shrink, and open the seal.
    FindEffect(FindEffectArguments),
    /// Find the effect that a model lacks: 'discrepancy close', with the shipped rig file where no --rig or --model is given.
    Close(ProgramArguments),
    /// Run any SocketCAN program on an embedded bus: 'bench can'.
    Can(ProgramArguments),
    /// Run your tests of a controller: pytest with the plugin of the Python package airbench_hil.
    Test(ProgramArguments),
    /// The plant behind a bus: process 1.
    Emulator(ProgramArguments),
    /// The axis controllers: process 2.
    Controller(ProgramArguments),
    /// Everything around them: summaries, reports, the live page, the gateway, checks of controllers.
    Bench(ProgramArguments),
    /// Measured against simulated: the workflow that names missing effects, and its steps.
    Discrepancy(ProgramArguments),
    /// Many simulated runs from one file.
    Campaign(ProgramArguments),
}

/// The whole command line, for help texts, pages of the manual and completions.
pub fn command() -> clap::Command {
    Cli::command().args_override_self(true)
}

/// What goes to the program as it stands, `--help` too.
#[derive(Args, Debug)]
#[command(disable_help_flag = true, disable_version_flag = true)]
pub(crate) struct ProgramArguments {
    /// Arguments of the program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENT")]
    pub(crate) arguments: Vec<OsString>,
}

/// How an experiment is run.
#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXIT_CODE_HELP)]
pub(crate) struct RunArguments {
    /// Name of a shipped experiment, or a path to a .toml file (default: point-to-point, 0.3 m in 3 s out and back)
    #[arg(default_value = "point-to-point", hide_default_value = true)]
    pub(crate) experiment: PathBuf,
    /// Simulated time on the embedded bus: as fast as it goes, the same bytes every time
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// The plant inside the controller process, no bus: faster still, the same measurement
    #[arg(long)]
    pub(crate) rehearse: bool,
    /// A controller process for each axis instead of one for both
    #[arg(long)]
    pub(crate) two: bool,
    /// Axis program of the drive in place of the experiment's
    #[arg(long, value_name = "FILE")]
    pub(crate) drive_program: Option<PathBuf>,
    /// Axis program of the load in place of the experiment's
    #[arg(long, value_name = "FILE")]
    pub(crate) load_program: Option<PathBuf>,
    /// A variable in place of the program's, such as drive.algorithm.gain_per_s=30; may be repeated
    #[arg(long, value_name = "VARIABLE=VALUE")]
    pub(crate) set: Vec<OsString>,
    /// A parameter set in place of the programs' numbers, as 'controller parameters' prints it
    #[arg(long, value_name = "FILE")]
    pub(crate) parameters: Option<PathBuf>,
    /// Let XCP tools measure the controllers, and change parameters with the key of FILE
    #[arg(long, value_name = "FILE")]
    pub(crate) xcp: Option<PathBuf>,
    /// Take over numbers of the program files that change while the run goes on
    #[arg(long)]
    pub(crate) watch_programs: bool,
    /// Repeat the experiment until N seconds of the rig's time have passed
    #[arg(long, value_name = "N")]
    pub(crate) seconds: Option<String>,
    /// can://IFACE or unix:///PATH[?loss=P&seed=N&bitrate=B]; default: in real time can://vcan0 when it is up, else the embedded
    /// bus of your user, where other programs look for it; where that is taken, and in lockstep, an embedded bus of the run's own
    #[arg(long, value_name = "URL")]
    pub(crate) bus: Option<String>,
    /// The run's folder (default: runs/TIME-EXPERIMENT, and runs/latest points to it)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Effects that only the rig reads, as 'emulator seal' draws them
    #[arg(long, value_name = "FILE")]
    pub(crate) sealed: Option<PathBuf>,
    /// What breaks when; 'emulator faults' lists what can
    #[arg(long, value_name = "FILE")]
    pub(crate) faults: Option<PathBuf>,
    /// Seed of the sensors' noise (default 1)
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<String>,
    /// Pin the emulator's loop to this CPU
    #[arg(long, value_name = "N")]
    pub(crate) cpu: Option<String>,
    /// Pin the controller's loop to this CPU; with --two, both of them
    #[arg(long, value_name = "N")]
    pub(crate) controller_cpu: Option<String>,
    /// Write the timing of every cycle: emulator-timing.csv, controller-timing.csv
    #[arg(long)]
    pub(crate) full_timing: bool,
    /// Let the emulator wake this early and spin
    #[arg(long, value_name = "N")]
    pub(crate) spin_us: Option<String>,
    /// Open the bus to python-can, cantools and SavvyCAN: socketcand protocol on 127.0.0.1:29536
    #[arg(long)]
    pub(crate) gateway: bool,
    /// Serve the run as a page, with controls, and print its address; ends with the run
    #[arg(long)]
    pub(crate) watch: bool,
    /// Where the page is served
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    pub(crate) http: String,
    /// What follows a stop that was released, in place of the experiment's; with --watch on-start, for the page's start
    #[arg(long, value_name = "NEXT", value_parser = ["end", "restart", "on-start"])]
    pub(crate) after_emergency_stop: Option<String>,
    /// Name the experiments
    #[arg(long)]
    pub(crate) list: bool,
}

const FIND_EFFECT_HELP: &str = "\
An effect is drawn and sealed; the emulator runs with it and the controller drives both axes over the bus; 'discrepancy close'
gets the rig file without the effect and the measurement, names the missing effect and writes an extended rig file; the emulator
runs the same experiments without the effect and with the extended file. One picture shows both gaps to the measurement, beside
that of the sealed rig measured once more, which is the repeatability. Only then the seal is opened and compared. A term of a file
that is hidden with --hidden counts as named when a suspect of its name and axis is.

In DIR, for each seed: fitted/ and held-out/ with the runs measured, baseline and extended, held-out/ with repeated besides;
workflow/ with report.html, report.json and the extended rig.toml; gap.html, the gaps in one picture; hidden/, which only the
last step reads; told.txt.

Exit codes: 0 done, whatever was named; 1 with --expect-right, when one was wrong; 2 usage, bad input, or an output that
cannot be written; 3 a process failed; 130 interrupted.";

/// What is hidden, and how it is searched.
#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = FIND_EFFECT_HELP)]
pub(crate) struct FindEffectArguments {
    /// Seed of the draw
    #[arg(long, value_name = "N", default_value = "1", value_parser = |text: &str| whole(text, 0, 999_999_999))]
    pub(crate) seed: u64,
    /// Number of rigs, one after the other, seeds N, N+1, …
    #[arg(long, value_name = "N", default_value = "1", value_parser = |text: &str| whole(text, 1, 1000))]
    pub(crate) count: u64,
    /// Number of different effects in each
    #[arg(long, value_name = "K", default_value = "1")]
    pub(crate) effects: u8,
    /// Where effects are drawn
    #[arg(long, value_name = "WHICH", default_value = "both", value_parser = ["drive", "load", "both"])]
    pub(crate) axis: String,
    /// Effects and terms to hide, in place of a draw: a file as a rig file has them
    #[arg(long, value_name = "FILE", conflicts_with_all = ["effects", "axis"])]
    pub(crate) hidden: Option<PathBuf>,
    /// Suspects beside the catalogue, for 'discrepancy close'
    #[arg(long, value_name = "FILE")]
    pub(crate) suspects: Option<PathBuf>,
    /// Simulated time: as fast as it goes, and the same bytes every time (default: real time)
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// Experiment for the fit, by name or file
    #[arg(long, value_name = "NAME", default_value = "identification")]
    pub(crate) experiment: PathBuf,
    /// Experiment for the comparison (default: discrepancy/experiments/held-out.toml)
    #[arg(long, value_name = "NAME")]
    pub(crate) held_out: Option<PathBuf>,
    /// can://IFACE or unix:///PATH (default: can://vcan0 when it is up and this is real time, else an embedded bus of this run)
    #[arg(long, value_name = "URL", value_parser = bus)]
    pub(crate) bus: Option<String>,
    /// Program in place of discrepancy; also AIRBENCH_DISCREPANCY
    #[arg(long, value_name = "FILE")]
    pub(crate) discrepancy: Option<PathBuf>,
    /// Exit with 1 when a hidden effect was not named, or another was
    #[arg(long)]
    pub(crate) expect_right: bool,
    /// Folder of all results (default: runs/TIME-find-effect)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// A whole number in a range.
fn whole(text: &str, least: u64, most: u64) -> Result<u64, String> {
    let number = text.parse().ok().filter(|number| (least..=most).contains(number));
    number.ok_or_else(|| format!("must be a whole number from {least} to {most}"))
}

/// The URL of a bus, as it was written.
fn bus(text: &str) -> Result<String, String> {
    let parsed: Result<protocol::bus::BusUrl, _> = text.parse();
    parsed.map(|_| text.to_owned()).map_err(|error| error.to_string())
}

const LATENCY_HELP: &str = "\
Measures in pairs: in each, for the same time each and in alternating order, cyclictest, emulator and controller, the same with
the rig waking early and spinning, a ping-pong of 16 bytes on the same bus and one on a bare pair of sockets. Then makes the
report, and prints the table of ratios. See bench/docs/latency.md.

In DIR: report.html, report.md, report.json and more of the plain runs, spin/ with those of the spinning ones, table.md, and
pair-NN/run, pair-NN/run-spin with what belongs to each run.

Exit codes: 0 good; 1 a bound or a claim was broken (one that is not resolved was not); 2 usage, bad input, or an output that
cannot be written; 3 the bus or a process failed; 130 interrupted: what was measured is kept and reported.";

/// What is measured, and where.
#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = LATENCY_HELP)]
pub(crate) struct LatencyArguments {
    /// Pairs; six and more give the ratios an interval
    #[arg(long, value_name = "N", default_value = "10", value_parser = |text: &str| whole(text, 1, 1000))]
    pub(crate) pairs: u64,
    /// Length of each slice, whole seconds
    #[arg(long, value_name = "N", default_value = "10", value_parser = |text: &str| whole(text, 1, 86400))]
    pub(crate) seconds: u64,
    /// CPU of the rig, of cyclictest and of the ping (default: the last that this process may use)
    #[arg(long, value_name = "N")]
    pub(crate) cpu: Option<usize>,
    /// CPU of the controller and of the pong (default: the one before it, if there are two)
    #[arg(long, value_name = "N")]
    pub(crate) controller_cpu: Option<usize>,
    /// FIFO priority of all of them, 2 to 98
    #[arg(long, value_name = "N", default_value = "80", value_parser = |text: &str| whole(text, 2, 98))]
    pub(crate) priority: u64,
    /// How early the spinning rig wakes, 1 to 999; 0: leave these runs out
    #[arg(long, value_name = "N", default_value = "100", value_parser = |text: &str| whole(text, 0, 999))]
    pub(crate) spin_us: u64,
    /// Load generator, started before each slice and stopped after it, such as "stress-ng --cpu 2"
    #[arg(long, value_name = "COMMAND", default_value = "", hide_default_value = true)]
    pub(crate) load: String,
    /// Record gaps of the machine during the runs; changes the result, never for a claim
    #[arg(long)]
    pub(crate) probe: bool,
    /// can://IFACE or unix:///PATH[?…] (default: an embedded bus of this run)
    #[arg(long, value_name = "URL", value_parser = bus)]
    pub(crate) bus: Option<String>,
    /// Compare the report with this file of bounds
    #[arg(long, value_name = "FILE")]
    pub(crate) bounds: Option<PathBuf>,
    /// Compare both reports with the claims for an idle machine (latency/bounds.toml, latency/bounds-spin.toml); 1 when one is
    /// broken, not when one is not resolved: its interval crosses the bound, so more pairs are needed
    #[arg(long)]
    pub(crate) claims: bool,
    /// Experiment that is run
    #[arg(long, value_name = "NAME", default_value = "point-to-point")]
    pub(crate) experiment: PathBuf,
    /// Folder of all results (default: runs/TIME-latency)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Put the table into bench/docs/latency.md of the checkout, between its two marks
    #[arg(long)]
    pub(crate) write: bool,
}
