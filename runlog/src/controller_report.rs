//! What a controller process leaves: how its controllers were run and what they counted.
//!
//! A file of an earlier version lacks newer fields: they are read as their defaults, and fields whose absence means something are
//! options, which the controller always writes.

use crate::timing_recorder::TimingFigures;
use protocol::bus::BusCounters;
use realtime::Percentiles;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// The report of a process: `controller.json`, `controller-drive.json` or `controller-load.json`. `N` is an item of the news, `X`
/// the counters of XCP.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, bound(deserialize = "N: Deserialize<'de> + Default, X: Deserialize<'de> + Default"))]
pub struct ControllerReport<N = Value, X = Value> {
    /// See [`crate::run_folder::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// How it was called.
    pub command_line: Vec<String>,
    /// Version of the controller.
    pub version: String,
    /// Title of the experiment.
    pub title: String,
    /// Start of its clock, s since 1970; null where time is simulated.
    pub started_unix_s: Option<f64>,
    /// Whether it ended as it should.
    pub ended_well: Option<bool>,
    /// Why it ended.
    pub ended_because: String,
    /// Cycles that an axis of the process answered, each once: rows of the timing table.
    pub cycles_answered: u64,
    /// Cycles that the rig says it skipped.
    pub rig_cycles_skipped: u64,
    /// Frames counted and ignored.
    pub frames_ignored: IgnoredFrames,
    /// What the bus counted.
    pub bus: BusCounters,
    /// Sensor frames of the process's axes that came after newer ones.
    pub frames_late: u64,
    /// Sensor frames of the process's axes that came again.
    pub frames_duplicate: u64,
    /// Percentiles of the stages, arrivals, what the kernel counted, flight recorder. Wake-up: from the arrival of sensors; one
    /// sample for each row, and one for each frame of the axis that wakes us that was overtaken.
    #[serde(flatten)]
    pub timing: TimingFigures,
    /// Allocations in the 1 ms path; null when the build does not count them.
    pub allocations_in_cycle: Option<u64>,
    /// Rows lost to a full queue.
    pub records_dropped: Option<u64>,
    /// Sensor frames of the axis that wakes us that had arrived before the loop began and were overtaken; they are no wake-ups.
    pub sensors_before_start: u64,
    /// Stamps and frames lost to a full queue: histograms, timing table and flight recorder lack them.
    pub timing_dropped: u64,
    /// What the system granted for real time.
    pub realtime_granted: Vec<realtime::Grant>,
    /// What it refused, with the remedy.
    pub realtime_refused: Vec<String>,
    /// Each axis of the process.
    pub axes: BTreeMap<String, AxisReport<X>>,
    /// What a person was shown.
    pub news: Vec<N>,
}

/// What an axis was run with and what it counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, bound(deserialize = "X: Deserialize<'de> + Default"))]
pub struct AxisReport<X = Value> {
    /// State of its main chain at the end.
    pub chain_state: String,
    /// Why it came to that.
    pub chain_cause: String,
    /// State of its emergency stop chain at the end.
    pub emergency_stop_state: String,
    /// How often the experiment was driven through.
    pub repetitions_done: Option<u32>,
    /// Why its algorithm is no longer asked; null while it is.
    pub algorithm_fault: Option<String>,
    /// Largest |set-point - position sensor| while the set-point moved; null without a position.
    pub position_error_dynamic_m: Option<f64>,
    /// Largest mean |error| over the last 0.2 s of each rest; null without a position.
    pub position_error_static_m: Option<f64>,
    /// Cycles that the axis answered: its commands on the bus.
    pub cycles_answered: u64,
    /// Sensor frames of the axis that came.
    pub sensors_received: u64,
    /// Sensor frames of the axis that never came.
    #[serde(deserialize_with = "sum_of_counts")]
    pub sensors_lost: Option<u64>,
    /// Sensor frames of the axis that came after newer ones.
    pub sensors_late: u64,
    /// Sensor frames of the axis that came again; they are among those received.
    pub sensors_duplicate: u64,
    /// Those among the sensor frames before the rig's first tick that came; with the lost ones, all that is missing.
    pub sensors_missed_before_first_tick: Option<u64>,
    /// Offset of its position sensor as it was matched, m.
    pub matched_offset_m: f64,
    /// The program file as it stands; null for an axis that held its valve shut.
    pub program_toml: Option<String>,
    /// Path that the program was read from.
    pub program_file: Option<String>,
    /// Values of all variables at the end.
    pub variables: BTreeMap<String, f64>,
    /// What XCP did; absent where it was not asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub xcp: Option<X>,
}

/// Frames that were counted and ignored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct IgnoredFrames {
    /// Not as `rig.dbc` says.
    pub malformed: u64,
    /// Identifiers that `rig.dbc` does not know, extended and remote frames.
    pub unknown: u64,
}

/// The report of a process taken apart by what becomes of it when a run's files are joined: its figures and its axes go into
/// `summary.json`, all else into `run.json`. What is no figure stays as it stands, whatever version or foreign controller wrote
/// it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct SplitControllerReport {
    /// How it ended and kept its time.
    #[serde(flatten)]
    pub figures: ControllerFigures,
    /// Each axis, an [`AxisReport`] if the controller is ours; empty when the report does not hold axes.
    #[serde(deserialize_with = "axes_if_any")]
    pub axes: Map<String, Value>,
    /// What it was run with, and its further counters.
    #[serde(flatten)]
    pub used: Map<String, Value>,
}

/// An axis as a controller reported it; empty where it does not use the words of [`AxisReport`].
#[must_use]
pub fn reported_of_axis(reported: &Value) -> AxisReport {
    AxisReport::deserialize(reported).unwrap_or_default()
}

/// What a controller process reports of itself at the end, and the summary takes; null is not reported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ControllerFigures {
    /// As in [`TimingFigures`].
    pub wakeup_ns: Option<Percentiles>,
    /// As in [`TimingFigures`].
    pub execution_ns: Option<Percentiles>,
    /// As in [`TimingFigures`].
    pub period_error_ns: Option<Percentiles>,
    /// As [`ControllerReport::allocations_in_cycle`].
    pub allocations_in_cycle: Option<u64>,
    /// As [`ControllerReport::records_dropped`].
    pub records_dropped: Option<u64>,
    /// As [`ControllerReport::ended_because`].
    pub ended_because: Option<String>,
    /// As [`ControllerReport::ended_well`].
    pub ended_well: Option<bool>,
}

fn axes_if_any<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Map<String, Value>, D::Error> {
    Ok(match Value::deserialize(deserializer)? {
        Value::Object(axes) => axes,
        _ => Map::new(),
    })
}

/// A count; earlier versions wrote one for each axis.
fn sum_of_counts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Counts {
        One(Option<u64>),
        Each(BTreeMap<String, u64>),
    }
    Ok(match Counts::deserialize(deserializer)? {
        Counts::One(count) => count,
        Counts::Each(counts) => counts.values().copied().reduce(|sum, count| sum + count),
    })
}
