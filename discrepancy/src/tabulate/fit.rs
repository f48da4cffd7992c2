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
use crate::fit::{Products, descend, loss};
use crate::name::NUMBER_COSTS;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{MOST_OFF, Refit};
use crate::windows::{Reach, ReferenceRun};
use plant::RigParameters;
use plant::effects::tabulated::{Balance, Tabulated};
use rayon::prelude::*;

/// Steps of finite differences: N, Nl/min; and as a share of the value.
const FORCE_CHANGE_N: f64 = 1.0;
const FLOW_CHANGE_NL_PER_MIN: f64 = 0.5;
const CHANGE_SHARE: f64 = 0.05;
/// Prior standard deviations of values, beyond what occurs.
const FORCE_TOLERANCE_N: f64 = 200.0;
const FLOW_TOLERANCE_NL_PER_MIN: f64 = 200.0;
/// Steps with the same derivatives, which cost many times a step.
const ALONG: usize = 3;
/// Step fractions of the line search.
const SHARES: [f64; 4] = [1.0, 0.4, 0.15, 0.05];
/// Fall of the loss below which a fit has converged.
const CONVERGED: f64 = 1.0;
/// Folds of the cross-validation.
const FOLDS: usize = 5;

/// A table with fitted values.
#[derive(Clone, Debug)]
pub(super) struct Tied {
    pub(super) table: Tabulated,
    /// Whether all values are equal.
    pub(super) is_constant: bool,
    /// Sorted values of its variable in the windows.
    pub(super) seen: Vec<f64>,
}

impl Tied {
    /// Whether a point acts in a window.
    fn acts(&self, point: usize, reach: &Reach) -> bool {
        let Tabulated { axis, variable, at, .. } = &self.table;
        let before = point.checked_sub(1).map_or(f64::NEG_INFINITY, |before| at[before]);
        let after = at.get(point + 1).copied().unwrap_or(f64::INFINITY);
        self.is_constant || reach.meets(*axis, *variable, [before, after])
    }
}

