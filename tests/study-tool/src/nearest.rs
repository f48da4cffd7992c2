//! The numbers of the catalogue's law that come nearest to another form of it: what a program can be right about.
//!
//! ```text
//!   minimise |M (y - y_law(z))|^2      y: readings without noise of the record with that effect alone, in its other form
//! ```
//!
//! Windows, their true starts, and what does not count are those of [`super::signature`]; parameters are those of the record, and
//! there is no background. The fit is Gauss-Newton in the coordinates of a candidate, from the drawn numbers, and ends where no
//! shortened step falls. A number that the record hardly shows stays near the drawn one.
//!
//! Source: issue 32 (the true number of another form is that of the best fit). White 1982, Econometrica 50(1): what the fit of a
//! misspecified model converges to.

use crate::classes::with_parameter;
use crate::compute::{ComputeError, trajectory};
use crate::draws::Draw;
use crate::signature::{Observer, Run, length};
use discrepancy::candidates::Candidate;
use nalgebra::{DMatrix, DVector};
use plant::RigParameters;
use record_maker::{Hidden, Recipe, Record, simulate};
use serde::{Deserialize, Serialize};

/// Step of finite differences, as a coordinate.
const CHANGE: f64 = 0.01;
/// Most steps, and the relative fall of the squares that ends the fit.
const STEPS: usize = 12;
const CONVERGED: f64 = 1e-4;
/// Fractions of a step, and its largest coordinate.
const FRACTIONS: [f64; 5] = [1.0, 0.4, 0.16, 0.064, 0.0256];
const LONGEST: f64 = 0.3;
/// What the fit may leave of an effect of the catalogue's own form, as a share of its squared signature, and by which share a
/// number may be off there.
const FAITHFUL_LEFT: f64 = 0.05;
const FAITHFUL: f64 = 0.01;
/// Ridge as a share of a column's square.
const RIDGE: f64 = 1e-3;

/// The law nearest to a hidden effect of another form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NearestLaw {
    /// One for each key of the sheet, in its unit.
    pub numbers: Vec<f64>,
    /// Share of the form's squared signature that it leaves.
    pub left_share: f64,
}

/// The nearest law of one hidden effect of a draw; `None` where the same fit does not find an effect of the catalogue's own form
/// again, as between linked rods. A number that it does not find there is the drawn one.
///
/// # Errors
/// [`ComputeError`] when a record cannot be made.
pub fn nearest_law(draw: &Draw, hidden: &Hidden) -> Result<Option<NearestLaw>, ComputeError> {
    let fitted = |foreign_form| fitted(&record(draw, hidden, foreign_form)?, hidden);
    let own = fitted(false)?;
    if own.left_share > FAITHFUL_LEFT {
        return Ok(None);
    }
    let other = fitted(true)?;
    let found = |(own, drawn): (&f64, &f64)| (own / drawn - 1.0).abs() < FAITHFUL;
    let numbers = own.numbers.iter().zip(&hidden.numbers).zip(&other.numbers);
    let numbers = numbers.map(|((own, drawn), other)| if found((own, drawn)) { *other } else { *drawn });
    Ok(Some(NearestLaw { numbers: numbers.collect(), ..other }))
}

/// A record of a hidden effect alone, in one of its forms.
fn record(draw: &Draw, hidden: &Hidden, foreign_form: bool) -> Result<Record, ComputeError> {
    let recipe =
        Recipe { hidden: vec![hidden.clone()], background: None, foreign_form, ..draw.recipe.clone() };
    simulate(&recipe, &RigParameters::baseline())
        .map_err(|error| ComputeError::Make { number: draw.number, error })
}

