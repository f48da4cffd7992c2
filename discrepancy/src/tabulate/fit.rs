//! The values of tables and the factors of parameters, fitted in the simulator by Gauss-Newton.
//!
//! ```text
//!   e(z) = readings - simulation at z      columns: d simulation / d z_i, all coordinates alike, new every few steps
//!   step of z, shortened until the loss falls
//! ```
//!
//! [`crate::refit`] takes parameters linearly; here they are simulated too, since a table would absorb the error of their
//! linearisation.

use super::with_tables;
use crate::engine::{Engine, FACTOR_CHANGE};
use crate::fit::loss;
use crate::name::EFFECT_PARAMETER_PENALTY;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{FittedModel, MOST_OFF, has_factor_at_bound};
use crate::windows::{ReferenceRun, VariableRanges};
use model_fit::estimator::{Convergence, Estimator, Options, Outcome, Step, TABLES, TABLES_WITHIN};
use model_fit::parallel;
use plant::RigParameters;
use plant::effects::tabulated::{Balance, Tabulated};

/// Steps of finite differences: N, Nl/min; and as a share of the value.
const FORCE_CHANGE_N: f64 = 1.0;
const FLOW_CHANGE_NL_PER_MIN: f64 = 0.5;
const CHANGE_SHARE: f64 = 0.05;
/// Prior standard deviations of values, beyond what occurs.
const FORCE_PRIOR_STD_N: f64 = 200.0;
const FLOW_PRIOR_STD_NL_PER_MIN: f64 = 200.0;
/// Folds of the cross-validation.
const FOLDS: usize = 5;

#[derive(Clone, Debug)]
pub(super) struct FittedTable {
    pub(super) table: Tabulated,
    /// Whether all values are equal.
    pub(super) is_constant: bool,
    /// Sorted values of its variable in the windows.
    pub(super) sorted_samples: Vec<f64>,
}

impl FittedTable {
    fn acts(&self, point: usize, ranges: &VariableRanges) -> bool {
        let Tabulated { axis, variable, at, .. } = &self.table;
        let before = point.checked_sub(1).map_or(f64::NEG_INFINITY, |before| at[before]);
        let after = at.get(point + 1).copied().unwrap_or(f64::INFINITY);
        self.is_constant || ranges.overlaps(*axis, *variable, [before, after])
    }
}

/// Tables and parameters.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) factors: [f64; COUNT],
    /// Which of them are free.
    pub(super) free: [bool; COUNT],
    pub(super) tables: Vec<FittedTable>,
}

/// A free number.
#[derive(Clone, Copy, Debug)]
enum Coordinate {
    Factor(usize),
    /// Table and point; of a constant all points.
    Value(usize, usize),
}

impl Model {
    /// Parameters without tables; those not free are at the rig file's values.
    pub(super) fn without_tables(factors: [f64; COUNT], free: [bool; COUNT]) -> Self {
        Model { factors, free: [true; COUNT], tables: Vec::new() }.with_fixed(free)
    }

    /// The same with only some parameters free, the others at the rig file's values.
    pub(super) fn with_fixed(mut self, free: [bool; COUNT]) -> Self {
        self.free = free;
        for (factor, _) in self.factors.iter_mut().zip(free).filter(|(_, free)| !free) {
            *factor = 1.0;
        }
        self
    }

    fn rig(&self, engine: &Engine<'_>) -> Option<RigParameters> {
        with_tables(&with_factors(&engine.rig, &self.factors), &self.tables)
    }

    fn coordinates(&self) -> Vec<Coordinate> {
        let factors = (0..COUNT).filter(|at| self.free[*at]).map(Coordinate::Factor);
        let values = self.tables.iter().enumerate().flat_map(|(at, fitted)| {
            (0..if fitted.is_constant { 1 } else { fitted.table.at.len() })
                .map(move |point| Coordinate::Value(at, point))
        });
        factors.chain(values).collect()
    }

