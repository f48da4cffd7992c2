//! Heterogeneity of an effect's amplitude between the windows of the records.
//!
//! ```text
//!   d_k, i_k   estimate of the effect's change from window k alone (one step), as a share of its amplitude, and its information
//!   Q = sum_k i_k (d_k - mean)^2     tau^2 = (Q - (n - 1)) / (sum i - sum i^2 / sum i), at least 0     CV_B = tau
//! ```
//!
//! A law that is nearly right has one amplitude whatever the rig does. Another one absorbs more of what is missing in some
//! windows than in others, and its amplitude differs between them by as much as its size.
//!
//! The information i_k has the weight f_k / |e_k|^2 of its window: 1 / i_k is the variance by the model's residual, not by the
//! noise of the sensors, so that a bad fit looks more homogeneous than it is.
//!
//! Source: DerSimonian, Laird 1986, Control. Clin. Trials 7(3): random effects. Takkouche et al. 1999, Am. J. Epidemiol. 150(2):
//! between-study coefficient of variation.

use super::elimination::Selection;
use super::null_distribution::MAX_OUTLIER_SHARE;
use super::{MIN_GAIN, STEPS, is_large, lacks_fit, leading_key, loss_where_last_acts, relinearise};
use crate::engine::Engine;
use crate::fit::Products;
use crate::parameters::COUNT;
use crate::refit::{
    FittedModel, Linearisation, coordinate_columns, linearise, prior_precisions, refit_steps, rig_of,
};
use model_fit::parallel;

/// CV_B above which an effect neither comes first in a round nor stays in a model that lacks fit: right names had 0.01 to 0.24 on
/// seed 13, a development seed, impostors 0.1 to 2. These figures are of the derivative that the whole response stands for since.
const MAX_CV_IN_SEARCH: f64 = 0.3;
/// I^2, the share of Q that is not chance, above which tau counts in a standard error: high heterogeneity in the terms of Higgins
/// et al. 2003, BMJ 327. Windows of an exact law disagree a little too.
const HIGH_I2: f64 = 0.75;
/// Share of the most informative window's information below which a window does not count.
const MIN_INFORMATION_SHARE: f64 = 1e-9;
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
    before: &FittedModel,
    fits: &mut Vec<FittedModel>,
) -> bool {
    let gain = |fit: &FittedModel| before.loss - fit.loss;
    let Some(most) = fits.first().map(gain) else { return false };
    let needed = |fit: &FittedModel| {
        let share = MIN_LOSS_SHARE * loss_where_last_acts(engine, before, fit);
        share.max(MIN_GAIN).max(MIN_GAIN_SHARE * most)
    };
    let is_homogeneous = |fit: &FittedModel| {
        let variation = amplitude_variation(engine, linearisation, fit);
        variation.and_then(|all| all.last().copied()).is_some_and(|variation| variation < MAX_CV_IN_SEARCH)
    };
    let compared = &fits[..fits.len().min(COMPARED)];
    let stays = parallel::map(compared, |fit| gain(fit) > needed(fit) && is_homogeneous(fit));
    let homogeneous: Vec<FittedModel> =
        compared.iter().zip(stays).filter(|(_, stays)| *stays).map(|(fit, _)| fit.clone()).collect();
    let found = !homogeneous.is_empty();
    if found {
        *fits = homogeneous;
    }
    found
}

/// Leaves the fits above the amplitude floor, where one of them is adequate or the model before them is.
pub(super) fn prefer_large(engine: &Engine<'_>, before: &FittedModel, fits: &mut Vec<FittedModel>) {
    let is_adequate = |fit: &FittedModel| !lacks_fit(engine, fit.loss);
    let is_large = |fit: &FittedModel| fit.effects.last().is_some_and(is_large);
    if is_adequate(before) || fits.iter().any(|fit| is_large(fit) && is_adequate(fit)) {
        fits.retain(is_large);
    }
}

