//! Numbers of the catalogue's law nearest to another form of it: the true numbers for a program that only knows the law.
//!
//! ```text
//!   minimise |M (y - y_law(z))|^2      y: readings without noise of the record with that effect alone, in its other form
//! ```
//!
//! Windows, true initial states and excluded readings are those of [`super::signature`]; the parameters are those of the
//! record, and there is no background. The fit is Gauss-Newton in the coordinates of a candidate, from the drawn numbers. It
//! ends where no shortened step reduces the squares. A number that the record hardly determines stays near the drawn one.
//!
//! The true number of another form is defined as that of the best fit. Source: White 1982, Econometrica 50(1): the limit of the
//! estimates of a misspecified model.

use crate::classes::with_parameter;
use crate::compute::{ComputeError, trajectory};
use crate::draws::Draw;
use crate::signature::{Observer, Run, dot, length};
use discrepancy::candidates::Candidate;
use model_fit::estimator::{Estimator, Iterate, JOINT, Options, Step};
use nalgebra::{DMatrix, DVector};
use plant::RigParameters;
use record_maker::{Form, Hidden, PARAMETERS, Recipe, Record, simulate};
use serde::{Deserialize, Serialize};

/// Step of the finite differences, in coordinates.
const CHANGE: f64 = 0.01;
/// Most iterations; decrease of the squares at convergence, as a share of the squared signature; and longest step of a
/// coordinate.
const STEPS: usize = 12;
const RELATIVE_TOLERANCE: f64 = 1e-7;
const LONGEST: f64 = 0.3;
/// Largest residual of an effect of the catalogue's form, as a share of its squared signature, and largest relative error of a
/// number, for the fit to count as faithful.
const FAITHFUL_LEFT: f64 = 0.05;
const FAITHFUL: f64 = 0.01;
/// Ridge as a share of a column's square.
const RIDGE: f64 = 1e-3;
/// Largest deviation of a parameter.
const MOST_OFF: f64 = 0.15;

/// The law nearest to a hidden effect of another form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NearestLaw {
    /// One for each key of the sheet, in its unit.
    pub(crate) numbers: Vec<f64>,
    /// Residual squares of the fit over the form's squared signature.
    pub(crate) left_share: f64,
}

/// The nearest law of one hidden effect of a draw; `None` where the same fit does not recover an effect of the catalogue's
/// form, as between linked rods. A number that it does not recover there is the drawn one.
pub(crate) fn nearest_law(draw: &Draw, hidden: &Hidden) -> Result<Option<NearestLaw>, ComputeError> {
    let fitted = |form| fitted(&record(draw, hidden, form)?, hidden);
    let catalogue = fitted(Form::Catalogue)?;
    if catalogue.left_share > FAITHFUL_LEFT {
        return Ok(None);
    }
    let other = fitted(draw.recipe.form)?;
    let found = |(recovered, drawn): (&f64, &f64)| (recovered / drawn - 1.0).abs() < FAITHFUL;
    let numbers = catalogue.numbers.iter().zip(&hidden.numbers).zip(&other.numbers);
    let numbers =
        numbers.map(|((recovered, drawn), other)| if found((recovered, drawn)) { *other } else { *drawn });
    Ok(Some(NearestLaw { numbers: numbers.collect(), ..other }))
}

/// A record of a hidden effect alone, in one of its forms.
fn record(draw: &Draw, hidden: &Hidden, form: Form) -> Result<Record, ComputeError> {
    let recipe = Recipe { hidden: vec![hidden.clone()], background: None, form, ..draw.recipe.clone() };
    simulate(&recipe, &RigParameters::baseline())
        .map_err(|error| ComputeError::Make { number: draw.number, error })
}

/// The catalogue's law of a hidden effect fitted to a record.
pub(crate) fn fitted(made: &Record, hidden: &Hidden) -> Result<NearestLaw, ComputeError> {
    let mut wrong = made.recipe.wrong_parameters.iter();
    let baseline = RigParameters::baseline();
    let rig = wrong.try_fold(baseline, |rig, (name, factor)| with_parameter(&rig, name, *factor))?;
    let observer = Observer::new(trajectory(made, &rig));
    let observed = observer.observed(made);
    let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
    let candidate = Candidate::in_rig(&rig, sheet, hidden.place);
    let start = (0..sheet.keys.len()).map(|key| candidate.coordinate(key, hidden.numbers[key])).collect();
    let whole = length(&observer.between(&observed, &observer.baseline)).powi(2);
    let fit = Fit { observer: &observer, observed: &observed, candidate, rig: &rig, priors: &[] };
    let nearest = fit.nearest(fit.at(start).expect("a record was made with these numbers"), whole);
    let numbers = candidate.effect_parameters(&nearest.coordinates);
    Ok(NearestLaw { numbers, left_share: nearest.squares / whole.max(1e-12) })
}

/// The fit of a law together with the first parameters of the baseline.
pub(crate) struct Fit<'a> {
    pub(crate) observer: &'a Observer,
    pub(crate) observed: &'a Run,
    pub(crate) candidate: Candidate,
    pub(crate) rig: &'a RigParameters,
    /// Precision of the deviation of each of [`PARAMETERS`] that is fitted, over that of the whitened readings.
    pub(crate) priors: &'a [f64],
}