    fn perturbed(&self, coordinate: Coordinate, change: f64) -> Self {
        let mut model = self.clone();
        match coordinate {
            Coordinate::Factor(at) => {
                model.factors[at] = (model.factors[at] + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
            }
            Coordinate::Value(at, point) => {
                let fitted = &mut model.tables[at];
                let most = fitted.table.balance.most();
                let value = (fitted.table.value[point] + change).clamp(-most, most);
                if fitted.is_constant {
                    fitted.table.value.fill(value);
                } else {
                    fitted.table.value[point] = value;
                }
            }
        }
        model
    }

    /// Finite difference step of a coordinate.
    fn change(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Factor(_) => FACTOR_CHANGE,
            Coordinate::Value(at, point) => {
                let table = &self.tables[at].table;
                let least = match table.balance {
                    Balance::Force => FORCE_CHANGE_N,
                    Balance::FlowA | Balance::FlowB => FLOW_CHANGE_NL_PER_MIN,
                };
                least.max(CHANGE_SHARE * table.value[point].abs())
            }
        }
    }

    fn precision(&self, coordinate: Coordinate) -> f64 {
        let prior_std = match coordinate {
            Coordinate::Factor(at) => PARAMETERS[at].prior_std,
            Coordinate::Value(at, _) => match self.tables[at].table.balance {
                Balance::Force => FORCE_PRIOR_STD_N,
                Balance::FlowA | Balance::FlowB => FLOW_PRIOR_STD_NL_PER_MIN,
            },
        };
        prior_std.powi(-2)
    }

    /// Prior precisions of all free coordinates.
    fn precisions(&self) -> Vec<f64> {
        self.coordinates().iter().map(|coordinate| self.precision(*coordinate)).collect()
    }

    /// Deviations of all free coordinates from their prior means.
    fn deviations(&self) -> Vec<f64> {
        self.coordinates().iter().map(|coordinate| self.deviation(*coordinate)).collect()
    }

    /// Deviation of a coordinate from its neutral value.
    fn deviation(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Factor(at) => self.factors[at] - 1.0,
            Coordinate::Value(at, point) => self.tables[at].table.value[point],
        }
    }

    /// Priors of the factors and of the values, and the penalty for the points; no penalty for parameters off the file, as J has.
    fn priors_and_penalty(&self) -> f64 {
        let factors = (0..COUNT).map(Coordinate::Factor);
        let values = self.coordinates().into_iter().filter(|one| matches!(one, Coordinate::Value(..)));
        let prior = factors.chain(values).map(|one| self.precision(one) * self.deviation(one).powi(2));
        prior.sum::<f64>() + self.penalty_for_points()
    }

    fn penalty_for_points(&self) -> f64 {
        let coordinates = self.coordinates();
        let points = coordinates.iter().filter(|one| matches!(one, Coordinate::Value(..)));
        EFFECT_PARAMETER_PENALTY * points.count() as f64
    }
}

/// A simulated model.
#[derive(Clone, Debug)]
pub(super) struct Iterate {
    pub(super) model: Model,
    residual: Vec<f64>,
    /// L, priors and the penalty for the points.
    pub(super) loss: f64,
}

impl model_fit::estimator::Iterate for Iterate {
    fn loss(&self) -> f64 {
        self.loss
    }

    fn is_at_bound(&self) -> bool {
        let is_most = |fitted: &FittedTable| {
            fitted.table.value.iter().any(|value| value.abs() >= fitted.table.balance.most())
        };
        has_factor_at_bound(&self.model.factors) || self.model.tables.iter().any(is_most)
    }
}

impl Iterate {
    /// `None` where no rig can have the model.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let residual = engine.residual(&engine.simulate(&model.rig(engine)?));
        let loss = loss(&engine.squares(&residual), &engine.scaled_dof) + model.priors_and_penalty();
        loss.is_finite().then_some(Iterate { model, residual, loss })
    }

    /// The parameters with standard errors, as a fit without effects; `linearisation` is the linearisation at the model.
    pub(super) fn as_fitted_model(
        &self,
        engine: &Engine<'_>,
        linearisation: &TableLinearisation,
    ) -> FittedModel {
        let (coordinates, precisions) = (self.model.coordinates(), self.model.precisions());
        let mut errors = vec![f64::INFINITY; COUNT];
        let products = engine.products(&self.residual, &linearisation.columns);
        let chosen: Vec<usize> = (0..coordinates.len()).collect();
        let fit = products.fit(&chosen, &precisions);
        if let Some(covariance) = products.covariance(&chosen, &fit, &precisions) {
            for (at, coordinate) in coordinates.iter().enumerate() {
                if let Coordinate::Factor(factor) = coordinate {
                    errors[*factor] = covariance[(at, at)].max(0.0).sqrt();
                }
            }
        }
        let factors = self.model.factors;
        FittedModel {
            effects: Vec::new(),
            factors,
            loss: self.loss,
            squares: Vec::new(),
            errors,
            design_effect: 1.0,
            convergence: Convergence::default(),
        }
    }
}

