//! Calibration: baseline parameters without effects, with standard errors.
//!
//! Gauss-Newton over all factors, relinearised at each iterate. A parameter whose error is not clearly below its prior standard
//! deviation is not determined by the records.
//!
//! [`finer`] fits the numbers behind them, which the command `calibrate` reports as well.
//!
//! Source: Neugebauer 2011, section 3.2 (identification of the model's parameters); effects.md, Parameters that may
//! merely be wrong.

pub mod finer;

use crate::engine::Engine;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{FittedModel, Linearisation, refit, relinearise};
use crate::report::Quantity;
use model_fit::estimator::CALIBRATION;

/// Share of the prior standard deviation above which an error means that the records do not determine the parameter.
const UNRESOLVED: f64 = 0.7;

/// Fits the parameters without effects.
pub fn calibrate(engine: &Engine<'_>, baseline: &Linearisation) -> FittedModel {
    let first = refit(engine, baseline, &[]).expect("the baseline is a rig");
    relinearise(engine, first, CALIBRATION)
}

/// A parameter of a fit, in the unit of the rig file; of tables their common factor.
pub fn quantity(engine: &Engine<'_>, at: usize, fit: &FittedModel) -> Quantity {
    let (parameter, measured) = (PARAMETERS[at], engine.windows[0].record.measured);
    let (before, unit) = parameter.value(&engine.rig, measured);
    // The simulated value: numbers are clamped to their ranges, and the break-away force to the sliding force.
    let value = if unit.is_empty() {
        before * fit.factors[at]
    } else {
        parameter.value(&with_factors(&engine.rig, &fit.factors), measured).0
    };
    let error = fit.errors[fit.errors.len() - COUNT + at];
    Quantity {
        name: parameter.name.to_owned(),
        value,
        unit: unit.to_owned(),
        standard_error: (error < UNRESOLVED * parameter.prior_std).then_some(before * error),
        before: Some(before),
    }
}
