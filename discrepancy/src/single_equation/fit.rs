//! Least squares over rows, by normal equations of scaled columns: fits, folds left out, clustered standard errors.
//!
//! ```text
//!   c = (X' X)^-1 X' y          cov c = (X' X)^-1 (sum_g X_g' r_g r_g' X_g) (X' X)^-1  G / (G - 1)
//! ```
//!
//! g are blocks of time: the residual of a model that lacks something is no noise, and rows beside each other say the same twice.
//! For the same reason a count of rows is replaced by n / (1 + 2 sum rho_k), the sum ending where the autocorrelation first is
//! not positive.
//!
//! Source: Liang, Zeger 1986, Biometrika 73(1) (clusters). The sum ends on a single lag; Geyer 1992, Statistical Science 7(4),
//! ends it on sums of adjacent pairs of lags.

use crate::stats::mean;
use nalgebra::{DMatrix, DVector};

/// Smallest pivot of a scaled Gram matrix; below, columns are collinear.
const LEAST_PIVOT: f64 = 1e-9;

/// Columns of the same length.
pub(super) type Columns = Vec<Vec<f64>>;

#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) numbers: Vec<f64>,
    pub(super) residual: Vec<f64>,
}

/// Rows of all training records.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub(super) target: Vec<f64>,
    pub(super) in_score: Vec<bool>,
    /// Ranges of rows that are one record each.
    pub(super) records: Vec<std::ops::Range<usize>>,
}

/// One way of cutting rows into folds.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    pub(super) name: &'static str,
    pub(super) folds: Vec<Vec<usize>>,
}

/// Normal equations, columns scaled to rms 1.
struct Normal {
    gram: DMatrix<f64>,
    right: DVector<f64>,
}

fn scales(columns: &Columns) -> Vec<f64> {
    let rms = |c: &Vec<f64>| (c.iter().map(|v| v * v).sum::<f64>() / c.len().max(1) as f64).sqrt();
    columns.iter().map(|column| 1.0 / rms(column).max(1e-300)).collect()
}

fn normal(
    columns: &Columns,
    scales: &[f64],
    target: &[f64],
    rows: impl Iterator<Item = usize> + Clone,
) -> Normal {
    let count = columns.len();
    let mut gram = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for i in 0..count {
        right[i] = rows.clone().map(|row| columns[i][row] * target[row]).sum::<f64>() * scales[i];
        for j in 0..=i {
            let sum = rows.clone().map(|row| columns[i][row] * columns[j][row]).sum::<f64>();
            gram[(i, j)] = sum * scales[i] * scales[j];
            gram[(j, i)] = gram[(i, j)];
        }
    }
    Normal { gram, right }
}

impl Normal {
    /// The inverse of the Gram matrix; `None` for collinear columns over these rows.
    fn inverse(&self, rows: usize) -> Option<DMatrix<f64>> {
        let cholesky = (self.gram.clone() / rows.max(1) as f64).cholesky()?;
        let least =
            cholesky.l_dirty().diagonal().iter().fold(f64::INFINITY, |least, pivot| least.min(*pivot));
        let empty = self.gram.nrows() == 0;
        (empty || least * least > LEAST_PIVOT).then(|| cholesky.inverse() / rows.max(1) as f64)
    }
}

impl Rows {
    /// The fit of these columns; `None` when they are collinear.
    pub(super) fn fit(&self, columns: &Columns) -> Option<Fit> {
        let scales = scales(columns);
        let all = normal(columns, &scales, &self.target, 0..self.target.len());
        let numbers = all.inverse(self.target.len())? * &all.right;
        let numbers: Vec<f64> = numbers.iter().zip(&scales).map(|(number, scale)| number * scale).collect();
        let residual = residual(&self.target, columns, &numbers);
        Some(Fit { numbers, residual })
    }

    /// Squared residuals of each held-out fold, judged rows only; `None` where the other folds do not determine columns apart.
    pub(super) fn fold_rss(&self, columns: &Columns, cut: &Cut) -> Option<Vec<f64>> {
        let scales = scales(columns);
        let all = normal(columns, &scales, &self.target, 0..self.target.len());
        let each = cut.folds.iter().map(|fold| {
            let held_out = normal(columns, &scales, &self.target, fold.iter().copied());
            let rest = Normal { gram: &all.gram - held_out.gram, right: &all.right - held_out.right };
            let numbers = rest.inverse(self.target.len() - fold.len())? * &rest.right;
            let in_score = fold.iter().filter(|row| self.in_score[**row]);
            Some(
                in_score
                    .map(|row| {
                        let modelled: f64 =
                            (0..columns.len()).map(|i| numbers[i] * scales[i] * columns[i][*row]).sum();
                        (self.target[*row] - modelled).powi(2)
                    })
                    .sum(),
            )
        });
        each.collect()
    }

    /// Covariance of a fit's numbers, clustered by the folds of a cut.
    pub(super) fn covariance(&self, columns: &Columns, fit: &Fit, cut: &Cut) -> Option<DMatrix<f64>> {
        let scales = scales(columns);
        let inverse =
            normal(columns, &scales, &self.target, 0..self.target.len()).inverse(self.target.len())?;
        let count = columns.len();
        let mut meat = DMatrix::zeros(count, count);
        for fold in &cut.folds {
            let score = DVector::from_fn(count, |i, _| {
                fold.iter().map(|row| columns[i][*row] * scales[i] * fit.residual[*row]).sum::<f64>()
            });
            meat += &score * score.transpose();
        }
        let clusters = cut.folds.len() as f64;
        let scaled = &inverse * meat * &inverse * (clusters / (clusters - 1.0));
        Some(DMatrix::from_fn(count, count, |i, j| scaled[(i, j)] * scales[i] * scales[j]))
    }

