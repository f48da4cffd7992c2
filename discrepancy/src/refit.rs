//! Fits effects in the simulator: their coordinates by Gauss-Newton, the baseline parameters linearly.
//!
//! ```text
//!   e(z) = readings - simulation with the effects at z       columns: N (parameters), d simulation / d z_i
//!   fit of the columns to e(z) -> step of z, shorter until the loss falls; ridges hold how far all of it is from the file
//! ```
//!
//! Derivatives are finite differences over a twentieth of the coordinate and at least 0.02, since exact derivatives through stick
//! and slip are useless. Source: discrepancy-notes.md, pipeline 6.

use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::fit::{Fit, Products};
use crate::name::EFFECT_PARAMETER_PENALTY;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use model_fit::estimator::{CANDIDATE, Convergence, Estimator, Iterate, Options, Outcome, Step};
use plant::RigParameters;

/// Smallest step of finite differences, and its share of the coordinate.
const CHANGE: f64 = 0.02;
const CHANGE_SHARE: f64 = 0.05;
/// Prior standard deviations of coordinates: amplitudes, shapes.
const AMPLITUDE_PRIOR_STD: f64 = 3.0;
const SHAPE_PRIOR_STD: f64 = 0.7;
/// Bound of the relative deviation of a parameter.
pub(crate) const MOST_OFF: f64 = 0.3;
/// Penalty for each parameter off its file value. A sensor that reads four per cent low is a better explanation than all masses,
/// frictions and areas off by as much.
const PARAMETER_COSTS: f64 = EFFECT_PARAMETER_PENALTY;
/// Relative deviation at which half of the penalty is due.
const COUNTS_AS_OFF: f64 = 0.005;

/// A candidate with fitted numbers, or those from which a fit starts.
#[derive(Clone, Debug)]
pub struct EffectEstimate {
    /// The effect or suspect, and its place.
    pub candidate: Candidate,
    /// One for each key of its sheet.
    pub coordinates: Vec<f64>,
}

/// A fitted model: effects and parameters.
#[derive(Clone, Debug)]
pub struct FittedModel {
    /// In the order in which they joined.
    pub effects: Vec<EffectEstimate>,
    /// Factors of the baseline parameters, in the order of [`PARAMETERS`]; 1 is the rig file's value.
    pub factors: [f64; COUNT],
    /// Of `refit` and `name::gauss_newton::fit_all` the penalised loss J: loss L of the windows, priors, and a penalty for each
    /// number of an effect and each parameter that is off. Of `fit_selected` and `fit_for_comparison` there, which return the
    /// reported model, L and priors alone. Beside tables L, priors and the penalty for points (`tabulate`).
    pub loss: f64,
    /// Squared residuals of each window.
    pub(crate) squares: Vec<f64>,
    /// Standard errors of all coordinates, in the order of the effects and their keys, then of the factors; clustered by windows.
    pub errors: Vec<f64>,
    /// Design effect: cluster-robust over model-based variance of the last effect's amplitude; at least 1. Fits of a round differ
    /// in their last effect.
    pub(crate) design_effect: f64,
    /// How the fit ended.
    pub(crate) convergence: Convergence,
}

impl FittedModel {
    /// The same with the standard errors of its parameters widened by tau, their standard deviation between the windows.
    pub(crate) fn widened(&self, tau: &[f64; COUNT]) -> Self {
        let mut wider = self.clone();
        let from = wider.errors.len() - COUNT;
        wider.errors[from..].iter_mut().zip(tau).for_each(|(error, tau)| *error = error.hypot(*tau));
        wider
    }
}

impl Iterate for FittedModel {
    fn loss(&self) -> f64 {
        self.loss
    }

    fn is_at_bound(&self) -> bool {
        is_at_bound(&self.effects) || has_factor_at_bound(&self.factors)
    }
}

/// Whether a factor is at the end of its range.
pub(crate) fn has_factor_at_bound(factors: &[f64; COUNT]) -> bool {
    factors.iter().any(|factor| (factor - 1.0).abs() >= MOST_OFF)
}

/// Whether a coordinate is at the end of its range.
pub(crate) fn is_at_bound(effects: &[EffectEstimate]) -> bool {
    effects.iter().any(|effect| {
        let coordinates = effect.coordinates.iter().enumerate();
        coordinates.into_iter().any(|(key, at)| effect.candidate.fit_bounds(key).contains(at))
    })
}

/// Parameter sensitivities and the point of linearisation.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// Sensitivities to the parameters.
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) factors: [f64; COUNT],
}

