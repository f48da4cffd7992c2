//! Least squares by multiple shooting: effects of the catalogue and numbers of the rig file, in the simulator.
//!
//! ```text
//!   minimise |r(z)|^2        r whitened residual of all windows, each with start states of its own (projected out)
//! ```
//!
//! Plain least squares: no priors, no robust loss, no weights of windows. Source: Bock, Recent advances in parameter
//! identification techniques for O.D.E., 1983.

use crate::selection::Problem;
use discrepancy::candidates::Candidate;
use discrepancy::engine::Engine;
use discrepancy::parameters::{COUNT, with_factors};
use model_fit::estimator::{Estimator, Iterate, Options, Step};
use nalgebra::{DMatrix, DVector};
use plant::RigParameters;

/// Gauss-Newton of a model. The loss is a chi2 of some ten thousand numbers.
const OPTIONS: Options = Options {
    steps: 8,
    absolute_tolerance: 1.0,
    relative_tolerance: 0.0,
    fractions: &[1.0, 0.4, 0.16, 0.06],
};
/// The same of one that is compared with others.
const ROUGH: Options = Options { steps: 3, ..OPTIONS };
/// Finite differences: of a coordinate, of a factor.
const CHANGE: f64 = 0.03;
const FACTOR_CHANGE: f64 = 0.01;
/// Largest deviation of a parameter from the rig file.
const MOST_OFF: f64 = 0.3;
/// Amplitudes that a candidate is simulated at, in its dimensionless coordinate: where it vanishes continuously with it, and
/// where it does not.
const SMALL: [f64; 1] = [0.25];
const LARGE: [f64; 2] = [0.6, 0.85];
/// Smallest amplitude that a fit starts at.
const LEAST_START: f64 = 0.05;

/// An effect at a place, or a number of the rig file.
#[derive(Clone, Debug)]
pub(crate) enum Term {
    Effect { candidate: Candidate, coordinates: Vec<f64> },
    Parameter { at: usize, factor: f64 },
}

impl Term {
    /// Dimensionless numbers, with their ranges.
    fn numbers(&self) -> Vec<(f64, [f64; 2])> {
        match self {
            Term::Effect { candidate, coordinates } => {
                coordinates.iter().enumerate().map(|(key, z)| (*z, candidate.fit_bounds(key))).collect()
            }
            Term::Parameter { factor, .. } => vec![(*factor, [1.0 - MOST_OFF, 1.0 + MOST_OFF])],
        }
    }

    fn set(&mut self, key: usize, number: f64) {
        match self {
            Term::Effect { coordinates, .. } => coordinates[key] = number,
            Term::Parameter { factor, .. } => *factor = number,
        }
    }

    fn change(&self) -> f64 {
        match self {
            Term::Effect { .. } => CHANGE,
            Term::Parameter { .. } => FACTOR_CHANGE,
        }
    }
}

/// Terms that were fitted to the record by multiple shooting.
pub(crate) struct Fit {
    pub(crate) terms: Vec<Term>,
    residual: DVector<f64>,
    /// Sum of the squares of `residual`.
    squares: f64,
    /// Sensitivities to all numbers of the terms, one column each; none of a rough fit.
    columns: DMatrix<f64>,
}

impl Iterate for Fit {
    fn loss(&self) -> f64 {
        self.squares
    }

    fn is_at_bound(&self) -> bool {
        self.terms.iter().flat_map(Term::numbers).any(|(number, range)| range.contains(&number))
    }
}

impl Fit {
    /// Standard errors of all numbers of the terms, in their order, with the variance that the fit leaves; infinite where the
    /// records do not bound them.
    pub(crate) fn standard_errors(&self, count: f64) -> Vec<f64> {
        let variance = self.squares / count;
        match self.columns.tr_mul(&self.columns).try_inverse() {
            Some(inverse) => {
                inverse.diagonal().iter().map(|entry| (entry.max(0.0) * variance).sqrt()).collect()
            }
            None => vec![f64::INFINITY; self.columns.ncols()],
        }
    }
}

/// What is chosen from: records, and all candidates.
pub(crate) struct RigProblem<'a> {
    engine: &'a Engine<'a>,
    candidates: Vec<Candidate>,
}

