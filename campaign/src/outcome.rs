//! What a run comes to: how it ended, and its figures; a row of the result.

use crate::factor::Value;
use std::collections::BTreeMap;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    pub ended: Ended,
    /// Why, in words; empty for a run that is done.
    pub because: String,
    /// How much of the rig's time passed, s.
    pub simulated_s: f64,
    /// Whether the experiment's own bounds were kept; none for a command, and without bounds.
    pub passed: Option<bool>,
    /// Figures that there was something to measure on.
    pub figures: BTreeMap<String, Value>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// It came to its end.
    Done,
    TimeOver,
    /// A fault or an abort ended it: a result like any other.
    Stopped,
    /// A program crashed, hung, or answered with nonsense.
    Failed,
}

impl Ended {
    /// As results call it.
    #[must_use]
    pub(crate) fn name(self) -> &'static str {
        match self {
            Ended::Done => "done",
            Ended::TimeOver => "time-over",
            Ended::Stopped => "stopped",
            Ended::Failed => "failed",
        }
    }
}

impl Outcome {
    #[must_use]
    pub(crate) fn failed(because: String) -> Self {
        Outcome { ended: Ended::Failed, because, simulated_s: 0.0, passed: None, figures: BTreeMap::new() }
    }
}
