//! What the emulator leaves: `run.json` at the start of a run and `summary.json` at its end.
//!
//! Keys that others read are those of bus.md. A file of an earlier version lacks newer fields: they are read as their defaults,
//! and fields whose absence means something are options, which the emulator always writes.

use crate::timing_recorder::{CommandAges, FlightFigures, TimingFigures};
use protocol::bus::BusCounters;
use protocol::bus::host::HostReport;
use protocol::commands::CommandCounters;
use realtime::{ArrivalFigures, Machine, Percentiles, VitalTotals, WallClockStep};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// `run.json`: what a run was made with. `S` is the scene, `M` the machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, bound(deserialize = "S: Deserialize<'de> + Default, M: Deserialize<'de> + Default"))]
pub struct RunDescription<S = Value, M = Machine> {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The emulator's command line.
    pub emulator_command_line: Vec<String>,
    /// The emulator's version.
    pub emulator_version: String,
    /// Whether the build counts allocations, which costs a little time.
    pub counts_allocations: bool,
    /// Start of the run's clock, in s since 1970; null in lockstep, whose time is simulated.
    pub started_unix_s: Option<f64>,
    /// `real` or `lockstep`.
    pub pace: String,
    /// The bus by its URL.
    pub bus: String,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// The rig file as it was read.
    pub rig_toml: String,
    /// The experiment file as it was read; null without one.
    pub experiment_toml: Option<String>,
    /// The script of faults as it was read; null without one.
    pub faults_toml: Option<String>,
    /// Initial state of the rig as used, and what people do to it when.
    pub rig_setup: S,
    /// Whether a sealed file was read, in which nobody but the rig looks; which effects it switches on stands in `truth.csv`
    /// alone.
    pub sealed: bool,
    /// What the system granted for real time.
    pub realtime_granted: Vec<realtime::Grant>,
    /// What it refused, with the remedy.
    pub realtime_refused: Vec<String>,
    /// Kernel, processors and clock source.
    pub machine: M,
}

/// `summary.json` as the emulator writes it; `bench summary` joins the controllers' reports to it. `E` is an event.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, bound(deserialize = "E: Deserialize<'de> + Default"))]
pub struct Summary<E = NotedEvent> {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Largest |set-point - position sensor| while the set-point moves; the controllers know it.
    pub position_error_dynamic_m: Option<f64>,
    /// Largest mean |error| over the last 0.2 s of each rest; the controllers know it.
    pub position_error_static_m: Option<f64>,
    /// When cycle 0 was due, in s of the time stamps of `bus.log`; cycle k was due k ms later.
    pub bus_log_cycle_zero_s: f64,
    /// Cycles begun, skipped ones included.
    pub cycles: Option<u64>,
    /// Cycles computed late and not sent.
    pub skipped: Option<u64>,
    /// Wake-ups that missed at least one cycle.
    pub overruns: u64,
    /// Cycles whose work ended after the next deadline.
    pub late_completions: u64,
    /// Frames that the rig handed to the bus.
    pub frames_sent: u64,
    /// Frames that the rig took from the bus.
    pub frames_received: u64,
    /// Frames that never came, by gaps in the counters at the receivers.
    pub frames_lost: Option<u64>,
    /// The part of it that the rig missed: commands of both axes.
    pub frames_lost_at_rig: Option<u64>,
    /// Frames that were counted and ignored because they are not as `rig.dbc` says.
    pub frames_malformed: u64,
    /// Commands accepted a cycle or more later than the cycle after the one that they answer.
    pub frames_late: u64,
    /// Commands equal to the one before, counter and all.
    pub frames_duplicate: u64,
    /// Commands refused as stale, and commands that grew stale while acting.
    pub stale_commands: u64,
    /// Wake-up latency against the scheduled time; empty in lockstep.
    pub wakeup_ns: Percentiles,
    /// Execution time of a cycle; empty in lockstep.
    pub execution_ns: Percentiles,
    /// Period error; empty in lockstep.
    pub period_error_ns: Percentiles,
    /// Stage that takes frames; empty in lockstep.
    pub receive_ns: Percentiles,
    /// Stage that computes, missed cycles included; empty in lockstep.
    pub step_ns: Percentiles,
    /// Stage that samples the sensors and sends; empty in lockstep.
    pub send_ns: Percentiles,
    /// From a cycle's scheduled time to everything of it done; empty in lockstep.
    pub completion_ns: Percentiles,
    /// Drive sensors handed over to command received; empty in lockstep.
    pub round_trip_ns: Percentiles,
    /// The same of the load.
    pub load_round_trip_ns: Percentiles,
    /// Drive sensors handed over to the start of the first cycle in which the command acts; empty in lockstep.
    pub drive_command_age_ns: Percentiles,
    /// The same of the load.
    pub load_command_age_ns: Percentiles,
    /// Cycles sent, by the age in cycles of the command that acted; empty in lockstep.
    pub command_age_cycles: CommandAges,
    /// How regularly each cyclic frame came that came at all; empty in lockstep.
    pub arrivals: Vec<ArrivalFigures>,
    /// Dumps of the flight recorder.
    pub flight: FlightFigures,
    /// Steps of the wall clock by more than 1 ms, from which nothing followed; the first hundred.
    pub wall_clock_steps: Vec<WallClockStep>,
    /// What the kernel counted of the loop's thread after the first second.
    pub vitals: VitalTotals,
    /// Allocations in the 1 ms path after the first second; null unless the program counts them.
    pub allocations_in_cycle: Option<u64>,
    /// Records that did not reach the files because a queue was full.
    pub records_dropped: Option<u64>,
    /// Why the run ended.
    pub ended_because: String,
    /// Whether the run ended well and, once joined, kept all its thresholds.
    pub passed: Option<bool>,
    /// Bounds on named figures; filled when the files are joined.
    pub thresholds: serde_json::Map<String, Value>,
    /// Commands of the drive axis by what became of them.
    pub drive_commands: CommandCounters,
    /// Commands of the load axis by what became of them.
    pub load_commands: CommandCounters,
    /// Frames received by what became of them.
    pub frames_ignored: FrameCounters,
    /// The rig's own counters of the bus.
    pub bus: BusCounters,
    /// What the host of the embedded bus counted; null when the emulator did not host it.
    pub bus_host: Option<HostReport>,
    /// Events in all.
    pub event_count: Option<u64>,
    /// The first events of each kind.
    pub events: Vec<E>,
}

/// An event as it stands in a file, whatever its kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NotedEvent {
    /// The rig's cycle.
    pub cycle: u64,
    /// Its name, or an object of its name and its details.
    pub kind: Value,
}

/// Frames that arrived at the rig and were ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameCounters {
    /// Not as `rig.dbc` says: length, checksum, reserved bits, a raw value out of range.
    pub malformed: u64,
    /// Identifiers that `rig.dbc` does not know, extended and remote frames.
    pub unknown: u64,
    /// Frames that only the rig sends.
    pub second_rig: u64,
}

/// What `summary.json` and `controller.json` have in common.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct ProcessReport {
    /// Stages, arrivals, the kernel's counters, dumps.
    #[serde(flatten)]
    pub timing: TimingFigures,
    /// Drive sensors handed over to command received; the emulator's alone.
    pub round_trip_ns: Percentiles,
    /// The process's counters of the bus; `None` for a process that left no report of its end.
    pub bus: Option<BusCounters>,
    /// Records that did not reach the files.
    pub records_dropped: Option<u64>,
    /// Steps of the wall clock; the emulator's alone.
    pub wall_clock_steps: Vec<WallClockStep>,
}