impl<'a> RigProblem<'a> {
    pub(crate) fn new(engine: &'a Engine<'a>, candidates: Vec<Candidate>) -> Self {
        RigProblem { engine, candidates }
    }

    fn factors(terms: &[Term]) -> [f64; COUNT] {
        let mut factors = [1.0; COUNT];
        for term in terms {
            if let Term::Parameter { at, factor } = term {
                factors[*at] = *factor;
            }
        }
        factors
    }

    /// The rig file's rig with effects, without changed numbers.
    fn with_effects(&self, terms: &[Term]) -> Option<RigParameters> {
        add(self.engine.rig.clone(), terms)
    }

    fn rig(&self, terms: &[Term]) -> Option<RigParameters> {
        add(with_factors(&self.engine.rig, &Self::factors(terms)), terms)
    }

    fn evaluate(&self, terms: Vec<Term>) -> Option<Fit> {
        let simulated = self.engine.simulate(&self.rig(&terms)?);
        let residual = DVector::from_vec(self.engine.residual(&simulated));
        let squares = residual.norm_squared();
        let columns = DMatrix::zeros(residual.len(), 0);
        squares.is_finite().then_some(Fit { terms, residual, squares, columns })
    }

    /// Sensitivities at a fit by one-sided differences that stay inside the ranges.
    fn columns(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        let mut columns = Vec::new();
        let coarse = self.engine.simulate_coarsely(&self.rig(&fit.terms)?);
        for (at, term) in fit.terms.iter().enumerate() {
            for (key, (number, [_, most])) in term.numbers().into_iter().enumerate() {
                let change = if number + term.change() > most { -term.change() } else { term.change() };
                let mut terms = fit.terms.clone();
                terms[at].set(key, number + change);
                let simulated = self.engine.simulate_coarsely(&self.rig(&terms)?);
                let column = DVector::from_vec(self.engine.difference(&simulated, &coarse));
                columns.push(column / change);
            }
        }
        Some(if columns.is_empty() {
            DMatrix::zeros(fit.residual.len(), 0)
        } else {
            DMatrix::from_columns(&columns)
        })
    }

    /// Gauss-Newton step; a small ridge where the records do not bound a direction.
    fn step(columns: &DMatrix<f64>, residual: &DVector<f64>) -> Option<DVector<f64>> {
        let mut gram = columns.tr_mul(columns);
        for at in 0..gram.nrows() {
            gram[(at, at)] = gram[(at, at)].mul_add(1.0 + 1e-9, 1e-6);
        }
        Some(gram.cholesky()?.solve(&columns.tr_mul(residual)))
    }

    /// Gauss-Newton from what the terms bring.
    fn descend(&self, terms: &[Term], options: Options) -> Option<Fit> {
        let first = self.evaluate(terms.to_vec())?;
        let (fit, _) = Estimator::new(options).descend(first, |estimator, iterate| {
            let Some(columns) = self.columns(iterate) else { return Step::Impossible };
            let Some(step) = Self::step(&columns, &iterate.residual) else { return Step::Impossible };
            let predicted_reduction =
                2.0 * step.dot(&columns.tr_mul(&iterate.residual)) - (&columns * &step).norm_squared();
            estimator.backtrack(iterate, predicted_reduction, options.fractions, |share| {
                let mut terms = iterate.terms.clone();
                let mut changes = step.iter();
                for term in &mut terms {
                    for (key, (number, [least, most])) in term.numbers().into_iter().enumerate() {
                        let change = share * changes.next().expect("one for each number");
                        term.set(key, (number + change).clamp(least, most));
                    }
                }
                self.evaluate(terms)
            })
        });
        Some(fit)
    }

    /// Where a candidate is simulated for its first sensitivity: its first number, or another that is no shape.
    fn starts(candidate: &Candidate) -> Vec<(usize, f64)> {
        let amplitudes: &[f64] = if candidate.vanishes_at_zero_amplitude() { &SMALL } else { &LARGE };
        let mut starts: Vec<(usize, f64)> = amplitudes.iter().map(|amplitude| (0, *amplitude)).collect();
        if candidate.is_two_sided() {
            starts.extend(amplitudes.iter().map(|amplitude| (0, -amplitude)));
        }
        let others =
            (1..candidate.sheet.keys.len()).filter(|key| candidate.sheet.keys[*key].neutral.is_some());
        starts.extend(others.map(|key| (key, 0.4)));
        starts.retain(|(key, z)| {
            let [least, most] = candidate.fit_bounds(*key);
            (least..=most).contains(z)
        });
        starts
    }

