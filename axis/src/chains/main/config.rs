//! Configuration of the main chain: lengths, repetitions, start, and behaviour after an emergency stop.

use super::{APPROACH_M_PER_S, APPROACH_SHORTEST_S};
use crate::chains::AfterStop;
use crate::chains::settled::Bounds;

/// Seconds after which a partner that was never heard is missing.
pub(super) const PARTNER_TIMEOUT_S: f64 = 10.0;

/// How long the states are meant to last, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Lengths {
    /// Preparing; 0 when there is nothing to prepare.
    pub(crate) prepare_s: f64,
    /// Ramp to the initial force; 0 when there is none.
    pub(crate) initial_force_s: f64,
    /// One repetition of the set-points; the longer of both axes.
    pub(crate) experiment_s: f64,
}

/// Condition that ends the settling before the experiment, besides being settled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Start {
    /// No further condition.
    #[default]
    ByItself,
    /// `RunControl` start: once for all repetitions, again after an abort.
    OnStart,
}

/// Configuration of the main chain of one axis. Both axes must be given the same, save for `start_m`, `prepares` and
/// `lengths`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MainConfig {
    /// Number of the experiment on the bus.
    pub(crate) experiment: u8,
    /// Whether a state is left only together with the other axis's chain.
    pub(crate) partner_needed: bool,
    /// Where the initial positioning ends, m; `None` for an axis that is not positioned.
    pub(crate) start_m: Option<f64>,
    /// Whether preparing waits for `prepared`.
    pub(crate) prepares: bool,
    /// How long the states are meant to last.
    pub(crate) lengths: Lengths,
    /// How long they are meant to last for the slower of both axes.
    pub(crate) longest_lengths: Lengths,
    /// Longest initial positioning of either axis, s.
    pub(crate) approach_longest_s: f64,
    /// How often the experiment is run; `None`: until the rig ends.
    pub(crate) repetitions: Option<u32>,
    /// How long the axis must have been settled, before and after, s.
    pub(crate) settling_s: f64,
    /// How long each state may take beyond what it is meant to, s.
    pub(crate) settling_timeout_s: f64,
    pub(crate) start: Start,
    pub(crate) after_emergency_stop: AfterStop,
    pub(crate) settled: Bounds,
}

impl Default for MainConfig {
    fn default() -> Self {
        Self {
            experiment: 1,
            partner_needed: true,
            start_m: None,
            prepares: false,
            lengths: Lengths::default(),
            longest_lengths: Lengths::default(),
            approach_longest_s: approach_s(0.0, 0.5),
            repetitions: Some(1),
            settling_s: 0.5,
            settling_timeout_s: 10.0,
            start: Start::default(),
            after_emergency_stop: AfterStop::default(),
            settled: Bounds::default(),
        }
    }
}

/// Seconds of the way from `from_m` to `to_m`: gentle beside any experiment.
pub(crate) fn approach_s(from_m: f64, to_m: f64) -> f64 {
    ((to_m - from_m).abs() / APPROACH_M_PER_S).max(APPROACH_SHORTEST_S)
}
