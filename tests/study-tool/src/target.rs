//! Targets of rates, and whether they are reached.
//!
//! A target is reached when the estimate reaches it. The interval shows whether the number of draws resolves that:
//!
//! ```text
//! interval within the target            reached
//! interval outside the target           missed
//! interval across an end of it          not resolved: the estimate reaches the target, or misses it
//! ```
//!
//! The interval is Wilson's of 95 % ([`crate::interval`]). A target of none in so many draws is reached by their number alone.

use crate::interval::Rate;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// The target of a rate; serialised in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub(crate) enum Target {
    /// No target: the rate is part of another one.
    Component,
    /// No target: the rate is only reported.
    Reported,
    /// At least so many per cent.
    AtLeast(u32),
    /// At most so many per cent.
    AtMost(u32),
    /// Between these per cents.
    Between(u32, u32),
    /// None in so many draws.
    NoneOf(usize),
}

impl Target {
    /// The shares that reach the target.
    fn bounds(self) -> Option<[f64; 2]> {
        let share = |percent: u32| f64::from(percent) / 100.0;
        match self {
            Target::Component | Target::Reported => None,
            Target::AtLeast(least) => Some([share(least), 1.0]),
            Target::AtMost(most) => Some([0.0, share(most)]),
            Target::Between(least, most) => Some([share(least), share(most)]),
            Target::NoneOf(_) => Some([0.0, 0.0]),
        }
    }
}

impl Display for Target {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Target::Component => Ok(()),
            Target::Reported => write!(formatter, "reported"),
            Target::AtLeast(least) => write!(formatter, "{least} %"),
            Target::AtMost(most) => write!(formatter, "at most {most} %"),
            Target::Between(least, most) => write!(formatter, "{least} to {most} %"),
            Target::NoneOf(draws) => write!(formatter, "none of {draws}"),
        }
    }
}

impl From<Target> for String {
    fn from(target: Target) -> String {
        target.to_string()
    }
}

/// Outcome of a rate and its interval against a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Outcome {
    NoDraw,
    Reached,
    Missed,
    /// The estimate reaches the target; the interval crosses an end of it.
    EstimateReaches,
    EstimateMisses,
}

impl Outcome {
    /// `None` without a target.
    pub(crate) fn of(rate: &Rate, target: Target) -> Option<Self> {
        let [least, most] = target.bounds()?;
        let Some(share) = rate.share else { return Some(Outcome::NoDraw) };
        let [low, high] = rate.interval;
        let is_enough = matches!(target, Target::NoneOf(draws) if rate.count == 0 && rate.of >= draws);
        Some(if is_enough || (least <= low && high <= most) {
            Outcome::Reached
        } else if high < least || most < low {
            Outcome::Missed
        } else if (least..=most).contains(&share) {
            Outcome::EstimateReaches
        } else {
            Outcome::EstimateMisses
        })
    }
}

impl Display for Outcome {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Outcome::NoDraw => "no draw",
            Outcome::Reached => "reached",
            Outcome::Missed => "missed",
            Outcome::EstimateReaches => "not resolved (estimate reaches)",
            Outcome::EstimateMisses => "not resolved (estimate misses)",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_resolved_where_the_interval_does_not_cross_it() {
        // Wilson's intervals: 6 of 6 from 61 %, 2 of 6 to 70 %, 196 of 200 from 95 %, 9 of 9 from 70 %, 5 of 9 to 81 %.
        for (count, of, target, outcome) in [
            (6, 6, Target::AtLeast(97), Outcome::EstimateReaches),
            (2, 6, Target::AtLeast(88), Outcome::Missed),
            (196, 200, Target::AtLeast(92), Outcome::Reached),
            (5, 9, Target::AtLeast(92), Outcome::Missed),
            (3, 5, Target::AtLeast(88), Outcome::EstimateMisses),
            (23, 25, Target::AtLeast(92), Outcome::EstimateReaches),
            (9, 9, Target::Between(93, 97), Outcome::EstimateMisses),
            (0, 5, Target::AtMost(2), Outcome::EstimateReaches),
            (0, 200, Target::AtMost(2), Outcome::Reached),
            (6, 24, Target::AtMost(10), Outcome::Missed),
            (0, 0, Target::AtLeast(85), Outcome::NoDraw),
        ] {
            assert_eq!(
                Outcome::of(&Rate::new(count, of), target),
                Some(outcome),
                "{count} of {of}, {target}"
            );
        }
        for target in [Target::Component, Target::Reported] {
            assert_eq!(Outcome::of(&Rate::new(1, 2), target), None);
        }
    }

    #[test]
    fn none_is_reached_by_so_many_draws_and_missed_by_one() {
        let of = |count, of| Outcome::of(&Rate::new(count, of), Target::NoneOf(200)).unwrap();
        assert_eq!(of(0, 5), Outcome::EstimateReaches);
        assert_eq!(of(0, 200), Outcome::Reached);
        assert_eq!(of(1, 300), Outcome::Missed);
    }

    #[test]
    fn a_target_is_written_in_words() {
        let words = [Target::Component, Target::AtLeast(97), Target::AtMost(5), Target::Between(93, 97)];
        assert_eq!(words.map(|target| target.to_string()), ["", "97 %", "at most 5 %", "93 to 97 %"]);
        assert_eq!(serde_json::json!(Target::NoneOf(200)), "none of 200");
        assert_eq!(serde_json::json!(Outcome::EstimateReaches), "estimate-reaches");
    }
}
