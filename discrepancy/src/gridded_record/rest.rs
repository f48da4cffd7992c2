//! Classifies each period: rest, creep, or undecided.
//!
//! A piston at rest needs the break-away force, a creeping one does not, and a parabola over 21 samples does not resolve 1 mm/s.
//! Rest is slow for a while; creep is slow and steady in one direction for longer. Where neither is certain, the alternative rate
//! is kept, and the simulation decides by the residual.

use super::{POSITION_HALF_WIDTH, Parabola, slope_error};
use model_fit::stats::mean;
use plant::PERIOD_S;

/// Periods to each side that must be slow at rest.
const REST_REACH: usize = 12;
/// Threshold of a slow slope, in standard errors.
const SLOW_ERRORS: f64 = 3.5;
/// Half-widths of the stretches compared for creep, periods, and the fastest creep.
const CREEP_REACHES: [usize; 2] = [50, 100];
const CREEP_FASTEST_M_PER_S: f64 = 0.01;
/// Significance of a difference of two means, in standard errors.
const CREEP_ERRORS: f64 = 4.0;

/// Variance of a position at rest over that of a sample: it is a mean.
pub(super) fn mean_variance() -> f64 {
    1.0 / (2 * REST_REACH + 1) as f64
}

/// Classifies the periods of an axis by its positions.
pub(super) struct RestClassifier<'a> {
    parabolas: &'a [Option<Parabola>],
    positions: &'a [Option<f64>],
    noise_m: f64,
    slow: Vec<bool>,
    /// Mean position where it seems at rest over [`REST_REACH`] to each side.
    rests: Vec<Option<f64>>,
}

/// Position and rate of a piston.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    pub(super) position_m: f64,
    pub(super) rate_m_per_s: f64,
    /// An indistinguishable rate.
    pub(super) alternative_velocity_m_per_s: Option<f64>,
}

impl<'a> RestClassifier<'a> {
    /// `noise_m` is the effective noise of means, larger than that of readings where noise is autocorrelated.
    pub(super) fn new(parabolas: &'a [Option<Parabola>], positions: &'a [Option<f64>], noise_m: f64) -> Self {
        let error = noise_m * slope_error(POSITION_HALF_WIDTH);
        let slow = |parabola: &Parabola| parabola.slope.abs() < SLOW_ERRORS * error;
        let slow: Vec<bool> = parabolas.iter().map(|parabola| parabola.as_ref().is_some_and(slow)).collect();
        let mut classifier = RestClassifier { parabolas, positions, noise_m, slow, rests: Vec::new() };
        classifier.rests = (0..positions.len()).map(|place| classifier.resting_position(place)).collect();
        classifier
    }

    /// Periods that seem at rest.
    pub(super) fn resting(&self) -> Vec<bool> {
        self.rests.iter().map(Option::is_some).collect()
    }

    /// Position and rate; `None` without a parabola.
    pub(super) fn rate(&self, place: usize) -> Option<Rate> {
        let Parabola { value, slope } = self.parabolas[place]?;
        let rate_of = |position_m: f64, rate_m_per_s: f64, alternative_velocity_m_per_s: Option<f64>| {
            Some(Rate { position_m, rate_m_per_s, alternative_velocity_m_per_s })
        };
        let Some(rest_m) = self.rests[place] else {
            return rate_of(value, slope / PERIOD_S, self.slow[place].then_some(0.0));
        };
        match CREEP_REACHES.into_iter().find_map(|reach| self.steady_creep(place, reach)) {
            Some(creep_m_per_s) => rate_of(value, creep_m_per_s, Some(0.0)),
            None => rate_of(rest_m, 0.0, self.creep(place)),
        }
    }

    fn resting_position(&self, place: usize) -> Option<f64> {
        let from = place.saturating_sub(REST_REACH);
        let to = (place + REST_REACH + 1).min(self.slow.len());
        if !self.slow[from..to].iter().all(|slow| *slow) {
            return None;
        }
        let near: Vec<f64> = self.positions[from..to].iter().flatten().copied().collect();
        let half = near.len() / 2;
        let creep_m = (mean(&near[half..]) - mean(&near[..half])).abs();
        (creep_m < self.least_m(half)).then(|| mean(&near))
    }

