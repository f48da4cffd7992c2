//! Backward elimination of parameters: those that the model does not need return to the rig file's values, and it is refitted.
//!
//! ```text
//!   loss with all ──► drop the parameter with the smallest rise of the loss, while it is below the threshold ──► refit
//! ```
//!
//! Free parameters absorb noise, and of two correlated ones both move where one is off. The report, the extended rig file and the
//! held-out test use the one refitted model.

use super::gauss_newton::{fit_for_comparison, fit_selected};
use crate::engine::Engine;
use crate::parameters::{COUNT, PARAMETERS};
use crate::refit::{FittedModel, coordinate_columns, linearise, prior_precisions, rig_of};

/// Rise of the loss at which a parameter is kept: three and a half standard errors.
const NEEDED: f64 = 12.0;

/// Significance of a parameter that is off, in standard errors.
const OFF_ERRORS: f64 = 4.0;
/// Smallest relative deviation of such a parameter.
const OFF_LEAST: f64 = 0.01;

/// Multiple of the shift by the error of integration that such a parameter exceeds beside its standard errors.
const OFF_SHIFTS: f64 = 3.0;

/// Which parameters of a model are significantly off the rig file's values: beyond their standard errors, and beyond what the
/// error of integration shifts them by.
pub(crate) fn significantly_off(engine: &Engine<'_>, model: &FittedModel) -> [bool; COUNT] {
    let errors = &model.errors[model.errors.len() - COUNT..];
    let by = model.factors.map(|factor| (factor - 1.0).abs());
    let beyond_errors: [bool; COUNT] = std::array::from_fn(|at| is_significant(by[at], errors[at]));
    if !beyond_errors.contains(&true) {
        return beyond_errors;
    }
    let shifts = integration_shifts(engine, model).unwrap_or([0.0; COUNT]);
    std::array::from_fn(|at| beyond_errors[at] && by[at] > OFF_ERRORS * errors[at] + OFF_SHIFTS * shifts[at])
}

/// Whether a relative deviation with this standard error makes a parameter off.
fn is_significant(by: f64, error: f64) -> bool {
    by > OFF_LEAST && by > OFF_ERRORS * error
}

/// Size of the change of each parameter when the model is fitted to itself simulated with half the step. `None` where it cannot
/// be linearised.
fn integration_shifts(engine: &Engine<'_>, model: &FittedModel) -> Option<[f64; COUNT]> {
    let rig = rig_of(&engine.rig, &model.effects, &model.factors)?;
    let simulated = engine.simulate(&rig);
    let mut columns = linearise(engine, model).columns;
    columns.extend(coordinate_columns(engine, &model.factors, &model.effects, &simulated)?);
    let difference = engine.difference(&engine.simulate_finely(&rig), &simulated);
    let products = engine.products(&difference, &columns);
    let all: Vec<usize> = (0..columns.len()).collect();
    let precisions = prior_precisions(&model.effects);
    let weights = products.weights(&engine.squares(&engine.residual(&simulated)));
    let shifts = products.weighted_solution(&all, &weights, &precisions, &vec![0.0; all.len()])?;
    Some(std::array::from_fn(|at| shifts[at].abs()))
}

/// The model refitted with the needed parameters only; with all of them where the loss of the refit rises by [`NEEDED`] or more
/// for each parameter that is held.
pub(super) fn with_needed(engine: &Engine<'_>, model: &FittedModel) -> FittedModel {
    let Some(all) = fit_for_comparison(engine, model) else { return model.clone() };
    let Some(needed) = needed(engine, &all) else { return all };
    let held = needed.iter().filter(|needed| !**needed).count();
    match fit_selected(engine, &all, &needed) {
        Some(fewer) if fewer.loss < all.loss + NEEDED * held as f64 => fewer,
        _ => all,
    }
}

/// Needed parameters by the linearised model; `None` where all are needed, or where no derivative exists.
fn needed(engine: &Engine<'_>, model: &FittedModel) -> Option<[bool; COUNT]> {
    let linearisation = linearise(engine, model);
    let simulated = engine.simulate(&rig_of(&engine.rig, &model.effects, &model.factors)?);
    let coordinates = coordinate_columns(engine, &model.factors, &model.effects, &simulated)?;
    let mut residual = engine.residual(&simulated);
    // Shifts the residual to the rig file's values, so that the coefficients are deviations from them.
    for (column, factor) in linearisation.columns.iter().zip(model.factors) {
        residual.iter_mut().zip(column).for_each(|(value, column)| *value += (factor - 1.0) * column);
    }
    let columns: Vec<&Vec<f64>> = linearisation.columns.iter().chain(&coordinates).collect();
    let products = engine.products(&residual, &columns);
    let precisions = prior_precisions(&model.effects);
    let loss = |needed: &[bool; COUNT]| {
        let chosen: Vec<usize> = (0..columns.len()).filter(|at| *at >= COUNT || needed[*at]).collect();
        let precisions: Vec<f64> = chosen.iter().map(|at| precisions[*at]).collect();
        products.fit(&chosen, &precisions).loss
    };
    let mut needed = [true; COUNT];
    let mut current = loss(&needed);
    loop {
        let least = (0..PARAMETERS.len())
            .filter(|at| needed[*at])
            .map(|at| {
                let mut without = needed;
                without[at] = false;
                (loss(&without), without)
            })
            .min_by(|left, right| left.0.total_cmp(&right.0));
        match least {
            Some((without, fewer)) if without - current < NEEDED => (current, needed) = (without, fewer),
            _ => break,
        }
    }
    needed.contains(&false).then_some(needed)
}