/// Tables and parameters.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) factors: [f64; COUNT],
    /// Which of them are free.
    pub(super) free: [bool; COUNT],
    pub(super) tables: Vec<Tied>,
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
    pub(super) fn alone(factors: [f64; COUNT], free: [bool; COUNT]) -> Self {
        Model { factors, free: [true; COUNT], tables: Vec::new() }.held(free)
    }

    /// The same with only some parameters free, the others at the rig file's values.
    pub(super) fn held(mut self, free: [bool; COUNT]) -> Self {
        self.free = free;
        for (factor, _) in self.factors.iter_mut().zip(free).filter(|(_, free)| !free) {
            *factor = 1.0;
        }
        self
    }

    fn rig(&self, engine: &Engine<'_>) -> Option<RigParameters> {
        with_tables(&with_factors(engine.rig(), &self.factors), &self.tables)
    }

    fn moved(&self) -> Vec<Coordinate> {
        let factors = (0..COUNT).filter(|at| self.free[*at]).map(Coordinate::Factor);
        let values = self.tables.iter().enumerate().flat_map(|(at, tied)| {
            (0..if tied.is_constant { 1 } else { tied.table.at.len() })
                .map(move |point| Coordinate::Value(at, point))
        });
        factors.chain(values).collect()
    }

    fn moved_by(&self, coordinate: Coordinate, change: f64) -> Self {
        let mut model = self.clone();
        match coordinate {
            Coordinate::Factor(at) => {
                model.factors[at] = (model.factors[at] + change).clamp(1.0 - MOST_OFF, 1.0 + MOST_OFF);
            }
            Coordinate::Value(at, point) => {
                let tied = &mut model.tables[at];
                let most = tied.table.balance.most();
                let value = (tied.table.value[point] + change).clamp(-most, most);
                if tied.is_constant {
                    tied.table.value.fill(value);
                } else {
                    tied.table.value[point] = value;
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

    fn ridge(&self, coordinate: Coordinate) -> f64 {
        let tolerance = match coordinate {
            Coordinate::Factor(at) => PARAMETERS[at].tolerance,
            Coordinate::Value(at, _) => match self.tables[at].table.balance {
                Balance::Force => FORCE_TOLERANCE_N,
                Balance::FlowA | Balance::FlowB => FLOW_TOLERANCE_NL_PER_MIN,
            },
        };
        tolerance.powi(-2)
    }

    /// Prior precisions of all free coordinates.
    fn ridges(&self) -> Vec<f64> {
        self.moved().iter().map(|coordinate| self.ridge(*coordinate)).collect()
    }

    /// Deviation of a coordinate from its neutral value.
    fn off(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Factor(at) => self.factors[at] - 1.0,
            Coordinate::Value(at, point) => self.tables[at].table.value[point],
        }
    }

    /// Prior penalty of the factors and penalty for the points.
    fn costs(&self) -> f64 {
        let factors: f64 =
            (0..COUNT).map(|at| (self.off(Coordinate::Factor(at)) / PARAMETERS[at].tolerance).powi(2)).sum();
        let points =
            self.moved().iter().filter(|coordinate| matches!(coordinate, Coordinate::Value(..))).count();
        factors + NUMBER_COSTS * points as f64
    }
}

/// A simulated model.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) model: Model,
    residual: Vec<f64>,
    /// Loss of the windows plus penalties.
    pub(super) loss: f64,
}

impl Point {
    /// `None` where no rig can have the model.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let residual = engine.residual(&engine.simulate(&model.rig(engine)?));
        let loss = loss(&engine.squares(&residual), engine.freedom()) + model.costs();
        loss.is_finite().then_some(Point { model, residual, loss })
    }

    /// The parameters with standard errors, as a fit without effects; `lines` is the linearisation at the model.
    pub(super) fn as_refit(&self, engine: &Engine<'_>, lines: &Lines) -> Refit {
        let (moved, ridges) = (self.model.moved(), self.model.ridges());
        let mut errors = vec![f64::INFINITY; COUNT];
        let products = engine.products(&self.residual, &lines.columns);
        let chosen: Vec<usize> = (0..moved.len()).collect();
        let fit = products.fit(&chosen, &ridges);
        if let Some(covariance) = products.covariance(&chosen, &fit, &ridges) {
            for (at, coordinate) in moved.iter().enumerate() {
                if let Coordinate::Factor(factor) = coordinate {
                    errors[*factor] = covariance[(at, at)].max(0.0).sqrt();
                }
            }
        }
        let factors = self.model.factors;
        Refit { placed: Vec::new(), factors, loss: self.loss, squares: Vec::new(), errors, inflation: 1.0 }
    }
}

/// Sensitivities of a model to some coordinates; `passed` is its reference run.
fn columns(
    engine: &Engine<'_>,
    model: &Model,
    moved: &[Coordinate],
    passed: &[ReferenceRun],
) -> Option<Vec<Vec<f64>>> {
    let from: Vec<f64> = passed.iter().flat_map(ReferenceRun::simulated).copied().collect();
    moved
        .par_iter()
        .map(|coordinate| {
            let change = model.change(*coordinate);
            let rig = model.moved_by(*coordinate, change).rig(engine)?;
            let simulated = match coordinate {
                Coordinate::Factor(_) => engine.simulate_coarsely(&rig),
                Coordinate::Value(at, point) => {
                    let tied = &model.tables[*at];
                    engine.simulate_where(&rig, passed, |reach| tied.acts(*point, reach))
                }
            };
            let mut column = engine.difference(&simulated, &from);
            column.iter_mut().for_each(|value| *value /= change);
            Some(column)
        })
        .collect()
}

/// Linearisation of a model.
pub(super) struct Lines {
    model: Model,
    passed: Vec<ReferenceRun>,
    columns: Vec<Vec<f64>>,
}

/// A table of zeros with the sensitivities to its values.
pub(super) struct Beside {
    tied: Tied,
    columns: Vec<Vec<f64>>,
}

impl Beside {
    pub(super) fn balance(&self) -> Balance {
        self.tied.table.balance
    }
}

