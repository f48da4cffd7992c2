//! Heterogeneity of an effect's amplitude between the windows of the records.
//!
//! ```text
//!   d_k, i_k   change of the amplitude that window k asks for beside the fitted model, and its information
//!   Q = sum_k i_k (d_k - mean)^2     tau^2 = (Q - (n - 1)) / (sum i - sum i^2 / sum i), at least 0     CV_B = tau / |amplitude|
//! ```
//!
//! A law that is nearly right has one amplitude whatever the rig does. Another one absorbs more of what is missing in some
//! windows than in others, and its amplitude differs between them by as much as its size.
//!
//! The information i_k has the weight f_k / |e_k|^2 of its window: 1 / i_k is the variance by what the model leaves, not by the
//! noise of the sensors, so that a bad fit looks more homogeneous than it is.
//!
//! Source: DerSimonian, Laird 1986, Control. Clin. Trials 7(3): random effects. Takkouche et al. 1999, Am. J. Epidemiol. 150(2):
//! between-study coefficient of variation.

use super::elimination::Selection;
use super::{MIN_LOSS_REDUCTION, STEPS, is_large, lacks_fit, leading_key, loss_where_last_acts, relinearise};
use crate::engine::Engine;
use crate::refit::{
    Linearisation, Refit, coordinate_columns, linearise, prior_precisions, refit_steps, rig_of,
};
use rayon::prelude::*;

/// CV_B above which an effect neither comes first in a round nor stays in a model that lacks fit: right names had 0.01 to 0.24 on
/// seed 13, a development seed, impostors 0.1 to 2.
const MAX_CV_IN_SEARCH: f64 = 0.3;
/// Number of fits of a round that are compared.
const COMPARED: usize = 4;
/// Share of the best gain that a homogeneous fit must reach to come before it.
const MIN_GAIN_SHARE: f64 = 0.4;
/// Share of the loss before it that a homogeneous effect must remove.
const MIN_LOSS_SHARE: f64 = 0.1;

/// Leaves the fits, of the best [`COMPARED`], that are homogeneous and remove enough, the one with the least loss first; whether
/// there is one. All stay where there is none.
pub(super) fn prefer_homogeneous(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    before: &Refit,
    fits: &mut Vec<Refit>,
) -> bool {
    let gain = |fit: &Refit| before.loss - fit.loss;
    let Some(most) = fits.first().map(gain) else { return false };
    let needed = |fit: &Refit| {
        let share = MIN_LOSS_SHARE * loss_where_last_acts(engine, before, fit);
        share.max(MIN_LOSS_REDUCTION).max(MIN_GAIN_SHARE * most)
    };
    let is_homogeneous = |fit: &Refit| {
        let variation = amplitude_variation(engine, linearisation, fit);
        variation.and_then(|all| all.last().copied()).is_some_and(|variation| variation < MAX_CV_IN_SEARCH)
    };
    let homogeneous: Vec<Refit> = fits
        .par_iter()
        .take(COMPARED)
        .filter(|fit| gain(fit) > needed(fit) && is_homogeneous(fit))
        .cloned()
        .collect();
    let found = !homogeneous.is_empty();
    if found {
        *fits = homogeneous;
    }
    found
}

/// Leaves the fits above the amplitude floor, where one of them is adequate or the model before them is.
pub(super) fn prefer_large(engine: &Engine<'_>, before: &Refit, fits: &mut Vec<Refit>) {
    let is_adequate = |fit: &Refit| !lacks_fit(engine, fit.loss);
    let is_large = |fit: &Refit| fit.placed.last().is_some_and(is_large);
    if is_adequate(before) || fits.iter().any(|fit| is_large(fit) && is_adequate(fit)) {
        fits.retain(is_large);
    }
}

/// Eliminates effects on whose amplitude the windows do not agree, the worst first.
pub(super) fn eliminate_heterogeneous(engine: &Engine<'_>, selection: &mut Selection) {
    let Selection { calibrated, model, rounds } = selection;
    while !model.placed.is_empty() {
        let linearisation = linearise(engine, model);
        let Some(variation) = amplitude_variation(engine, &linearisation, model) else { break };
        let worst = variation.iter().copied().enumerate().max_by(|left, right| left.1.total_cmp(&right.1));
        let Some((at, _)) = worst.filter(|(_, variation)| *variation > MAX_CV_IN_SEARCH) else { break };
        let mut placed = model.placed.clone();
        placed.remove(at);
        rounds.remove(at.min(rounds.len() - 1));
        *model = if placed.is_empty() {
            calibrated.clone()
        } else {
            let fit = refit_steps(engine, &linearisation, &placed, STEPS);
            let Some(fit) = fit else { break };
            relinearise(engine, fit)
        };
    }
}

/// CV_B of each effect of a model, of its leading amplitude; `linearisation` holds sensitivities to the parameters at this model
/// or near it. `None` where no derivative exists.
pub(super) fn amplitude_variation(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &Refit,
) -> Option<Vec<f64>> {
    let simulated = engine.simulate(&rig_of(engine.rig(), &model.placed, &model.factors)?);
    let residual = engine.residual(&simulated);
    let mut columns = linearisation.columns.clone();
    let mut column = columns.len();
    columns.extend(coordinate_columns(engine, &model.factors, &model.placed, &simulated)?);
    let products = engine.products(&residual, &columns);
    let weights = products.weights(&engine.squares(&residual));
    let precisions = prior_precisions(&model.placed);
    model
        .placed
        .iter()
        .map(|placed| {
            let key = leading_key(placed);
            let changes = products.window_changes(column + key, &weights, &precisions)?;
            column += placed.coordinates.len();
            Some(coefficient_of_variation(placed.coordinates[key], &changes))
        })
        .collect()
}

/// CV_B of an amplitude from the changes that windows ask for and their information; infinite where the amplitude is 0.
fn coefficient_of_variation(amplitude: f64, changes: &[(f64, f64)]) -> f64 {
    let total: f64 = changes.iter().map(|(_, information)| information).sum();
    let mean = changes.iter().map(|(change, information)| change * information).sum::<f64>() / total;
    let heterogeneity: f64 =
        changes.iter().map(|(change, information)| information * (change - mean).powi(2)).sum();
    let squares: f64 = changes.iter().map(|(_, information)| information * information).sum();
    let spare = total - squares / total;
    if spare <= 0.0 {
        return 0.0;
    }
    let variance = (heterogeneity - (changes.len() as f64 - 1.0)) / spare;
    variance.max(0.0).sqrt() / amplitude.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_agree_within_their_errors_have_no_variation() {
        let changes: Vec<(f64, f64)> =
            (0..20).map(|window| (if window % 2 == 0 { 0.1 } else { -0.1 }, 100.0)).collect();
        // Q = 20 of 19 expected.
        let small = coefficient_of_variation(1.0, &changes);
        assert!(small < 0.03, "{small}");
    }

    #[test]
    fn windows_that_ask_for_different_amplitudes_have_the_variation_of_those() {
        let changes: Vec<(f64, f64)> =
            (0..20).map(|window| (if window % 2 == 0 { 0.5 } else { -0.5 }, 100.0)).collect();
        for amplitude in [1.0, -2.0] {
            let variation = coefficient_of_variation(amplitude, &changes);
            assert!((variation * f64::abs(amplitude) - 0.5).abs() < 0.03, "{variation}");
        }
    }
}
