//! Binned means of unknown inputs over their strongest variables, with bands; over two variables as a surface.

use super::{HISTORY_COMPLEXITY, UnknownPoint, UnknownSeries, VARIABLES};
use crate::report::{Curve, Surface};

pub(crate) const BINS: usize = 20;
const MAPS: usize = 2;
/// Bins of a surface: of its first variable, and of its second.
const SURFACE: [usize; 2] = [10, 3];
/// Fewest points of a bin.
const LEAST: usize = 5;
/// Smallest Birge ratio of a drawn balance.
const DRAWN: f64 = 1.1;

/// Maps of all significant balances over their strongest variables that are no history variables, which may follow by chance.
pub(super) fn maps(series: &[UnknownSeries]) -> Vec<Curve> {
    let mut maps = Vec::new();
    for series in series.iter().filter(|series| series.birge_ratio().is_some_and(|ratio| ratio > DRAWN)) {
        let present =
            (0..VARIABLES.len()).filter(|variable| VARIABLES[*variable].complexity < HISTORY_COMPLEXITY);
        let mut ranked: Vec<(usize, f64)> =
            present.map(|variable| (variable, between(series, variable))).collect();
        ranked.sort_by(|left, right| right.1.total_cmp(&left.1));
        maps.extend(ranked.iter().take(MAPS).map(|(variable, _)| map(series, *variable)));
    }
    maps
}

/// Map of a series over a variable; the curve's variable names the balance too.
pub(crate) fn map(series: &UnknownSeries, variable: usize) -> Curve {
    let mut curve = Curve {
        variable: format!("{} over {}", series.balance, VARIABLES[variable].name),
        variable_unit: VARIABLES[variable].unit.to_owned(),
        unit: series.unit.to_owned(),
        ..Curve::default()
    };
    let places = bins(&series.points.iter().map(|point| point.variables[variable]).collect::<Vec<_>>());
    for bin in 0..BINS {
        let binned: Vec<_> = series
            .points
            .iter()
            .zip(&places)
            .filter(|(_, place)| **place == bin)
            .map(|(point, _)| point)
            .collect();
        let Some((value, band)) = mean_and_band(&binned) else { continue };
        curve.at.push(mean(&binned, |point| point.variables[variable]));
        curve.value.push(value);
        curve.band.push(band);
    }
    curve
}

pub(crate) fn surface(series: &UnknownSeries, variables: [usize; 2]) -> Surface {
    let places = [0, 1].map(|side| {
        let values: Vec<f64> = series.points.iter().map(|point| point.variables[variables[side]]).collect();
        few_bins(&values, SURFACE[side])
    });
    let bin = |at: usize, side: usize| places[side][at];
    let of = |is_in: &dyn Fn(usize) -> bool| -> Vec<&UnknownPoint> {
        (0..series.points.len()).filter(|at| is_in(*at)).map(|at| &series.points[at]).collect()
    };
    // Tied values leave bins empty.
    let kept = [0, 1].map(|side| {
        let there = |place: &usize| !of(&|at| bin(at, side) == *place).is_empty();
        (0..SURFACE[side]).filter(there).collect::<Vec<_>>()
    });
    let at = [0, 1].map(|side| {
        let middle = |place: &usize| {
            mean(&of(&|at| bin(at, side) == *place), |point| point.variables[variables[side]])
        };
        kept[side].iter().map(middle).collect()
    });
    let cells: Vec<Vec<Option<(f64, f64)>>> = kept[1]
        .iter()
        .map(|second| {
            let cell =
                |first: &usize| mean_and_band(&of(&|at| bin(at, 0) == *first && bin(at, 1) == *second));
            kept[0].iter().map(cell).collect()
        })
        .collect();
    let rows = |of: fn((f64, f64)) -> f64| {
        cells.iter().map(|row| row.iter().map(|cell| cell.map(of)).collect()).collect()
    };
    Surface {
        variables: variables.map(|variable| VARIABLES[variable].name.to_owned()),
        variable_units: variables.map(|variable| VARIABLES[variable].unit.to_owned()),
        unit: series.unit.to_owned(),
        at,
        value: rows(|(value, _)| value),
        band: rows(|(_, band)| band),
    }
}

fn mean(points: &[&UnknownPoint], of: impl Fn(&UnknownPoint) -> f64) -> f64 {
    let weights: f64 = points.iter().map(|point| point.deviation.powi(-2)).sum();
    points.iter().map(|point| of(point) * point.deviation.powi(-2)).sum::<f64>() / weights
}