    /// Sum of squares of judged rows.
    pub(super) fn rss(&self, residual: &[f64]) -> f64 {
        residual.iter().zip(&self.in_score).filter(|(_, in_score)| **in_score).map(|(r, _)| r * r).sum()
    }

    /// How many independent rows a residual is worth.
    pub(super) fn effective_sample_size(&self, residual: &[f64]) -> f64 {
        let in_score = self.in_score.iter().filter(|in_score| **in_score).count() as f64;
        let rss = residual.iter().map(|r| r * r).sum::<f64>().max(f64::MIN_POSITIVE);
        let longest = self.records.iter().map(ExactSizeIterator::len).max().unwrap_or(0) / 4;
        let mut sum = 0.0;
        for lag in 1..longest {
            let products = |range: &std::ops::Range<usize>| -> f64 {
                range.clone().skip(lag).map(|row| residual[row] * residual[row - lag]).sum()
            };
            let rho = self.records.iter().map(products).sum::<f64>() / rss;
            if rho <= 0.0 {
                break;
            }
            sum += rho;
        }
        (in_score / (1.0 + 2.0 * sum)).max(2.0)
    }

    /// Folds in time: each record in blocks.
    pub(super) fn in_time(&self, blocks: usize) -> Cut {
        let of = |range: &std::ops::Range<usize>| -> Vec<Vec<usize>> {
            let (start, length) = (range.start, range.len());
            (0..blocks)
                .map(|b| (start + length * b / blocks..start + length * (b + 1) / blocks).collect())
                .collect()
        };
        Cut { name: "time", folds: self.records.iter().flat_map(of).collect() }
    }

    /// Folds in bands of a variable, each with as many rows.
    pub(super) fn in_bands(&self, name: &'static str, of: &[f64], bands: usize) -> Cut {
        let mut order: Vec<usize> = (0..of.len()).collect();
        order.sort_by(|a, b| of[*a].total_cmp(&of[*b]).then(a.cmp(b)));
        let folds = (0..bands).map(|band| {
            let mut fold = order[order.len() * band / bands..order.len() * (band + 1) / bands].to_vec();
            fold.sort_unstable();
            fold
        });
        Cut { name, folds: folds.collect() }
    }
}

/// What columns leave of a target.
pub(super) fn residual(target: &[f64], columns: &Columns, numbers: &[f64]) -> Vec<f64> {
    (0..target.len())
        .map(|row| target[row] - numbers.iter().zip(columns).map(|(number, c)| number * c[row]).sum::<f64>())
        .collect()
}

/// Root of the mean square.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Mean over its standard error, of differences that are one for each fold and taken as independent.
pub(crate) fn clustered_t(differences: &[f64]) -> f64 {
    let count = differences.len() as f64;
    let mean = mean(differences);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean / (variance / count).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(target: Vec<f64>) -> Rows {
        let count = target.len();
        Rows { target, in_score: vec![true; count], records: std::iter::once(0..count).collect() }
    }

    fn line() -> (Rows, Columns) {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let target = x.iter().map(|x| 3.0 + 2e-3 * x).collect();
        (rows(target), vec![vec![1.0; 100], x])
    }

    #[test]
    fn what_was_put_in_comes_out_and_a_fold_left_out_is_met() {
        let (rows, columns) = line();
        let fit = rows.fit(&columns).unwrap();
        assert!((fit.numbers[0] - 3.0).abs() < 1e-9 && (fit.numbers[1] - 2e-3).abs() < 1e-9, "{fit:?}");
        let left = rows.fold_rss(&columns, &rows.in_time(5)).unwrap();
        assert!(left.len() == 5 && left.iter().all(|squares| *squares < 1e-12), "{left:?}");
    }

    #[test]
    fn columns_that_cannot_be_told_apart_are_no_fit() {
        let (rows, mut columns) = line();
        columns.push(columns[1].iter().map(|x| 5.0 * x + 1.0).collect());
        assert!(rows.fit(&columns).is_none());
        // And a band that alone has a column's values leaves a rest that cannot tell it.
        let step: Vec<f64> = (0..100).map(|at| if at < 20 { 1.0 } else { 0.0 }).collect();
        assert!(rows.fold_rss(&vec![vec![1.0; 100], step], &rows.in_time(5)).is_none());
    }

    #[test]
    fn rows_that_repeat_their_neighbours_count_once() {
        // Ten values, each ten times, of alternating signs that sum up to nothing.
        let residual: Vec<f64> = (0..1000).map(|at| if (at / 10) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let rows = rows(residual.clone());
        let effective = rows.effective_sample_size(&residual);
        assert!((100.0..300.0).contains(&effective), "{effective}");
    }

    #[test]
    fn a_clustered_error_sees_that_blocks_differ() {
        // An offset that is 1 in one half of the blocks and -1 in the other has mean 0 and error 1 / sqrt(blocks - 1).
        let target: Vec<f64> = (0..100).map(|at| if (at / 10) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let rows = rows(target);
        let columns = vec![vec![1.0; 100]];
        let fit = rows.fit(&columns).unwrap();
        let covariance = rows.covariance(&columns, &fit, &rows.in_time(10)).unwrap();
        assert!((covariance[(0, 0)].sqrt() - 1.0 / 3.0).abs() < 1e-9, "{covariance}");
    }
}
