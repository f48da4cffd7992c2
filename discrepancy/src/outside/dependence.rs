//! Statistical dependence of an unknown input on a variable.
//!
//! ```text
//! R2 = 1 - sum w (d - m(bin))^2 / sum w (d - mean)^2        m from the other fold, folds of alternate fifths of a second
//! p  = (1 + shifts whose R2 is as large) / (1 + shifts)     200 circular shifts of the input against the variable
//! ```
//!
//! d unknown input, w = 1/deviation^2, 20 bins of equal count or equal width, whichever has the larger R2. A circular shift keeps
//! both autocorrelations and destroys the dependence, so that a slow drift is not taken for a law.
//!
//! Source: discrepancy-notes.md, 9 and Pipeline 8.

use crate::locate::maps::{BINS, bins, few_bins};
use crate::locate::{UnknownSeries, VARIABLES};
use model_fit::stats::mean_and_variance;

/// Circular shifts.
pub(crate) const SHIFTS: usize = 200;
/// Short windows of a block of a fold: 0.2 s, so that both folds see each stroke in all its parts.
const BLOCK_SHORT_WINDOWS: usize = 10;
/// Bins to each side of a pair.
const PAIR_BINS: usize = 6;

/// Values, weights, variables and folds of an unknown input.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    values: Vec<f64>,
    weights: Vec<f64>,
    variables: Vec<[f64; VARIABLES.len()]>,
    folds: Vec<usize>,
}

/// The bin of each short window.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    bin_index: Vec<usize>,
    count: usize,
}

impl Bins {
    pub(crate) fn of(sample: &Sample, variable: usize) -> Self {
        let values: Vec<f64> = sample.variables.iter().map(|variables| variables[variable]).collect();
        Bins { bin_index: bins(&values), count: BINS }
    }

    /// Bins of equal width, which isolate a pulse of few short windows.
    pub(crate) fn even(sample: &Sample, variable: usize) -> Self {
        let values = || sample.variables.iter().map(|variables| variables[variable]);
        let least = values().fold(f64::INFINITY, f64::min);
        let width = (values().fold(f64::NEG_INFINITY, f64::max) - least) / BINS as f64;
        let index = |value: f64| if width > 0.0 { ((value - least) / width) as usize } else { 0 };
        Bins { bin_index: values().map(|value| index(value).min(BINS - 1)).collect(), count: BINS }
    }

    pub(crate) fn of_pair(sample: &Sample, left: usize, right: usize) -> Self {
        let of = |variable: usize| {
            few_bins(
                &sample.variables.iter().map(|variables| variables[variable]).collect::<Vec<_>>(),
                PAIR_BINS,
            )
        };
        let both = of(left).into_iter().zip(of(right));
        Bins {
            bin_index: both.map(|(left, right)| left * PAIR_BINS + right).collect(),
            count: PAIR_BINS * PAIR_BINS,
        }
    }
}

impl Sample {
    pub(crate) fn of(series: &UnknownSeries) -> Self {
        let points = &series.points;
        Sample {
            values: points.iter().map(|point| point.value).collect(),
            weights: points.iter().map(|point| point.deviation.powi(-2)).collect(),
            variables: points.iter().map(|point| point.variables).collect(),
            folds: points.iter().map(|point| (point.window / BLOCK_SHORT_WINDOWS) % 2).collect(),
        }
    }

    /// Value, weight and variables of each window.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (f64, f64, &[f64; VARIABLES.len()])> {
        self.values
            .iter()
            .zip(&self.weights)
            .zip(&self.variables)
            .map(|((value, weight), variables)| (*value, *weight, variables))
    }

    /// R2 over a variable, its p value, and its distance from the shifted ones in standard deviations.
    pub(crate) fn test(&self, variable: usize) -> (f64, f64, f64) {
        let both = [Bins::of(self, variable), Bins::even(self, variable)];
        let most = |shift: usize| {
            both.iter().map(|bins| self.explained(bins, shift)).fold(f64::NEG_INFINITY, f64::max)
        };
        let r2 = most(0);
        let n = self.values.len();
        let shifted: Vec<f64> = (1..=SHIFTS).map(|at| most(at * n / (SHIFTS + 1))).collect();
        let reached = shifted.iter().filter(|other| **other >= r2).count();
        let (mean, variance) = mean_and_variance(&shifted);
        let shift_z = if variance > 0.0 { (r2 - mean) / variance.sqrt() } else { 0.0 };
        (r2, (1 + reached) as f64 / (1 + SHIFTS) as f64, shift_z)
    }

    /// Cross-validated R2 of bin means, with the input shifted by some short windows.
    pub(crate) fn explained(&self, bins: &Bins, shift: usize) -> f64 {
        let n = self.values.len();
        let from = |at: usize| (at + shift) % n;
        let mut sums = vec![[[0.0; 2]; 2]; bins.count];
        let mut all = [[0.0; 2]; 2];
        for at in 0..n {
            let (value, weight) = (self.values[from(at)], self.weights[from(at)]);
            let fold = self.folds[at];
            for sum in [&mut sums[bins.bin_index[at]][fold], &mut all[fold]] {
                sum[0] += weight * value;
                sum[1] += weight;
            }
        }
        let mean = |sum: &[f64; 2]| if sum[1] > 0.0 { sum[0] / sum[1] } else { 0.0 };
        let (mut residual, mut total) = (0.0, 0.0); // weighted sums of squares
        for at in 0..n {
            let (value, weight) = (self.values[from(at)], self.weights[from(at)]);
            let other = 1 - self.folds[at];
            let bin = &sums[bins.bin_index[at]][other];
            let middle = mean(&all[other]);
            let predicted = if bin[1] > 0.0 { mean(bin) } else { middle };
            residual += weight * (value - predicted).powi(2);
            total += weight * (value - middle).powi(2);
        }
        if total > 0.0 { 1.0 - residual / total } else { 0.0 }
    }

    /// Weighted squares beyond their expectation.
    pub(crate) fn excess(&self) -> f64 {
        self.squares() - self.values.len() as f64
    }

    /// The weighted mean over its standard error.
    pub(crate) fn mean_over_error(&self) -> f64 {
        let (sum, weight) = self.mean();
        sum / weight.sqrt()
    }

    /// Share of the squares that the mean explains.
    pub(crate) fn constant_share(&self) -> f64 {
        let (sum, weight) = self.mean();
        sum * sum / weight / self.squares()
    }

    pub(crate) fn squares(&self) -> f64 {
        self.values.iter().zip(&self.weights).map(|(value, weight)| weight * value * value).sum()
    }

    fn mean(&self) -> (f64, f64) {
        let sum = self.values.iter().zip(&self.weights).map(|(value, weight)| weight * value).sum();
        (sum, self.weights.iter().sum())
    }
}
