//! Standard errors with autocorrelated residuals and an approximate (misspecified) law.
//!
//! ```text
//!   error^2 = max(s^2 n / n_eff, e_b^2) + e_law^2                      s of the model, n_eff the effective sample size
//!   e_b^2 = (B - 1)/B sum over blocks b of (theta_(b) - mean)^2        delete-one-block jackknife
//! ```
//! theta_(b): the fit without block b, by one linear step. Where the law is approximate, the estimate differs between blocks that
//! visit other places, and that spread is in e_b. A misfit that is the same in every block is not.
//!
//! ```text
//!   number of the law          e_law = LAW |theta|                 the law's form is known to a share LAW of its size
//!   other number               e_law = LAW |theta - theta_0|       theta_0: fitted without the law
//! ```
//! A part of the law's effect that has another form than the law is left to the other numbers, without a trace in the residual;
//! what the whole law takes from them is theta - theta_0. LAW is a declared size of the model error, of the kind of a
//! discrepancy term's prior [Kennedy, O'Hagan 2001, JRSS B 63(3); Brynjarsdóttir, O'Hagan 2014, Inverse Problems 30(11):
//! without one, intervals do not hold].
//!
//! Sources: Künsch 1989, Annals of Statistics 17(3) (blocks).

use super::bounds;
use super::fit::UnknownId;
use super::normal::{correlations, standard_errors};
use super::select::Fitted;
use nalgebra::{DMatrix, DVector};

/// Error of a number, SI: by the records, and by an approximate law.
#[derive(Clone, Copy, Debug)]
pub(super) struct NumberError {
    of_records: f64,
    of_law: f64,
}

impl NumberError {
    pub(super) fn total(self) -> f64 {
        self.of_records.hypot(self.of_law)
    }
}

/// Errors of the numbers of a fit: the larger of the model-based error, inflated for autocorrelation, and the jackknife's. Where
/// a law was named, its model error is added in quadrature. `None` for a number that the records do not determine.
pub(super) fn errors(fitted: &Fitted<'_>, baseline: &Fitted<'_>, has_law: bool) -> Vec<Option<NumberError>> {
    let fitting = &fitted.fitting;
    let counts: f64 = (0..fitted.effective.len()).map(|output| fitting.count(output)).sum();
    let inflation = (counts / fitted.effective.iter().sum::<f64>().max(1.0)).max(1.0).sqrt();
    let errors = standard_errors(&fitted.normal);
    let of_blocks = of_blocks(&fitted.steps);
    let all = fitting.unknowns.iter().zip(&fitted.point.values_si).zip(errors.into_iter().zip(of_blocks));
    all.map(|((unknown, value), (error, of_blocks))| {
        let of_law = if has_law { of_law(*value, before(baseline, unknown.id)) } else { 0.0 };
        error.map(|error| NumberError { of_records: (error * inflation).max(of_blocks), of_law })
    })
    .collect()
}

/// What a number is in another fit.
pub(super) fn before(baseline: &Fitted<'_>, id: UnknownId) -> Option<f64> {
    let place = baseline.fitting.unknowns.iter().position(|other| other.id == id);
    place.map(|place| baseline.point.values_si[place])
}

/// Covariance of numbers at these places, SI; one at the end of its range does not vary. The errors by the records are
/// correlated as the normal equations have them, those of the law are not. `None` where the records do not determine one.
pub(super) fn of_numbers(
    fitted: &Fitted<'_>,
    errors: &[Option<NumberError>],
    places: &[usize],
) -> Option<DMatrix<f64>> {
    let correlations = correlations(&fitted.normal);
    let of_place = |place: &usize| {
        let range_si = fitted.fitting.unknowns[*place].range_si;
        match bounds::is_at_bound(fitted.point.values_si[*place], range_si) {
            true => Some(NumberError { of_records: 0.0, of_law: 0.0 }),
            false => errors[*place],
        }
    };
    let errors: Vec<NumberError> = places.iter().map(of_place).collect::<Option<_>>()?;
    let of_law = |row: usize, column: usize| if row == column { errors[row].of_law.powi(2) } else { 0.0 };
    Some(DMatrix::from_fn(places.len(), places.len(), |row, column| {
        let of_records = errors[row].of_records * errors[column].of_records;
        correlations[(places[row], places[column])] * of_records + of_law(row, column)
    }))
}

/// Standard errors from what the fit moves by without each block; zero for a number that none moves.
fn of_blocks(steps: &[DVector<f64>]) -> Vec<f64> {
    let count = steps.len() as f64;
    let of_number = |place: usize| {
        let mean = steps.iter().map(|step| step[place]).sum::<f64>() / count;
        let squares: f64 = steps.iter().map(|step| (step[place] - mean).powi(2)).sum();
        (squares * (count - 1.0) / count).sqrt()
    };
    (0..steps.first().map_or(0, DVector::len)).map(of_number).collect()
}

/// Share of a law that is another law: set on 18 draws of seed 1 of the study of any plant, whose laws are near to their
/// suspects.
const LAW: f64 = 0.1;

/// Error of a number beside a law that is only near; `baseline` is its value without the law, `None` for a number of the law.
fn of_law(value: f64, baseline: Option<f64>) -> f64 {
    LAW * (value - baseline.unwrap_or(0.0)).abs()
}

/// Autocorrelation of what series have in common, from lag 1, until it is not positive.
pub(super) fn autocorrelation(series: &[Vec<f64>]) -> Vec<f64> {
    let squares: f64 = series.iter().flatten().map(|value| value * value).sum();
    let longest = series.iter().map(Vec::len).max().unwrap_or(0) / 4;
    let of_lag = |lag: usize| -> f64 {
        let products = |values: &Vec<f64>| -> f64 {
            values.iter().skip(lag).zip(values).map(|(late, early)| late * early).sum()
        };
        series.iter().map(products).sum::<f64>() / squares.max(f64::MIN_POSITIVE)
    };
    (1..longest).map(of_lag).take_while(|value| *value > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::{autocorrelation, of_blocks};
    use nalgebra::DVector;

    #[test]
    fn the_jackknife_of_a_mean_is_its_standard_error() {
        // The mean of 1, 2, 4, 9 without each of them, less 4; s^2 = 38/3, over 4 samples.
        let values = [1.0, 2.0, 4.0, 9.0];
        let steps = values.map(|value| DVector::from_vec(vec![(16.0 - value) / 3.0 - 4.0, 0.0]));
        let errors = of_blocks(&steps);
        assert!((errors[0] - (38.0_f64 / 12.0).sqrt()).abs() < 1e-12, "{errors:?}");
        assert!(errors[1].abs() < f64::EPSILON && of_blocks(&[]).is_empty());
    }

    #[test]
    fn an_autocorrelation_ends_where_it_is_not_positive() {
        // Runs of four equal values: 3/4 - 1/4 at lag 1, 2/4 - 2/4 and the ends at lag 2, negative at lag 3.
        let series = (0..400).map(|at| if (at / 4) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let found = autocorrelation(&[series]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0] - 0.5).abs() < 0.01 && found[1] < 0.01, "{found:?}");
    }
}
