//! Gauss-Newton on all numbers of a model in the simulator, with backtracking, and their standard errors.
//!
//! ```text
//!   effects and needed parameters ──► Gauss-Newton step ──► accepted only when the simulated loss falls
//! ```
//!
//! Of two steps, one from all windows and one without outlying windows, the better is taken. Where a full step raises the loss,
//! windows whose squares exceed the linearised prediction by [`NONLINEAR_EXCESS`] are excluded from it and it is computed again;
//! it is shortened where no further window is excluded. The loss of a step is that of all windows.
//!
//! Forward selection moves the parameters on the linearised model, which suffices to compare models. The final numbers come from
//! the simulator.

use super::null_distribution::above_outlier_limit;
use crate::engine::Engine;
use crate::fit::{Fit, Products, loss};
use crate::parameters::COUNT;
use crate::refit::{
    EffectEstimate, FittedModel, MOST_OFF, coordinate_columns, has_factor_at_bound, is_at_bound,
    model_penalty, prior_deviations, prior_precisions, rig_of,
};
use model_fit::estimator::{Estimator, Iterate, JOINT, JOINT_COMPARED, Options, Step};
use model_fit::parallel;
use std::borrow::Cow;

/// Maximum number of exclusions of windows from a step, and the excess over the predicted squares that excludes one, in standard
/// deviations.
const EXCLUSIONS: usize = 4;
const NONLINEAR_EXCESS: f64 = 6.0;

/// Grid of fractions by which the deviations of the parameters are scaled.
const SHRINK_FACTORS: [f64; 4] = [1.0, 0.6, 0.3, 0.0];

/// Factors with all deviations from the rig file scaled by the fraction with the smallest simulated loss. While an effect is
/// missing, the linearised step may lead far off.
pub(super) fn shrink_parameters(engine: &Engine<'_>, model: &FittedModel) -> [f64; COUNT] {
    let tried = SHRINK_FACTORS.map(|shrink| model.factors.map(|factor| 1.0 + shrink * (factor - 1.0)));
    let loss = |factors: &[f64; COUNT]| {
        iterate(engine, model.effects.clone(), *factors).map_or(f64::INFINITY, |iterate| iterate.loss)
    };
    let losses = parallel::map(&tried, loss);
    let best = (0..SHRINK_FACTORS.len()).min_by(|one, other| losses[*one].total_cmp(&losses[*other]));
    tried[best.expect("one at least")]
}

/// Fits all parameters and coordinates of a model in the simulator, and adds the penalties; returns the model itself where the
/// penalised loss does not fall.
pub(super) fn fit_all(engine: &Engine<'_>, model: &FittedModel) -> FittedModel {
    let Some(mut fit) = fit_for_comparison(engine, model) else { return model.clone() };
    fit.loss += model_penalty(coordinates(&fit.effects), &fit.factors);
    if fit.loss < model.loss { fit } else { model.clone() }
}

struct SimulatedModel {
    effects: Vec<EffectEstimate>,
    factors: [f64; COUNT],
    simulated: Vec<f64>,
    residual: Vec<f64>,
    /// Squared residuals of each window.
    squares: Vec<f64>,
    /// Loss of the windows with priors, without penalties.
    loss: f64,
}

impl Iterate for SimulatedModel {
    fn loss(&self) -> f64 {
        self.loss
    }

    fn is_at_bound(&self) -> bool {
        is_at_bound(&self.effects) || has_factor_at_bound(&self.factors)
    }
}

/// Fits a model in the simulator with the parameters that are not `needed` at the rig file's values; `None` where no rig can have
/// it. Its loss has the priors and no penalties.
pub(super) fn fit_selected(
    engine: &Engine<'_>,
    model: &FittedModel,
    needed: &[bool; COUNT],
) -> Option<FittedModel> {
    fit_within(engine, model, needed, JOINT)
}

/// The same with all parameters, to compare models: of an inexact one the last steps do not count.
pub(super) fn fit_for_comparison(engine: &Engine<'_>, model: &FittedModel) -> Option<FittedModel> {
    fit_within(engine, model, &[true; COUNT], JOINT_COMPARED)
}

