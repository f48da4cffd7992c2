//! Whether a ratio keeps its bounds, as far as its pairs can say, and how many pairs could say more.
//!
//! A ratio is known no better than the confidence interval of its median:
//!
//! | interval | verdict |
//! |---|---|
//! | between the bounds | kept |
//! | beyond a bound as a whole | broken |
//! | crosses a bound, or does not exist (fewer than six pairs) | not resolved |
//!
//! # Pairs that would resolve it
//! The interval of a median of n independent values shrinks as 1/√n. Ratios are taken on a logarithmic scale, on which a ratio
//! and its inverse are equally far from 1. With the median m, the bound b and the end e of the interval that lies beyond it,
//!
//! ```text
//!   n' = n · ((ln e − ln m) / (ln b − ln m))²
//! ```
//!
//! pairs bring that end onto the bound. This assumes that pairs are independent and equally distributed, and that the median
//! stays as it was measured; so n' is an order of magnitude. A median on its bound is resolved by no number of pairs.
//!
//! # Source
//! H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed. 2003, chapter 10: asymptotic variance of a sample quantile.

use super::model::Ratio;
use figures::median;

/// More pairs than this are not proposed: of 10 s slices they take two months.
const MOST_PAIRS: f64 = 1e5;

/// What pairs say of a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The interval lies within the bound.
    Kept,
    /// The interval lies beyond the bound.
    Broken,
    /// The interval crosses the bound.
    NotResolved {
        /// Pairs after which it would no longer; none when more than can be measured.
        pairs: Option<u64>,
    },
}

/// Holds the interval of a ratio against its bounds.
pub(crate) fn verdict(ratio: &Ratio, min: Option<f64>, max: Option<f64>) -> Verdict {
    let Some((low, high)) = ratio.interval else {
        return Verdict::NotResolved { pairs: Some(median::LEAST_VALUES) };
    };
    let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
    if min <= low && high <= max {
        return Verdict::Kept;
    }
    if high < min || max < low {
        return Verdict::Broken;
    }
    let pairs = |end, bound| pairs_to_bring(ratio, end, bound);
    let needed = match ratio.median {
        median if median > max => pairs(low, max),
        median if median < min => pairs(high, min),
        _ => {
            let above = if high > max { pairs(high, max) } else { 0.0 };
            let below = if low < min { pairs(low, min) } else { 0.0 };
            above.max(below)
        }
    };
    let proposed =
        (needed <= MOST_PAIRS).then(|| (needed.ceil() as u64).max(ratio.pairs_ns.len() as u64 + 1));
    Verdict::NotResolved { pairs: proposed }
}

/// Pairs after which this end of the interval has moved to the bound; infinite where the median is on the bound, or is 0.
fn pairs_to_bring(ratio: &Ratio, end: f64, bound: f64) -> f64 {
    let from_median = |value: f64| (value / ratio.median).ln();
    let pairs = ratio.pairs_ns.len() as f64 * (from_median(end) / from_median(bound)).powi(2);
    if pairs.is_nan() { f64::INFINITY } else { pairs }
}

/// What it would take to resolve a bound, after the words "not resolved".
pub(crate) fn in_words(pairs: Option<u64>) -> String {
    match pairs {
        Some(median::LEAST_VALUES) => format!("an interval needs {} pairs", median::LEAST_VALUES),
        Some(pairs) => format!("about {} pairs would resolve it", two_digits(pairs)),
        None => "the median is on the bound, and no number of pairs would resolve it".into(),
    }
}

/// Two digits that count, rounded up: the number is an order of magnitude.
fn two_digits(pairs: u64) -> u64 {
    let unit = 10u64.pow(pairs.checked_ilog10().unwrap_or(0).saturating_sub(1));
    pairs.div_ceil(unit) * unit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(pairs: usize, median: f64, interval: Option<(f64, f64)>) -> Ratio {
        let confidence = interval.map(|_| 0.979);
        Ratio { name: "a p50 / b p50".into(), pairs_ns: vec![(1, 1); pairs], median, interval, confidence }
    }

    fn at_most(median: f64, interval: (f64, f64), max: f64) -> Verdict {
        verdict(&ratio(10, median, Some(interval)), None, Some(max))
    }

    fn pairs(verdict: Verdict) -> Option<u64> {
        let Verdict::NotResolved { pairs } = verdict else { panic!("{verdict:?}") };
        pairs
    }

    #[test]
    fn an_interval_on_one_side_of_its_bound_decides() {
        assert_eq!(at_most(1.03, (0.99, 1.05), 1.1), Verdict::Kept);
        assert_eq!(at_most(1.03, (0.99, 1.1), 1.1), Verdict::Kept);
        assert_eq!(at_most(1.24, (1.12, 1.37), 1.1), Verdict::Broken);
        let of = ratio(10, 1.0, Some((0.9, 1.1)));
        assert_eq!(verdict(&of, Some(0.9), None), Verdict::Kept);
        assert_eq!(verdict(&of, Some(1.2), None), Verdict::Broken);
        assert_eq!(verdict(&of, None, None), Verdict::Kept);
    }

    #[test]
    fn an_interval_that_crosses_its_bound_decides_nothing() {
        // Both were printed once, as kept and as broken. n' = 10 (ln(4.95/1.05) / ln(1.1/1.05))² and 10 (ln(0.62/1.24) /
        // ln(1.1/1.24))².
        assert_eq!(pairs(at_most(1.05, (0.27, 4.95), 1.1)), Some(11_111));
        assert_eq!(pairs(at_most(1.24, (0.62, 1.37), 1.1)), Some(335));
        // The same below: m, b and the interval inverted.
        let inverted = ratio(10, 1.0 / 1.24, Some((1.0 / 1.37, 1.0 / 0.62)));
        assert_eq!(pairs(verdict(&inverted, Some(1.0 / 1.1), None)), Some(335));
    }

    #[test]
    fn four_times_the_pairs_halve_the_interval() {
        let end = |half: f64| (-half).exp()..half.exp();
        let of = |half: f64| (end(half).start, end(half).end);
        assert_eq!(pairs(at_most(1.0, of(0.4), 0.2f64.exp())), Some(40));
        // Between two bounds the one that takes longer counts.
        let both = verdict(&ratio(10, 1.0, Some(of(0.4))), Some((-0.1f64).exp()), Some(0.2f64.exp()));
        assert!((160..=161).contains(&pairs(both).unwrap()), "{both:?}");
        assert_eq!(pairs(at_most(1.0, of(0.2001), 0.2f64.exp())), Some(11), "one more at least");
    }

    #[test]
    fn a_median_on_its_bound_is_resolved_by_no_number_of_pairs() {
        for median in [1.1, 1.1000001] {
            assert_eq!(pairs(at_most(median, (0.9, 1.3), 1.1)), None);
        }
        assert_eq!(pairs(at_most(0.0, (0.0, 1.3), 1.1)), None, "a ratio of 0 has no logarithm");
        assert!(in_words(None).contains("no number of pairs"));
    }

    #[test]
    fn without_an_interval_nothing_is_resolved() {
        for median in [0.5, 2.0] {
            assert_eq!(pairs(verdict(&ratio(5, median, None), None, Some(1.1))), Some(6));
        }
        assert_eq!(in_words(Some(6)), "an interval needs 6 pairs");
    }

    #[test]
    fn numbers_of_pairs_are_rounded_up_to_two_digits() {
        assert_eq!([7, 40, 335, 11_111, 99_999].map(two_digits), [7, 40, 340, 12_000, 100_000]);
    }
}