/// Sensitivities of a model to some coordinates; `reference_runs` is its reference run.
fn columns(
    engine: &Engine<'_>,
    model: &Model,
    coordinates: &[Coordinate],
    reference_runs: &[ReferenceRun],
) -> Option<Vec<Vec<f64>>> {
    let from: Vec<f64> = reference_runs.iter().flat_map(|run| &run.simulated).copied().collect();
    let columns = parallel::map(coordinates, |coordinate| {
        let change = model.change(*coordinate);
        let rig = model.perturbed(*coordinate, change).rig(engine)?;
        let simulated = match coordinate {
            Coordinate::Factor(_) => engine.simulate_coarsely(&rig),
            Coordinate::Value(at, point) => {
                let fitted = &model.tables[*at];
                engine.simulate_where(&rig, reference_runs, |ranges| fitted.acts(*point, ranges))
            }
        };
        Some(engine.slope(&simulated, &from, change))
    });
    columns.into_iter().collect()
}

pub(super) struct TableLinearisation {
    model: Model,
    reference_runs: Vec<ReferenceRun>,
    columns: Vec<Vec<f64>>,
}

/// A table of zeros with the sensitivities to its values.
pub(super) struct LinearisedTable {
    fitted: FittedTable,
    columns: Vec<Vec<f64>>,
}

impl LinearisedTable {
    pub(super) fn balance(&self) -> Balance {
        self.fitted.table.balance
    }
}

impl TableLinearisation {
    /// Linearises a model; `None` where no rig can have it.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let reference_runs = engine.reference_runs(&model.rig(engine)?);
        let columns = columns(engine, &model, &model.coordinates(), &reference_runs)?;
        Some(TableLinearisation { model, reference_runs, columns })
    }

    /// Columns of the model and of further tables.
    pub(super) fn columns_with<'a>(&'a self, tables: &[&'a LinearisedTable]) -> Vec<&'a [f64]> {
        let more = tables.iter().flat_map(|beside| &beside.columns);
        self.columns.iter().chain(more).map(Vec::as_slice).collect()
    }

    /// Linearises one more table of zeros; `None` where no rig can have it.
    pub(super) fn linearised_table(
        &self,
        engine: &Engine<'_>,
        fitted: FittedTable,
    ) -> Option<LinearisedTable> {
        let mut model = self.model.clone();
        model.tables.push(fitted.clone());
        let coordinates = model.coordinates().split_off(self.columns.len());
        Some(LinearisedTable {
            fitted,
            columns: columns(engine, &model, &coordinates, &self.reference_runs)?,
        })
    }

    /// Cross-validated loss of the linearised model, without priors and penalties.
    pub(super) fn cross_validated_loss(&self, engine: &Engine<'_>, point: &Iterate) -> f64 {
        let products = engine.products(&point.residual, &self.columns);
        let coordinates = self.model.coordinates();
        let precisions = self.model.precisions();
        let from = self.model.deviations();
        products.cross_validated_loss(&(0..coordinates.len()).collect::<Vec<_>>(), &precisions, &from, FOLDS)
    }

    /// Predicted loss of the linearised model with further tables: L, priors and the penalty for the points.
    pub(super) fn predicted_loss(
        &self,
        engine: &Engine<'_>,
        point: &Iterate,
        tables: &[&LinearisedTable],
    ) -> f64 {
        let mut model = self.model.clone();
        model.tables.extend(tables.iter().map(|beside| beside.fitted.clone()));
        let columns = self.columns_with(tables);
        let products = engine.products(&point.residual, &columns);
        let all: Vec<usize> = (0..columns.len()).collect();
        let fit = products.fit_from(&all, &model.precisions(), &model.deviations());
        fit.loss + model.penalty_for_points()
    }
}