impl Linearisation {
    /// At the rig file's values.
    pub fn at_baseline(engine: &Engine<'_>) -> Self {
        let factors = [1.0; COUNT];
        Linearisation { columns: engine.parameter_columns(&engine.rig, &factors), factors }
    }

    /// Deviations of the parameters from the prior means.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        self.factors.iter().map(|factor| factor - 1.0).collect()
    }
}

/// The rig with effects and factors; `None` where the numbers are inconsistent.
pub(crate) fn rig_of(
    rig: &RigParameters,
    effects: &[EffectEstimate],
    factors: &[f64; COUNT],
) -> Option<RigParameters> {
    effects.iter().try_fold(with_factors(rig, factors), |rig, effect| {
        effect.candidate.rig(&rig, &effect.coordinates).ok()
    })
}

pub(crate) fn parameter_precisions() -> Vec<f64> {
    PARAMETERS.iter().map(|parameter| parameter.prior_std.powi(-2)).collect()
}

/// Number of parameters off their file values, small deviations counted in part.
fn soft_count_off(factors: &[f64; COUNT]) -> f64 {
    factors
        .iter()
        .map(|factor| (factor - 1.0).powi(2))
        .map(|square| square / (square + COUNTS_AS_OFF.powi(2)))
        .sum()
}

pub(crate) fn model_penalty(effect_parameters: usize, factors: &[f64; COUNT]) -> f64 {
    EFFECT_PARAMETER_PENALTY * effect_parameters as f64 + PARAMETER_COSTS * soft_count_off(factors)
}

pub(crate) fn coordinate_precision(candidate: &Candidate, key: usize) -> f64 {
    let prior_std = if candidate.is_shape(key) { SHAPE_PRIOR_STD } else { AMPLITUDE_PRIOR_STD };
    prior_std.powi(-2)
}

/// Prior precisions of the parameters, then of all coordinates of the effects.
pub(crate) fn prior_precisions(effects: &[EffectEstimate]) -> Vec<f64> {
    let of_effect = |effect: &EffectEstimate| {
        (0..effect.coordinates.len())
            .map(|key| coordinate_precision(&effect.candidate, key))
            .collect::<Vec<_>>()
    };
    parameter_precisions().into_iter().chain(effects.iter().flat_map(of_effect)).collect()
}

/// Deviations from the prior means in the same order.
pub(crate) fn prior_deviations(factors: &[f64; COUNT], effects: &[EffectEstimate]) -> Vec<f64> {
    let coordinates = effects.iter().flat_map(|effect| effect.coordinates.iter().copied());
    factors.iter().map(|factor| factor - 1.0).chain(coordinates).collect()
}

/// All coordinates of the effects: place in `effects`, and key.
pub(crate) fn coordinates(effects: &[EffectEstimate]) -> Vec<(usize, usize)> {
    effects
        .iter()
        .enumerate()
        .flat_map(|(at, effect)| (0..effect.coordinates.len()).map(move |key| (at, key)))
        .collect()
}

/// Loss of effects at fixed coordinates with the parameters fitted; infinite where no rig can have them.
pub(crate) fn loss_at(engine: &Engine<'_>, linearisation: &Linearisation, effects: &[EffectEstimate]) -> f64 {
    let Some(rig) = rig_of(&engine.rig, effects, &linearisation.factors) else { return f64::INFINITY };
    let products = engine.products(&engine.residual(&engine.simulate_coarsely(&rig)), &linearisation.columns);
    let parameters: Vec<usize> = (0..COUNT).collect();
    let off = linearisation.deviations();
    products.fit_within(&parameters, &parameter_precisions(), &off, &[MOST_OFF; COUNT]).loss
}

/// Effects at some coordinates, simulated, with the parameters fitted linearly.
struct ProjectedFit {
    effects: Vec<EffectEstimate>,
    simulated: Vec<f64>,
    residual: Vec<f64>,
    fit: Fit,
    /// Prior loss of the coordinates.
    prior: f64,
}

impl Iterate for ProjectedFit {
    fn loss(&self) -> f64 {
        self.fit.loss + self.prior
    }

    fn is_at_bound(&self) -> bool {
        is_at_bound(&self.effects)
    }
}

/// Fits effects from a starting point.
///
/// `None` where no rig can have it.
pub(crate) fn refit(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    start: &[EffectEstimate],
) -> Option<FittedModel> {
    refit_steps(engine, linearisation, start, CANDIDATE.steps)
}

