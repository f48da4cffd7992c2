//! Regimes of a short window: rest, after break-away, motion out or in, near an end, after a valve edge.
//!
//! A short window is in one of hold, onset, motion-out and motion-in, and besides in near-ends and valve-edge where it is so.

use super::SHORT_WINDOW_PERIODS;
use crate::gridded_record::{AxisState, GriddedRecord};
use plant::RigParameters;

/// The regimes, in the order of the report.
pub(crate) const REGIMES: [&str; 6] = ["hold", "onset", "motion-out", "motion-in", "near-ends", "valve-edge"];
/// How long after leaving rest the onset lasts.
const ONSET_PERIODS: usize = 100;
/// How far from an end of the stroke is near, m.
const NEAR_M: f64 = 0.03;
/// Change of the command in a period that is an edge, share of full opening.
const EDGE: f64 = 0.2;
/// How long after an edge.
const AFTER_EDGE_PERIODS: usize = 20;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Regimes {
    in_regime: [bool; REGIMES.len()],
}

impl Regimes {
    /// The regimes of an axis in a short window that starts at a period.
    pub(super) fn of(rig: &RigParameters, record: &GriddedRecord, axis: usize, from: usize) -> Self {
        let point =
            |period: usize| -> &AxisState { &record.smoothed_states[period.min(record.len() - 1)][axis] };
        let rests = |period: usize| point(period).rod_velocity_m_per_s == 0.0;
        let hold = (from..=from + SHORT_WINDOW_PERIODS).all(rests);
        let onset = !hold && (from.saturating_sub(ONSET_PERIODS)..from + SHORT_WINDOW_PERIODS).any(rests);
        let out = point(from + SHORT_WINDOW_PERIODS / 2).rod_velocity_m_per_s >= 0.0;
        let middle_m = point(from + SHORT_WINDOW_PERIODS / 2).extension_m;
        let near = middle_m.min(rig.cylinder().stroke_m - middle_m) < NEAR_M;
        let command = |period: usize| record.inputs[period].valve[axis];
        let edge = (from.saturating_sub(AFTER_EDGE_PERIODS).max(1)..from + SHORT_WINDOW_PERIODS)
            .any(|period| (command(period) - command(period - 1)).abs() > EDGE);
        let moving = !hold && !onset;
        Regimes { in_regime: [hold, onset, moving && out, moving && !out, near, edge] }
    }

    pub(crate) fn contains(&self, regime: &str) -> bool {
        REGIMES.iter().zip(self.in_regime).any(|(name, within)| *name == regime && within)
    }
}
