//! Unknown inputs over the variable that they follow most closely, as means of 20 bins with a band.

use super::{UnknownSeries, VARIABLE_UNITS, VARIABLES};
use crate::report::Curve;

/// Bins of a map.
pub const BINS: usize = 20;
/// Maps of a balance.
const MAPS: usize = 2;
/// Points that a bin needs to be told.
const LEAST: usize = 5;
/// Balances above this are drawn.
const DRAWN: f64 = 1.1;

/// The maps of all balances that stand out, each over its strongest variables.
pub(super) fn maps(series: &[UnknownSeries]) -> Vec<Curve> {
    let mut maps = Vec::new();
    for series in series.iter().filter(|series| series.over_noise().is_some_and(|over| over > DRAWN)) {
        let mut ranked: Vec<(usize, f64)> =
            (0..VARIABLES.len()).map(|variable| (variable, between(series, variable))).collect();
        ranked.sort_by(|left, right| right.1.total_cmp(&left.1));
        maps.extend(ranked.iter().take(MAPS).map(|(variable, _)| map(series, *variable)));
    }
    maps
}

/// The map of a series over a variable; the curve's variable tells the balance too.
#[must_use]
pub fn map(series: &UnknownSeries, variable: usize) -> Curve {
    let mut curve = Curve {
        variable: format!("{} over {}", series.balance, VARIABLES[variable]),
        variable_unit: VARIABLE_UNITS[variable].to_owned(),
        unit: series.unit.to_owned(),
        at: Vec::new(),
        value: Vec::new(),
        band: Vec::new(),
    };
    let places = bins(&series.points.iter().map(|point| point.variables[variable]).collect::<Vec<_>>());
    for bin in 0..BINS {
        let own: Vec<_> = series
            .points
            .iter()
            .zip(&places)
            .filter(|(_, place)| **place == bin)
            .map(|(point, _)| point)
            .collect();
        if own.len() < LEAST {
            continue;
        }
        let weights: f64 = own.iter().map(|point| point.deviation.powi(-2)).sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            (0..own.len()).map(|at| of(at) * own[at].deviation.powi(-2)).sum::<f64>() / weights
        };
        let value = mean(&|at| own[at].value);
        // The scatter around the mean is more than the noise where other things move the input too.
        let scatter = mean(&|at| (own[at].value - value).powi(2)) / (own.len() - 1) as f64;
        curve.at.push(mean(&|at| own[at].variables[variable]));
        curve.value.push(value);
        curve.band.push(2.0 * scatter.max(1.0 / weights).sqrt());
    }
    curve
}

/// The bin of each value: equally many in each as far as equal values allow, since those share one.
#[must_use]
pub fn bins(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|left, right| values[*left].total_cmp(&values[*right]).then(left.cmp(right)));
    let mut places = vec![0; values.len()];
    let mut last: Option<(f64, usize)> = None;
    for (rank, at) in order.into_iter().enumerate() {
        let own = rank * BINS / values.len();
        let bin = match last {
            Some((value, bin)) if value == values[at] => bin,
            _ => own,
        };
        places[at] = bin;
        last = Some((values[at], bin));
    }
    places
}

/// Weighted variance between the bins of a variable over that of the series.
fn between(series: &UnknownSeries, variable: usize) -> f64 {
    let places = bins(&series.points.iter().map(|point| point.variables[variable]).collect::<Vec<_>>());
    let (mut sums, mut weights) = ([0.0; BINS], [0.0; BINS]);
    for (point, bin) in series.points.iter().zip(places) {
        let weight = point.deviation.powi(-2);
        sums[bin] += weight * point.value;
        weights[bin] += weight;
    }
    let whole = sums.iter().sum::<f64>().powi(2) / weights.iter().sum::<f64>();
    let within: f64 = sums
        .iter()
        .zip(weights)
        .filter(|(_, weight)| *weight > 0.0)
        .map(|(sum, weight)| sum * sum / weight)
        .sum();
    within - whole
}
