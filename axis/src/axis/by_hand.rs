//! Set-points that a person gives while an experiment runs, instead of its row.
//!
//! The newest target is approached along a sinoid from the current set-point. A transition that has begun is completed, since
//! only its end is at rest; a target given meanwhile follows it. A target given while the row moves waits until the row is at
//! rest. From the first transition on the operator leads until the experiment ends: the rest of the row is left out, since the
//! point where it would take over again is undefined.

use crate::chains::main::Phase;
use crate::experiment::OperatorLimits;
use crate::set_point::SmoothTransition;
use crate::set_point::law::ProfilePoint;

/// Largest over mean speed of a sinoid.
const PEAK: f64 = 2.0;

/// Set-point that follows the operator's targets, in m or N.
pub(super) struct OperatorSetPoint {
    limits: OperatorLimits,
    /// Newest target that no transition leads to yet.
    target: Option<f64>,
    /// The current or last transition and its start, s into the experiment.
    transition: Option<(SmoothTransition, f64)>,
    /// The last set-point since the operator took over; `None` before.
    last_value: Option<f64>,
}

impl OperatorSetPoint {
    pub(super) fn new(limits: OperatorLimits) -> Self {
        Self { limits, target: None, transition: None, last_value: None }
    }

    /// Drops target, transition and last value.
    pub(super) fn reset(&mut self) {
        (self.target, self.transition, self.last_value) = (None, None, None);
    }

    /// Takes the `target` that the operator gave since the last cycle; it is ignored outside of an experiment.
    pub(super) fn set_target(&mut self, phase: Phase, target: Option<f64>) {
        match phase {
            Phase::Experiment { .. } => {
                let [least, most] = self.limits.range;
                self.target = target.map(|value| value.clamp(least, most)).or(self.target);
            }
            Phase::HoldEnd => {}
            _ => self.reset(),
        }
    }

    /// The set-point `elapsed_s` after the experiment began, where its row has `planned`.
    pub(super) fn at(&mut self, elapsed_s: f64, planned: ProfilePoint) -> ProfilePoint {
        let mut point =
            self.transition.map_or(planned, |(transition, began_s)| transition.at(elapsed_s - began_s));
        if !point.moving
            && let Some(to) = self.target.take()
        {
            let duration_s = PEAK * (to - point.value).abs() / self.limits.rate_per_s;
            let transition = SmoothTransition::new(point.value, to, duration_s);
            self.transition = Some((transition, elapsed_s));
            point = transition.at(0.0);
        }
        if self.transition.is_some() {
            self.last_value = Some(point.value);
        }
        point
    }

    /// The operator's last set-point, if there is one.
    pub(super) fn end(&self) -> Option<f64> {
        self.last_value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: OperatorLimits = OperatorLimits { rate_per_s: 0.2, range: [0.0, 0.5] };
    fn ask(hand: &mut OperatorSetPoint, value: f64) {
        hand.set_target(Phase::Experiment { elapsed_s: 0.0 }, Some(value));
    }

    const ROW: ProfilePoint = ProfilePoint { value: 0.1, rate: 0.0, acceleration: 0.0, moving: false };

    #[test]
    fn a_value_is_approached_with_the_largest_rate_and_held() {
        let mut hand = OperatorSetPoint::new(LIMITS);
        assert_eq!((hand.at(0.0, ROW), hand.end()), (ROW, None));
        ask(&mut hand, 0.3);
        let way: Vec<_> = (1000..4000).map(|ms| hand.at(f64::from(ms) * 1e-3, ROW)).collect();
        let fastest = way.iter().map(|point| point.rate).fold(0.0, f64::max);
        assert!((fastest - 0.2).abs() < 1e-6, "{fastest} m/s");
        // 0.2 m with a mean of 0.1 m/s.
        assert!(way[1999].moving && !way[2000].moving);
        let steps = way.windows(2).map(|two| (two[1].value - two[0].value).abs()).fold(0.0, f64::max);
        assert!(steps < 0.201e-3, "{steps} m in a ms");
        assert_eq!((way[2999].value, hand.end()), (0.3, Some(0.3)));
    }

    #[test]
    fn what_is_asked_for_on_the_way_comes_behind_it_and_the_newest_counts() {
        let mut hand = OperatorSetPoint::new(LIMITS);
        ask(&mut hand, 0.3);
        let start = hand.at(0.0, ROW);
        assert!(start.value == 0.1 && start.moving);
        ask(&mut hand, 0.0);
        ask(&mut hand, 0.25);
        assert!(hand.at(1.0, ROW).rate > 0.0, "the way goes on");
        assert_eq!(hand.at(2.0, ROW).value, 0.3);
        assert!((hand.at(2.5, ROW).value - 0.25).abs() < 1e-12);
    }

    #[test]
    fn values_beyond_the_range_are_taken_to_its_end() {
        let mut hand = OperatorSetPoint::new(LIMITS);
        ask(&mut hand, 0.9);
        hand.at(0.0, ROW);
        assert_eq!(hand.at(100.0, ROW).value, 0.5);
        hand.set_target(Phase::HoldEnd, Some(0.1));
        assert_eq!(hand.end(), Some(0.5), "held, and nobody listens");
        hand.set_target(Phase::HoldStart, Some(0.1));
        assert_eq!((hand.at(0.0, ROW), hand.end()), (ROW, None));
    }

    #[test]
    fn a_row_that_moves_on_after_a_hand_has_led_is_left_out() {
        let mut hand = OperatorSetPoint::new(LIMITS);
        ask(&mut hand, 0.3);
        hand.at(0.0, ROW);
        let row = ProfilePoint { value: 0.15, rate: 0.1, moving: true, ..ROW };
        assert_eq!(hand.at(2.0, row), ProfilePoint { value: 0.3, ..ROW }, "held where the hand has led to");
        ask(&mut hand, 0.2);
        assert!(
            hand.at(3.0, row).moving && hand.at(3.5, row).rate < 0.0,
            "the hand is followed, and not the row"
        );
        assert_eq!(hand.at(4.0, ProfilePoint { moving: false, ..row }).value, 0.2);
    }

    #[test]
    fn a_row_that_moves_is_waited_for() {
        let mut hand = OperatorSetPoint::new(LIMITS);
        ask(&mut hand, 0.3);
        let moving = ProfilePoint { rate: 0.1, moving: true, ..ROW };
        assert_eq!(hand.at(0.0, moving), moving);
        assert!(hand.at(0.1, ROW).moving);
    }
}
