//! Robust least squares of columns over windows.
//!
//! ```text
//!   minimise  sum_k f_k ln(|e_k - C_k a|^2 / f_k) + sum_j ((a_j - m_j) / s_j)^2         window k, f_k degrees of freedom
//!                                                                                    m_j, s_j  prior mean, standard deviation
//! ```
//!
//! The first sum is, up to a constant, minus twice the profile log-likelihood of Gaussian windows of unknown variance; its null
//! expectation is about -1 for each window. The contribution of a window grows only
//! logarithmically, so that a few windows around a break-away do not dominate; within the noise it is least squares. It is
//! minimised by iterative reweighting: the weight of a window is f_k / |e_k - C_k a|^2.
//!
//! Normal equations are kept for each window, so that any selection of columns is solved without the samples.
//!
//! Source: discrepancy-notes.md, 3, 6 (clustered scores, weights on windows and not on samples). Ljung 1999, System
//! Identification, 15.3, and Seber, Wild 1989, Nonlinear Regression, 2.2.3: likelihood concentrated over variances.

mod errors;
pub(crate) mod evidence;

use crate::windows::dot;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Passes of reweighting.
const PASSES: usize = 12;
/// Fall of the loss below which it has converged.
const ABSOLUTE_TOLERANCE: f64 = 1e-3;

/// Lower bound of the chi2 per degree of freedom of a window.
pub(crate) const MIN_CHI2_PER_DOF: f64 = 1e-3;

/// The loss of windows with these squares and degrees of freedom.
pub(crate) fn loss(squares: &[f64], dof: &[f64]) -> f64 {
    squares.iter().zip(dof).map(|(square, dof)| dof * (square / dof).max(MIN_CHI2_PER_DOF).ln()).sum()
}

/// Products of a residual and some columns, window by window.
#[derive(Clone, Debug)]
pub(crate) struct Products {
    pub(crate) columns: usize,
    /// Degrees of freedom of each window.
    dof: Vec<f64>,
    /// |e|^2 of each window.
    squares: Vec<f64>,
    /// C'e of each window.
    scores: Vec<Vec<f64>>,
    /// C'C of each window, row by row, shared by all residuals of the same columns.
    information: Arc<[Vec<f64>]>,
}

#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// Coefficient of each column that took part.
    pub(crate) coefficients: Vec<f64>,
    pub(crate) loss: f64,
    /// |e - C a|^2 of each window.
    pub(crate) squares: Vec<f64>,
    /// Final weight of each window.
    pub(crate) weights: Vec<f64>,
}

impl Products {
    /// The products of a residual with columns, all window by window of `rows` numbers.
    pub(crate) fn new<C: AsRef<[f64]>>(residual: &[f64], columns: &[C], dof: &[f64], rows: usize) -> Self {
        let windows = dof.len();
        let information = (0..windows)
            .map(|window| {
                let part = |column: usize| &columns[column].as_ref()[window * rows..][..rows];
                let mut products = vec![0.0; columns.len() * columns.len()];
                for left in 0..columns.len() {
                    for right in 0..=left {
                        let product = dot(part(left), part(right));
                        products[left * columns.len() + right] = product;
                        products[right * columns.len() + left] = product;
                    }
                }
                products
            })
            .collect();
        let mut products = Products {
            columns: columns.len(),
            dof: dof.to_vec(),
            squares: Vec::new(),
            scores: Vec::new(),
            information,
        };
        products.set_residual(residual, columns, rows);
        products
    }

    pub(crate) fn set_residual<C: AsRef<[f64]>>(&mut self, residual: &[f64], columns: &[C], rows: usize) {
        let windows = residual.chunks_exact(rows);
        self.squares = windows.clone().map(|residual| dot(residual, residual)).collect();
        self.scores = windows
            .enumerate()
            .map(|(window, residual)| {
                columns
                    .iter()
                    .map(|column| dot(residual, &column.as_ref()[window * rows..][..rows]))
                    .collect()
            })
            .collect();
    }

