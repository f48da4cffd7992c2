//! The values of tables and the factors of parameters, fitted in the simulator by Gauss-Newton.
//!
//! ```text
//!   e(z) = readings - simulation at z      columns: d simulation / d z_i, all coordinates alike, new every few steps
//!   step of z, shortened until the loss falls
//! ```
//!
//! [`crate::refit`] moves the coordinates of effects and takes parameters linearly; here parameters are simulated too, since a
//! table would take up what their straight lines leave.

use super::with_tables;
use crate::engine::{Engine, FACTOR_CHANGE};
use crate::fit::{Products, loss};
use crate::name::NUMBER_COSTS;
use crate::parameters::{COUNT, PARAMETERS, with_factors};
use crate::refit::{MOST_OFF, Refit};
use crate::windows::{Reach, ReferenceRun, dot};
use plant::RigParameters;
use plant::effects::tabulated::{Balance, Tabulated};
use rayon::prelude::*;

/// The same of a value: N, Nl/min; and in proportion.
const FORCE_CHANGE_N: f64 = 1.0;
const FLOW_CHANGE_NL_PER_MIN: f64 = 0.5;
const CHANGE_SHARE: f64 = 0.05;
/// Standard deviations of values before anything is measured: beyond what occurs.
const FORCE_TOLERANCE_N: f64 = 200.0;
const FLOW_TOLERANCE_NL_PER_MIN: f64 = 200.0;
/// Steps that are taken with the same derivatives: those of a table with many points cost many times a step.
const ALONG: usize = 3;
/// Shortened steps that are tried.
const SHARES: [f64; 4] = [1.0, 0.4, 0.15, 0.05];
/// Fall of the loss below which a fit has settled.
const CONVERGED: f64 = 1.0;
/// Parts of the records that are left out in turn, to see what a model only learned.
const FOLDS: usize = 5;

/// A table whose values are moved.
#[derive(Clone, Debug)]
pub(super) struct Tied {
    pub(super) table: Tabulated,
    /// Whether all values are one.
    pub(super) is_constant: bool,
    /// What its variable was in the windows, sorted.
    pub(super) seen: Vec<f64>,
}

impl Tied {
    /// Whether one of its values is anything to a window.
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
    /// Which of them are moved.
    pub(super) free: [bool; COUNT],
    pub(super) tables: Vec<Tied>,
}

/// What is moved.
#[derive(Clone, Copy, Debug)]
enum Coordinate {
    Factor(usize),
    /// Table and point; of a constant all points.
    Value(usize, usize),
}

impl Model {
    /// Parameters alone; those that are not free are what the file says.
    pub(super) fn alone(factors: [f64; COUNT], free: [bool; COUNT]) -> Self {
        Model { factors, free: [true; COUNT], tables: Vec::new() }.held(free)
    }

    /// The same with only some parameters free, the others what the file says.
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

    /// How far a coordinate is moved for a derivative.
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

    /// How far a coordinate is from nothing.
    fn off(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::Factor(at) => self.factors[at] - 1.0,
            Coordinate::Value(at, point) => self.tables[at].table.value[point],
        }
    }

    /// What coordinates cost that are far from nothing, and points that there are.
    fn costs(&self) -> f64 {
        let factors: f64 =
            (0..COUNT).map(|at| (self.off(Coordinate::Factor(at)) / PARAMETERS[at].tolerance).powi(2)).sum();
        let points =
            self.moved().iter().filter(|coordinate| matches!(coordinate, Coordinate::Value(..))).count();
        factors + NUMBER_COSTS * points as f64
    }
}

/// A model and what it leaves.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) model: Model,
    residual: Vec<f64>,
    /// Of the windows, and what the model costs.
    pub(super) loss: f64,
}