/// A point of the fit: coordinates of the law, then deviations of the parameters.
pub(crate) struct FitPoint {
    pub(crate) coordinates: Vec<f64>,
    pub(crate) run: Run,
    residual: Vec<f64>,
    /// Weighted squares of the deviations by their priors included.
    squares: f64,
}

impl Iterate for FitPoint {
    fn loss(&self) -> f64 {
        self.squares
    }

    fn is_at_bound(&self) -> bool {
        false
    }
}

impl Fit<'_> {
    /// The rig at some coordinates; `None` where it is refused.
    pub(crate) fn rig_at(&self, coordinates: &[f64]) -> Option<RigParameters> {
        let (effect, deviations) = coordinates.split_at(self.keys());
        let mut all = PARAMETERS.iter().zip(deviations);
        let rig = all
            .try_fold(self.rig.clone(), |rig, (name, deviation)| with_parameter(&rig, name, 1.0 + deviation));
        self.candidate.rig(&rig.ok()?, effect).ok()
    }

    fn keys(&self) -> usize {
        self.candidate.sheet.keys.len()
    }

    fn simulated(&self, coordinates: &[f64]) -> Option<Run> {
        Some(self.observer.readings(&self.rig_at(coordinates)?))
    }

    /// The point at some coordinates; `None` where the rig is refused.
    pub(crate) fn at(&self, coordinates: Vec<f64>) -> Option<FitPoint> {
        let run = self.simulated(&coordinates)?;
        let residual = self.observer.between(self.observed, &run);
        let off = coordinates[self.keys()..].iter().zip(self.priors);
        let squares = length(&residual).powi(2) + off.map(|(off, prior)| prior * off * off).sum::<f64>();
        Some(FitPoint { coordinates, run, residual, squares })
    }

    fn bounds(&self, at: usize) -> [f64; 2] {
        if at < self.keys() { self.candidate.fit_bounds(at) } else { [-MOST_OFF, MOST_OFF] }
    }

    /// Least squares from a starting point; converged when the decrease is below a share of `whole`.
    pub(crate) fn nearest(&self, start: FitPoint, whole: f64) -> FitPoint {
        let options = Options { steps: STEPS, absolute_tolerance: RELATIVE_TOLERANCE * whole, ..JOINT };
        let (fitted, _) = Estimator::new(options).descend(start, |estimator, point| {
            let Some(step) = self.step(&point.coordinates, &point.run, &point.residual) else {
                return Step::Impossible;
            };
            estimator.backtrack(point, 0.0, options.fractions, |fraction| {
                let moved = point.coordinates.iter().zip(step.iter()).enumerate();
                self.at(moved
                    .map(|(key, (from, step))| {
                        let [least, most] = self.bounds(key);
                        (from + fraction * step.clamp(-LONGEST, LONGEST)).clamp(least, most)
                    })
                    .collect())
            })
        });
        fitted
    }

    fn step(&self, from: &[f64], run: &Run, residual: &[f64]) -> Option<DVector<f64>> {
        let columns: Vec<Vec<f64>> = (0..from.len())
            .map(|key| {
                let [_, most] = self.bounds(key);
                let change = if from[key] + CHANGE > most { -CHANGE } else { CHANGE };
                let mut moved = from.to_vec();
                moved[key] += change;
                let mut column = self.observer.between(&self.simulated(&moved)?, run);
                column.iter_mut().for_each(|value| *value /= change);
                Some(column)
            })
            .collect::<Option<_>>()?;
        let count = columns.len();
        let mut matrix = DMatrix::from_fn(count, count, |row, column| dot(&columns[row], &columns[column]));
        let largest = (0..count).map(|at| matrix[(at, at)]).fold(0.0, f64::max);
        (0..count).for_each(|at| matrix[(at, at)] += RIDGE * matrix[(at, at)] + 1e-9 * largest);
        let mut right = DVector::from_iterator(count, columns.iter().map(|column| dot(column, residual)));
        for (prior, at) in self.priors.iter().zip(self.keys()..) {
            matrix[(at, at)] += prior;
            right[at] -= prior * from[at];
        }
        matrix.cholesky().map(|factor| factor.solve(&right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::Shape;
    use crate::folder::Plan;

    #[test]
    fn the_law_of_its_own_form_is_found_again_and_another_form_has_other_numbers() {
        let draws = Plan::new(5, Shape { each: 1, ..Shape::SMALL }).draws();
        let draw = draws.iter().find(|draw| draw.recipe.hidden[0].name == "valve-characteristic").unwrap();
        let hidden = &draw.recipe.hidden[0];
        let [catalogue, other] = [Form::Catalogue, Form::Near].map(|form| {
            let mut record = record(draw, hidden, form).unwrap();
            record.rows.truncate(2000);
            fitted(&record, hidden).unwrap()
        });
        let drawn = hidden.numbers[0];
        assert!(
            catalogue.left_share < 0.01 && (catalogue.numbers[0] / drawn - 1.0).abs() < FAITHFUL,
            "{catalogue:?} {drawn}"
        );
        assert!(other.left_share > catalogue.left_share && other.left_share < 0.4, "{catalogue:?} {other:?}");
        assert!((other.numbers[0] / drawn - 1.0).abs() > 3.0 * FAITHFUL, "{other:?} {drawn}");
    }
}
