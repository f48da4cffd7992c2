//! Sign-flip null distribution of the gain: the elimination threshold and the detection limits.
//!
//! Effects that act to one side in a few windows pass it too often (discrepancy-notes.md, Second reading, 4).
//!
//! Source: discrepancy-notes.md, 4 (thresholds from this very record) and pipeline 1. Hemerik, Goeman, Finos 2020, J. R. Stat.
//! Soc. B 82(3): score sign flipping. Westfall, Young 1993, Resampling-Based Multiple Testing: maximum over candidates.

use crate::engine::Engine;
use crate::parameters::COUNT;
use crate::refit::{FittedModel, Linearisation, parameter_precisions, rig_of};
use crate::screen::Columns;
use model_fit::stats::order_statistic;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Draws of the null distribution.
const SIGN_FLIP_DRAWS: usize = 300;
/// Quantile of the draws that is the threshold.
const NULL_QUANTILE: f64 = 0.99;
/// Fixed seed: the threshold is part of the result and has the same bits in each run.
const SEED: u64 = 0xd15c_4e9a_0c1e_5e11;

/// Chi2 per degree of freedom of an outlying window, and the largest share of outliers that is excluded. In such a window the
/// break-away came at another moment.
pub(super) const OUTLIER_CHI2_PER_DOF: f64 = 3.0;
pub(super) const MAX_OUTLIER_SHARE: f64 = 0.05;

/// Window scores of all candidates against a model's residual.
pub(super) struct NullDistribution {
    /// Outlying windows.
    outliers: Vec<usize>,
    /// For each probe: candidate, coordinate of the amplitude, window scores, information.
    probes: Vec<(usize, f64, Vec<f64>, f64)>,
}

impl NullDistribution {
    pub(super) fn new(
        engine: &Engine<'_>,
        columns: &Columns,
        linearisation: &Linearisation,
        model: &FittedModel,
    ) -> Self {
        let rig =
            rig_of(&engine.rig, &model.effects, &model.factors).expect("a model that was fitted is a rig");
        let residual = engine.residual(&engine.simulate(&rig));
        let of: Vec<(usize, f64, usize)> = columns
            .probes
            .iter()
            .enumerate()
            .flat_map(|(at, probes)| probes.iter().map(move |(probe, place)| (at, probe[0], *place)))
            .collect();
        let parameter_columns = linearisation.columns.iter().map(Vec::as_slice);
        let all: Vec<&[f64]> =
            parameter_columns.chain(of.iter().map(|(_, _, place)| columns.column(*place))).collect();
        let products = engine.products(&residual, &all);
        let precisions = parameter_precisions();
        let parameters: Vec<usize> = (0..COUNT).collect();
        let weights = &products.fit_from(&parameters, &precisions, &linearisation.deviations()).weights;
        let scores = products.efficient_scores(&parameters, weights, &precisions);
        let outliers = outliers(&engine.squares(&residual), &engine.scaled_dof);
        let probes = of
            .into_iter()
            .zip(scores)
            .map(|((at, z, _), (mut scores, information))| {
                outliers.iter().for_each(|window| scores[*window] = 0.0);
                (at, z, scores, information)
            })
            .collect();
        NullDistribution { outliers, probes }
    }

    /// Rise of the loss of a reduced model, without the outlying windows.
    pub(super) fn loss_rise(&self, engine: &Engine<'_>, without: &FittedModel, model: &FittedModel) -> f64 {
        let of = |window: &usize| {
            let [without, with] = [without, model].map(|fit| fit.squares[*window].max(f64::MIN_POSITIVE));
            engine.scaled_dof[*window] * (without / with).ln()
        };
        without.loss - model.loss - self.outliers.iter().map(of).sum::<f64>()
    }

    /// Quantile of the largest gain of any candidate when the sign of each window is drawn at random. Sign flips keep the
    /// correlation within a window and destroy that with a candidate.
    pub(super) fn threshold(&self) -> f64 {
        let windows = self.probes.first().map_or(0, |(_, _, scores, _)| scores.len());
        let mut random = Pcg64::seed_from_u64(SEED);
        let mut most: Vec<f64> = (0..SIGN_FLIP_DRAWS)
            .map(|_| {
                let signs: Vec<f64> =
                    (0..windows).map(|_| if random.next_u64() >> 63 == 0 { 1.0 } else { -1.0 }).collect();
                self.probes
                    .iter()
                    .map(|(_, _, scores, information)| {
                        let sum: f64 = scores.iter().zip(&signs).map(|(score, sign)| score * sign).sum();
                        sum * sum / information
                    })
                    .fold(0.0, f64::max)
            })
            .collect();
        let rank = ((SIGN_FLIP_DRAWS as f64 * NULL_QUANTILE) as usize).min(SIGN_FLIP_DRAWS - 1);
        order_statistic(&mut most, rank).expect("the rank is one of the draws")
    }

    /// Smallest amplitude coordinate of each candidate that reaches a gain.
    pub(super) fn limits(&self, candidates: usize, gain: f64) -> Vec<Option<f64>> {
        let mut limits: Vec<Option<f64>> = vec![None; candidates];
        for (at, z, _, information) in self.probes.iter().filter(|(_, z, _, _)| *z != 0.0) {
            let limit = z.abs() * (gain / information).sqrt();
            if limit.is_finite() && limits[*at].is_none_or(|least| limit < least) {
                limits[*at] = Some(limit);
            }
        }
        limits
    }
}

/// Outlying windows; none where they are more than a few.
fn outliers(squares: &[f64], dof: &[f64]) -> Vec<usize> {
    let outliers: Vec<usize> = above_outlier_limit(squares, dof).collect();
    let most = (MAX_OUTLIER_SHARE * dof.len() as f64).max(1.0);
    if outliers.len() as f64 <= most { outliers } else { Vec::new() }
}

/// Windows beyond [`OUTLIER_CHI2_PER_DOF`], however many.
pub(super) fn above_outlier_limit(squares: &[f64], dof: &[f64]) -> impl Iterator<Item = usize> {
    let windows = squares.iter().zip(dof).enumerate();
    windows.filter(|(_, (square, dof))| **square > OUTLIER_CHI2_PER_DOF * **dof).map(|(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::outliers;

    #[test]
    fn windows_that_are_far_off_are_left_out_only_where_they_are_few() {
        let squares =
            |off: usize| -> Vec<f64> { (0..40).map(|at| if at < off { 40.0 } else { 10.0 }).collect() };
        let excluded = |off: usize| outliers(&squares(off), &[10.0; 40]);
        assert_eq!(excluded(0), Vec::<usize>::new());
        assert_eq!(excluded(2), [0, 1]);
        // A model with so many outliers is wrong in them.
        assert_eq!(excluded(3), Vec::<usize>::new());
    }
}
