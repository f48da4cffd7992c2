//! Starting points of a fit: an output error has many minima, and the lowest that several points lead to is taken.
//!
//! | starting points | how many |
//! |---|---|
//! | values of the file, those of the smaller fit, each value of the newest suspect | at most 12 |
//! | numbers of the newest suspect over their ranges, all others as in the smaller fit | 4 to 24, by the length of the records |
//! | the newest suspect without effect: a number at 0 or an end of its range, where the loss is the smaller fit's | at most 1 |
//! | points of a Halton sequence around them, those with the least loss | three of `[fit] starts` |
//!
//! A point is spread over a fifth to five times each number, as far as its range allows; a number that may change its sign over
//! five times it either way, and one whose value is 0 over its range. A suspect's own number goes over its whole range, on a
//! logarithmic scale where that has one sign. The sequence is the same in each run, and training records
//! alone say which of its points are kept.
//!
//! Of the first two rows six go on beside the first value: those with the largest fall of the squares, were what the suspect does
//! there taken times the best share. All points go two steps, the best six four more, and the best two of these to the end
//! [Jamieson, Talwalkar 2016, AISTATS: successive halving].
//!
//! Source: Halton 1960, Numerische Mathematik 2 (bases are the primes).

use super::fit::{Fitting, OPTIONS, Point, UnknownId};
use crate::estimator::{Convergence, Outcome};
use crate::structure::LinearisedFit;
use model::Failure;
use nalgebra::DVector;

/// Most starting points that values of the file make.
const MOST: usize = 12;
/// Rows over the points of a suspect's own numbers, and the fewest and most of these: a fit takes some seconds on any record.
const ROWS_TIMES_POINTS: usize = 14_400;
const POINTS: [usize; 2] = [4, 24];
/// Of a suspect's values and points those that are fitted beside the first, and the cosine of what two do that are one point.
const PROMISING: usize = 6;
const SAME_DIRECTION: f64 = 0.999;
/// Points of the sequence that are kept.
const KEPT: usize = 3;
/// Steps of each round, and how many of those that have come lowest go on.
const ROUNDS: [(usize, usize); 2] = [(2, 6), (4, 2)];
/// How far a number is spread, times or over its value.
const FACTOR: f64 = 5.0;
/// How far below its value a number is spread that may be 0, and above it one without an end.
const BELOW: f64 = 20.0;
/// Bases of the sequence; numbers beyond them keep their values.
const PRIMES: [u32; 20] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71];

