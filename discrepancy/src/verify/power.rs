//! What residuals have in each window and lane, over what noise alone gives there.

use super::LEVELS;
use super::nothing::Nothing;
use crate::windows::WINDOW;

/// Share of the windows that is left out, the worst of the extended model.
const LEFT_OUT: f64 = 0.02;
/// Share of the windows that tells the level of the noise: its quantile.
const QUIET: f64 = 0.1;

/// Squares of a window, and what noise alone would have.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Squares {
    /// Sum of squared residuals, in squares of the noise.
    pub(super) own: f64,
    /// Mean of the same for noise; 0 where there are no samples.
    pub(super) expected: f64,
}

impl Squares {
    pub(super) fn over(self) -> f64 {
        self.own / self.expected
    }
}

/// Squares of all windows and lanes, window by window.
#[derive(Clone, Debug)]
pub(super) struct Power {
    lanes: usize,
    squares: Vec<Squares>,
}

/// Sums of squares of each window and lane.
pub(super) fn sums(residual: &[f64], lanes: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(residual.len() / WINDOW);
    for window in residual.chunks_exact(WINDOW * lanes) {
        let lane = |lane: usize| window.iter().skip(lane).step_by(lanes).map(|own| own * own).sum::<f64>();
        sums.extend((0..lanes).map(lane));
    }
    sums
}

impl Power {
    /// Sums of squares where noise alone has `expected`.
    pub(super) fn new(sums: &[f64], expected: &[f64], lanes: usize) -> Self {
        let squares = sums
            .iter()
            .zip(expected)
            .map(|(own, expected)| Squares { own: *own, expected: *expected })
            .collect();
        Power { lanes, squares }
    }

    /// The smaller of two in each window and lane.
    pub(super) fn smaller(&self, other: &Power) -> Power {
        let squares = self
            .squares
            .iter()
            .zip(&other.squares)
            .map(|(own, other)| Squares { own: own.own.min(other.own), ..*own })
            .collect();
        Power { lanes: self.lanes, squares }
    }

    /// The same with a level of noise taken out of each lane.
    pub(super) fn over(&self, levels: &[f64]) -> Power {
        let squares = self
            .squares
            .iter()
            .zip(levels.iter().cycle())
            .map(|(own, level)| Squares { own: own.own / level, ..*own })
            .collect();
        Power { lanes: self.lanes, squares }
    }

    /// One lane, window by window.
    pub(super) fn lane(&self, lane: usize) -> Vec<Squares> {
        self.squares.iter().skip(lane).step_by(self.lanes).copied().collect()
    }

    /// All lanes together, window by window.
    pub(super) fn joint(&self) -> Vec<Squares> {
        let sum = |lanes: &[Squares]| {
            lanes.iter().fold(Squares::default(), |sum, own| Squares {
                own: sum.own + own.own,
                expected: sum.expected + own.expected,
            })
        };
        self.squares.chunks_exact(self.lanes).map(sum).collect()
    }

    /// The quantile of each lane's windows that tells its level, over what noise alone has on average.
    pub(super) fn quiet(&self) -> Vec<f64> {
        (0..self.lanes)
            .map(|lane| {
                let own = self.lane(lane);
                let mut own: Vec<f64> =
                    own.into_iter().filter(|own| own.expected > 0.0).map(Squares::over).collect();
                own.sort_unstable_by(f64::total_cmp);
                own.get((QUIET * own.len() as f64) as usize).copied().unwrap_or(1.0)
            })
            .collect()
    }
}

/// Level of each lane's noise, as a factor on its power.
pub(super) fn levels(power: &Power, nothing: &Nothing) -> Vec<f64> {
    let quiet = power.quiet();
    quiet.iter().zip(&nothing.quiet).map(|(own, mean)| (own / mean).clamp(LEVELS[0], LEVELS[1])).collect()
}

/// Which windows are judged: without the worst.
pub(super) fn kept(squares: &[Squares]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..squares.len()).filter(|at| squares[*at].expected > 0.0).collect();
    // A stable sort: equal windows stay in their order.
    order.sort_by(|left, right| squares[*right].over().total_cmp(&squares[*left].over()));
    let out = (LEFT_OUT * order.len() as f64).ceil() as usize;
    let mut kept: Vec<bool> = squares.iter().map(|own| own.expected > 0.0).collect();
    // One window is judged however few there are.
    for at in order.iter().take(out.min(order.len().saturating_sub(1))) {
        kept[*at] = false;
    }
    kept
}

/// Power over that of noise, of the windows that are judged; 0 without any.
pub(super) fn pooled(squares: &[Squares], kept: &[bool]) -> f64 {
    let (own, expected) = squares
        .iter()
        .zip(kept)
        .filter(|(_, kept)| **kept)
        .fold((0.0, 0.0), |sum, (own, _)| (sum.0 + own.own, sum.1 + own.expected));
    if expected > 0.0 { own / expected } else { 0.0 }
}

/// Lag-1 autocorrelation of a lane within the windows that are judged.
pub(super) fn neighbours(residual: &[f64], lane: usize, lanes: usize, kept: &[bool]) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (window, _) in residual.chunks_exact(WINDOW * lanes).zip(kept).filter(|(_, kept)| **kept) {
        let own: Vec<f64> = window.iter().skip(lane).step_by(lanes).copied().collect();
        products += own.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
        squares += own.iter().map(|own| own * own).sum::<f64>();
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}
