//! Calibration of single rig file numbers: the dead volume and each point of the valve tables.
//!
//! ```text
//!   entry = the file's x factor of the parameter that scales it x its own factor       one Gauss-Newton fit of all factors
//! ```
//!
//! A parameter is the common factor of all points of a table, so that points outside the records follow it. Naming does not use
//! these numbers: a wrong dead volume is an effect of the catalogue.
//!
//! Source: Neugebauer 2011, section 3.2: the valve's characteristic is measured point by point.

use super::UNRESOLVED;
use crate::engine::{Engine, FACTOR_CHANGE};
use crate::fit::{Fit, Products};
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{FittedModel, MOST_OFF, parameter_precisions};
use crate::report::Quantity;
use model_fit::estimator::{CALIBRATION, Estimator, Iterate};
use plant::RigParameters;
use plant::parameters::table::KEYS;

/// Keys with the prior standard deviation of their factors.
const CALIBRATED_KEYS: [(&str, f64); 3] = [
    ("cylinder.dead_volume_cm3", 0.3),
    ("valve.kv_supply_m3_per_h", 0.05),
    ("valve.kv_exhaust_m3_per_h", 0.05),
];
/// The parameter that scales the tables.
const KV_SCALE: &str = "parameter:kv-scale";
/// Step fractions until the rig is valid.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// An entry of a key of the rig file: its index in the list.
#[derive(Clone, Copy, Debug)]
struct TableEntry {
    key: &'static str,
    index: usize,
    prior_std: f64,
}

/// All factors, and the linear fit there. Its loss is that of the next iterate but for what is not linear, so that a step counts
/// by the loss of the fit and not of a simulation, unlike in other fits.
struct Linearised {
    factors: Vec<f64>,
    products: Products,
    fit: Fit,
}

impl Iterate for Linearised {
    fn loss(&self) -> f64 {
        self.fit.loss
    }

    fn is_at_bound(&self) -> bool {
        self.factors.iter().any(|factor| (factor - 1.0).abs() >= 2.0 * MOST_OFF)
    }
}

/// Calibrated parameters and table entries.
#[derive(Clone, Debug)]
pub struct TableCalibration {
    /// Parameters, then entries, for display.
    pub quantities: Vec<Quantity>,
    /// The same for the rig file: points of tables multiplied by their common factor.
    pub changed: Vec<Quantity>,
}

/// Fits entries and parameters jointly; `None` where no rig can have the result.
pub fn calibrate_tables(engine: &Engine<'_>, calibrated: &FittedModel) -> Option<TableCalibration> {
    let rig = &engine.rig;
    let scale = PARAMETERS.iter().position(|parameter| parameter.name == KV_SCALE).expect("one of them");
    let entries = entries(rig, &calibrated.factors);
    let mut precisions = parameter_precisions();
    precisions.extend(entries.iter().map(|entry| entry.prior_std.powi(-2)));
    let all: Vec<usize> = (0..precisions.len()).collect();

    let mut factors: Vec<f64> = calibrated.factors.to_vec();
    factors.resize(precisions.len(), 1.0);
    let linearised = |factors: Vec<f64>| -> Option<Linearised> {
        let residual = engine.residual(&engine.simulate(&rig_with(rig, &entries, &factors)?));
        let products = engine.products(&residual, &columns(engine, &entries, &factors)?);
        let off: Vec<f64> = factors.iter().map(|factor| factor - 1.0).collect();
        let fit = products.fit_from(&all, &precisions, &off);
        Some(Linearised { factors, products, fit })
    };
    // At the end of a range the last iterate stands.
    let (best, _) = Estimator::new(CALIBRATION).descend(linearised(factors)?, |estimator, from| {
        estimator.backtrack(from, 0.0, CALIBRATION.fractions, |_| {
            linearised(valid_step(rig, &entries, &from.factors, &from.fit.coefficients)?)
        })
    });
    let Linearised { factors: at, products, fit } = best;
    // Points of tables times their common factor.
    let in_file = entries
        .iter()
        .zip(COUNT..)
        .map(|(entry, at)| if rig.numbers(entry.key).len() > 1 { vec![at, scale] } else { vec![at] });
    let sums: Vec<Vec<usize>> = all.iter().map(|at| vec![*at]).chain(in_file).collect();
    let errors = products.jackknife_of_sums(&all, &fit, &precisions, &sums)?;
    let (factor_errors, file_errors) = errors.split_at(all.len());
    let factors = valid_step(rig, &entries, &at, &fit.coefficients)?;

    let mut parameter_factors = [1.0; COUNT];
    parameter_factors.copy_from_slice(&factors[..COUNT]);
    let fitted = FittedModel {
        factors: parameter_factors,
        errors: factor_errors[..COUNT].to_vec(),
        ..calibrated.clone()
    };
    let parameters: Vec<Quantity> = (0..COUNT).map(|at| super::quantity(engine, at, &fitted)).collect();
    let mut quantities = parameters.clone();
    let mut changed: Vec<Quantity> = parameters
        .into_iter()
        .enumerate()
        .filter(|(at, _)| *at != scale)
        .map(|(_, quantity)| quantity)
        .collect();
    changed.retain(|quantity| quantity.standard_error.is_some());
    let is_resolved = |at: usize| factor_errors[COUNT + at] < UNRESOLVED * entries[at].prior_std;
    // All points of a table change together, so that it stays monotonic.
    let is_changed = |key: &str| {
        let any = (0..entries.len()).any(|at| entries[at].key == key && is_resolved(at));
        any || (rig.numbers(key).len() > 1 && quantities[scale].standard_error.is_some())
    };
    let changes: Vec<bool> = entries.iter().map(|entry| is_changed(entry.key)).collect();
    for (at, entry) in entries.iter().enumerate() {
        let list = rig.numbers(entry.key);
        let before = list[entry.index];
        let key = KEYS.iter().find(|key| key.path() == entry.key)?;
        let of_table = list.len() > 1;
        let factor = factors[COUNT + at] * if of_table { factors[scale] } else { 1.0 };
        let quantity = Quantity {
            name: if of_table { format!("{}[{}]", entry.key, entry.index) } else { entry.key.to_owned() },
            value: before * factor,
            unit: key.unit.name().to_owned(),
            standard_error: is_resolved(at).then_some(before * file_errors[at]),
            before: Some(before),
        };
        if changes[at] {
            changed.push(quantity.clone());
        }
        quantities.push(quantity);
    }
    Some(TableCalibration { quantities, changed })
}

