//! A term over the variable that it depends on most, along the fitted training records.
//!
//! ```text
//!   eta^2 = 1 - sum (T - mean of its bin)^2 / sum (T - mean)^2        T the term, bins over a variable
//! ```
//! Bins have equal width or equal count, whichever has the larger eta^2: a term may act at an end of its variable alone.
//! The variable is the input or state with the largest eta^2, the correlation ratio. The curve is the mean of each bin; its band
//! goes from the smallest to the largest value, so that it is wide where more than this variable enters.

use super::report;
use super::select::Fitted;
use super::sensors::said;
use crate::stats::mean_and_variance;
use model::{Part, Unit};

const BINS: usize = 40;

/// A term over a variable, in the model's own units.
pub(crate) struct TermCurve {
    pub(crate) suspect: String,
    pub(crate) place: String,
    pub(crate) unit: String,
    pub(crate) variable: String,
    pub(crate) variable_unit: String,
    /// The correlation ratio, as the share of the term's variance.
    pub(crate) share: f64,
    /// Of each bin that has rows: mean of the variable, smallest, mean and largest value of the term.
    pub(crate) bins: Vec<[f64; 4]>,
}

/// A curve for each suspect of a fit; none for one that rests, or that cannot be computed by itself.
pub(crate) fn curves(fitted: &Fitted<'_>) -> Vec<TermCurve> {
    if fitted.suspects.is_empty() {
        return Vec::new();
    }
    let model = fitted.fitting.model;
    let inputs = model.inputs.iter().enumerate();
    let inputs = inputs.map(|(index, input)| (Part::Input(index), &input.name, &input.unit));
    let states = model.states.iter().enumerate().filter(|(_, state)| state.suspect.is_none());
    let states = states.map(|(index, state)| (Part::State(index), &state.name, &state.unit));
    let variables: Vec<_> = inputs
        .chain(states)
        .filter_map(|(part, name, unit)| Some((name, unit, said(fitted, part)?)))
        .collect();
    let of = |suspect: &usize| {
        let term = said(fitted, Part::Suspect(*suspect))?;
        let measuring = model.measuring(Part::Suspect(*suspect))?;
        let unit = &measuring.outputs.last()?.unit;
        let of = |(name, variable_unit, values): &(&String, &Unit, Vec<f64>)| {
            let (share, bins) = binned(values, &term)?;
            let scaled = |[x, low, mean, high]: [f64; 4]| {
                [x / variable_unit.factor, low / unit.factor, mean / unit.factor, high / unit.factor]
            };
            Some(TermCurve {
                suspect: model.suspects[*suspect].name.clone(),
                place: report::place(model, *suspect),
                unit: unit.text.clone(),
                variable: (*name).clone(),
                variable_unit: variable_unit.text.clone(),
                share,
                bins: bins.into_iter().map(scaled).collect(),
            })
        };
        variables.iter().filter_map(of).max_by(|one, other| one.share.total_cmp(&other.share))
    };
    fitted.suspects.iter().filter_map(of).collect()
}

/// The correlation ratio of values over a variable, and of each bin mean of the variable, smallest, mean and largest value;
/// `None` where one of both rests.
fn binned(variable: &[f64], values: &[f64]) -> Option<(f64, Vec<[f64; 4]>)> {
    let pairs = variable.iter().copied().zip(values.iter().copied());
    let mut pairs: Vec<_> = pairs.filter(|(x, value)| x.is_finite() && value.is_finite()).collect();
    pairs.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    let [(low, _), .., (high, _)] = pairs[..] else { return None };
    let mean = pairs.iter().map(|(_, value)| value).sum::<f64>() / pairs.len() as f64;
    let whole: f64 = pairs.iter().map(|(_, value)| (value - mean).powi(2)).sum();
    if high <= low || (whole / pairs.len() as f64).sqrt() <= 1e-9 * mean.abs() {
        return None;
    }
    let width = |_: usize, x: f64| (x - low) / (high - low);
    let count = |place: usize, _: f64| place as f64 / pairs.len() as f64;
    let of = |position: &dyn Fn(usize, f64) -> f64| {
        let mut bins = vec![Vec::new(); BINS];
        for (place, pair) in pairs.iter().enumerate() {
            bins[((position(place, pair.0) * BINS as f64) as usize).min(BINS - 1)].push(*pair);
        }
        let mut within = 0.0;
        let rows = bins.into_iter().filter(|bin| !bin.is_empty()).map(|bin| {
            let (xs, values): (Vec<f64>, Vec<f64>) = bin.into_iter().unzip();
            let (mean, _) = mean_and_variance(&values);
            within += values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            [mean_and_variance(&xs).0, least, mean, most]
        });
        let rows: Vec<_> = rows.collect();
        (1.0 - within / whole, rows)
    };
    let [by_width, by_count] = [of(&width), of(&count)];
    Some(if by_count.0 > by_width.0 { by_count } else { by_width })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_tells_a_function_from_what_depends_on_something_else() {
        let x: Vec<f64> = (0..4000).map(|at| (f64::from(at) * 0.01).sin()).collect();
        let other: Vec<f64> = (0..4000).map(|at| (f64::from(at) * 0.0271).cos()).collect();
        let term: Vec<f64> = x.iter().map(|x| x * x.abs()).collect();
        let [share, other_share] = [&x, &other].map(|x| binned(x, &term).unwrap().0);
        assert!(share > 0.99 && other_share < 0.2, "{share} {other_share}");
        let (_, bins) = binned(&x, &term).unwrap();
        // In a bin of 0.1 width the values spread by at most 2 |x| 0.1.
        assert!(bins.iter().all(|[x, low, mean, high]| {
            low <= mean && mean <= high && high - low <= 0.25 && (mean - x * x.abs()).abs() < 2e-3
        }));
        assert!(binned(&x, &[1.0; 4000]).is_none() && binned(&[2.0; 4000], &term).is_none());
    }
}