/// Starting points of a fit beside what a smaller model came to.
pub(crate) fn starts(
    fitting: &Fitting<'_>,
    suspects: &[usize],
    from: Option<(&Fitting<'_>, &Point)>,
) -> Vec<Vec<f64>> {
    let first = from.map_or_else(|| fitting.start(), |from| values_from(fitting, from));
    if suspects.is_empty() && from.is_some() {
        return vec![first];
    }
    if fitting.model.starts == 0 {
        return promising(fitting, values_of_newest(fitting, suspects, first), from);
    }
    let mut all = promising(fitting, of_newest_from(fitting, suspects, &first), from);
    if let (Some(newest), Some((_, smaller))) = (suspects.last(), from) {
        all.extend(without_effect(fitting, *newest, &first, smaller.loss));
    }
    let file = fitting.start();
    let spread = spread(fitting, [&file, &first]);
    if !all.contains(&file) {
        all.push(file);
    }
    all.extend(spread);
    all
}

/// The newest suspect at the values of its file and over its ranges, all other numbers as in the smaller fit.
pub(super) fn of_newest(
    fitting: &Fitting<'_>,
    suspects: &[usize],
    from: (&Fitting<'_>, &Point),
) -> Vec<Vec<f64>> {
    of_newest_from(fitting, suspects, &values_from(fitting, from))
}

/// First values of a suspect's numbers, all other numbers as in the smaller fit.
fn values_from(fitting: &Fitting<'_>, (smaller, point): (&Fitting<'_>, &Point)) -> Vec<f64> {
    let known = |id: UnknownId| smaller.unknowns.iter().position(|unknown| unknown.id == id);
    let value = |place: usize| point.values_si[place];
    let unknowns = fitting.unknowns.iter();
    unknowns.map(|unknown| known(unknown.id).map_or(unknown.start_si, value)).collect()
}

fn of_newest_from(fitting: &Fitting<'_>, suspects: &[usize], first: &[f64]) -> Vec<Vec<f64>> {
    let mut all = values_of_newest(fitting, suspects, first.to_vec());
    all.extend(suspects.last().into_iter().flat_map(|newest| over_ranges(fitting, *newest, first)));
    all
}

/// Of starting points that differ in the suspect's own numbers the first, and those with the largest fall of the squares by a
/// share of what the suspect does there.
fn promising(
    fitting: &Fitting<'_>,
    starts: Vec<Vec<f64>>,
    from: Option<(&Fitting<'_>, &Point)>,
) -> Vec<Vec<f64>> {
    let Some((smaller, point)) = from.filter(|_| starts.len() > PROMISING + 1) else { return starts };
    let Some(beside) = LinearisedFit::new(smaller, point) else { return starts };
    let mut starts = starts.into_iter();
    let mut all: Vec<Vec<f64>> = starts.next().into_iter().collect();
    let fall = |values: Vec<f64>| {
        let predicted = fitting.predictions(&values, &beside.scale).ok()?;
        let change = beside.project_off(DVector::from_vec(predicted) - &beside.predictions);
        let (size, gain) = (change.norm_squared(), change.dot(&beside.residual));
        let fall = if gain > 0.0 { gain * gain / size } else { 0.0 };
        (size > 0.0 && fall.is_finite()).then(|| (fall, change / size.sqrt(), values))
    };
    let mut others: Vec<(f64, DVector<f64>, Vec<f64>)> = starts.filter_map(fall).collect();
    others.sort_by(|one, other| other.0.total_cmp(&one.0));
    let mut kept: Vec<DVector<f64>> = Vec::new();
    for (_, direction, values) in others {
        if kept.len() < PROMISING && kept.iter().all(|known| known.dot(&direction) < SAME_DIRECTION) {
            kept.push(direction);
            all.push(values);
        }
    }
    all
}

impl Fitting<'_> {
    /// The best of the fits from several starting points: a few steps from each, and at most so many from those that have come
    /// lowest.
    pub(crate) fn fit_from(
        &self,
        starts: Vec<Vec<f64>>,
        most: usize,
    ) -> Result<(Point, Convergence), Failure> {
        let mut why = None;
        let mut begun: Vec<(Point, Convergence)> = Vec::new();
        let unmoved = Convergence { outcome: Outcome::StepLimit, ..Convergence::default() };
        let mut here = self.clone();
        for start in self.within_ranges(starts) {
            match here.fit(start, ROUNDS[0].0) {
                Ok((point, convergence)) => {
                    here = here.near(&point);
                    begun.push((point, unmoved.then(convergence)));
                }
                Err(failure) => why = Some(failure),
            }
        }
        let further = |(point, convergence): (Point, Convergence), steps: usize| match convergence.outcome {
            Outcome::StepLimit => {
                self.fit(point.values_si, steps).map(|(end, more)| (end, convergence.then(more)))
            }
            _ => Ok((point, convergence)),
        };
        for (round, (_, kept)) in ROUNDS.iter().enumerate() {
            begun.sort_by(|(one, _), (other, _)| one.loss.total_cmp(&other.loss));
            // Points that have come to the same minimum go on once.
            begun.dedup_by(|(one, _), (other, _)| one.loss - other.loss < OPTIONS.absolute_tolerance);
            begun.truncate(*kept);
            let steps = ROUNDS.get(round + 1).map_or(most, |(steps, _)| *steps);
            begun = begun.into_iter().map(|one| further(one, steps)).collect::<Result<_, _>>()?;
        }
        let best = begun.into_iter().min_by(|(one, _), (other, _)| one.loss.total_cmp(&other.loss));
        best.ok_or_else(|| why.expect("there is one start at least"))
    }

    /// Starting points within the ranges, each once.
    fn within_ranges(&self, starts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = Vec::new();
        for mut start in starts {
            for (value, unknown) in start.iter_mut().zip(&self.unknowns) {
                *value = value.clamp(unknown.range_si[0], unknown.range_si[1]);
            }
            if !all.contains(&start) {
                all.push(start);
            }
        }
        all
    }
}

/// Places of a suspect's own numbers among the unknowns.
fn places_of(fitting: &Fitting<'_>, suspect: usize) -> Vec<usize> {
    let is_of_suspect = |place: &usize| fitting.suspect_of(&fitting.unknowns[*place]) == Some(suspect);
    (0..fitting.unknowns.len()).filter(is_of_suspect).collect()
}

/// A suspect's own numbers over their ranges.
fn over_ranges(fitting: &Fitting<'_>, suspect: usize, first: &[f64]) -> Vec<Vec<f64>> {
    let places = places_of(fitting, suspect);
    let rows: usize = fitting.records.iter().map(|record| record.time_s.len()).sum();
    let points =
        if places.is_empty() { 0 } else { (ROWS_TIMES_POINTS / rows.max(1)).clamp(POINTS[0], POINTS[1]) };
    let point = |number: usize| {
        let mut values = first.to_vec();
        for (dimension, place) in places.iter().enumerate().take(PRIMES.len()) {
            let share = radical_inverse(number as u32, PRIMES[dimension]);
            values[*place] = within_range(values[*place], fitting.unknowns[*place].range_si, share);
        }
        values
    };
    (1..=points).map(point).collect()
}

/// A value at a share, 0 to 1, of its range: on a logarithmic scale on each side of 0.
fn within_range(value: f64, [least, most]: [f64; 2], share: f64) -> f64 {
    let size = value.abs();
    if least < 0.0 && most > 0.0 {
        let (end, share) = if share < 0.5 { (least, 1.0 - 2.0 * share) } else { (most, 2.0 * share - 1.0) };
        let side = within_range(size, [0.0, end.abs()], share);
        return side.copysign(end);
    }
    if most <= 0.0 {
        return -within_range(size, [-most, -least], 1.0 - share);
    }
    let most = if most.is_finite() { most } else { BELOW * size.max(least) };
    let least = if least > 0.0 { least } else { (size / BELOW).min(most / BELOW) };
    if least > 0.0 { least * libm::pow(most / least, share) } else { most * share }
}

/// A starting point with no more loss than the smaller fit: a larger model must not end above it.
fn without_effect(fitting: &Fitting<'_>, suspect: usize, first: &[f64], loss: f64) -> Option<Vec<f64>> {
    let candidates = places_of(fitting, suspect).into_iter().flat_map(|place| {
        let [least, most] = fitting.unknowns[place].range_si;
        let ends = [0.0, least, most]
            .into_iter()
            .filter(move |end| end.is_finite() && least <= *end && *end <= most);
        ends.map(move |end| {
            let mut values = first.to_vec();
            values[place] = end;
            values
        })
    });
    let is_as_low = |values: &Vec<f64>| {
        fitting.at(values.clone()).is_ok_and(|point| point.loss <= loss + OPTIONS.absolute_tolerance)
    };
    candidates.into_iter().find(is_as_low)
}

/// Each combination of values that the file gives the newest suspect, at most [`MOST`]; the other numbers as in `first`.
fn values_of_newest(fitting: &Fitting<'_>, suspects: &[usize], first: Vec<f64>) -> Vec<Vec<f64>> {
    let mut all = vec![first];
    let Some(newest) = suspects.last() else { return all };
    for (index, parameter) in
        fitting.model.parameters.iter().enumerate().filter(|(_, one)| one.suspect == Some(*newest))
    {
        let others = parameter.values_si[1..].iter().flat_map(|value| {
            all.iter().map(|start| {
                let moved = fitting.unknowns.iter().zip(start).map(|(unknown, before)| match unknown.id {
                    UnknownId::Shared(of) | UnknownId::PerRecord(of, _) if of == index => *value,
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
    fn a_range_is_covered_on_each_side_of_nothing() {
        for (value, range, share, expected) in [
            (5.0, [1.0, 100.0], 0.5, 10.0),
            (1.0, [0.0, 20.0], 1.0, 20.0),
            (1.0, [0.0, 20.0], 0.0, 0.05),
            (1.0, [-20.0, 20.0], 0.0, -20.0),
            (1.0, [-20.0, 20.0], 0.75, 1.0),
            (-5.0, [-100.0, -1.0], 0.5, -10.0),
            (2.0, [0.0, f64::INFINITY], 1.0, 40.0),
            (0.0, [0.0, 8.0], 0.5, 4.0),
        ] {
            let moved = within_range(value, range, share);
            assert!((moved - expected).abs() < 1e-12, "{value} within {range:?}: {moved}, not {expected}");
        }
    }

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