    /// The amplitude of a column that a linear fit beside the columns of a model takes, and the squares that it removes.
    fn linear(at: &Fit, column: &[f64], range: [f64; 2]) -> Option<(f64, f64)> {
        let mut column = DVector::from_column_slice(column);
        if at.columns.ncols() > 0 {
            column -= &at.columns * Self::step(&at.columns, &column)?;
        }
        let (slope, curvature) = (column.dot(&at.residual), column.norm_squared());
        let amplitude = (slope / curvature).clamp(range[0], range[1]);
        (curvature > 0.0).then_some((amplitude, 2.0 * amplitude * slope - amplitude * amplitude * curvature))
    }
}

fn add(rig: RigParameters, terms: &[Term]) -> Option<RigParameters> {
    terms.iter().try_fold(rig, |rig, term| match term {
        Term::Effect { candidate, coordinates } => candidate.rig(&rig, coordinates).ok(),
        Term::Parameter { .. } => Some(rig),
    })
}

impl Problem for RigProblem<'_> {
    type Term = Term;
    type Fit = Fit;

    fn count(&self) -> f64 {
        self.engine.scaled_dof.iter().sum()
    }

    fn fit(&self, terms: &[Term]) -> Option<Fit> {
        let mut fit = self.descend(terms, OPTIONS)?;
        fit.columns = self.columns(&fit)?;
        Some(fit)
    }

    fn fit_roughly(&self, terms: &[Term]) -> Option<Fit> {
        self.descend(terms, ROUGH)
    }

    fn predicted_gains(&self, at: &Fit) -> Vec<(Term, f64)> {
        let (Some(rig), Some(plain)) = (self.rig(&at.terms), self.with_effects(&at.terms)) else {
            return Vec::new();
        };
        let coarse = self.engine.simulate_coarsely(&rig);
        let mut gains = Vec::new();
        for candidate in &self.candidates {
            for (key, z) in Self::starts(candidate) {
                let mut coordinates = candidate.origin();
                coordinates[key] = z;
                let Ok(rig) = candidate.rig(&rig, &coordinates) else { continue };
                let mut column = self.engine.difference(&self.engine.simulate_coarsely(&rig), &coarse);
                column.iter_mut().for_each(|value| *value /= z);
                let [least, most] = candidate.fit_bounds(key);
                // Of one sign: the other one is a start of its own.
                let range = if z > 0.0 { [LEAST_START, most] } else { [least, -LEAST_START] };
                let Some((amplitude, gain)) = Self::linear(at, &column, range) else { continue };
                coordinates[key] = if candidate.vanishes_at_zero_amplitude() { amplitude } else { z };
                gains.push((Term::Effect { candidate: *candidate, coordinates }, gain));
            }
        }
        let factors = Self::factors(&at.terms);
        for (parameter, column) in self.engine.parameter_columns(&plain, &factors).iter().enumerate() {
            if let Some((change, gain)) = Self::linear(at, column, [-MOST_OFF, MOST_OFF]) {
                gains.push((Term::Parameter { at: parameter, factor: 1.0 + change }, gain));
            }
        }
        gains.retain(|(term, _)| !at.terms.iter().any(|there| Self::is_same(there, term)));
        gains
    }

    fn squares(fit: &Fit) -> f64 {
        fit.squares
    }

    fn terms(fit: &Fit) -> &[Term] {
        &fit.terms
    }

    fn numbers(term: &Term) -> usize {
        term.numbers().len()
    }

    fn is_same(one: &Term, other: &Term) -> bool {
        match (one, other) {
            (Term::Effect { candidate: one, .. }, Term::Effect { candidate: other, .. }) => {
                one.sheet.name == other.sheet.name && one.place == other.place
            }
            (Term::Parameter { at: one, .. }, Term::Parameter { at: other, .. }) => one == other,
            _ => false,
        }
    }
}
