//! Which parameters a model needs beside its effects: the others go back to what the file says, and it is fitted again without
//! them.
//!
//! ```text
//!   loss with all ──► the one that is missed least goes, while its going costs less than it is worth ──► fitted again
//! ```
//!
//! Parameters that a fit left free take up noise, and of two that hang together both move where one is off. A rig that had only
//! the largest of them would be none of a fit: what is told, what the extended file has and what is judged is one model.
//!
//! Standard errors stay those beside all parameters: which of them are needed was told by the same records.

use super::{NUMBER_COSTS, REFININGS, SETTLED, around_of};
use crate::engine::Engine;
use crate::fit::Products;
use crate::parameters::{COUNT, PARAMETERS};
use crate::refit::{Around, Refit, coordinate_columns, coordinate_ridge, parameter_ridges, refit, rig_of};

/// Fall of the loss for which a parameter is moved: three and a half standard errors.
const NEEDED: f64 = 12.0;

/// The model with only the parameters that it needs; itself, where it cannot do without the others.
pub(super) fn with_needed(engine: &Engine<'_>, model: &Refit) -> Refit {
    let Some(needed) = needed(engine, model) else { return model.clone() };
    let held = needed.iter().filter(|needed| !**needed).count();
    let mut best: Option<Refit> = None;
    for _ in 0..REFININGS {
        let from = best.as_ref().unwrap_or(model);
        let Some(next) = refit(engine, &around(engine, from, needed), &from.placed, NUMBER_COSTS) else {
            break;
        };
        let settled = best.as_ref().is_some_and(|best| next.loss > best.loss - SETTLED);
        if best.as_ref().is_none_or(|best| next.loss < best.loss) {
            best = Some(next);
        }
        if settled {
            break;
        }
    }
    match best {
        Some(best) if best.loss < model.loss + NEEDED * held as f64 => {
            Refit { errors: model.errors.clone(), inflation: model.inflation, ..best }
        }
        _ => model.clone(),
    }
}

/// Sensitivities around a model, those of parameters that are not needed left out: a column of nothing is not moved.
fn around(engine: &Engine<'_>, model: &Refit, needed: [bool; COUNT]) -> Around {
    let mut model = model.clone();
    for (factor, _) in model.factors.iter_mut().zip(needed).filter(|(_, needed)| !needed) {
        *factor = 1.0;
    }
    let mut around = around_of(engine, &model);
    for (column, _) in around.columns.iter_mut().zip(needed).filter(|(_, needed)| !needed) {
        column.fill(0.0);
    }
    around
}

/// Which parameters are needed, by straight lines around the model; `None` where all are, or where it has no neighbours.
fn needed(engine: &Engine<'_>, model: &Refit) -> Option<[bool; COUNT]> {
    let around = around_of(engine, model);
    let simulated = engine.simulate(&rig_of(engine.rig(), &model.placed, &model.factors)?);
    let coordinates = coordinate_columns(engine, &model.factors, &model.placed, &simulated)?;
    let mut residual = engine.residual(&simulated);
    // From where the file is: what is fitted then is how far each parameter is off.
    for (column, factor) in around.columns.iter().zip(model.factors) {
        residual.iter_mut().zip(column).for_each(|(own, column)| *own += (factor - 1.0) * column);
    }
    let columns: Vec<&[f64]> = around.columns.iter().chain(&coordinates).map(Vec::as_slice).collect();
    let products = Products::new(&residual, &columns, engine.freedom(), engine.rows());
    let mut ridges = parameter_ridges();
    for placed in &model.placed {
        ridges.extend((0..placed.coordinates.len()).map(|key| coordinate_ridge(&placed.candidate, key)));
    }
    let loss = |needed: &[bool; COUNT]| {
        let chosen: Vec<usize> = (0..columns.len()).filter(|at| *at >= COUNT || needed[*at]).collect();
        let ridges: Vec<f64> = chosen.iter().map(|at| ridges[*at]).collect();
        products.fit(&chosen, &ridges).loss
    };
    let mut needed = [true; COUNT];
    let mut own = loss(&needed);
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
            Some((without, fewer)) if without - own < NEEDED => (own, needed) = (without, fewer),
            _ => break,
        }
    }
    needed.contains(&false).then_some(needed)
}