/// The catalogue's law of a hidden effect fitted to a record.
fn fitted(made: &Record, hidden: &Hidden) -> Result<NearestLaw, ComputeError> {
    let mut wrong = made.recipe.wrong_parameters.iter();
    let baseline = RigParameters::baseline();
    let rig = wrong.try_fold(baseline, |rig, (name, factor)| with_parameter(&rig, name, *factor))?;
    let observer = Observer::new(trajectory(made, &rig));
    let observed = observer.observed(made);
    let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
    let candidate = Candidate::beside(&rig, sheet, hidden.place);
    let start = (0..sheet.keys.len()).map(|key| candidate.coordinate(key, hidden.numbers[key])).collect();
    let whole = length(&observer.between(&observed, observer.baseline())).powi(2);
    let fit = Fit { observer: &observer, observed: &observed, candidate, rig: &rig };
    let (coordinates, left) = fit.nearest(start);
    Ok(NearestLaw { numbers: candidate.effect_parameters(&coordinates), left_share: left / whole.max(1e-12) })
}

struct Fit<'a> {
    observer: &'a Observer,
    observed: &'a Run,
    candidate: Candidate,
    rig: &'a RigParameters,
}

impl Fit<'_> {
    fn simulated(&self, coordinates: &[f64]) -> Option<Run> {
        Some(self.observer.readings(&self.candidate.rig(self.rig, coordinates).ok()?))
    }

    /// The coordinates with the least squares, and these.
    fn nearest(&self, start: Vec<f64>) -> (Vec<f64>, f64) {
        let Some(mut run) = self.simulated(&start) else { return (start, f64::INFINITY) };
        let mut best = start;
        let mut residual = self.observer.between(self.observed, &run);
        let mut squares = length(&residual).powi(2);
        for _ in 0..STEPS {
            let Some(step) = self.step(&best, &run, &residual) else { break };
            let shorter = FRACTIONS.iter().find_map(|fraction| {
                let tried: Vec<f64> = best
                    .iter()
                    .zip(step.iter())
                    .enumerate()
                    .map(|(key, (from, step))| {
                        let [least, most] = self.candidate.fit_bounds(key);
                        (from + fraction * step.clamp(-LONGEST, LONGEST)).clamp(least, most)
                    })
                    .collect();
                let run = self.simulated(&tried)?;
                let residual = self.observer.between(self.observed, &run);
                let fewer = length(&residual).powi(2);
                (fewer < squares).then_some((tried, run, residual, fewer))
            });
            let Some(next) = shorter else { break };
            let converged = squares - next.3 < CONVERGED * squares;
            (best, run, residual, squares) = next;
            if converged {
                break;
            }
        }
        (best, squares)
    }

    fn step(&self, from: &[f64], run: &Run, residual: &[f64]) -> Option<DVector<f64>> {
        let columns: Vec<Vec<f64>> = (0..from.len())
            .map(|key| {
                let [_, most] = self.candidate.fit_bounds(key);
                let change = if from[key] + CHANGE > most { -CHANGE } else { CHANGE };
                let mut moved = from.to_vec();
                moved[key] += change;
                let mut column = self.observer.between(&self.simulated(&moved)?, run);
                column.iter_mut().for_each(|value| *value /= change);
                Some(column)
            })
            .collect::<Option<_>>()?;
        let dot = |left: &[f64], right: &[f64]| left.iter().zip(right).map(|(a, b)| a * b).sum::<f64>();
        let count = columns.len();
        let mut matrix = DMatrix::from_fn(count, count, |row, column| dot(&columns[row], &columns[column]));
        let largest = (0..count).map(|at| matrix[(at, at)]).fold(0.0, f64::max);
        (0..count).for_each(|at| matrix[(at, at)] += RIDGE * matrix[(at, at)] + 1e-9 * largest);
        let right = DVector::from_iterator(count, columns.iter().map(|column| dot(column, residual)));
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
        let [own, other] = [false, true].map(|foreign_form| {
            let mut record = record(draw, hidden, foreign_form).unwrap();
            record.rows.truncate(2000);
            fitted(&record, hidden).unwrap()
        });
        let drawn = hidden.numbers[0];
        assert!(own.left_share < 0.01 && (own.numbers[0] / drawn - 1.0).abs() < FAITHFUL, "{own:?} {drawn}");
        assert!(other.left_share > own.left_share && other.left_share < 0.4, "{own:?} {other:?}");
        assert!((other.numbers[0] / drawn - 1.0).abs() > 3.0 * FAITHFUL, "{other:?} {drawn}");
    }
}
