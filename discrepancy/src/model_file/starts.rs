//! From where a fit starts: an output error has many minima, and the lowest that several starts lead to is taken.
//!
//! | starts | how many |
//! |---|---|
//! | values of the file, those of the smaller fit, each value of the newest suspect | at most 12 |
//! | points of a Halton sequence around them, those with the least loss | `kept` of `[fit] starts` |
//!
//! A point is spread over a fifth to five times each number, as far as its range allows; a number that may change its sign over
//! five times it either way, and one whose value is 0 over its range. The sequence is the same in each run, and training records
//! alone say which of its points are kept.
//!
//! Source: Halton 1960, Numerische Mathematik 2 (bases are the primes).

use super::fit::{Fitting, OPTIONS, Point, What};
use crate::estimator::{Convergence, Outcome};
use model::Failure;

/// Most starts that values of the file make.
const MOST: usize = 12;
/// Points of the sequence that are kept.
const KEPT: usize = 3;
/// Steps from each start, and how many of those that have come lowest go on to the end.
const SHORT: usize = 6;
const FINISHED: usize = 2;
/// How far a number is spread, times or over its value.
const FACTOR: f64 = 5.0;
/// Bases of the sequence; numbers beyond them keep their values.
const PRIMES: [u32; 20] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71];

/// Starts of a fit beside what a smaller model came to.
pub(crate) fn starts(
    fitting: &Fitting<'_>,
    suspects: &[usize],
    from: Option<(&Fitting<'_>, &Point)>,
) -> Vec<Vec<f64>> {
    let known = |what: What| {
        let (smaller, point) = from?;
        let place = smaller.unknowns.iter().position(|unknown| unknown.what == what)?;
        Some(point.values_si[place])
    };
    let first: Vec<f64> =
        fitting.unknowns.iter().map(|unknown| known(unknown.what).unwrap_or(unknown.start_si)).collect();
    if suspects.is_empty() && from.is_some() {
        return vec![first];
    }
    let mut all = values_of_newest(fitting, suspects, first.clone());
    if fitting.model.starts == 0 {
        return all;
    }
    let file = fitting.start();
    let spread = spread(fitting, [&file, &first]);
    if !all.contains(&file) {
        all.push(file);
    }
    all.extend(spread);
    all
}

impl Fitting<'_> {
    /// The best of the fits from several starts: a few steps from each, and all steps from those that have come lowest.
    pub(crate) fn fit_from(&self, starts: Vec<Vec<f64>>) -> Result<(Point, Convergence), Failure> {
        let mut why = None;
        let mut begun = Vec::new();
        for start in starts {
            match self.fit(start, SHORT) {
                Ok(fit) => begun.push(fit),
                Err(failure) => why = Some(failure),
            }
        }
        begun.sort_by(|(one, _), (other, _)| one.loss.total_cmp(&other.loss));
        // Starts that have come to the same minimum go on once.
        begun.dedup_by(|(one, _), (other, _)| one.loss - other.loss < OPTIONS.converged);
        let mut best: Option<(Point, Convergence)> = None;
        for (point, convergence) in begun.into_iter().take(FINISHED) {
            let ended = match convergence.outcome {
                Outcome::StepLimit => self
                    .fit(point.values_si, OPTIONS.steps)
                    .map(|(end, more)| (end, convergence.then(more)))?,
                _ => (point, convergence),
            };
            if best.as_ref().is_none_or(|(best, _)| ended.0.loss < best.loss) {
                best = Some(ended);
            }
        }
        best.ok_or_else(|| why.expect("there is one start at least"))
    }
}

/// Every start of the newest suspect beside the other numbers.
fn values_of_newest(fitting: &Fitting<'_>, suspects: &[usize], first: Vec<f64>) -> Vec<Vec<f64>> {
    let mut all = vec![first];
    let Some(newest) = suspects.last() else { return all };
    for (index, parameter) in
        fitting.model.parameters.iter().enumerate().filter(|(_, one)| one.suspect == Some(*newest))
    {
        let others = parameter.values_si[1..].iter().flat_map(|value| {
            all.iter().map(|start| {
                let moved = fitting.unknowns.iter().zip(start).map(|(unknown, before)| match unknown.what {
                    What::Shared(of) | What::OfRecord(of, _) if of == index => *value,
                    _ => *before,
                });
                moved.collect()
            })
        });
        let others: Vec<Vec<f64>> = others.collect();
        all.extend(others);
        all.truncate(MOST);
    }
    all
}

/// The best points of the sequence, around each centre in turn.
fn spread(fitting: &Fitting<'_>, centres: [&Vec<f64>; 2]) -> Vec<Vec<f64>> {
    let points = (1..=fitting.model.starts).map(|number| {
        let centre = centres[number % centres.len()];
        let values = fitting.unknowns.iter().zip(centre).enumerate().map(|(place, (unknown, value))| {
            let share = PRIMES.get(place).map_or(0.5, |base| radical_inverse(number as u32, *base));
            spread_over(*value, unknown.range_si, 2.0 * share - 1.0)
        });
        values.collect::<Vec<f64>>()
    });
    let mut tried: Vec<Point> = points.filter_map(|values| fitting.at(values).ok()).collect();
    tried.retain(|point| point.loss.is_finite());
    tried.sort_by(|one, other| one.loss.total_cmp(&other.loss));
    tried.into_iter().take(KEPT).map(|point| point.values_si).collect()
}

/// A value moved by a share of -1 to 1 of what is allowed.
fn spread_over(value: f64, [least, most]: [f64; 2], share: f64) -> f64 {
    let moved = if value == 0.0 {
        let end = if share < 0.0 { least } else { most };
        if end.is_finite() { share.abs() * end } else { 0.0 }
    } else if least < 0.0 && most > 0.0 {
        value + FACTOR * share * value.abs()
    } else {
        value * libm::pow(FACTOR, share)
    };
    moved.clamp(least, most)
}

/// The digits of a number in a base, mirrored at the point.
fn radical_inverse(mut number: u32, base: u32) -> f64 {
    let (mut sum, mut weight) = (0.0, 1.0);
    while number > 0 {
        weight /= f64::from(base);
        sum += weight * f64::from(number % base);
        number /= base;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_that_of_halton() {
        let of = |base: u32| [1, 2, 3, 4, 5].map(|number| radical_inverse(number, base));
        assert_eq!(of(2), [0.5, 0.25, 0.75, 0.125, 0.625]);
        for (computed, expected) in of(3).into_iter().zip([1.0, 2.0, 1.0 / 3.0, 4.0 / 3.0, 7.0 / 3.0]) {
            assert!((computed - expected / 3.0).abs() < 1e-15, "{computed} is not {expected} / 3");
        }
    }

    #[test]
    fn a_number_is_spread_within_its_range() {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        for (value, range, share, expected) in [
            (2.0, [0.0, 100.0], 1.0, 10.0),
            (2.0, [0.0, 100.0], -1.0, 0.4),
            (2.0, [1.0, 4.0], 1.0, 4.0),
            (2.0, free, -1.0, -8.0),
            (0.0, [-3.0, 6.0], 0.5, 3.0),
            (0.0, [-3.0, 6.0], -0.5, -1.5),
            (0.0, free, 1.0, 0.0),
        ] {
            let moved = spread_over(value, range, share);
            assert!((moved - expected).abs() < 1e-12, "{value} within {range:?}: {moved}, not {expected}");
        }
    }
}
