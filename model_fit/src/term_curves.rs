//! A term over the variable that it depends on most, along the fitted training records.
//!
//! ```text
//!   eta^2 = 1 - sum (T - mean of its bin)^2 / sum (T - mean)^2        T the term, bins over a variable
//!   e^2   = g' C g        g the mean of dT/dtheta in a bin, C the covariance of the term's numbers theta
//! ```
//! Bins have equal width or equal count, whichever has the larger eta^2: a term may act at an end of its variable alone.
//! The variable is the input or state with the largest eta^2, the correlation ratio. The curve is the mean of each bin, e its
//! standard error, linearised. dT/dtheta is that of the law at the states as they were fitted: what the law does to these moves
//! along the curve. Smallest and largest value are far apart where more than this variable enters.

use super::covariance::{self, NumberError};
use super::fit::Fitting;
use super::record::MeasuredRecord;
use super::report;
use super::select::{Fitted, Rival, SearchResult};
use super::sensors::{part_values, with_extra_output};
use model::{Part, Program, Unit};
use nalgebra::{DMatrix, DVector};

const BINS: usize = 40;

/// A term over a variable, in the model's own units.
pub(crate) struct TermCurve {
    pub(crate) suspect: String,
    /// What was named, where the suspect stands in its place.
    pub(crate) instead_of: Option<String>,
    pub(crate) place: String,
    pub(crate) unit: String,
    pub(crate) variable: String,
    pub(crate) variable_unit: String,
    /// The correlation ratio, as the share of the term's variance.
    pub(crate) share: f64,
    /// Whether no variable has a larger one.
    pub(crate) is_most: bool,
    /// Those that have rows.
    pub(crate) bins: Vec<Bin>,
}

/// Rows with nearly the same value of the variable.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bin {
    /// Mean of the variable.
    pub(crate) x: f64,
    /// Of the term.
    pub(crate) least: f64,
    pub(crate) mean: f64,
    pub(crate) most: f64,
    /// Standard error of the mean by the term's numbers; `None` where the records do not determine one of them.
    pub(crate) error: Option<f64>,
}

/// A curve for each suspect of the extended model, and for each that could not be told from one; none for one that rests, or
/// that cannot be computed by itself.
pub(crate) fn curves(found: &SearchResult<'_>, rivals: &[Rival<'_>]) -> Vec<TermCurve> {
    let has_law = !found.accepted.is_empty();
    let mut curves = drawn((&found.extended, &found.baseline), (&found.extended.suspects, None), has_law);
    for rival in rivals {
        let Ok(fit) = &rival.fit else { continue };
        let name = &fit.fitting.model.suspects[rival.instead_of].name;
        let of_named = curves.iter().find(|curve| curve.suspect == *name && curve.instead_of.is_none());
        let over = of_named.map(|curve| curve.variable.as_str());
        let instead = drawn((fit, &found.baseline), (&[rival.suspect], over), true);
        curves.extend(instead.into_iter().map(|curve| TermCurve { instead_of: Some(name.clone()), ..curve }));
    }
    curves
}

