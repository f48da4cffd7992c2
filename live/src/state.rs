//! The state of the page as programs, the page and Prometheus get it: written as JSON by one type, and read by its fields.
//!
//! Keys are those of `bench/docs/watch.md`; null is what is not known.

use super::light::Judgement;
use runlog::event::FaultMark;
use serde::Serialize;
use std::collections::BTreeMap;

/// Values by column, each in the unit of its column.
pub(crate) type NewestRow = BTreeMap<String, Option<f64>>;

/// The state of each chain of an axis by its name; `None` of a number that `rig.dbc` does not name.
pub(crate) type ChainStates = BTreeMap<&'static str, Option<&'static str>>;

/// The state of the run that goes on.
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
    /// By axis; `None` of a controller that is silent.
    pub chains: BTreeMap<&'static str, Option<ChainStates>>,
    pub faults_active: Vec<ActiveFault>,
    pub bus: BusLoad,
    pub timing: Timing,
    /// `None` before the first judgement.
    pub claim: Option<Judgement>,
    /// Listeners to events.
    pub viewers: usize,
    /// Events that listeners were too slow for.
    pub dropped: u64,
    pub telemetry_records_lost: u64,
    /// The last messages, where they are asked for.
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

/// A fault that is put into the run.
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
    /// By name of the frame, those that came.
    pub frames_per_s: BTreeMap<&'static str, f64>,
    /// Sensor frames of this run that did not come here.
    pub lost: u64,
    /// Frames that are not as `rig.dbc` says.
    pub malformed: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Timing {
    /// Percentiles of each stage by its name.
    #[serde(flatten)]
    pub percentiles: BTreeMap<&'static str, StagePercentiles>,
    pub overruns: u64,
    /// In each of the last seconds, the one that goes on last.
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

/// How much a message concerns a person.
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