    /// The products of another residual with the same columns.
    pub(crate) fn of_residual<C: AsRef<[f64]>>(&self, residual: &[f64], columns: &[C], rows: usize) -> Self {
        let mut products = self.clone();
        products.set_residual(residual, columns, rows);
        products
    }

    /// The same residual with the squares that noise adds on average.
    pub(crate) fn with_expected_noise(mut self) -> Self {
        self.squares.iter_mut().zip(&self.dof).for_each(|(square, dof)| *square += dof);
        self
    }

    /// The same with further columns, whose products are known: for each window C'e of the further ones, and the information
    /// between the present and the further ones, and among the further ones.
    pub(crate) fn extended(
        &self,
        scores: &[Vec<f64>],
        information: &[(DMatrix<f64>, DMatrix<f64>)],
    ) -> Products {
        let (present, further) = (self.columns, scores.first().map_or(0, Vec::len));
        let columns = present + further;
        let information = self.information.iter().zip(information).map(|(known, (between, among))| {
            let mut products = vec![0.0; columns * columns];
            for row in 0..columns {
                for column in 0..columns {
                    products[row * columns + column] = match (row < present, column < present) {
                        (true, true) => known[row * present + column],
                        (true, false) => between[(row, column - present)],
                        (false, true) => between[(column, row - present)],
                        (false, false) => among[(row - present, column - present)],
                    };
                }
            }
            products
        });
        let scores =
            self.scores.iter().zip(scores).map(|(known, further)| [known.as_slice(), further].concat());
        let (dof, squares) = (self.dof.clone(), self.squares.clone());
        Products { columns, dof, squares, scores: scores.collect(), information: information.collect() }
    }

    pub(crate) fn loss(&self, squares: &[f64]) -> f64 {
        loss(squares, &self.dof)
    }

    pub(crate) fn weights(&self, squares: &[f64]) -> Vec<f64> {
        let weight = |(square, dof): (&f64, &f64)| dof / square.max(MIN_CHI2_PER_DOF * dof);
        squares.iter().zip(&self.dof).map(weight).collect()
    }

    /// |e - C a|^2 of each window for some columns.
    fn squares(&self, chosen: &[usize], coefficients: &[f64]) -> Vec<f64> {
        (0..self.squares.len())
            .map(|window| {
                let (scores, information) = (&self.scores[window], &self.information[window]);
                let mut square = self.squares[window];
                for (at, coefficient) in chosen.iter().zip(coefficients) {
                    square -= 2.0 * coefficient * scores[*at];
                    for (other_at, other) in chosen.iter().zip(coefficients) {
                        square += coefficient * other * information[at * self.columns + other_at];
                    }
                }
                square.max(0.0)
            })
            .collect()
    }

    /// Weighted normal equations of some columns, with ridges 1 / s_j^2.
    pub(crate) fn normal(
        &self,
        chosen: &[usize],
        weights: &[f64],
        precisions: &[f64],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let count = chosen.len();
        let mut matrix = DMatrix::zeros(count, count);
        let mut vector = DVector::zeros(count);
        for (window, weight) in weights.iter().enumerate() {
            for (row, at) in chosen.iter().enumerate() {
                vector[row] += weight * self.scores[window][*at];
                for (column, other) in chosen.iter().enumerate().take(row + 1) {
                    matrix[(row, column)] += weight * self.information[window][at * self.columns + other];
                }
            }
        }
        for row in 0..count {
            for column in 0..row {
                matrix[(column, row)] = matrix[(row, column)];
            }
            matrix[(row, row)] += precisions[row];
        }
        (matrix, vector)
    }

    /// The solution of the weighted normal equations; `prior_offset` is what earlier steps added to each coefficient. `None`
    /// where they are singular.
    pub(crate) fn weighted_solution(
        &self,
        chosen: &[usize],
        weights: &[f64],
        precisions: &[f64],
        prior_offset: &[f64],
    ) -> Option<Vec<f64>> {
        self.bounded_solution(chosen, weights, precisions, prior_offset, &vec![f64::INFINITY; chosen.len()])
    }

