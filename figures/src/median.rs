//! The median of a few values, with an interval that needs no distribution.
//!
//! Each of n values in rising order, x_1 … x_n, lies below the true median with probability ½, so the median is between x_j and
//! x_(n+1−j) with
//!
//! ```text
//!   confidence = 1 − 2 · Σ_{i<j} C(n, i) / 2^n          n = 10, j = 2: 1 − 2 · 11/1024 = 97.9 %
//! ```
//!
//! The narrowest interval of at least 95 % is reported; five values and fewer have none.
//!
//! # Source
//! H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed. 2003, section 7.1.

const CONFIDENCE: f64 = 0.95;
/// Fewer values have no interval: 1 − 2 · (1/2)^5 is below [`CONFIDENCE`].
pub const LEAST_VALUES: u64 = 6;

/// A median; its interval, from six values on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Median {
    /// The median, in the values' unit.
    pub value: f64,
    /// Its interval, least and most.
    pub interval: Option<(f64, f64)>,
    /// Probability that the interval holds the true median, such as 0.979 for ten values.
    pub confidence: Option<f64>,
}

/// The median of these values; nothing of nothing.
pub fn median(mut values: Vec<f64>) -> Option<Median> {
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let value = match count {
        0 => return None,
        count if count % 2 == 1 => values[count / 2],
        count => f64::midpoint(values[count / 2 - 1], values[count / 2]),
    };
    let (interval, confidence) = match order(count) {
        Some((j, confidence)) => (Some((values[j - 1], values[count - j])), Some(confidence)),
        None => (None, None),
    };
    Some(Median { value, interval, confidence })
}

/// Rank from each end, from 1, and the confidence of the interval between: the narrowest of enough confidence.
fn order(count: usize) -> Option<(usize, f64)> {
    let mut best = None;
    // C(n, i) / 2^n, which stays a plain number for any count of values.
    let mut probability = 0.5f64.powi(i32::try_from(count).ok()?);
    let mut below = 0.0;
    for j in 1..=count.div_ceil(2) {
        below += probability;
        probability *= (count - j + 1) as f64 / j as f64;
        let confidence = 1.0 - 2.0 * below;
        if confidence < CONFIDENCE {
            break;
        }
        best = Some((j, confidence));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidences_are_those_of_the_table() {
        assert_eq!(order(5), None);
        assert!((0..20).all(|count| order(count).is_some() == (count as u64 >= LEAST_VALUES)));
        for (count, j, confidence) in [(6, 1, 0.968_75), (9, 2, 0.960_937_5), (12, 3, 0.961_425_781_25)] {
            assert_eq!(order(count), Some((j, confidence)), "{count}");
        }
        assert_eq!(order(20).unwrap().0, 6);
    }

    #[test]
    fn ten_values_give_the_second_and_the_ninth() {
        let reported = median((1..=10).rev().map(f64::from).collect()).unwrap();
        assert_eq!((reported.value, reported.interval), (5.5, Some((2.0, 9.0))));
    }

    #[test]
    fn a_few_have_a_median_and_no_interval() {
        let reported = median(vec![3.0, 5.0, 4.0]).unwrap();
        assert_eq!(reported, Median { value: 4.0, interval: None, confidence: None });
        assert_eq!(median(vec![]), None);
    }
}