/// Entries that are not 0 and can change either way. Points without flow belong to the dead zone; equal points of a table cannot
/// move alone.
fn entries(rig: &RigParameters, parameters: &[f64; COUNT]) -> Vec<TableEntry> {
    let has_neighbours = |entry: &TableEntry| {
        [FACTOR_CHANGE, -FACTOR_CHANGE].iter().all(|change| {
            let factors: Vec<f64> = parameters.iter().copied().chain([1.0 + change]).collect();
            rig_with(rig, std::slice::from_ref(entry), &factors).is_some()
        })
    };
    let of_key = |(key, prior_std): (&'static str, f64)| {
        let list = rig.numbers(key);
        (0..list.len()).filter(|index| list[*index] > 0.0).map(move |index| TableEntry {
            key,
            index,
            prior_std,
        })
    };
    CALIBRATED_KEYS.into_iter().flat_map(of_key).filter(has_neighbours).collect()
}

/// The rig with all factors; `None` where one leaves its range or a table is not monotonic.
fn rig_with(rig: &RigParameters, entries: &[TableEntry], factors: &[f64]) -> Option<RigParameters> {
    let mut parameter_factors = [1.0; COUNT];
    parameter_factors.copy_from_slice(&factors[..COUNT]);
    let rig = with_factors(rig, &parameter_factors);
    let lists: Vec<(&str, Vec<f64>)> = CALIBRATED_KEYS
        .iter()
        .map(|(key, _)| {
            let mut list = rig.numbers(key).to_vec();
            for (entry, factor) in
                entries.iter().zip(&factors[COUNT..]).filter(|(entry, _)| entry.key == *key)
            {
                list[entry.index] *= factor;
            }
            (*key, list)
        })
        .collect();
    rig.with_all(lists.iter().map(|(key, list)| (*key, list.as_slice()))).ok()
}

/// The factors after the largest valid fraction of a step.
fn valid_step(
    rig: &RigParameters,
    entries: &[TableEntry],
    factors: &[f64],
    step: &[f64],
) -> Option<Vec<f64>> {
    SHARES.iter().find_map(|share| {
        let moved: Vec<f64> = factors
            .iter()
            .zip(step)
            .map(|(factor, step)| (factor + share * step).clamp(1.0 - 2.0 * MOST_OFF, 1.0 + 2.0 * MOST_OFF))
            .collect();
        rig_with(rig, entries, &moved).map(|_| moved)
    })
}

fn columns(engine: &Engine<'_>, entries: &[TableEntry], factors: &[f64]) -> Option<Vec<Vec<f64>>> {
    let perturbed = |change: f64| {
        (0..factors.len()).map(move |at| {
            let mut factors = factors.to_vec();
            factors[at] += change;
            rig_with(&engine.rig, entries, &factors)
        })
    };
    let rigs = perturbed(FACTOR_CHANGE).chain(perturbed(-FACTOR_CHANGE)).collect::<Option<Vec<_>>>()?;
    Some(engine.differences(&rigs, 2.0 * FACTOR_CHANGE))
}
