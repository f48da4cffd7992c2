//! `run.json` and `summary.json`: as the emulator leaves them at the start of a run and at its end, as a rehearsal does, and as
//! `bench summary` joins what the controllers left to them.
//!
//! Keys that others read are those of bus.md. A file of an earlier version lacks newer fields: they are read as their defaults,
//! and fields whose absence means something are options, which the emulator always writes.

use crate::controller_report::{ControllerFigures, IgnoredFrames};
use crate::event::EventKind;
use crate::run_folder::{FileError, read_json};
use crate::timing_recorder::{CommandAges, FlightFigures, TimingFigures};
use protocol::bus::BusCounters;
use protocol::bus::host::HostReport;
use protocol::commands::CommandCounters;
use realtime::{ArrivalFigures, Machine, Percentiles, VitalTotals, WallClockStep};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::Path;

/// The pace of a rehearsal, which has no emulator.
pub const REHEARSAL: &str = "rehearsal";

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
pub struct Summary<E = RecordedEvent> {
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
    /// Frames that the rig refused: not as `rig.dbc` says (`frames_ignored.malformed`), or no CAN frame (`bus.malformed`). Those
    /// that the controllers refused stand in their reports.
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
    pub thresholds: BTreeMap<String, JudgedBound>,
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

impl Summary {
    /// Reads the file. Not generic, so that it is compiled once; [`read_json`] is in each crate that calls it.
    ///
    /// # Errors
    /// As [`read_json`].
    pub fn read(path: &Path) -> Result<Self, FileError> {
        read_json(path)
    }
}

/// An event as it stands in a file, whatever its kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RecordedEvent {
    /// The rig's cycle.
    pub cycle: u64,
    /// Its name, or an object of its name and its details. It stays as it stands: a kind of another version must not be lost.
    pub kind: Value,
}

impl RecordedEvent {
    /// The kind as its type; `None` for one that this version does not write.
    #[must_use]
    pub fn known_kind(&self) -> Option<EventKind> {
        EventKind::deserialize(&self.kind).ok()
    }
}

/// Frames that arrived at the rig and were ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameCounters {
    /// Those that a controller would not heed either.
    #[serde(flatten)]
    pub ignored: IgnoredFrames,
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

/// `run.json` of a rehearsal: what of [`RunDescription`] there is without an emulator. `S` is the scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, bound(deserialize = "S: Deserialize<'de> + Default"))]
pub struct RehearsalDescription<S = Value> {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// [`REHEARSAL`].
    pub pace: String,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// The rig file as it was read.
    pub rig_toml: String,
    /// The experiment file as it was read.
    pub experiment_toml: String,
    /// Initial state of the rig as used, and what people do to it when.
    pub rig_setup: S,
}

/// `summary.json` of a rehearsal: the keys of [`Summary`] that others read; what only a bus or a clock has is 0 or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RehearsalSummary {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// As [`Summary::position_error_dynamic_m`].
    pub position_error_dynamic_m: Option<f64>,
    /// As [`Summary::position_error_static_m`].
    pub position_error_static_m: Option<f64>,
    /// Cycles rehearsed.
    pub cycles: u64,
    /// 0: no cycle comes late.
    pub skipped: u64,
    /// 0, like the frames: there is no bus.
    pub overruns: u64,
    /// 0.
    pub frames_sent: u64,
    /// 0.
    pub frames_received: u64,
    /// 0.
    pub frames_lost: u64,
    /// 0.
    pub frames_lost_at_rig: u64,
    /// 0.
    pub frames_malformed: u64,
    /// 0: no command comes late.
    pub stale_commands: u64,
    /// Empty.
    pub wakeup_ns: Percentiles,
    /// Empty.
    pub round_trip_ns: Percentiles,
    /// 0: whoever rehearses waits for the disk.
    pub records_dropped: u64,
    /// Why it ended.
    pub ended_because: String,
    /// Whether it ended well and, once joined, kept all its thresholds.
    pub passed: bool,
    /// All events.
    pub events: Vec<RehearsalEvent>,
}