/// A curve for each of these suspects, over the given variable where half of what the best one explains depends on it.
fn drawn(
    (fitted, baseline): (&Fitted<'_>, &Fitted<'_>),
    (suspects, over): (&[usize], Option<&str>),
    has_law: bool,
) -> Vec<TermCurve> {
    if suspects.is_empty() {
        return Vec::new();
    }
    let model = fitted.fitting.model;
    let inputs = model.inputs.iter().enumerate();
    let inputs = inputs.map(|(index, input)| (Part::Input(index), &input.name, &input.unit));
    let states = model.states.iter().enumerate().filter(|(_, state)| state.suspect.is_none());
    let states = states.map(|(index, state)| (Part::State(index), &state.name, &state.unit));
    let variables: Vec<_> = inputs
        .chain(states)
        .filter_map(|(part, name, unit)| Some((name, unit, part_values(fitted, part)?)))
        .collect();
    let errors = covariance::errors(fitted, baseline, has_law);
    let of = |suspect: &usize| {
        let term = TermSeries::of(fitted, *suspect, &errors)?;
        let unit = &term.unit;
        let of_variable = |at: usize| {
            let (share, bins) = binned(&variables[at].2, &term.values)?;
            Some((at, share, bins))
        };
        let all: Vec<_> = (0..variables.len()).filter_map(of_variable).collect();
        let most = all.iter().max_by(|one, other| one.1.total_cmp(&other.1))?;
        let is_given = |at: usize, share: f64| over == Some(variables[at].0.as_str()) && share > 0.5 * most.1;
        let (at, share, bins) = all.iter().find(|one| is_given(one.0, one.1)).unwrap_or(most);
        let (name, variable_unit, x) = &variables[*at];
        let is_most = *at == most.0;
        Some(TermCurve {
            suspect: model.suspects[*suspect].name.clone(),
            instead_of: None,
            place: report::place(model, *suspect),
            unit: unit.text.clone(),
            variable: (*name).clone(),
            variable_unit: variable_unit.text.clone(),
            share: *share,
            is_most,
            bins: bins.iter().map(|rows| term.bin(rows, x, [variable_unit.factor, unit.factor])).collect(),
        })
    };
    suspects.iter().filter_map(of).collect()
}

/// A term along the records, SI.
struct TermSeries {
    unit: Unit,
    values: Vec<f64>,
    /// Derivatives by its numbers, row by row.
    slopes: Vec<DVector<f64>>,
    covariance: Option<DMatrix<f64>>,
}

impl TermSeries {
    /// `None` for a term that cannot be computed by itself.
    fn of(fitted: &Fitted<'_>, suspect: usize, errors: &[Option<NumberError>]) -> Option<Self> {
        let measuring = fitted.fitting.model.measuring(Part::Suspect(suspect))?;
        let records: Vec<MeasuredRecord> = fitted.fitting.records.iter().map(with_extra_output).collect();
        let program = Program::new(&measuring, &fitted.suspects).ok()?.along_states(&measuring);
        let fitting = Fitting::new(&measuring, program, &records, &fitted.suspects);
        let is_of_suspect = |place: &usize| fitting.suspect_of(&fitting.unknowns[*place]) == Some(suspect);
        let places: Vec<usize> = (0..fitting.unknowns.len()).filter(is_of_suspect).collect();
        let term = measuring.outputs.len() - 1;
        let (mut values, mut slopes) = (Vec::new(), Vec::new());
        for record in 0..records.len() {
            let directions = fitting.of_record(record);
            let direction = |place: &usize| directions.iter().position(|other| other == place);
            let of_term: Vec<Option<usize>> = places.iter().map(direction).collect();
            let sink = |_, output, value, slope: &[f64]| {
                if output == term {
                    values.push(value);
                    let of_number = |direction: &Option<usize>| direction.map_or(0.0, |at| slope[at]);
                    slopes.push(DVector::from_iterator(of_term.len(), of_term.iter().map(of_number)));
                }
            };
            fitting.simulate(record, &fitted.point.values_si, true, sink).ok()?;
        }
        let covariance = covariance::of_numbers(fitted, errors, &places);
        Some(Self { unit: measuring.outputs[term].unit.clone(), values, slopes, covariance })
    }

    /// A bin of these rows, over the factors of both units.
    fn bin(&self, rows: &[usize], x: &[f64], [of_x, of_term]: [f64; 2]) -> Bin {
        let count = rows.len() as f64;
        let values = || rows.iter().map(|row| self.values[*row]);
        let slopes = rows.iter().map(|row| &self.slopes[*row]);
        let variance = self.covariance.as_ref().map(|covariance| {
            let mean = slopes.fold(DVector::zeros(covariance.nrows()), |sum, slope| sum + slope) / count;
            mean.dot(&(covariance * &mean))
        });
        Bin {
            x: rows.iter().map(|row| x[*row]).sum::<f64>() / count / of_x,
            least: values().fold(f64::INFINITY, f64::min) / of_term,
            mean: values().sum::<f64>() / count / of_term,
            most: values().fold(f64::NEG_INFINITY, f64::max) / of_term,
            error: variance.map(|variance| variance.max(0.0).sqrt() / of_term),
        }
    }
}