impl Lines {
    /// Linearises a model; `None` where no rig can have it.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let passed = engine.pass(&model.rig(engine)?);
        let columns = columns(engine, &model, &model.moved(), &passed)?;
        Some(Lines { model, passed, columns })
    }

    /// Columns of the model and of further tables.
    pub(super) fn with<'a>(&'a self, tables: &[&'a Beside]) -> Vec<&'a [f64]> {
        let more = tables.iter().flat_map(|beside| &beside.columns);
        self.columns.iter().chain(more).map(Vec::as_slice).collect()
    }

    /// Linearises one more table of zeros; `None` where no rig can have it.
    pub(super) fn beside(&self, engine: &Engine<'_>, tied: Tied) -> Option<Beside> {
        let mut model = self.model.clone();
        model.tables.push(tied.clone());
        let moved = model.moved().split_off(self.columns.len());
        Some(Beside { tied, columns: columns(engine, &model, &moved, &self.passed)? })
    }

    /// Cross-validated loss of the linearised model, without penalties.
    pub(super) fn unseen_loss(&self, engine: &Engine<'_>, point: &Point) -> f64 {
        let products = engine.products(&point.residual, &self.columns);
        let moved = self.model.moved();
        let ridges = self.model.ridges();
        let from: Vec<f64> = moved.iter().map(|coordinate| self.model.off(*coordinate)).collect();
        products.unseen_loss(&(0..moved.len()).collect::<Vec<_>>(), &ridges, &from, FOLDS)
    }

    /// Predicted loss of the linearised model with further tables.
    pub(super) fn promised(&self, engine: &Engine<'_>, point: &Point, tables: &[&Beside]) -> f64 {
        let mut model = self.model.clone();
        model.tables.extend(tables.iter().map(|beside| beside.tied.clone()));
        let columns = self.with(tables);
        let products = engine.products(&point.residual, &columns);
        products.fit(&(0..columns.len()).collect::<Vec<_>>(), &model.ridges()).loss + model.costs()
    }
}

/// Forward selection of parameters beside the tables on the linearised model, while the loss falls by `gain`.
pub(super) fn needed(engine: &Engine<'_>, point: &Point, lines: &[&[f64]], gain: f64) -> [bool; COUNT] {
    let mut needed = [false; COUNT];
    let model = Model { free: [true; COUNT], ..point.model.clone() };
    let moved = model.moved();
    let products = engine.products(&point.residual, lines);
    let loss_with = |needed: &[bool; COUNT]| {
        let is_in = |at: &usize| match moved[*at] {
            Coordinate::Factor(factor) => needed[factor],
            Coordinate::Value(..) => true,
        };
        let chosen: Vec<usize> = (0..moved.len()).filter(is_in).collect();
        let ridges: Vec<f64> = chosen.iter().map(|at| model.ridge(moved[*at])).collect();
        products.fit(&chosen, &ridges).loss
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
pub(super) fn fit(engine: &Engine<'_>, start: Point, steps: usize) -> Point {
    let loss = |point: &Point| point.loss;
    descend(start, steps, CONVERGED, loss, |point| {
        let lines = Lines::of(engine, point.model.clone())?;
        Some(self::steps(engine, point.clone(), &lines.with(&[])))
    })
}

/// Steps with the same sensitivities, one column for each free coordinate.
pub(super) fn steps(engine: &Engine<'_>, start: Point, lines: &[&[f64]]) -> Point {
    let (moved, ridges) = (start.model.moved(), start.model.ridges());
    let mut products = engine.products(&start.residual, lines);
    let loss = |point: &Point| point.loss;
    descend(start, ALONG, CONVERGED, loss, |point| {
        products.set_residual(&point.residual, lines, engine.rows());
        along(engine, point, &moved, &products, &ridges)
    })
}

/// Backtracking line search: the longest step that lowers the loss.
fn along(
    engine: &Engine<'_>,
    point: &Point,
    moved: &[Coordinate],
    products: &Products,
    ridges: &[f64],
) -> Option<Point> {
    let joint = products.fit(&(0..moved.len()).collect::<Vec<_>>(), ridges);
    SHARES.iter().find_map(|share| {
        let changes = moved.iter().zip(&joint.coefficients);
        let model = changes.fold(point.model.clone(), |model, (coordinate, change)| {
            model.moved_by(*coordinate, share * change)
        });
        Point::of(engine, model).filter(|tried| tried.loss < point.loss)
    })
}
