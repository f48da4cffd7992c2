//! Confidence intervals of a rate.
//!
//! ```text
//! Wilson          (p + z^2/2n ± z sqrt(p (1-p)/n + z^2/4n^2)) / (1 + z^2/n)      two-sided, 95 %
//! Clopper, Pearson    upper u with P(at most k of n | u) = 0.05                  one-sided, 95 %: at most so much
//! ```
//!
//! Rates that should be high are reported with Wilson's interval, whose mean coverage is near 95 %. False alarms are reported
//! with the exact upper bound, which is conservative: 0 of 200 bounds the rate by 1.5 %.
//!
//! Source: Wilson 1927, J. Am. Stat. Assoc. 22(158); Clopper, Pearson 1934, Biometrika 26(4); Brown, Cai, DasGupta 2001, Stat.
//! Sci. 16(2).

use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF, Normal};

const CONFIDENCE: f64 = 0.95;

/// A count of a total, with confidence intervals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    /// Cases that count.
    pub count: usize,
    /// All cases.
    pub of: usize,
    pub(crate) share: Option<f64>,
    /// Wilson's interval of the rate.
    pub(crate) interval: [f64; 2],
    /// Exact one-sided upper bound of the rate.
    pub(crate) at_most: f64,
}

impl Rate {
    pub(crate) fn new(count: usize, of: usize) -> Self {
        let share = (of > 0).then(|| count as f64 / of as f64);
        Rate {
            count,
            of,
            share,
            interval: wilson(count as f64, of as f64, CONFIDENCE),
            at_most: at_most(count, of),
        }
    }

    /// The rate of the items for which `is` holds.
    pub(crate) fn of<T>(items: impl IntoIterator<Item = T>, mut is: impl FnMut(T) -> bool) -> Self {
        let (mut count, mut of) = (0, 0);
        for item in items {
            of += 1;
            count += usize::from(is(item));
        }
        Rate::new(count, of)
    }
}

/// Wilson's interval of `count` of `of`, which need not be integers when they are weighted.
pub(crate) fn wilson(count: f64, of: f64, confidence: f64) -> [f64; 2] {
    if of <= 0.0 {
        return [0.0, 1.0];
    }
    let (n, p) = (of, count / of);
    let z = Normal::standard().inverse_cdf(0.5 + confidence / 2.0);
    let centre = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    // Rounding must not push an end out of [0, 1], nor away from an extreme rate.
    let low = if count <= 0.0 { 0.0 } else { (centre - half) / scale };
    let high = if count >= of { 1.0 } else { (centre + half) / scale };
    [low.max(0.0), high.min(1.0)]
}

fn at_most(count: usize, of: usize) -> f64 {
    if count >= of {
        return 1.0;
    }
    Beta::new(count as f64 + 1.0, (of - count) as f64).map_or(1.0, |beta| beta.inverse_cdf(CONFIDENCE))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(left: f64, right: f64, tolerance: f64) {
        assert!((left - right).abs() < tolerance, "{left} is not {right}");
    }

    #[test]
    fn wilsons_interval_is_that_of_the_books() {
        // Newcombe 1998, Stat. Med. 17, table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29; to four digits.
        for (count, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let [least, most] = Rate::new(count, of).interval;
            close(least, low, 6e-5);
            close(most, high, 6e-5);
        }
        assert_eq!(Rate::new(7, 7).interval[1], 1.0);
        assert_eq!(Rate::new(0, 0).interval, [0.0, 1.0]);
    }

    #[test]
    fn none_of_two_hundred_proves_less_than_one_and_a_half_per_cent() {
        // 1 - 0.05^(1/200), the closed form at zero; the root of the beta function is found to 1e-6.
        close(Rate::new(0, 200).at_most, 1.0 - 0.05_f64.powf(1.0 / 200.0), 1e-6);
        assert!(Rate::new(0, 200).at_most < 0.015);
        // At most 1 of 10 has probability 0.05 at this rate: (1-u)^10 + 10 u (1-u)^9.
        let u = Rate::new(1, 10).at_most;
        close((1.0 - u).powi(10) + 10.0 * u * (1.0 - u).powi(9), 0.05, 1e-6);
        assert_eq!(Rate::new(3, 3).at_most, 1.0);
    }
}
