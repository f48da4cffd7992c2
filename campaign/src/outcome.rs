//! Result of a run: how it ended, and its figures; a row of the table of runs.

use crate::factor::Value;
use std::collections::BTreeMap;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    pub ended: EndState,
    /// Why, in words; empty for a run that is done.
    pub because: String,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Whether the bounds of the experiment were kept; `None` without bounds, and where a command does not say.
    pub passed: Option<bool>,
    /// Figures by name, without those that the run does not define.
    pub figures: BTreeMap<String, Value>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EndState {
    /// The experiment or the command was completed.
    Done,
    TimeOver,
    /// A fault or an abort ended it; this is a valid result.
    Stopped,
    /// A program crashed, hung, or gave an invalid answer.
    Failed,
}

impl EndState {
    /// Its name in the column `ended`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            EndState::Done => "done",
            EndState::TimeOver => "time-over",
            EndState::Stopped => "stopped",
            EndState::Failed => "failed",
        }
    }
}

impl Outcome {
    pub(crate) fn failed(because: String) -> Self {
        Outcome { ended: EndState::Failed, because, simulated_s: 0.0, passed: None, figures: BTreeMap::new() }
    }
}