    /// The same with the sums of `prior_offset` and the coefficients within `most`: those that exceed it are held there, and the
    /// others are solved for again.
    fn bounded_solution(
        &self,
        chosen: &[usize],
        weights: &[f64],
        precisions: &[f64],
        prior_offset: &[f64],
        most: &[f64],
    ) -> Option<Vec<f64>> {
        let (matrix, mut vector) = self.normal(chosen, weights, precisions);
        vector
            .iter_mut()
            .zip(precisions)
            .zip(prior_offset)
            .for_each(|((score, precision), prior_offset)| *score -= precision * prior_offset);
        let mut solution: Vec<f64> = solve(matrix.clone(), &vector)?.iter().copied().collect();
        let mut free: Vec<usize> = (0..chosen.len()).collect();
        loop {
            let exceeds = |at: &usize| (prior_offset[*at] + solution[*at]).abs() > most[*at];
            let (held, rest): (Vec<usize>, Vec<usize>) = free.iter().partition(|at| exceeds(at));
            if held.is_empty() {
                return Some(solution);
            }
            for at in held {
                solution[at] = most[at].copysign(prior_offset[at] + solution[at]) - prior_offset[at];
            }
            free = rest;
            let is_held = |at: &usize| !free.contains(at);
            let right = DVector::from_fn(free.len(), |row, _| {
                let of_held = (0..chosen.len()).filter(is_held);
                vector[free[row]] - of_held.map(|at| matrix[(free[row], at)] * solution[at]).sum::<f64>()
            });
            let among = DMatrix::from_fn(free.len(), free.len(), |row, at| matrix[(free[row], free[at])]);
            let solved = solve(among, &right)?;
            free.iter().zip(solved.iter()).for_each(|(at, value)| solution[*at] = *value);
        }
    }

    /// The best coefficients of some columns; `precisions` as in [`Products::normal`].
    pub(crate) fn fit(&self, chosen: &[usize], precisions: &[f64]) -> Fit {
        self.fit_from(chosen, precisions, &vec![0.0; chosen.len()])
    }

    /// The same with prior means at `-prior_offset`: ridges act on the sums of `prior_offset` and the coefficients.
    pub(crate) fn fit_from(&self, chosen: &[usize], precisions: &[f64], prior_offset: &[f64]) -> Fit {
        self.fit_within(chosen, precisions, prior_offset, &vec![f64::INFINITY; chosen.len()])
    }

    /// The same with the absolute values of these sums at most `most`.
    pub(crate) fn fit_within(
        &self,
        chosen: &[usize],
        precisions: &[f64],
        prior_offset: &[f64],
        most: &[f64],
    ) -> Fit {
        let mut weights = self.weights(&self.squares);
        let mut coefficients = vec![0.0; chosen.len()];
        let mut squares = self.squares.clone();
        let prior_loss = |coefficients: &[f64]| -> f64 {
            coefficients
                .iter()
                .zip(prior_offset)
                .zip(precisions)
                .map(|((value, prior_offset), precision)| precision * (value + prior_offset).powi(2))
                .sum()
        };
        let mut loss = self.loss(&squares) + prior_loss(&coefficients);
        for _ in 0..PASSES {
            let Some(tried) = self.bounded_solution(chosen, &weights, precisions, prior_offset, most) else {
                break;
            };
            let tried_squares = self.squares(chosen, &tried);
            let tried_loss = self.loss(&tried_squares) + prior_loss(&tried);
            if tried_loss >= loss {
                break;
            }
            let converged = loss - tried_loss < ABSOLUTE_TOLERANCE;
            (coefficients, squares, loss) = (tried, tried_squares, tried_loss);
            weights = self.weights(&squares);
            if converged {
                break;
            }
        }
        Fit { coefficients, loss, squares, weights }
    }