/// The same with another maximum of steps; 0 evaluates the starting point.
pub(crate) fn refit_steps(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    start: &[EffectEstimate],
    steps: usize,
) -> Option<FittedModel> {
    let parameters: Vec<usize> = (0..COUNT).collect();
    let (precisions, off) = (parameter_precisions(), linearisation.deviations());
    let all_precisions = prior_precisions(start);
    let chosen: Vec<usize> = (0..all_precisions.len()).collect();
    let coordinates = coordinates(start);
    let most = [vec![MOST_OFF; COUNT], vec![f64::INFINITY; coordinates.len()]].concat();
    let mut parameter_products: Option<Products> = None;
    let prior = |effects: &[EffectEstimate]| -> f64 {
        coordinates
            .iter()
            .map(|(at, key)| {
                coordinate_precision(&effects[*at].candidate, *key) * effects[*at].coordinates[*key].powi(2)
            })
            .sum()
    };
    let mut evaluate = |effects: Vec<EffectEstimate>| -> Option<ProjectedFit> {
        let simulated = engine.simulate(&rig_of(&engine.rig, &effects, &linearisation.factors)?);
        let residual = engine.residual(&simulated);
        let products = match &mut parameter_products {
            Some(products) => {
                products.set_residual(&residual, &linearisation.columns, engine.rows);
                products
            }
            none => none.insert(engine.products(&residual, &linearisation.columns)),
        };
        let fit = products.fit_within(&parameters, &precisions, &off, &[MOST_OFF; COUNT]);
        let prior = prior(&effects);
        Some(ProjectedFit { effects, simulated, residual, fit, prior })
    };
    let products_at = |iterate: &ProjectedFit| -> Option<Products> {
        let columns =
            coordinate_columns(engine, &linearisation.factors, &iterate.effects, &iterate.simulated)?;
        let all: Vec<&Vec<f64>> = linearisation.columns.iter().chain(&columns).collect();
        Some(engine.products(&iterate.residual, &all))
    };
    let first = evaluate(start.to_vec())?;
    // The last linearisation.
    let mut last = None;
    let options = Options { steps, ..CANDIDATE };
    let (iterate, convergence) = Estimator::new(options).descend(first, |estimator, iterate| {
        last = products_at(iterate);
        let Some(products) = &last else { return Step::Impossible };
        let from = prior_deviations(&linearisation.factors, &iterate.effects);
        let joint = products.fit_within(&chosen, &all_precisions, &from, &most);
        let predicted_reduction = iterate.loss() - joint.loss;
        if predicted_reduction < estimator.tolerance(iterate.loss()) {
            return Step::Refused { predicted_reduction };
        }
        estimator.backtrack(iterate, predicted_reduction, options.fractions, |share| {
            let mut effects = iterate.effects.clone();
            for ((at, key), change) in coordinates.iter().zip(&joint.coefficients[COUNT..]) {
                let [least, most] = effects[*at].candidate.fit_bounds(*key);
                let coordinate = &mut effects[*at].coordinates[*key];
                *coordinate = (*coordinate + share * change).clamp(least, most);
            }
            evaluate(effects)
        })
    });
    if convergence.outcome == Outcome::StepLimit {
        // For the errors.
        last = products_at(&iterate);
    }
    let products = last?;
    // At the final iterate: parameters as fitted, coordinates unchanged.
    let mut at_point = iterate.fit.clone();
    at_point.coefficients.extend(std::iter::repeat_n(0.0, coordinates.len()));
    let covariance = products.covariance(&chosen, &at_point, &all_precisions);
    let (plain, _) = products.normal(&chosen, &at_point.weights, &all_precisions);
    let plain = plain.try_inverse();
    let error =
        |at: usize| covariance.as_ref().map_or(f64::INFINITY, |matrix| matrix[(at, at)].max(0.0).sqrt());
    let newest = coordinates.iter().position(|(at, _)| at + 1 == start.len()).map_or(COUNT, |at| COUNT + at);
    let design_effect = match (&covariance, &plain) {
        (Some(clustered), Some(plain)) if !coordinates.is_empty() => {
            (clustered[(newest, newest)] / plain[(newest, newest)]).max(1.0)
        }
        _ => 1.0,
    };
    let errors = (COUNT..chosen.len()).chain(0..COUNT).map(error).collect();
    let mut factors = linearisation.factors;
    for (factor, change) in factors.iter_mut().zip(&iterate.fit.coefficients) {
        // Rounding alone may exceed the bound.
        *factor = (*factor + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
    }
    let loss = iterate.loss() + model_penalty(coordinates.len(), &factors);
    let ProjectedFit { effects, fit, .. } = iterate;
    Some(FittedModel { effects, factors, loss, squares: fit.squares, errors, design_effect, convergence })
}

/// Parameter sensitivities linearised at a model.
pub(crate) fn linearise(engine: &Engine<'_>, model: &FittedModel) -> Linearisation {
    linearise_at(engine, &model.effects, model.factors)
}

/// The same at effects and factors.
pub(crate) fn linearise_at(
    engine: &Engine<'_>,
    effects: &[EffectEstimate],
    factors: [f64; COUNT],
) -> Linearisation {
    let rig = rig_of(&engine.rig, effects, &[1.0; COUNT]).unwrap_or_else(|| engine.rig.clone());
    Linearisation { columns: engine.parameter_columns(&rig, &factors), factors }
}

/// Refits a model with the parameters linearised anew at its own values; `None` where the loss does not fall, an error where no
/// rig can have it.
fn linearised_anew(engine: &Engine<'_>, model: &FittedModel) -> Result<Option<FittedModel>, ()> {
    let next = refit(engine, &linearise(engine, model), &model.effects).ok_or(())?;
    let convergence = model.convergence.then(next.convergence);
    Ok((next.loss < model.loss).then_some(FittedModel { convergence, ..next }))
}

/// The same once; the model itself where the loss does not fall.
pub(crate) fn relinearise_once(engine: &Engine<'_>, model: FittedModel) -> FittedModel {
    linearised_anew(engine, &model).ok().flatten().unwrap_or(model)
}

/// The same until the loss converges.
pub(crate) fn relinearise(engine: &Engine<'_>, model: FittedModel, options: Options) -> FittedModel {
    let (fit, outer) =
        Estimator::new(options).descend(model, |_, best| match linearised_anew(engine, best) {
            Err(()) => Step::Impossible,
            Ok(Some(next)) => Step::Accepted(next),
            Ok(None) => Step::Refused { predicted_reduction: 0.0 },
        });
    if outer.outcome == Outcome::StepLimit {
        return FittedModel { convergence: Convergence { outcome: outer.outcome, ..fit.convergence }, ..fit };
    }
    fit
}

/// Sensitivities to each coordinate of a model, in the order of effects and keys; `simulated` are its readings. `None` where a
/// neighbouring rig does not exist.
pub(crate) fn coordinate_columns(
    engine: &Engine<'_>,
    factors: &[f64; COUNT],
    effects: &[EffectEstimate],
    simulated: &[f64],
) -> Option<Vec<Vec<f64>>> {
    coordinates(effects)
        .iter()
        .map(|(at, key)| derivative(engine, factors, effects, simulated, *at, *key))
        .collect()
}

/// Step of the finite difference of a coordinate, to the side that stays inside the range.
pub(crate) fn difference_step(effect: &EffectEstimate, key: usize) -> f64 {
    let coordinate = effect.coordinates[key];
    let size = CHANGE.max(CHANGE_SHARE * coordinate.abs());
    let [_, most] = effect.candidate.fit_bounds(key);
    if coordinate + size > most { -size } else { size }
}

/// Sensitivity to a coordinate, by a one-sided difference that stays inside the range.
pub(crate) fn derivative(
    engine: &Engine<'_>,
    factors: &[f64; COUNT],
    effects: &[EffectEstimate],
    simulated: &[f64],
    at: usize,
    key: usize,
) -> Option<Vec<f64>> {
    let change = difference_step(&effects[at], key);
    let mut effects = effects.to_vec();
    effects[at].coordinates[key] += change;
    let readings = engine.simulate(&rig_of(&engine.rig, &effects, factors)?);
    Some(engine.slope(&readings, simulated, change))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clamped_factor_is_at_its_bound_and_spread_widens_the_errors_of_factors_alone() {
        let fit = |factor: f64| {
            let mut factors = [1.0; COUNT];
            factors[2] = factor;
            FittedModel {
                effects: Vec::new(),
                factors,
                loss: 0.0,
                squares: Vec::new(),
                errors: vec![3.0; COUNT + 1],
                design_effect: 1.0,
                convergence: Convergence::default(),
            }
        };
        let at_bound = [1.0 - MOST_OFF, 1.0 + MOST_OFF, 1.29].map(|factor| fit(factor).is_at_bound());
        assert_eq!(at_bound, [true, true, false]);
        let mut tau = [0.0; COUNT];
        tau[0] = 4.0;
        let wider = fit(1.0).widened(&tau);
        assert_eq!(wider.errors[..3], [3.0, 5.0, 3.0]);
    }
}
