//! The state of the page for programs, the page and Prometheus: one type, serialised to JSON.
//!
//! Keys are those of `bench/docs/watch.md`; null means unknown.

use super::light::Judgement;
use runlog::event::FaultMark;
use serde::Serialize;
use std::collections::BTreeMap;

/// Values by column, each in the unit of its column.
pub(crate) type NewestRow = BTreeMap<String, Option<f64>>;

/// The state of each chain of an axis by its name; `None` for a number without a name in `rig.dbc`.
pub(crate) type ChainStates = BTreeMap<&'static str, Option<&'static str>>;

/// The state of the run in progress.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct State {
    pub cycle: Option<u64>,
    pub t_s: Option<f64>,
    /// The newest row by column; empty before the first.
    pub last: NewestRow,
    pub emergency_stop: EmergencyStopState,
    pub linked: bool,
    pub check_valves_shut: Option<bool>,
    pub weights_kg: f64,
    /// By axis; `None` for a silent controller.
    pub chains: BTreeMap<&'static str, Option<ChainStates>>,
    pub faults_active: Vec<ActiveFault>,
    pub bus: BusLoad,
    pub timing: Timing,
    /// `None` before the first judgement.
    pub claim: Option<Judgement>,
    /// Number of subscribers to events.
    pub viewers: usize,
    /// Events that slow subscribers missed.
    pub dropped: u64,
    pub telemetry_records_lost: u64,
    /// The last messages, where they were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub messages: Option<Vec<Message>>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct EmergencyStopState {
    /// Whether it is tripped; `None` before the first status of the rig.
    pub active: Option<bool>,
    /// Nodes that hold it.
    pub senders: Vec<&'static str>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ActiveFault {
    pub name: String,
    pub place: String,
    /// Numbers of the fault by their keys.
    pub values: BTreeMap<String, f64>,
    pub cause: String,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BusLoad {
    /// In the last second, with worst-case stuffing; `None` before the first is over.
    pub load_percent: Option<f64>,
    /// Received frames by name.
    pub frames_per_s: BTreeMap<&'static str, f64>,
    /// Sensor frames of this run that were not received.
    pub lost: u64,
    /// Frames that violate `rig.dbc`.
    pub malformed: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Timing {
    /// Percentiles of each stage by its name.
    #[serde(flatten)]
    pub percentiles: BTreeMap<&'static str, StagePercentiles>,
    pub overruns: u64,
    /// In each of the last seconds, the current one last.
    pub overruns_by_second: Vec<u64>,
    /// Cycles that overruns skipped.
    pub skipped: u64,
}

/// Percentiles of a stage, us; `None` where there are too few samples.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StagePercentiles {
    #[serde(rename = "p50")]
    pub p50_us: Option<f64>,
    #[serde(rename = "p90")]
    pub p90_us: Option<f64>,
    #[serde(rename = "p99")]
    pub p99_us: Option<f64>,
    #[serde(rename = "p999")]
    pub p999_us: Option<f64>,
    #[serde(rename = "max")]
    pub max_us: Option<f64>,
    pub count: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Message {
    pub t_s: f64,
    pub level: Level,
    pub text: String,
}

/// Severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Level {
    Info,
    Warning,
    Error,
}

impl From<FaultMark> for ActiveFault {
    fn from(FaultMark { fault, at, numbers, cause, .. }: FaultMark) -> Self {
        Self { name: fault, place: at, values: numbers, cause }
    }
}
