//! The baseline's own parameters from records: what fits best when nothing is missing, with errors, and what the records
//! cannot tell.
//!
//! Gauss-Newton over all factors at once, sensitivities taken anew at each point. A record cannot tell a parameter whose
//! error is not clearly below its tolerance, nor two whose errors hang together.
//!
//! [`finer`] goes on from there to the numbers behind them, which the command `calibrate` tells as well.
//!
//! Source: Neugebauer 2011, section 3.2 (identification of the model's parameters); effects.md, Parameters that may
//! merely be wrong.

pub mod finer;

use crate::engine::Engine;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{Around, Refit, refit};
use crate::report::Quantity;
use plant::RigParameters;

/// Points at most.
const POINTS: usize = 8;
/// Fall of the loss below which it has settled.
const CONVERGED: f64 = 1.0;
/// Share of the tolerance above which an error says that the record does not tell.
const UNRESOLVED: f64 = 0.7;

/// The parameters that fit best, effects left out.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The fit.
    pub fit: Refit,
}

/// Fits all parameters.
#[must_use]
pub fn calibrate(engine: &Engine<'_>, baseline: &Around) -> Calibrated {
    let mut best = refit(engine, baseline, &[], 0.0).expect("the baseline is a rig");
    for _ in 1..POINTS {
        let columns = engine.parameter_columns(engine.rig(), &best.factors);
        let next = Around { columns, factors: best.factors };
        let Some(fit) = refit(engine, &next, &[], 0.0) else { break };
        let converged = fit.loss > best.loss - CONVERGED;
        if fit.loss < best.loss {
            best = fit;
        }
        if converged {
            break;
        }
    }
    Calibrated { fit: best }
}

impl Calibrated {
    /// The rig with the parameters that fit best.
    #[must_use]
    pub fn rig(&self, rig: &RigParameters) -> RigParameters {
        with_factors(rig, &self.fit.factors)
    }
}

/// A parameter of a fit, in the unit of the rig file; of tables their common factor.
#[must_use]
pub fn quantity(engine: &Engine<'_>, at: usize, fit: &Refit) -> Quantity {
    let (parameter, measured) = (PARAMETERS[at], engine.windows()[0].record().measured);
    let (before, unit) = parameter.value(engine.rig(), measured);
    // What was simulated: a number is held at the end of its range, and rest at what slides.
    let value = if unit.is_empty() {
        before * fit.factors[at]
    } else {
        parameter.value(&with_factors(engine.rig(), &fit.factors), measured).0
    };
    let error = fit.errors[fit.errors.len() - COUNT + at];
    Quantity {
        name: parameter.name.to_owned(),
        value,
        unit: unit.to_owned(),
        standard_error: (error < UNRESOLVED * parameter.tolerance).then_some(before * error),
        before: Some(before),
    }
}
