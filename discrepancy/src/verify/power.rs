//! Residual power of each window and output over its null expectation.

use super::VARIANCE_FACTOR_BOUNDS;
use super::null_power::NullPower;
use crate::windows::WINDOW_PERIODS;
use model_fit::stats::order_statistic;

/// Share of trimmed windows.
const LEFT_OUT: f64 = 0.02;
/// Quantile of the windows that measures the noise level.
const DECILE: f64 = 0.1;

/// Squares of a window and their null expectation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Squares {
    /// Sum of squared residuals, in squares of the noise.
    pub(super) sum: f64,
    /// Null expectation; 0 without samples.
    pub(super) expected: f64,
}

impl Squares {
    pub(super) fn ratio(self) -> f64 {
        self.sum / self.expected
    }
}

/// Squares of all windows and outputs, window by window.
#[derive(Clone, Debug)]
pub(super) struct Power {
    outputs: usize,
    squares: Vec<Squares>,
}

/// Sums of squares of each window and output.
pub(super) fn sums(residual: &[f64], outputs: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(residual.len() / WINDOW_PERIODS);
    for window in residual.chunks_exact(WINDOW_PERIODS * outputs) {
        let output = |output: usize| {
            window.iter().skip(output).step_by(outputs).map(|value| value * value).sum::<f64>()
        };
        sums.extend((0..outputs).map(output));
    }
    sums
}

impl Power {
    /// Sums of squares and their null expectations.
    pub(super) fn new(sums: &[f64], expected: &[f64], outputs: usize) -> Self {
        let squares = sums
            .iter()
            .zip(expected)
            .map(|(sum, expected)| Squares { sum: *sum, expected: *expected })
            .collect();
        Power { outputs, squares }
    }

    /// The smaller of two in each window and output.
    pub(super) fn smaller(&self, other: &Power) -> Power {
        let squares = self
            .squares
            .iter()
            .zip(&other.squares)
            .map(|(one, other)| Squares { sum: one.sum.min(other.sum), ..*one })
            .collect();
        Power { outputs: self.outputs, squares }
    }

    /// The same with the level of each output divided out.
    pub(super) fn divided_by_levels(&self, levels: &[f64]) -> Power {
        let squares = self
            .squares
            .iter()
            .zip(levels.iter().cycle())
            .map(|(squares, level)| Squares { sum: squares.sum / level, ..*squares })
            .collect();
        Power { outputs: self.outputs, squares }
    }

    /// One output, window by window.
    pub(super) fn output(&self, output: usize) -> Vec<Squares> {
        self.squares.iter().skip(output).step_by(self.outputs).copied().collect()
    }

    /// All outputs together, window by window.
    pub(super) fn joint(&self) -> Vec<Squares> {
        let sum = |outputs: &[Squares]| {
            outputs.iter().fold(Squares::default(), |total, output| Squares {
                sum: total.sum + output.sum,
                expected: total.expected + output.expected,
            })
        };
        self.squares.chunks_exact(self.outputs).map(sum).collect()
    }

    /// The quantile of each output's windows that measures its level.
    pub(super) fn lower_decile(&self) -> Vec<f64> {
        (0..self.outputs)
            .map(|output| {
                let squares = self.output(output);
                let mut ratios: Vec<f64> =
                    squares.into_iter().filter(|window| window.expected > 0.0).map(Squares::ratio).collect();
                let rank = (DECILE * ratios.len() as f64) as usize;
                order_statistic(&mut ratios, rank).unwrap_or(1.0)
            })
            .collect()
    }
}

/// Level of each output's noise, as a factor on its power.
pub(super) fn levels(power: &Power, null: &NullPower) -> Vec<f64> {
    let lower_decile = power.lower_decile();
    lower_decile
        .iter()
        .zip(&null.lower_decile)
        .map(|(quantile, mean)| (quantile / mean).clamp(VARIANCE_FACTOR_BOUNDS[0], VARIANCE_FACTOR_BOUNDS[1]))
        .collect()
}

/// Windows that remain after trimming. Of two models `squares` has the smaller power of both in each window, so that a fault of
/// the record is trimmed and an error of one model alone is not.
pub(super) fn untrimmed(squares: &[Squares]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..squares.len()).filter(|at| squares[*at].expected > 0.0).collect();
    // A stable sort: equal windows stay in their order.
    order.sort_by(|left, right| squares[*right].ratio().total_cmp(&squares[*left].ratio()));
    let out = (LEFT_OUT * order.len() as f64).ceil() as usize;
    let mut kept: Vec<bool> = squares.iter().map(|squares| squares.expected > 0.0).collect();
    // At least one window remains.
    for at in order.iter().take(out.min(order.len().saturating_sub(1))) {
        kept[*at] = false;
    }
    kept
}

/// Pooled power ratio of the remaining windows; 0 without any.
pub(super) fn pooled(squares: &[Squares], kept: &[bool]) -> f64 {
    let (sum, expected) = squares
        .iter()
        .zip(kept)
        .filter(|(_, kept)| **kept)
        .fold((0.0, 0.0), |total, (window, _)| (total.0 + window.sum, total.1 + window.expected));
    if expected > 0.0 { sum / expected } else { 0.0 }
}

/// Lag-1 autocorrelation of an output in the remaining windows.
pub(super) fn lag1_autocorrelation(residual: &[f64], output: usize, outputs: usize, kept: &[bool]) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (window, _) in residual.chunks_exact(WINDOW_PERIODS * outputs).zip(kept).filter(|(_, kept)| **kept) {
        let series: Vec<f64> = window.iter().skip(output).step_by(outputs).copied().collect();
        products += series.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
        squares += series.iter().map(|value| value * value).sum::<f64>();
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}