/// Eliminates effects on whose amplitude the windows do not agree, the worst first.
pub(super) fn eliminate_heterogeneous(engine: &Engine<'_>, selection: &mut Selection) {
    let Selection { calibrated, model, rounds } = selection;
    while !model.effects.is_empty() {
        let linearisation = linearise(engine, model);
        let Some(variation) = amplitude_variation(engine, &linearisation, model) else { break };
        let worst = variation.iter().copied().enumerate().max_by(|left, right| left.1.total_cmp(&right.1));
        let Some((at, _)) = worst.filter(|(_, variation)| *variation > MAX_CV_IN_SEARCH) else { break };
        let mut effects = model.effects.clone();
        effects.remove(at);
        rounds.remove(at.min(rounds.len() - 1));
        *model = if effects.is_empty() {
            calibrated.clone()
        } else {
            let fit = refit_steps(engine, &linearisation, &effects, STEPS);
            let Some(fit) = fit else { break };
            relinearise(engine, fit)
        };
    }
}

/// How much the windows disagree on an effect.
#[derive(Clone, Debug)]
pub(crate) struct Heterogeneity {
    /// CV_B of the leading amplitude.
    pub(crate) variation: f64,
    /// tau of each coordinate; 0 without high heterogeneity.
    pub(crate) tau: Vec<f64>,
}

/// CV_B of each effect of a model.
fn amplitude_variation(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &FittedModel,
) -> Option<Vec<f64>> {
    Some(heterogeneity(engine, linearisation, model)?.into_iter().map(|effect| effect.variation).collect())
}

/// Of each effect of a model; `linearisation` holds sensitivities to the parameters at this model or near it. `None` where no
/// derivative exists.
pub(super) fn heterogeneity(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &FittedModel,
) -> Option<Vec<Heterogeneity>> {
    let windows = WindowwiseFits::new(engine, linearisation, model)?;
    let mut column = linearisation.columns.len();
    (0..model.effects.len())
        .map(|at| {
            let effect = &model.effects[at];
            let columns = column..column + effect.coordinates.len();
            column = columns.end;
            let scale = windows.with_response(engine, model, at, columns.start + leading_key(effect))?;
            let variation = tau(&informative(&scale));
            let tau = columns.map(|column| Some(significant_tau(&windows.changes(column)?)));
            Some(Heterogeneity { variation, tau: tau.collect::<Option<_>>()? })
        })
        .collect()
}

/// tau of each parameter that a model moves from the rig file's value, 0 without high heterogeneity. `None` where no derivative
/// exists.
pub(super) fn parameter_tau(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &FittedModel,
) -> Option<[f64; COUNT]> {
    let mut tau = [0.0; COUNT];
    let moved: Vec<usize> = (0..COUNT).filter(|at| model.factors[*at] != 1.0).collect();
    if moved.is_empty() {
        return Some(tau);
    }
    let windows = WindowwiseFits::new(engine, linearisation, model)?;
    for at in moved {
        tau[at] = significant_tau(&windows.changes(at)?);
    }
    Some(tau)
}

/// Linearised fit of each window by itself: parameters of the model first, then the coordinates of its effects.
struct WindowwiseFits {
    simulated: Vec<f64>,
    residual: Vec<f64>,
    columns: Vec<Vec<f64>>,
    products: Products,
    weights: Vec<f64>,
    precisions: Vec<f64>,
}

impl WindowwiseFits {
    fn new(engine: &Engine<'_>, linearisation: &Linearisation, model: &FittedModel) -> Option<Self> {
        let simulated = engine.simulate(&rig_of(&engine.rig, &model.effects, &model.factors)?);
        let residual = engine.residual(&simulated);
        let mut columns = linearisation.columns.clone();
        columns.extend(coordinate_columns(engine, &model.factors, &model.effects, &simulated)?);
        let products = engine.products(&residual, &columns);
        let weights = products.weights(&engine.squares(&residual));
        let precisions = prior_precisions(&model.effects);
        Some(WindowwiseFits { simulated, residual, columns, products, weights, precisions })
    }

    /// Changes, as shares of it, that the windows ask for of the whole response to an effect, which stands in for one of its
    /// columns: a derivative is small where the effect saturates, and the share is not.
    fn with_response(
        &self,
        engine: &Engine<'_>,
        model: &FittedModel,
        effect: usize,
        column: usize,
    ) -> Option<Vec<(f64, f64)>> {
        let mut without = model.effects.clone();
        without.remove(effect);
        let other = engine.simulate(&rig_of(&engine.rig, &without, &model.factors)?);
        let mut columns: Vec<&[f64]> = self.columns.iter().map(Vec::as_slice).collect();
        let response = engine.difference(&self.simulated, &other);
        columns[column] = &response;
        engine.products(&self.residual, &columns).window_changes(column, &self.weights, &self.precisions)
    }