/// Forward selection of parameters beside the tables on the linearised model, while the loss falls by `gain`.
pub(super) fn needed(
    engine: &Engine<'_>,
    point: &Iterate,
    linearisation: &[&[f64]],
    gain: f64,
) -> [bool; COUNT] {
    let mut needed = [false; COUNT];
    let model = Model { free: [true; COUNT], ..point.model.clone() };
    let coordinates = model.coordinates();
    let products = engine.products(&point.residual, linearisation);
    let loss_with = |needed: &[bool; COUNT]| {
        let is_in = |at: &usize| match coordinates[*at] {
            Coordinate::Factor(factor) => needed[factor],
            Coordinate::Value(..) => true,
        };
        let chosen: Vec<usize> = (0..coordinates.len()).filter(is_in).collect();
        let free = chosen.iter().map(|at| coordinates[*at]);
        let precisions: Vec<f64> = free.clone().map(|one| model.precision(one)).collect();
        let from: Vec<f64> = free.map(|one| model.deviation(one)).collect();
        products.fit_from(&chosen, &precisions, &from).loss
    };
    let mut loss = loss_with(&needed);
    for _ in 0..COUNT {
        let tried = (0..COUNT).filter(|at| !needed[*at]).map(|at| {
            let mut more = needed;
            more[at] = true;
            (loss_with(&more), more)
        });
        match tried.min_by(|left, right| left.0.total_cmp(&right.0)) {
            Some((less, more)) if loss - less > gain => (loss, needed) = (less, more),
            _ => break,
        }
    }
    needed
}

/// Gauss-Newton until convergence.
pub(super) fn fit(engine: &Engine<'_>, start: Iterate, steps: usize) -> Iterate {
    let options = Options { steps, ..TABLES };
    let (fitted, _) = Estimator::new(options).descend(start, |estimator, point| {
        let Some(linearisation) = TableLinearisation::of(engine, point.model.clone()) else {
            return Step::Impossible;
        };
        let (next, within) = steps_within(engine, point.clone(), &linearisation.columns_with(&[]));
        estimator.count_all(within);
        match within {
            Convergence { iterations: 0, outcome: Outcome::Stalled, .. } => {
                Step::Refused { predicted_reduction: f64::INFINITY }
            }
            Convergence { iterations: 0, .. } => Step::Refused { predicted_reduction: 0.0 },
            _ => Step::Accepted(next),
        }
    });
    fitted
}

/// Steps with the same sensitivities, one column for each free coordinate.
pub(super) fn steps(engine: &Engine<'_>, start: Iterate, linearisation: &[&[f64]]) -> Iterate {
    steps_within(engine, start, linearisation).0
}

fn steps_within(engine: &Engine<'_>, start: Iterate, linearisation: &[&[f64]]) -> (Iterate, Convergence) {
    let (coordinates, precisions) = (start.model.coordinates(), start.model.precisions());
    let all: Vec<usize> = (0..coordinates.len()).collect();
    let mut products = engine.products(&start.residual, linearisation);
    Estimator::new(TABLES_WITHIN).descend(start, |estimator, point| {
        products.set_residual(&point.residual, linearisation, engine.rows);
        let joint = products.fit_from(&all, &precisions, &point.model.deviations());
        let predicted_reduction = point.loss - point.model.penalty_for_points() - joint.loss;
        if predicted_reduction < estimator.tolerance(point.loss) {
            return Step::Refused { predicted_reduction };
        }
        estimator.backtrack(point, predicted_reduction, TABLES_WITHIN.fractions, |fraction| {
            let changes = coordinates.iter().zip(&joint.coefficients);
            let model = changes.fold(point.model.clone(), |model, (coordinate, change)| {
                model.perturbed(*coordinate, fraction * change)
            });
            Iterate::of(engine, model)
        })
    })
}