    /// Cross-validated loss: each fold, a contiguous stretch of windows, is judged with the coefficients of the others. Other
    /// arguments as in [`Products::fit_from`]. At a minimum, the difference to [`Products::loss`] is overfitting.
    pub(crate) fn cross_validated_loss(
        &self,
        chosen: &[usize],
        precisions: &[f64],
        prior_offset: &[f64],
        folds: usize,
    ) -> f64 {
        let all = self.weights(&self.squares);
        let windows = self.squares.len();
        let of = |fold: usize| fold * windows / folds..(fold + 1) * windows / folds;
        let judged = (0..folds).flat_map(|fold| {
            let mut weights = all.clone();
            weights[of(fold)].fill(0.0);
            let solution = self.weighted_solution(chosen, &weights, precisions, prior_offset);
            let solution = solution.unwrap_or_else(|| vec![0.0; chosen.len()]);
            self.squares(chosen, &solution)[of(fold)].to_vec()
        });
        self.loss(&judged.collect::<Vec<_>>())
    }

    /// For each further column: its weighted window scores and its information, with the first columns projected out.
    pub(crate) fn efficient_scores(
        &self,
        first: &[usize],
        weights: &[f64],
        precisions: &[f64],
    ) -> Vec<(Vec<f64>, f64)> {
        let count = first.len();
        let (matrix, _) = self.normal(first, weights, precisions);
        let inverse = matrix.try_inverse().unwrap_or_else(|| DMatrix::zeros(count, count));
        let weighted = |row: usize, column: usize| -> f64 {
            let windows = weights.iter().zip(self.information.iter());
            windows.map(|(weight, products)| weight * products[row * self.columns + column]).sum()
        };
        (count..self.columns)
            .map(|column| {
                let cross = DVector::from_iterator(count, first.iter().map(|at| weighted(*at, column)));
                let shares = &inverse * &cross;
                let whole = weighted(column, column);
                let scores = weights
                    .iter()
                    .zip(&self.scores)
                    .map(|(weight, scores)| {
                        let taken: f64 =
                            first.iter().zip(shares.iter()).map(|(at, share)| share * scores[*at]).sum();
                        weight * (scores[column] - taken)
                    })
                    .collect();
                (scores, (whole - cross.dot(&shares)).max(1e-9 * whole.max(1e-300)))
            })
            .collect()
    }
}