    /// Rate of a steady motion before, around and after a period, m/s.
    fn steady_creep(&self, place: usize, reach: usize) -> Option<f64> {
        let most_m = CREEP_FASTEST_M_PER_S * reach as f64 * PERIOD_S;
        let displacements_m = [
            self.displacement_m(place.checked_sub(reach)?, reach)?,
            self.displacement_m(place, reach)?,
            self.displacement_m(place + reach, reach)?,
        ];
        let is_steady = displacements_m.iter().all(|displacement_m| {
            displacement_m.signum() == displacements_m[1].signum()
                && (self.least_m(reach)..most_m).contains(&displacement_m.abs())
        });
        is_steady.then(|| displacements_m[1] / (reach as f64 * PERIOD_S))
    }

    /// Rate of possible creep over the shortest stretch, m/s.
    fn creep(&self, place: usize) -> Option<f64> {
        let [reach, _] = CREEP_REACHES;
        let displacement_m = self.displacement_m(place, reach)?;
        (displacement_m.abs() > self.least_m(reach)).then(|| displacement_m / (reach as f64 * PERIOD_S))
    }

    /// Mean of the stretch after a place minus that before; `None` at the ends of the record.
    fn displacement_m(&self, place: usize, reach: usize) -> Option<f64> {
        let stretch = |from: usize| {
            let near: Vec<f64> = self.positions.get(from..from + reach)?.iter().flatten().copied().collect();
            (!near.is_empty()).then(|| mean(&near))
        };
        Some(stretch(place)? - stretch(place.checked_sub(reach)?)?)
    }

    /// Smallest significant difference of two means of so many readings.
    fn least_m(&self, count: usize) -> f64 {
        CREEP_ERRORS * self.noise_m * (2.0 / count as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::parabolas;
    use super::*;

    /// Rate in the middle of a record.
    fn rate_of(way: &dyn Fn(f64) -> f64) -> Rate {
        // Micrometres of scatter, as a wide sensor's: 20 um rms.
        let scatter = |at: f64| 28e-6 * (0.9 * at).sin();
        let positions: Vec<_> =
            (0..600).map(f64::from).map(|at| Some(way(at - 300.0) + scatter(at))).collect();
        let parabolas = parabolas(&positions, POSITION_HALF_WIDTH);
        RestClassifier::new(&parabolas, &positions, 20e-6).rate(300).unwrap()
    }

    #[test]
    fn what_goes_evenly_one_way_creeps_and_may_yet_rest() {
        let rate = rate_of(&|t| 1e-6 * t);
        assert!(
            (rate.rate_m_per_s - 1e-3).abs() < 1e-4 && rate.alternative_velocity_m_per_s == Some(0.0),
            "{rate:?}"
        );
    }

    #[test]
    fn what_stands_rests_for_sure() {
        let rate = rate_of(&|_| 0.2);
        assert_eq!((rate.rate_m_per_s, rate.alternative_velocity_m_per_s), (0.0, None));
        let moves = rate_of(&|t| 1e-4 * ((t - 60.0).max(0.0) + (t + 60.0).min(0.0)));
        assert_eq!((moves.rate_m_per_s, moves.alternative_velocity_m_per_s), (0.0, None));
    }

    #[test]
    fn what_seems_at_rest_but_is_soon_under_way_may_creep() {
        let rate = rate_of(&|t| 1e-7 * (t - 15.0).max(0.0).powi(2));
        assert_eq!(rate.rate_m_per_s, 0.0);
        assert!(rate.alternative_velocity_m_per_s.unwrap() > 2e-4, "{rate:?}");
    }

    #[test]
    fn what_is_slow_beside_a_motion_may_rest() {
        let rate = rate_of(&|t| 3e-5 * (t - 8.0).max(0.0));
        assert!(rate.rate_m_per_s.abs() < 5e-3 && rate.alternative_velocity_m_per_s == Some(0.0), "{rate:?}");
    }
}