impl Point {
    /// `None` where no rig can be so.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let residual = engine.residual(&engine.simulate(&model.rig(engine)?));
        let squares: Vec<f64> =
            residual.chunks_exact(engine.rows()).map(|window| dot(window, window)).collect();
        let loss = loss(&squares, engine.freedom()) + model.costs();
        loss.is_finite().then_some(Point { model, residual, loss })
    }

    /// The parameters of the model with their errors, as a fit of no effect; the lines are its own.
    pub(super) fn as_refit(&self, engine: &Engine<'_>, lines: &Lines) -> Refit {
        let moved = self.model.moved();
        let mut errors = vec![f64::INFINITY; COUNT];
        let products = Products::new(&self.residual, &lines.with(&[]), engine.freedom(), engine.rows());
        let ridges: Vec<f64> = moved.iter().map(|coordinate| self.model.ridge(*coordinate)).collect();
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

/// Derivatives of a model by some coordinates; `passed` is what it shows.
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

/// Straight lines around a model: what each of its coordinates changes.
pub(super) struct Lines {
    model: Model,
    passed: Vec<ReferenceRun>,
    columns: Vec<Vec<f64>>,
}

/// A table of zeros, which changes nothing yet, and what each of its values would change.
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
    /// The lines of a model; `None` where no rig can be so.
    pub(super) fn of(engine: &Engine<'_>, model: Model) -> Option<Self> {
        let passed = engine.pass(&model.rig(engine)?);
        let columns = columns(engine, &model, &model.moved(), &passed)?;
        Some(Lines { model, passed, columns })
    }

    /// Those of the model and of some tables more.
    pub(super) fn with<'a>(&'a self, tables: &[&'a Beside]) -> Vec<&'a [f64]> {
        let more = tables.iter().flat_map(|beside| &beside.columns);
        self.columns.iter().chain(more).map(Vec::as_slice).collect()
    }

    /// The lines of one more table, all zeros; `None` where no rig can have it.
    pub(super) fn beside(&self, engine: &Engine<'_>, tied: Tied) -> Option<Beside> {
        let mut model = self.model.clone();
        model.tables.push(tied.clone());
        let moved = model.moved().split_off(self.columns.len());
        Some(Beside { tied, columns: columns(engine, &model, &moved, &self.passed)? })
    }

    /// The loss of the windows of each fold by what the other folds say of the model: what it costs is no part of it.
    pub(super) fn unseen_loss(&self, engine: &Engine<'_>, point: &Point) -> f64 {
        let columns = self.with(&[]);
        let products = Products::new(&point.residual, &columns, engine.freedom(), engine.rows());
        let moved = self.model.moved();
        let ridges: Vec<f64> = moved.iter().map(|coordinate| self.model.ridge(*coordinate)).collect();
        let from: Vec<f64> = moved.iter().map(|coordinate| self.model.off(*coordinate)).collect();
        products.unseen_loss(&(0..columns.len()).collect::<Vec<_>>(), &ridges, &from, FOLDS)
    }

    /// The loss that the lines promise of the model, `point`, with some tables more.
    pub(super) fn promised(&self, engine: &Engine<'_>, point: &Point, tables: &[&Beside]) -> f64 {
        let mut model = self.model.clone();
        model.tables.extend(tables.iter().map(|beside| beside.tied.clone()));
        let columns = self.with(tables);
        let products = Products::new(&point.residual, &columns, engine.freedom(), engine.rows());
        let ridges: Vec<f64> = model.moved().iter().map(|coordinate| model.ridge(*coordinate)).collect();
        products.fit(&(0..columns.len()).collect::<Vec<_>>(), &ridges).loss + model.costs()
    }
}

/// Parameters that a model needs beside its tables, one after the other while the loss falls by `gain`, by the straight lines of
/// all parameters and tables.
pub(super) fn needed(engine: &Engine<'_>, point: &Point, lines: &[&[f64]], gain: f64) -> [bool; COUNT] {
    let mut needed = [false; COUNT];
    let model = Model { free: [true; COUNT], ..point.model.clone() };
    let moved = model.moved();
    let products = Products::new(&point.residual, lines, engine.freedom(), engine.rows());
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

/// Moves a model until its loss falls no more.
pub(super) fn fit(engine: &Engine<'_>, start: Point, steps: usize) -> Point {
    let mut point = start;
    for _ in 0..steps {
        let Some(lines) = Lines::of(engine, point.model.clone()) else { break };
        let before = point.loss;
        point = self::steps(engine, point, &lines.with(&[]));
        if before - point.loss < CONVERGED {
            break;
        }
    }
    point
}

/// Some steps along the same straight lines, one for each coordinate that the model moves.
pub(super) fn steps(engine: &Engine<'_>, start: Point, lines: &[&[f64]]) -> Point {
    let moved = start.model.moved();
    let ridges: Vec<f64> = moved.iter().map(|coordinate| start.model.ridge(*coordinate)).collect();
    let mut products = Products::new(&start.residual, lines, engine.freedom(), engine.rows());
    let mut point = start;
    for _ in 0..ALONG {
        let Some(tried) = along(engine, &point, &moved, &products, &ridges) else { break };
        let converged = point.loss - tried.loss < CONVERGED;
        point = tried;
        if converged {
            break;
        }
        products.set_residual(&point.residual, lines, engine.rows());
    }
    point
}

/// The longest step along straight lines that is a better one.
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