/// Weighted mean and two standard errors; `None` for too few points.
fn mean_and_band(points: &[&UnknownPoint]) -> Option<(f64, f64)> {
    if points.len() < LEAST {
        return None;
    }
    let weights: f64 = points.iter().map(|point| point.deviation.powi(-2)).sum();
    let value = mean(points, |point| point.value);
    // The scatter exceeds the noise where other variables act too.
    let scatter = mean(points, |point| (point.value - value).powi(2)) / (points.len() - 1) as f64;
    Some((value, 2.0 * scatter.max(1.0 / weights).sqrt()))
}

/// Quantile bin of each value; ties share a bin.
pub(crate) fn bins(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|left, right| values[*left].total_cmp(&values[*right]).then(left.cmp(right)));
    let mut places = vec![0; values.len()];
    let mut last: Option<(f64, usize)> = None;
    for (rank, at) in order.into_iter().enumerate() {
        let even = rank * BINS / values.len();
        let bin = match last {
            Some((value, bin)) if value == values[at] => bin,
            _ => even,
        };
        places[at] = bin;
        last = Some((values[at], bin));
    }
    places
}

/// At most `most` bins; one for each distinct value where there are no more.
pub(crate) fn few_bins(values: &[f64], most: usize) -> Vec<usize> {
    let mut apart = values.to_vec();
    apart.sort_unstable_by(f64::total_cmp);
    apart.dedup();
    let place = |(value, bin): (&f64, usize)| {
        let rank = apart.partition_point(|other| other < value);
        if apart.len() <= most { rank } else { bin * most / BINS }
    };
    values.iter().zip(bins(values)).map(place).collect()
}

/// Weighted sum of squares between the bins of a variable.
fn between(series: &UnknownSeries, variable: usize) -> f64 {
    let places = bins(&series.points.iter().map(|point| point.variables[variable]).collect::<Vec<_>>());
    let (mut sums, mut weights) = ([0.0; BINS], [0.0; BINS]);
    for (point, bin) in series.points.iter().zip(places) {
        let weight = point.deviation.powi(-2);
        sums[bin] += weight * point.value;
        weights[bin] += weight;
    }
    let whole = sums.iter().sum::<f64>().powi(2) / weights.iter().sum::<f64>();
    let between: f64 = sums
        .iter()
        .zip(weights)
        .filter(|(_, weight)| *weight > 0.0)
        .map(|(sum, weight)| sum * sum / weight)
        .sum();
    between - whole
}

#[cfg(test)]
mod tests {
    use super::super::regime::Regimes;
    use super::super::{DIRECTION, POSITION};
    use super::*;

    #[test]
    fn a_surface_tells_what_neither_of_its_variables_does_alone() {
        // A force over x that turns with the direction; nothing at rest, and no point beyond 0.35 m on the way back.
        let point = |at: usize| {
            let (x, direction) = (0.01 * (at % 40) as f64, [-1.0, 0.0, 1.0][(at / 40) % 3]);
            let mut variables = [0.0; VARIABLES.len()];
            (variables[POSITION], variables[DIRECTION]) = (x, direction);
            let value = 20.0 * x * direction + if at.is_multiple_of(2) { 0.1 } else { -0.1 };
            let (per_pressure_offset, regimes) = ([0.0; 2], Regimes::default());
            UnknownPoint { window: at, value, deviation: 0.1, variables, per_pressure_offset, regimes }
        };
        let points = (0..1200)
            .map(point)
            .filter(|point| point.variables[DIRECTION] >= 0.0 || point.variables[POSITION] < 0.35)
            .collect();
        let series = UnknownSeries { balance: "drive.force".to_owned(), unit: "N", points };
        let surface = surface(&series, [POSITION, DIRECTION]);
        assert_eq!(surface.variables, ["x", "sign(v)"]);
        assert_eq!((surface.at[0].len(), surface.at[1].as_slice()), (10, &[-1.0, 0.0, 1.0][..]));
        for (row, direction) in surface.value.iter().zip([-1.0, 0.0, 1.0]) {
            for (value, x) in row.iter().zip(&surface.at[0]) {
                let expected = 20.0 * x * direction;
                assert!(value.is_none_or(|value| (value - expected).abs() < 0.5), "{value:?} at {x}");
            }
        }
        assert!(surface.value[0][9].is_none() && surface.band[0][9].is_none());
        assert!(surface.value[2][9].is_some() && surface.band[2][9].is_some_and(|band| band > 0.0));
    }
}
