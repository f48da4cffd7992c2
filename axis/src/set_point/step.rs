//! Step: at once to a place, which is then held.
//!
//! The set-point counts as moving in the basic cycle in which it jumps, so that the rest behind is one of its own; its rate is 0,
//! since a jump has none.

use super::law::{BOTH, Kind, Law, Moment};
use std::sync::Arc;

/// How long a jump counts as moving: a basic cycle.
pub(super) const JUMP_S: f64 = 0.000_999;

/// In the list of laws.
pub const KIND: Kind = Kind {
    name: "step",
    about: "at once to a place, which is then held",
    serves: BOTH,
    read: |given| {
        let to = given.place("to", "where it jumps to")?;
        Ok(Arc::new(Step { from: given.from, to, duration_s: given.duration_s(0.001)? }))
    },
};

/// A jump and the hold after it.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) duration_s: f64,
}

impl Law for Step {
    fn at(&self, time_s: f64) -> Moment {
        Moment { moving: time_s < JUMP_S && self.to != self.from, ..Moment::at_rest(self.to) }
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn end(&self) -> f64 {
        self.to
    }

    fn reach(&self) -> [f64; 2] {
        [self.to; 2]
    }
}