fn fit_within(
    engine: &Engine<'_>,
    model: &FittedModel,
    needed: &[bool; COUNT],
    options: Options,
) -> Option<FittedModel> {
    let mut factors = model.factors;
    for (factor, _) in factors.iter_mut().zip(needed).filter(|(_, needed)| !**needed) {
        *factor = 1.0;
    }
    let start = iterate(engine, model.effects.clone(), factors)?;
    let chosen: Vec<usize> =
        (0..COUNT + coordinates(&start.effects)).filter(|at| *at >= COUNT || needed[*at]).collect();
    let (iterate, convergence) = Estimator::new(options).descend(start, |estimator, iterate| {
        linearised(engine, iterate).map_or(Step::Impossible, |linearisation| {
            stepped(engine, estimator, iterate, &linearisation, &chosen)
        })
    });
    let errors = errors(engine, &linearised(engine, &iterate)?, &iterate);
    let SimulatedModel { effects, factors, squares, loss, .. } = iterate;
    Some(FittedModel {
        effects,
        factors,
        loss,
        squares,
        errors,
        design_effect: model.design_effect,
        convergence,
    })
}

fn iterate(
    engine: &Engine<'_>,
    effects: Vec<EffectEstimate>,
    factors: [f64; COUNT],
) -> Option<SimulatedModel> {
    let simulated = engine.simulate(&rig_of(&engine.rig, &effects, &factors)?);
    let residual = engine.residual(&simulated);
    let squares = engine.squares(&residual);
    let (precisions, off) = (prior_precisions(&effects), prior_deviations(&factors, &effects));
    let prior: Vec<f64> = precisions.iter().zip(&off).map(|(precision, off)| precision * off * off).collect();
    let loss = loss(&squares, &engine.scaled_dof)
        + prior[..COUNT].iter().sum::<f64>()
        + prior[COUNT..].iter().sum::<f64>();
    Some(SimulatedModel { effects, factors, simulated, residual, squares, loss })
}

/// Number of coordinates of the effects.
pub(super) fn coordinates(effects: &[EffectEstimate]) -> usize {
    effects.iter().map(|effect| effect.coordinates.len()).sum()
}

struct JointLinearisation {
    /// Sensitivities, parameters first.
    columns: Vec<Vec<f64>>,
    precisions: Vec<f64>,
    /// Deviations from the prior means.
    from: Vec<f64>,
}

impl JointLinearisation {
    /// Normal equations with the sensitivities of some windows set to zero.
    fn products(&self, engine: &Engine<'_>, iterate: &SimulatedModel, excluded: &[usize]) -> Products {
        let mut columns = Cow::from(&self.columns);
        if !excluded.is_empty() {
            for column in columns.to_mut() {
                excluded.iter().for_each(|at| column[at * engine.rows..][..engine.rows].fill(0.0));
            }
        }
        engine.products(&iterate.residual, &columns)
    }
}

fn linearised(engine: &Engine<'_>, iterate: &SimulatedModel) -> Option<JointLinearisation> {
    let rig = rig_of(&engine.rig, &iterate.effects, &[1.0; COUNT])?;
    let mut columns = engine.parameter_columns(&rig, &iterate.factors);
    columns.extend(coordinate_columns(engine, &iterate.factors, &iterate.effects, &iterate.simulated)?);
    let (precisions, from) =
        (prior_precisions(&iterate.effects), prior_deviations(&iterate.factors, &iterate.effects));
    Some(JointLinearisation { columns, precisions, from })
}

/// The better of two Gauss-Newton steps: with all windows, and without outlying windows, whose linearisation is unreliable.
fn stepped(
    engine: &Engine<'_>,
    estimator: &mut Estimator,
    iterate: &SimulatedModel,
    linearisation: &JointLinearisation,
    chosen: &[usize],
) -> Step<SimulatedModel> {
    let outliers: Vec<usize> = above_outlier_limit(&iterate.squares, &engine.scaled_dof).collect();
    let with_all = line_search(engine, estimator, iterate, linearisation, chosen, &[]);
    if outliers.is_empty() {
        return with_all;
    }
    match (with_all, line_search(engine, estimator, iterate, linearisation, chosen, &outliers)) {
        (Step::Accepted(all), Step::Accepted(fewer)) => {
            Step::Accepted(if fewer.loss.total_cmp(&all.loss).is_lt() { fewer } else { all })
        }
        (_, Step::Accepted(fewer)) => Step::Accepted(fewer),
        (with_all, _) => with_all,
    }
}

