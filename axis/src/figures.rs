//! Figures of the position control, taken cycle by cycle: dynamic and static error (bus.md, A run's folder).
//!
//! Dynamic: largest |set-point - position sensor| while the set-point moves. Static: largest of the mean |error| over the last
//! 0.2 s of each rest. Both over the experiment alone, not over the way to it, and over repetitions that were driven through: one
//! that was cut off counts for nothing.

use crate::axis::average::Average;
use crate::set_point::SetPoint;

#[derive(Clone, Copy, Debug, Default)]
struct MaximumErrors {
    moving_m: Option<f64>,
    resting_m: Option<f64>,
}

/// Dynamic and static error of a position control, over the repetitions that were not cut off, the current one among them.
#[derive(Debug, Default)]
pub struct PositionFigures {
    /// Of the repetitions that were driven through.
    kept: MaximumErrors,
    /// Of the one that is being driven.
    now: MaximumErrors,
    /// |error| of the rest that is going on, m.
    resting: Average,
}

impl PositionFigures {
    /// Takes a cycle of the experiment, with the position sensor as it came, m.
    pub(crate) fn take(&mut self, set_point: &SetPoint, position_m: f64) {
        let error_m = (set_point.position_m - position_m).abs();
        if set_point.moving {
            self.end_rest();
            self.now.moving_m = larger(self.now.moving_m, Some(error_m));
        } else {
            self.resting.take(error_m);
        }
    }

    /// The repetition, if one is being driven, has come to its end.
    pub(crate) fn end_repetition(&mut self) {
        self.end_rest();
        let now = std::mem::take(&mut self.now);
        self.kept.moving_m = larger(self.kept.moving_m, now.moving_m);
        self.kept.resting_m = larger(self.kept.resting_m, now.resting_m);
    }

    /// The repetition, if one is being driven, was cut off.
    pub(crate) fn drop_repetition(&mut self) {
        self.now = MaximumErrors::default();
        self.resting.clear();
    }

    /// Closes the rest that is going on, if any; a rest shorter than the window says nothing.
    fn end_rest(&mut self) {
        if self.resting.is_full() {
            self.now.resting_m = larger(self.now.resting_m, Some(self.resting.value()));
        }
        self.resting.clear();
    }

    /// Dynamic error, m; `None` before the set-point moved.
    pub fn dynamic_m(&self) -> Option<f64> {
        larger(self.kept.moving_m, self.now.moving_m)
    }

    /// Static error, m; `None` before a rest was long enough.
    pub fn static_m(&self) -> Option<f64> {
        larger(self.kept.resting_m, self.now.resting_m)
    }
}

fn larger(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    one.into_iter().chain(other).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moving_and_resting_errors_are_kept_apart() {
        let mut figures = PositionFigures::default();
        let moving = SetPoint { position_m: 0.2, velocity_m_per_s: 0.1, moving: true, ..SetPoint::default() };
        [0.19, 0.25, 0.2].iter().for_each(|position| figures.take(&moving, *position));
        // The rest starts 3 mm off and creeps: only its last 200 samples count.
        (0..500).for_each(|_| figures.take(&SetPoint::at_rest(0.2), 0.203));
        (0..200).for_each(|_| figures.take(&SetPoint::at_rest(0.2), 0.2004));
        assert_eq!(figures.static_m(), None, "the rest is not over");
        figures.take(&moving, 0.2);
        // Differences of numbers near 0.2 carry roundings of 3e-17.
        assert!((figures.dynamic_m().unwrap() - 0.05).abs() < 1e-15);
        assert!((figures.static_m().unwrap() - 0.0004).abs() < 1e-15);
    }

    #[test]
    fn a_short_rest_says_nothing() {
        let mut figures = PositionFigures::default();
        (0..199).for_each(|_| figures.take(&SetPoint::at_rest(0.2), 0.3));
        figures.end_repetition();
        assert_eq!((figures.dynamic_m(), figures.static_m()), (None, None));
    }

    #[test]
    fn a_repetition_that_was_cut_off_counts_for_nothing() {
        let mut figures = PositionFigures::default();
        let moving = SetPoint { position_m: 0.2, moving: true, ..SetPoint::default() };
        figures.take(&moving, 0.199);
        figures.end_repetition();
        figures.take(&moving, 0.0);
        (0..300).for_each(|_| figures.take(&SetPoint::at_rest(0.2), 0.0));
        figures.drop_repetition();
        figures.end_repetition();
        assert!((figures.dynamic_m().unwrap() - 0.001).abs() < 1e-15);
        assert_eq!(figures.static_m(), None);
    }
}