    /// Of one column, with each window's information.
    fn changes(&self, column: usize) -> Option<Vec<(f64, f64)>> {
        self.products.window_changes(column, &self.weights, &self.precisions)
    }
}

/// tau where I^2 is above [`HIGH_I2`], else 0. Neither uninformative windows count, nor the few that disagree most: there the
/// break-away came at another moment.
fn significant_tau(changes: &[(f64, f64)]) -> f64 {
    let mut informative = informative(changes);
    let mean = mean_of(&informative);
    let part = |(change, information): &(f64, f64)| information * (change - mean).powi(2);
    informative.sort_by(|left, right| part(left).total_cmp(&part(right)));
    informative.truncate(informative.len() - (MAX_OUTLIER_SHARE * informative.len() as f64) as usize);
    let dof = informative.len() as f64 - 1.0;
    if dof >= 1.0 && cochran_q(&informative) * (1.0 - HIGH_I2) > dof { tau(&informative) } else { 0.0 }
}

/// The windows that say something: the others would count as windows that agree.
fn informative(changes: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let most = changes.iter().map(|(_, information)| *information).fold(0.0, f64::max);
    changes.iter().copied().filter(|(_, information)| *information > MIN_INFORMATION_SHARE * most).collect()
}

/// Cochran's Q of the changes that windows ask for, each with its information.
fn cochran_q(changes: &[(f64, f64)]) -> f64 {
    let mean = mean_of(changes);
    changes.iter().map(|(change, information)| information * (change - mean).powi(2)).sum()
}

/// Mean of the changes that windows ask for, weighted by information.
fn mean_of(changes: &[(f64, f64)]) -> f64 {
    let total: f64 = changes.iter().map(|(_, information)| information).sum();
    changes.iter().map(|(change, information)| change * information).sum::<f64>() / total
}

/// tau, the standard deviation between windows of the changes that they ask for, each with its information: method of moments.
fn tau(changes: &[(f64, f64)]) -> f64 {
    let total: f64 = changes.iter().map(|(_, information)| information).sum();
    let squares: f64 = changes.iter().map(|(_, information)| information * information).sum();
    let denominator = total - squares / total;
    if denominator <= 0.0 {
        return 0.0;
    }
    let variance = (cochran_q(changes) - (changes.len() as f64 - 1.0)) / denominator;
    variance.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_agree_within_their_errors_have_no_variation() {
        let changes: Vec<(f64, f64)> =
            (0..20).map(|window| (if window % 2 == 0 { 0.1 } else { -0.1 }, 100.0)).collect();
        // Q = 20 of 19 expected.
        let small = tau(&changes);
        assert!(small < 0.03, "{small}");
        assert_eq!(significant_tau(&changes), 0.0);
    }

    #[test]
    fn windows_that_ask_for_different_amplitudes_have_the_variation_of_those() {
        let changes: Vec<(f64, f64)> =
            (0..20).map(|window| (if window % 2 == 0 { 0.5 } else { -0.5 }, 100.0)).collect();
        let tau = significant_tau(&changes);
        assert!((tau - 0.5).abs() < 0.03, "{tau}");
    }

    #[test]
    fn moderate_heterogeneity_and_uninformative_windows_widen_no_standard_error() {
        // Q is `times` what is expected by chance.
        let changes = |times: f64| -> Vec<(f64, f64)> {
            let sign = |window| if window % 2 == 0 { 1.0 } else { -1.0 };
            let informative = (0..20).map(|window| (sign(window) * (0.95 * times).sqrt() * 0.1, 100.0));
            informative.chain((0..200).map(|window| (sign(window), 1e-12))).collect()
        };
        assert_eq!(significant_tau(&changes(3.9)), 0.0);
        let mut one_disagrees = changes(1.0);
        one_disagrees[0].0 = 10.0;
        assert_eq!(significant_tau(&one_disagrees), 0.0);
        let tau = significant_tau(&changes(4.1));
        assert!((tau - 0.1 * (4.1_f64 - 1.0).sqrt()).abs() < 1e-9, "{tau}");
    }
}