/// Solves nearly singular symmetric equations after diagonal scaling.
fn solve(matrix: DMatrix<f64>, vector: &DVector<f64>) -> Option<DVector<f64>> {
    let count = vector.len();
    let scales: Vec<f64> = (0..count).map(|at| matrix[(at, at)].max(1e-12).sqrt()).collect();
    let mut scaled = matrix;
    let mut right = vector.clone();
    for row in 0..count {
        for column in 0..count {
            scaled[(row, column)] /= scales[row] * scales[column];
        }
        scaled[(row, row)] += 1e-10;
        right[row] /= scales[row];
    }
    let solved = scaled.cholesky()?.solve(&right);
    Some(DVector::from_iterator(count, solved.iter().zip(&scales).map(|(value, scale)| value / scale)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Ten windows of 50 numbers: a wave of one column, and noise that is the same each time.
    fn synthetic_windows(amplitude: f64, spoilt: bool) -> (Vec<f64>, Vec<f64>) {
        let column: Vec<f64> = (0..500).map(|at| (f64::from(at) * 0.37).sin()).collect();
        let noise =
            (0..500_u32).map(|at| f64::from(at.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5);
        let residual = column
            .iter()
            .zip(noise)
            .enumerate()
            .map(|(at, (value, noise))| {
                amplitude * value + noise * 12.0_f64.sqrt() + if spoilt && at < 50 { 40.0 } else { 0.0 }
            })
            .collect();
        (residual, column)
    }

    #[test]
    fn what_was_only_learned_is_seen_on_windows_that_were_left_out() {
        // Columns that have nothing to do with the residual, and one that is in it.
        let (residual, column) = synthetic_windows(0.8, false);
        let mut random = Pcg64::seed_from_u64(7);
        let chance: Vec<Vec<f64>> = (0..24)
            .map(|_| (0..500).map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5).collect())
            .collect();
        let loss = |columns: &[&[f64]]| {
            let all: Vec<usize> = (0..columns.len()).collect();
            let precisions = vec![1e-6; columns.len()];
            let products = Products::new(&residual, columns, &[50.0; 10], 50);
            let fit = products.fit(&all, &precisions);
            let mut after = residual.clone();
            for (column, coefficient) in columns.iter().zip(&fit.coefficients) {
                after.iter_mut().zip(*column).for_each(|(value, part)| *value -= coefficient * part);
            }
            let products = Products::new(&after, columns, &[50.0; 10], 50);
            (fit.loss, products.cross_validated_loss(&all, &precisions, &fit.coefficients, 5))
        };
        let null = loss(&[]).1;
        let (seen, unseen) = loss(&[&column]);
        assert!(unseen < null - 50.0 && (unseen - seen).abs() < 5.0, "{null} {seen} {unseen}");
        let (seen, unseen) = loss(&chance.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert!(seen < null - 10.0 && unseen > null, "{null} {seen} {unseen}");
    }

    #[test]
    fn the_amplitude_comes_back_even_when_a_window_is_spoilt() {
        for spoilt in [false, true] {
            let (residual, column) = synthetic_windows(0.8, spoilt);
            let products = Products::new(&residual, &[&column], &[50.0; 10], 50);
            let fit = products.fit(&[0], &[0.0]);
            assert!((fit.coefficients[0] - 0.8).abs() < 0.2, "{:?}", fit.coefficients);
            let error = products.covariance(&[0], &fit, &[0.0]).unwrap()[(0, 0)].sqrt();
            assert!((0.02..0.2).contains(&error), "{error}");
        }
    }

    #[test]
    fn a_tolerance_holds_a_coefficient_back() {
        let (residual, column) = synthetic_windows(0.8, false);
        let products = Products::new(&residual, &[&column], &[50.0; 10], 50);
        let held = products.fit(&[0], &[1e6]);
        assert!(held.coefficients[0].abs() < 0.01, "{:?}", held.coefficients);
    }

    #[test]
    fn a_bounded_coefficient_stays_at_its_bound_and_the_others_follow() {
        let (residual, column) = synthetic_windows(0.8, false);
        let other: Vec<f64> =
            column.iter().enumerate().map(|(at, value)| value + (at as f64).cos()).collect();
        let products = Products::new(&residual, &[&column, &other], &[50.0; 10], 50);
        let within =
            |most: f64| products.fit_within(&[0, 1], &[1e-6; 2], &[0.1, 0.0], &[most, f64::INFINITY]);
        let (free, bounded) = (within(2.0), within(0.3));
        assert_eq!(free.coefficients, products.fit_from(&[0, 1], &[1e-6; 2], &[0.1, 0.0]).coefficients);
        assert!((bounded.coefficients[0] - 0.2).abs() < 1e-12 && bounded.loss > free.loss, "{bounded:?}");
        assert!(bounded.coefficients[1] > free.coefficients[1] + 0.1, "{bounded:?} {free:?}");
    }

    /// A standard normal number from a generator that is the same each time.
    fn normal(random: &mut Pcg64) -> f64 {
        let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        Normal::standard().inverse_cdf(share.clamp(1e-12, 1.0 - 1e-12))
    }

    #[test]
    fn two_standard_errors_hold_the_truth_however_few_windows_tell() {
        let mut random = Pcg64::seed_from_u64(7);
        let rows = 20;
        for informative in [4_usize, 40] {
            let column: Vec<f64> = (0..40 * rows)
                .map(|at| if at < informative * rows { (at as f64).sin() } else { 0.0 })
                .collect();
            let held = (0..400)
                .filter(|_| {
                    // What hangs together within a window, and no model knows of.
                    let residual: Vec<f64> = (0..40)
                        .flat_map(|_| {
                            let common = 0.3 * normal(&mut random);
                            (0..rows).map(|_| normal(&mut random) + common).collect::<Vec<_>>()
                        })
                        .zip(&column)
                        .map(|(noise, value)| noise + 0.5 * value)
                        .collect();
                    let products = Products::new(&residual, &[&column], &[rows as f64; 40], rows);
                    let fit = products.fit(&[0], &[1e-9]);
                    let error = products.jackknife(&[0], &fit, &[1e-9]).unwrap()[0];
                    (fit.coefficients[0] - 0.5).abs() <= 2.0 * error
                })
                .count();
            assert!((360..=392).contains(&held), "{informative} windows: {held} of 400");
        }
    }
}