/// An event of a rehearsal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct RehearsalEvent {
    /// The rig's cycle.
    pub cycle: u64,
    /// The outcome, in Rust's `Debug` form.
    pub what: String,
}

/// `run.json` once joined.
///
/// Named is what the join reads and adds. All else goes through as it stands, whatever version or foreign program wrote it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JoinedRun {
    /// As [`RunDescription::pace`], or [`REHEARSAL`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pace: Option<String>,
    /// As [`RunDescription::experiment_toml`].
    pub experiment_toml: Option<String>,
    /// What one controller process for both axes was run with: the part of its report that the summary does not take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<Map<String, Value>>,
    /// The same of a process for each axis, by axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controllers: Option<BTreeMap<String, Map<String, Value>>>,
    /// The other keys of [`RunDescription`].
    #[serde(flatten)]
    pub further: Map<String, Value>,
}

impl JoinedRun {
    /// Whether there was no bus: the rehearsal runs the plant inside the controller.
    #[must_use]
    pub fn is_rehearsal(&self) -> bool {
        self.pace.as_deref() == Some(REHEARSAL)
    }
}

/// `summary.json` once joined with what the controllers left, and judged.
///
/// Named is what the join reads and adds. All else goes through as it stands: a key that another version or a foreign program
/// left out counts as not known, and [`Summary`] would make a 0 of it, which keeps bounds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JoinedSummary {
    /// As [`Summary::position_error_dynamic_m`]; from the drive's controller, or computed from its table.
    pub position_error_dynamic_m: Option<f64>,
    /// As [`Summary::position_error_static_m`], from the same source.
    pub position_error_static_m: Option<f64>,
    /// As [`Summary::bus_log_cycle_zero_s`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bus_log_cycle_zero_s: Option<f64>,
    /// As [`Summary::cycles`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<u64>,
    /// As [`Summary::skipped`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skipped: Option<u64>,
    /// As [`Summary::overruns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overruns: Option<u64>,
    /// Frames that never came: those that the rig missed and those that the controllers did.
    pub frames_lost: Option<u64>,
    /// As [`Summary::frames_lost_at_rig`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames_lost_at_rig: Option<u64>,
    /// As [`Summary::frames_ignored`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames_ignored: Option<FrameCounters>,
    /// As [`Summary::wakeup_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wakeup_ns: Option<Percentiles>,
    /// As [`Summary::round_trip_ns`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub round_trip_ns: Option<Percentiles>,
    /// As [`Summary::records_dropped`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub records_dropped: Option<u64>,
    /// As [`Summary::ended_because`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended_because: Option<String>,
    /// What `passed` was before the first join: whether the emulator, or the rehearsal, ended well.
    pub ended_well: Option<bool>,
    /// Whether nothing stands against the run.
    pub passed: Option<bool>,
    /// What stands against it, in a few words each.
    pub not_passed_because: Vec<String>,
    /// Bounds of the experiment by their figures.
    pub thresholds: BTreeMap<String, JudgedBound>,
    /// All figures that there was something to measure on, by name.
    pub figures: BTreeMap<String, f64>,
    /// The value of each repetition, of those figures that repetitions have.
    pub figures_by_repetition: BTreeMap<String, Vec<Option<f64>>>,
    /// What the controllers reported; absent when none left a report.
    #[serde(flatten)]
    pub by_controllers: Option<ReportedByControllers>,
    /// The other keys of [`Summary`].
    #[serde(flatten)]
    pub further: Map<String, Value>,
}

impl JoinedSummary {
    /// Reads the file, joined or not.
    ///
    /// # Errors
    /// As [`read_json`].
    pub fn read(path: &Path) -> Result<Self, FileError> {
        read_json(path)
    }
}

