//! Fits effects in the simulator itself: their numbers by Gauss-Newton, the parameters that may be wrong linearly beside them.
//!
//! ```text
//!   e(z) = readings - simulation with the effects at z       columns: N (parameters), d simulation / d z_i
//!   fit of the columns to e(z) -> step of z, shorter until the loss falls; ridges hold how far all of it is from the file
//! ```
//!
//! Derivatives are differences over a twentieth of the coordinate, two hundredths of its unit at least, never exact ones: through
//! stick and slip those of a single trajectory say nothing. Source: discrepancy-notes.md, pipeline 6.

use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::fit::{Fit, Products};
use crate::name::NUMBER_COSTS;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use plant::RigParameters;

/// Change of a coordinate by which derivatives are taken, at least and in proportion.
const CHANGE: f64 = 0.02;
const CHANGE_SHARE: f64 = 0.05;
/// Steps at most, how often one is made shorter, and to what share of it.
const STEPS: usize = 7;
const SHORTENINGS: usize = 3;
const SHORTER: f64 = 0.4;
/// Fall of the loss below which a fit has settled.
const CONVERGED: f64 = 0.3;
/// Standard deviations of coordinates before anything is measured: amplitudes, shapes.
const AMPLITUDE_TOLERANCE: f64 = 3.0;
const SHAPE_TOLERANCE: f64 = 0.7;
/// By how much a parameter may be off at most: one that is off by more is another rig.
pub(crate) const MOST_OFF: f64 = 0.3;
/// What each parameter that is off costs, as a number of an effect does: a sensor that shows four per cent too little is a better
/// explanation than all masses, frictions and areas off by as much.
const PARAMETER_COSTS: f64 = NUMBER_COSTS;
/// From where on a parameter counts as off.
const COUNTS_AS_OFF: f64 = 0.005;

/// One effect at some coordinates.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Which.
    pub candidate: Candidate,
    /// One for each key of its sheet.
    pub coordinates: Vec<f64>,
}

/// Some effects and the parameters beside them, fitted.
#[derive(Clone, Debug)]
pub struct Refit {
    /// The effects.
    pub placed: Vec<Placed>,
    /// Factors of the parameters.
    pub factors: [f64; COUNT],
    /// The loss, priors and a penalty for each number of an effect and each parameter that is off included.
    pub loss: f64,
    /// Squares of each window.
    pub squares: Vec<f64>,
    /// Standard errors of all coordinates, in the order of the effects and their keys, then of the factors; clustered by windows.
    pub errors: Vec<f64>,
    /// How many times larger the clustered variance is than the plain one, for the first amplitude; at least 1.
    pub inflation: f64,
}

/// Sensitivities around a point, and the factors that they were taken at.
#[derive(Clone, Debug)]
pub struct Around {
    /// Columns of the parameters.
    pub columns: Vec<Vec<f64>>,
    /// Factors at which they were taken.
    pub factors: [f64; COUNT],
}

impl Around {
    /// How far each parameter is from what is believed of it.
    #[must_use]
    pub fn off(&self) -> Vec<f64> {
        self.factors.iter().map(|factor| factor - 1.0).collect()
    }
}

/// The rig with some effects and factors; `None` where the numbers do not fit together.
#[must_use]
pub fn rig_of(rig: &RigParameters, placed: &[Placed], factors: &[f64; COUNT]) -> Option<RigParameters> {
    placed.iter().try_fold(with_factors(rig, factors), |rig, placed| {
        placed.candidate.rig(&rig, &placed.coordinates).ok()
    })
}

/// Ridges of the parameters, for how far their factors are from 1.
pub(crate) fn parameter_ridges() -> Vec<f64> {
    PARAMETERS.iter().map(|parameter| parameter.tolerance.powi(-2)).collect()
}

/// How many parameters are off, those that are so by little counted in part.
fn parameters_off(factors: &[f64; COUNT]) -> f64 {
    factors
        .iter()
        .map(|factor| (factor - 1.0).powi(2))
        .map(|square| square / (square + COUNTS_AS_OFF.powi(2)))
        .sum()
}