/// The correlation ratio of values over a variable, and the rows of each bin; `None` where one of both rests.
fn binned(variable: &[f64], values: &[f64]) -> Option<(f64, Vec<Vec<usize>>)> {
    let is_there = |row: &usize| variable[*row].is_finite() && values[*row].is_finite();
    let mut rows: Vec<usize> = (0..values.len()).filter(is_there).collect();
    rows.sort_by(|one, other| variable[*one].total_cmp(&variable[*other]));
    let [low, .., high] = rows[..] else { return None };
    let [low, high] = [low, high].map(|row| variable[row]);
    let mean = |rows: &[usize]| rows.iter().map(|row| values[*row]).sum::<f64>() / rows.len() as f64;
    let squares = |rows: &[usize]| {
        let mean = mean(rows);
        rows.iter().map(|row| (values[*row] - mean).powi(2)).sum::<f64>()
    };
    let whole = squares(&rows);
    if high <= low || (whole / rows.len() as f64).sqrt() <= 1e-9 * mean(&rows).abs() {
        return None;
    }
    let width = |_: usize, x: f64| (x - low) / (high - low);
    let count = |place: usize, _: f64| place as f64 / rows.len() as f64;
    let of = |position: &dyn Fn(usize, f64) -> f64| {
        let mut bins = vec![Vec::new(); BINS];
        for (place, row) in rows.iter().enumerate() {
            bins[((position(place, variable[*row]) * BINS as f64) as usize).min(BINS - 1)].push(*row);
        }
        bins.retain(|bin| !bin.is_empty());
        (1.0 - bins.iter().map(|bin| squares(bin)).sum::<f64>() / whole, bins)
    };
    let [by_width, by_count] = [of(&width), of(&count)];
    Some(if by_count.0 > by_width.0 { by_count } else { by_width })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::select;
    use model::Model;
    use std::path::Path;

    #[test]
    fn the_ratio_tells_a_function_from_what_depends_on_something_else() {
        let x: Vec<f64> = (0..4000).map(|at| (f64::from(at) * 0.01).sin()).collect();
        let other: Vec<f64> = (0..4000).map(|at| (f64::from(at) * 0.0271).cos()).collect();
        let term: Vec<f64> = x.iter().map(|x| x * x.abs()).collect();
        let [share, other_share] = [&x, &other].map(|x| binned(x, &term).unwrap().0);
        assert!(share > 0.99 && other_share < 0.2, "{share} {other_share}");
        let (_, bins) = binned(&x, &term).unwrap();
        assert_eq!(bins.iter().map(Vec::len).sum::<usize>(), x.len());
        // In a bin of 0.1 width the values spread by at most 2 |x| 0.1.
        let spread = |bin: &Vec<usize>| {
            let values = bin.iter().map(|row| term[*row]);
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
        };
        assert!(bins.iter().all(|bin| spread(bin) <= 0.25));
        assert!(binned(&x, &[1.0; 4000]).is_none() && binned(&[2.0; 4000], &term).is_none());
    }

    /// A state behind a force that jumps; what is hidden is a cubic spring and, with two numbers, a straight one beside it.
    const MODEL: &str = r#"
[fit]
starts = 0
[inputs.u]
[parameters]
drain = { unit = "1/s", value = 1, range = [0.1, 10] }
[states.x]
unit = "mm"
start = 0
derivative = "drain*(u*1[mm] - x)"
[outputs.y]
unit = "mm"
value = "x"
[[suspects]]
name = "cubic"
place = "x"
add = "-k*x^3"
parameters.k = { unit = "1/(mm^2 s)", value = 0.1, range = [0, 10] }
[[suspects]]
name = "bent"
place = "x"
add = "-a*x^3 - b*x"
parameters.a = { unit = "1/(mm^2 s)", value = 0.1, range = [-10, 10] }
parameters.b = { unit = "1/s", value = 0.01, range = [-10, 10] }
"#;

    fn record() -> String {
        let (mut x, mut state) = (0.0, 5_u64);
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let (mut text, mut u) = ("t_s,u,y\n".to_owned(), 0.0);
        for row in 0..300 {
            u = if row % 20 == 0 { 6.0 * random() } else { u };
            text += &format!("{},{u},{}\n", f64::from(row) * 0.1, x + 0.02 * random());
            for _ in 0..100 {
                x += 1e-3 * (2.0 * (u - x) - 0.3 * x * x * x);
            }
        }
        text
    }

    /// Curve of a suspect, its numbers and their errors, and the correlation of the first two.
    fn with_curve(suspect: usize, has_law: bool, check: impl Fn(&[Bin], &[[f64; 2]], f64)) {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), record()).unwrap();
        let model = Model::parse(MODEL, Path::new("m.toml")).unwrap();
        let records = [MeasuredRecord::read(&model, file.path()).unwrap()];
        let baseline = select::fitted(&model, &records, &[], None).unwrap();
        let fitted = select::fitted(&model, &records, &[suspect], Some(&baseline)).unwrap();
        let curve = drawn((&fitted, &baseline), (&[suspect], None), has_law).pop().unwrap();
        let unit = &curve.unit;
        assert!(curve.variable == "x" && curve.variable_unit == "mm" && unit == "mm/s", "{unit}");
        let numbers = report::numbers(&fitted, &baseline, has_law);
        let of_suspect = numbers.iter().filter(|number| number.suspect.is_some());
        let of_suspect: Vec<_> =
            of_suspect.map(|number| [number.value, number.standard_error.unwrap()]).collect();
        let errors = covariance::errors(&fitted, &baseline, has_law);
        let covariance = covariance::of_numbers(&fitted, &errors, &[1, of_suspect.len()]);
        let covariance = covariance.unwrap();
        check(
            &curve.bins,
            &of_suspect,
            covariance[(0, 1)] / (covariance[(0, 0)] * covariance[(1, 1)]).sqrt(),
        );
    }

    /// Where a law is proportional to its only number, so is its error: the state that it moves does not enter.
    #[test]
    fn the_band_of_a_law_with_one_number_is_the_error_of_that_number() {
        with_curve(0, true, |bins, numbers, _| {
            let [[k, error]] = numbers else { panic!("{numbers:?}") };
            assert!(bins.len() > 20 && (k - 0.3).abs() < 0.1, "{k}");
            for Bin { x, mean, error: of_curve, .. } in bins {
                assert!((mean + k * x.powi(3)).abs() < 0.1 * (0.1 + mean.abs()), "{mean} at {x}");
                let share = of_curve.unwrap() / mean.abs();
                assert!((share / (error / k) - 1.0).abs() < 1e-9, "{share} at {x}, {error} of {k}");
            }
        });
    }

    /// e^2 = (x^3 e_a)^2 + (x e_b)^2 + 2 r x^4 e_a e_b; bins are narrow, so that means are those of their middle to some percent.
    #[test]
    fn the_band_of_a_law_with_two_numbers_counts_their_correlation() {
        with_curve(1, false, |bins, numbers, correlation| {
            let [[_, of_a], [_, of_b]] = numbers else { panic!("{numbers:?}") };
            assert!(correlation.abs() > 0.1, "the test says little: {correlation}");
            for Bin { x, error, .. } in bins.iter().filter(|bin| bin.x.abs() > 0.5) {
                let [a, b] = [x.powi(3) * of_a, x * of_b];
                let expected = (a * a + b * b + 2.0 * correlation * a * b).sqrt();
                let error = error.unwrap();
                assert!((error / expected - 1.0).abs() < 0.1, "{error} for {expected} at {x}");
            }
        });
    }
}