/// What a joined summary has of the controllers' reports.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportedByControllers {
    /// Of one process for both axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerFigures>,
    /// Of a process for each axis, by axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controllers: Option<BTreeMap<String, ControllerFigures>>,
    /// Sensor frames that never came, of all axes that tell.
    pub frames_lost_at_controller: Option<u64>,
    /// Each axis as its controller reported it, which is an [`AxisReport`](crate::controller_report::AxisReport) if it is ours.
    pub axes: Map<String, Value>,
}

/// A bound of the experiment held against its figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JudgedBound {
    /// What the figure must reach.
    pub least: Option<f64>,
    /// What it must not exceed.
    pub most: Option<f64>,
    /// What it was; of several repetitions the one that keeps the bound least, and null when it was not measured.
    pub value: Option<f64>,
    /// Whether it was measured and is within both.
    pub kept: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Event;

    #[test]
    fn a_rehearsals_files_are_read_as_those_of_a_run() {
        let rehearsed = RehearsalSummary { cycles: 7, passed: true, ..RehearsalSummary::default() };
        let written = serde_json::to_value(&rehearsed).unwrap();
        let summary: Summary = serde_json::from_value(written.clone()).unwrap();
        let again = serde_json::to_value(&summary).unwrap();
        for (key, value) in written.as_object().unwrap() {
            assert_eq!(again.get(key), Some(value), "{key}");
        }
        let rehearsed = RehearsalDescription::<Value> { pace: REHEARSAL.into(), ..Default::default() };
        let written = serde_json::to_value(&rehearsed).unwrap();
        let run: RunDescription<Value, Value> = serde_json::from_value(written.clone()).unwrap();
        let again = serde_json::to_value(&run).unwrap();
        for (key, value) in written.as_object().unwrap() {
            assert_eq!(again.get(key), Some(value), "{key}");
        }
    }

    #[test]
    fn a_joined_summary_keeps_unknown_keys_and_lacks_what_nobody_reported() {
        let ages = serde_json::json!({ "drive": { "1": 2 } });
        let written =
            serde_json::json!({ "passed": true, "of_another_version": [1], "command_age_cycles": ages });
        let joined: JoinedSummary = serde_json::from_value(written).unwrap();
        assert_eq!(
            (joined.passed, joined.by_controllers.as_ref(), joined.overruns),
            (Some(true), None, None)
        );
        let again = serde_json::to_value(&joined).unwrap();
        assert_eq!(again["of_another_version"], serde_json::json!([1]));
        assert_eq!(again["command_age_cycles"]["drive"]["1"], 2);
        assert!(["axes", "overruns", "wakeup_ns"].iter().all(|key| again.get(*key).is_none()), "{again}");
        assert_eq!(serde_json::from_value::<JoinedSummary>(again).unwrap(), joined);
    }

    #[test]
    fn a_recorded_event_is_read_as_the_kind_that_it_was_written_as() {
        let event: Event = Event { cycle: 7, kind: EventKind::Skipped { cycles: 3 } };
        let recorded: RecordedEvent = serde_json::from_value(serde_json::to_value(&event).unwrap()).unwrap();
        assert_eq!((recorded.cycle, recorded.known_kind()), (event.cycle, Some(event.kind)));
        let other = RecordedEvent { kind: "of-another-version".into(), ..recorded };
        assert_eq!(other.known_kind(), None);
    }

    #[test]
    fn what_controllers_reported_goes_through_a_joined_summary() {
        let by_controllers = ReportedByControllers {
            controller: Some(ControllerFigures { ended_well: Some(true), ..ControllerFigures::default() }),
            ..ReportedByControllers::default()
        };
        let joined = JoinedSummary { by_controllers: Some(by_controllers), ..JoinedSummary::default() };
        let written = serde_json::to_value(&joined).unwrap();
        assert!(written["frames_lost_at_controller"].is_null() && written["axes"].is_object(), "{written}");
        assert_eq!(serde_json::from_value::<JoinedSummary>(written).unwrap(), joined);
    }
}