/// What so many numbers of effects and the parameters that are off cost.
pub(crate) fn costs(numbers: usize, factors: &[f64; COUNT], penalty: f64) -> f64 {
    penalty * numbers as f64 + PARAMETER_COSTS * parameters_off(factors)
}

/// Ridge of a coordinate.
pub(crate) fn coordinate_ridge(candidate: &Candidate, key: usize) -> f64 {
    let tolerance = if candidate.is_shape(key) { SHAPE_TOLERANCE } else { AMPLITUDE_TOLERANCE };
    tolerance.powi(-2)
}

/// Which coordinates of the effects are moved: all of them, place in `placed` and key.
fn moved(placed: &[Placed]) -> Vec<(usize, usize)> {
    placed
        .iter()
        .enumerate()
        .flat_map(|(at, placed)| (0..placed.coordinates.len()).map(move |key| (at, key)))
        .collect()
}

/// The loss of some effects where they are, the parameters fitted beside; infinite where the rig cannot have them.
#[must_use]
pub fn loss_at(engine: &Engine<'_>, around: &Around, placed: &[Placed]) -> f64 {
    let Some(rig) = rig_of(engine.rig(), placed, &around.factors) else { return f64::INFINITY };
    let residual = engine.residual(&engine.simulate_coarsely(&rig));
    let columns: Vec<&[f64]> = around.columns.iter().map(Vec::as_slice).collect();
    let products = Products::new(&residual, &columns, engine.freedom(), engine.rows());
    products.fit_from(&(0..COUNT).collect::<Vec<_>>(), &parameter_ridges(), &around.off()).loss
}

/// A point of a fit: where, and what is left there.
struct Point {
    placed: Vec<Placed>,
    simulated: Vec<f64>,
    residual: Vec<f64>,
    fit: Fit,
}

/// Fits some effects from a start. `penalty` is what each number that is moved costs.
///
/// `None` when the start is none that the rig can have.
#[must_use]
pub fn refit(engine: &Engine<'_>, around: &Around, start: &[Placed], penalty: f64) -> Option<Refit> {
    refit_steps(engine, around, start, penalty, STEPS)
}

