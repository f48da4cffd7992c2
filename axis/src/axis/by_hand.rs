//! Set-points that a person gives while an experiment runs, instead of its row.
//!
//! The newest one is approached along a sinoid from where the set-point stands. A way that has begun is gone to its end, since
//! only there it is at rest; what was asked for meanwhile comes behind it. What is asked for while the row moves waits for its
//! rest. From the first way on a hand leads until the experiment ends: what the row still had is left out, since nobody could
//! tell where it would take over from a hand.

use crate::chains::main::Phase;
use crate::experiment::ByHandLimits;
use crate::set_point::SmoothWay;
use crate::set_point::law::Moment;

/// Largest over mean speed of a sinoid.
const PEAK: f64 = 2.0;

/// What a person asks an axis for, in m or N.
pub(super) struct ByHand {
    limits: ByHandLimits,
    asked: Option<f64>,
    /// The way that is gone, or was gone last, and when it began, s into the experiment.
    way: Option<(SmoothWay, f64)>,
    /// The set-point shown last, since a hand leads.
    shown: Option<f64>,
}

impl ByHand {
    pub(super) fn new(limits: ByHandLimits) -> Self {
        Self { limits, asked: None, way: None, shown: None }
    }

    /// Nothing was asked for.
    pub(super) fn forget(&mut self) {
        (self.asked, self.way, self.shown) = (None, None, None);
    }

    /// Takes what a person `asked` for since the last cycle; outside of an experiment it is heard by nobody.
    pub(super) fn hear(&mut self, phase: Phase, asked: Option<f64>) {
        match phase {
            Phase::Experiment { .. } => {
                let [least, most] = self.limits.range;
                self.asked = asked.map(|value| value.clamp(least, most)).or(self.asked);
            }
            Phase::HoldEnd => {}
            _ => self.forget(),
        }
    }

    /// The set-point `elapsed_s` after the experiment began, where its row has `planned`.
    pub(super) fn at(&mut self, elapsed_s: f64, planned: Moment) -> Moment {
        let mut moment = self.way.map_or(planned, |(way, began_s)| way.at(elapsed_s - began_s));
        if !moment.moving
            && let Some(to) = self.asked.take()
        {
            let duration_s = PEAK * (to - moment.value).abs() / self.limits.rate_per_s;
            let way = SmoothWay::new(moment.value, to, duration_s);
            self.way = Some((way, elapsed_s));
            moment = way.at(0.0);
        }
        if self.way.is_some() {
            self.shown = Some(moment.value);
        }
        moment
    }

    /// Where a hand has led to, if one has.
    pub(super) fn end(&self) -> Option<f64> {
        self.shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ByHandLimits = ByHandLimits { rate_per_s: 0.2, range: [0.0, 0.5] };
    fn ask(hand: &mut ByHand, value: f64) {
        hand.hear(Phase::Experiment { elapsed_s: 0.0 }, Some(value));
    }

    const ROW: Moment = Moment { value: 0.1, rate: 0.0, acceleration: 0.0, moving: false };

    #[test]
    fn a_value_is_approached_with_the_largest_rate_and_held() {
        let mut hand = ByHand::new(LIMITS);
        assert_eq!((hand.at(0.0, ROW), hand.end()), (ROW, None));
        ask(&mut hand, 0.3);
        let way: Vec<_> = (1000..4000).map(|ms| hand.at(f64::from(ms) * 1e-3, ROW)).collect();
        let fastest = way.iter().map(|moment| moment.rate).fold(0.0, f64::max);
        assert!((fastest - 0.2).abs() < 1e-6, "{fastest} m/s");
        // 0.2 m with a mean of 0.1 m/s.
        assert!(way[1999].moving && !way[2000].moving);
        let steps = way.windows(2).map(|two| (two[1].value - two[0].value).abs()).fold(0.0, f64::max);
        assert!(steps < 0.201e-3, "{steps} m in a ms");
        assert_eq!((way[2999].value, hand.end()), (0.3, Some(0.3)));
    }

    #[test]
    fn what_is_asked_for_on_the_way_comes_behind_it_and_the_newest_counts() {
        let mut hand = ByHand::new(LIMITS);
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
        let mut hand = ByHand::new(LIMITS);
        ask(&mut hand, 0.9);
        hand.at(0.0, ROW);
        assert_eq!(hand.at(100.0, ROW).value, 0.5);
        hand.hear(Phase::HoldEnd, Some(0.1));
        assert_eq!(hand.end(), Some(0.5), "held, and nobody listens");
        hand.hear(Phase::HoldStart, Some(0.1));
        assert_eq!((hand.at(0.0, ROW), hand.end()), (ROW, None));
    }

    #[test]
    fn a_row_that_moves_on_after_a_hand_has_led_is_left_out() {
        let mut hand = ByHand::new(LIMITS);
        ask(&mut hand, 0.3);
        hand.at(0.0, ROW);
        let row = Moment { value: 0.15, rate: 0.1, moving: true, ..ROW };
        assert_eq!(hand.at(2.0, row), Moment { value: 0.3, ..ROW }, "held where the hand has led to");
        ask(&mut hand, 0.2);
        assert!(
            hand.at(3.0, row).moving && hand.at(3.5, row).rate < 0.0,
            "the hand is followed, and not the row"
        );
        assert_eq!(hand.at(4.0, Moment { moving: false, ..row }).value, 0.2);
    }

    #[test]
    fn a_row_that_moves_is_waited_for() {
        let mut hand = ByHand::new(LIMITS);
        ask(&mut hand, 0.3);
        let moving = Moment { rate: 0.1, moving: true, ..ROW };
        assert_eq!(hand.at(0.0, moving), moving);
        assert!(hand.at(0.1, ROW).moving);
    }
}
