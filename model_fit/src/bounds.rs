//! Numbers that ended at the end of their range, and numbers that the records hardly determine.

use super::report::{ModelReport, ParameterEstimate, significant};

/// How near to an end of its range a number counts as at it: this share of the end, and of the range.
const NEAR: f64 = 1e-4;
const NEAR_OF_RANGE: f64 = 1e-3;
/// Error over value from which on a number whose sign is known is hardly determined.
const WEAK: f64 = 0.5;
/// Tolerances from what a file expects, from which on a number is remarked.
const UNEXPECTED: f64 = 3.0;
/// Ratio of a held-out record's residual rms to that of the training records from which on it is remarked.
const MUCH_WORSE: f64 = 3.0;

pub(super) fn is_at_bound(value_si: f64, range_si: [f64; 2]) -> bool {
    let width = range_si[1] - range_si[0];
    range_si.iter().filter(|end| end.is_finite()).any(|end| {
        value_si == *end || (value_si - end).abs() <= (NEAR * end.abs()).min(NEAR_OF_RANGE * width)
    })
}

/// A number with the term that it belongs to.
fn name(number: &ParameterEstimate) -> String {
    number.suspect.as_ref().map_or(number.name.clone(), |suspect| format!("{} of {suspect}", number.name))
}

/// Of numbers that are fitted: which ended at an end of its range, which are hardly determined, and which are far from what the
/// file expects.
pub(super) fn remarks(numbers: &[ParameterEstimate]) -> Vec<String> {
    let remark = |number: &ParameterEstimate| {
        let value = format!("{} {}", significant(number.value), number.unit);
        if number.is_at_bound {
            return Some(format!(
                "{} ended at the end of its range, {value}: it has no error; widen the range, or say in \
                 the file why it ends there",
                name(number)
            ));
        }
        let error = number.standard_error?;
        (number.is_of_one_sign && error > WEAK * number.value.abs()).then(|| {
            format!(
                "{} is hardly determined: {value}, error {:.0} % of it; give a tolerance, make it fixed, or add a record",
                name(number),
                100.0 * error / number.value.abs()
            )
        })
    };
    numbers.iter().filter_map(remark).chain(numbers.iter().filter_map(unexpected)).collect()
}

/// A number that is many tolerances from its value in the file.
fn unexpected(number: &ParameterEstimate) -> Option<String> {
    let [value, tolerance] = number.expected?;
    let away = (number.value - value).abs() / tolerance;
    (away > UNEXPECTED).then(|| {
        format!(
            "{} is {} {}, {} tolerances from {}: is its unit, its sign or the tolerance wrong, does another number do the \
             same, or is something else missing?",
            name(number),
            significant(number.value),
            number.unit,
            significant(away),
            significant(value)
        )
    })
}

impl ModelReport {
    /// Held-out records with a much larger residual than the training records under the reported model: each with the ratio.
    pub(super) fn much_worse(&self) -> Vec<String> {
        let of = |residual: &super::ResidualComparison| {
            let fitted = self.training.iter().find(|fitted| fitted.output == residual.output)?;
            let ratio = residual.rms_after / fitted.rms_after;
            (fitted.rms_after > 0.0 && ratio > MUCH_WORSE).then(|| {
                format!(
                    "on {} {} {} {} rms is left, {ratio:.1} times that of the training records",
                    residual.record,
                    residual.output,
                    significant(residual.rms_after),
                    residual.unit
                )
            })
        };
        self.held_out.iter().filter_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::is_at_bound;

    #[test]
    fn a_number_is_at_an_end_that_it_has_all_but_reached() {
        let of = |value: f64| is_at_bound(value, [0.0, 10.0]);
        assert!(of(10.0) && of(9.99996) && of(0.0));
        assert!(!of(9.99) && !of(1e-5) && !is_at_bound(3.0, [f64::NEG_INFINITY, f64::INFINITY]));
        // A small number of a wide range is none, nor one of a narrow range far from 0.
        assert!(!is_at_bound(50.0, [0.0, 1e6]) && !is_at_bound(293.005, [293.0, 293.01]));
    }
}