/// The same with another number of steps at most; 0 only tells how good the start is.
#[must_use]
pub fn refit_steps(
    engine: &Engine<'_>,
    around: &Around,
    start: &[Placed],
    penalty: f64,
    steps: usize,
) -> Option<Refit> {
    let parameters: Vec<usize> = (0..COUNT).collect();
    let (ridges, off) = (parameter_ridges(), around.off());
    let moved = moved(start);
    let parameter_columns: Vec<&[f64]> = around.columns.iter().map(Vec::as_slice).collect();
    let mut parameter_products: Option<Products> = None;
    let mut evaluate = |placed: Vec<Placed>| -> Option<Point> {
        let simulated = engine.simulate(&rig_of(engine.rig(), &placed, &around.factors)?);
        let residual = engine.residual(&simulated);
        let products = match &mut parameter_products {
            Some(products) => {
                products.set_residual(&residual, &parameter_columns, engine.rows());
                products
            }
            none => {
                none.insert(Products::new(&residual, &parameter_columns, engine.freedom(), engine.rows()))
            }
        };
        let fit = products.fit_from(&parameters, &ridges, &off);
        Some(Point { placed, simulated, residual, fit })
    };
    let prior = |placed: &[Placed]| -> f64 {
        moved
            .iter()
            .map(|(at, key)| {
                coordinate_ridge(&placed[*at].candidate, *key) * placed[*at].coordinates[*key].powi(2)
            })
            .sum()
    };
    let mut point = evaluate(start.to_vec())?;
    let mut last = None;
    for step in 0..=steps {
        let columns = coordinate_columns(engine, &around.factors, &point.placed, &point.simulated)?;
        let all: Vec<&[f64]> =
            parameter_columns.iter().copied().chain(columns.iter().map(Vec::as_slice)).collect();
        let products = Products::new(&point.residual, &all, engine.freedom(), engine.rows());
        let chosen: Vec<usize> = (0..all.len()).collect();
        let mut all_ridges = ridges.clone();
        all_ridges.extend(moved.iter().map(|(at, key)| coordinate_ridge(&point.placed[*at].candidate, *key)));
        let places = moved.iter().map(|(at, key)| point.placed[*at].coordinates[*key]);
        let from: Vec<f64> = off.iter().copied().chain(places).collect();
        let joint = products.fit_from(&chosen, &all_ridges, &from);
        let before = point.fit.loss + prior(&point.placed);
        last = Some((products, all_ridges, chosen));
        if step == steps {
            break;
        }
        let mut share = 1.0;
        let mut better = None;
        for _ in 0..=SHORTENINGS {
            let mut placed = point.placed.clone();
            for ((at, key), change) in moved.iter().zip(&joint.coefficients[COUNT..]) {
                let [least, most] = placed[*at].candidate.reach(*key);
                let coordinate = &mut placed[*at].coordinates[*key];
                *coordinate = (*coordinate + share * change).clamp(least, most);
            }
            if let Some(tried) = evaluate(placed)
                && tried.fit.loss + prior(&tried.placed) < before
            {
                better = Some(tried);
                break;
            }
            share *= SHORTER;
        }
        let Some(tried) = better else { break };
        let converged = before - (tried.fit.loss + prior(&tried.placed)) < CONVERGED;
        point = tried;
        if converged {
            break;
        }
    }
    let (products, all_ridges, chosen) = last?;
    // At the point itself: parameters as fitted there, coordinates where they are.
    let mut at_point = point.fit.clone();
    at_point.coefficients.extend(std::iter::repeat_n(0.0, moved.len()));
    let covariance = products.covariance(&chosen, &at_point, &all_ridges);
    let (plain, _) = products.normal(&chosen, &at_point.weights, &all_ridges);
    let plain = plain.try_inverse();
    let error =
        |at: usize| covariance.as_ref().map_or(f64::INFINITY, |matrix| matrix[(at, at)].max(0.0).sqrt());
    let inflation = match (&covariance, &plain) {
        (Some(clustered), Some(plain)) if !moved.is_empty() => {
            (clustered[(COUNT, COUNT)] / plain[(COUNT, COUNT)]).max(1.0)
        }
        _ => 1.0,
    };
    let errors = (COUNT..chosen.len()).chain(0..COUNT).map(error).collect();
    let mut factors = around.factors;
    for (factor, change) in factors.iter_mut().zip(&point.fit.coefficients) {
        *factor = (*factor + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
    }
    let loss = point.fit.loss + prior(&point.placed) + costs(moved.len(), &factors, penalty);
    Some(Refit { placed: point.placed, factors, loss, squares: point.fit.squares, errors, inflation })
}

/// What each coordinate of a model changes, per unit of it, in the order of the effects and their keys; `simulated` is what the
/// model shows. `None` where the rig cannot have a neighbour of it.
pub(crate) fn coordinate_columns(
    engine: &Engine<'_>,
    factors: &[f64; COUNT],
    placed: &[Placed],
    simulated: &[f64],
) -> Option<Vec<Vec<f64>>> {
    moved(placed).iter().map(|(at, key)| derivative(engine, factors, placed, simulated, *at, *key)).collect()
}

/// What a coordinate changes, per unit of it; towards the inside where the range ends.
pub(crate) fn derivative(
    engine: &Engine<'_>,
    factors: &[f64; COUNT],
    placed: &[Placed],
    simulated: &[f64],
    at: usize,
    key: usize,
) -> Option<Vec<f64>> {
    let candidate = placed[at].candidate;
    let coordinate = placed[at].coordinates[key];
    let size = CHANGE.max(CHANGE_SHARE * coordinate.abs());
    let [_, most] = candidate.reach(key);
    let change = if coordinate + size > most { -size } else { size };
    let mut placed = placed.to_vec();
    placed[at].coordinates[key] += change;
    let moved = engine.simulate(&rig_of(engine.rig(), &placed, factors)?);
    let mut column = engine.difference(&moved, simulated);
    column.iter_mut().for_each(|value| *value /= change);
    Some(column)
}