/// A Gauss-Newton step that lowers the loss, without the windows `excluded`. Windows whose squares exceed the linearised
/// prediction, as around a break-away, are excluded too; then the step is shortened.
fn line_search(
    engine: &Engine<'_>,
    estimator: &mut Estimator,
    iterate: &SimulatedModel,
    linearisation: &JointLinearisation,
    chosen: &[usize],
    excluded: &[usize],
) -> Step<SimulatedModel> {
    let part = |of: &[f64]| chosen.iter().map(|at| of[*at]).collect::<Vec<_>>();
    let (precisions, from) = (part(&linearisation.precisions), part(&linearisation.from));
    let [whole, shorter @ ..] = JOINT.fractions else { unreachable!("a whole step is tried first") };
    let mut excluded = excluded.to_vec();
    let mut predicted_reduction = 0.0;
    for _ in 0..EXCLUSIONS {
        let fit = linearisation.products(engine, iterate, &excluded).fit_from(chosen, &precisions, &from);
        predicted_reduction = iterate.loss - fit.loss;
        estimator.count();
        let Some(tried) = step_by(engine, iterate, chosen, &fit, *whole) else {
            // No rig has the whole step: a shorter one may be possible.
            return estimator.backtrack(iterate, predicted_reduction, shorter, |fraction| {
                step_by(engine, iterate, chosen, &fit, fraction)
            });
        };
        if tried.loss < iterate.loss {
            return Step::Accepted(tried);
        }
        let nonlinear = |window: &usize| {
            tried.squares[*window] - fit.squares[*window]
                > NONLINEAR_EXCESS * engine.scaled_dof[*window].sqrt()
        };
        let before = excluded.len();
        excluded.extend((0..engine.scaled_dof.len()).filter(nonlinear));
        excluded.sort_unstable();
        excluded.dedup();
        if excluded.len() == before {
            return estimator.backtrack(iterate, predicted_reduction, shorter, |fraction| {
                step_by(engine, iterate, chosen, &fit, fraction)
            });
        }
    }
    Step::Refused { predicted_reduction }
}

/// The point after a fraction of a step.
fn step_by(
    engine: &Engine<'_>,
    from: &SimulatedModel,
    chosen: &[usize],
    step: &Fit,
    share: f64,
) -> Option<SimulatedModel> {
    let (mut effects, mut factors) = (from.effects.clone(), from.factors);
    let mut changes = vec![0.0; COUNT + coordinates(&effects)];
    chosen.iter().zip(&step.coefficients).for_each(|(at, coefficient)| changes[*at] = share * coefficient);
    for (factor, change) in factors.iter_mut().zip(&changes) {
        *factor = (*factor + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
    }
    let mut changes = changes[COUNT..].iter();
    for effect in &mut effects {
        for key in 0..effect.coordinates.len() {
            let [least, most] = effect.candidate.fit_bounds(key);
            effect.coordinates[key] =
                (effect.coordinates[key] + changes.next().expect("one each")).clamp(least, most);
        }
    }
    iterate(engine, effects, factors)
}

/// Standard errors with all parameters free, in the order of [`FittedModel::errors`]: the same records selected the needed ones.
fn errors(engine: &Engine<'_>, linearisation: &JointLinearisation, iterate: &SimulatedModel) -> Vec<f64> {
    let products = linearisation.products(engine, iterate, &[]);
    let all: Vec<usize> = (0..products.columns).collect();
    let weights = products.weights(&iterate.squares);
    let stays = Fit {
        coefficients: vec![0.0; all.len()],
        loss: iterate.loss,
        squares: iterate.squares.clone(),
        weights,
    };
    let errors = products
        .jackknife(&all, &stays, &linearisation.precisions)
        .unwrap_or_else(|| vec![f64::INFINITY; all.len()]);
    [&errors[COUNT..], &errors[..COUNT]].concat()
}
