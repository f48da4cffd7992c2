//! Whether a process's memory is constant: a robust slope, and the last quarter against the second.
//!
//! The beginning is left out, a minute or a quarter of the record, in which buffers grow. Of the rest
//!
//! ```text
//!   slope    median of the slopes between all pairs of samples [Theil 1950, Sen 1968]: a step or a spike does not move it
//!   quarters median of the last quarter / median of the second - 1: finds a staircase whose slope is 0 at most times
//! ```
//!
//! A leak of 64 KiB a minute is 90 MiB a day, of a process of some 20 MB. Shorter records than two minutes judge the quarters
//! only: the kernel counts resident pages in batches, and a batch on a minute is more than the bound.

use figures::median::median;
use serde::{Deserialize, Serialize};

/// Largest slope of constant memory, KiB per hour: 64 per minute.
pub(super) const SLOPE_LIMIT_KIB_PER_H: f64 = 64.0 * 60.0;
/// Largest growth from the second quarter to the last of constant memory.
pub(super) const GROWTH_LIMIT_PERCENT: f64 = 1.0;
/// Growth allowed to short records, KiB: lists that grow to their bound, and the batches of the kernel.
const SHORT_GROWTH_KIB: f64 = 512.0;
/// Longest beginning that is left out, s.
const START_S: f64 = 60.0;
/// Shortest record, without its beginning, whose slope is judged, s.
const SLOPE_NEEDS_S: f64 = 120.0;
/// Fewest samples, without the beginning, of a record that is judged.
const FEWEST_SAMPLES: usize = 16;
/// Most samples used for pairs; a longer record is thinned.
const PAIRED_SAMPLES: usize = 600;

/// Memory of a process at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// Time since the segment's start.
    pub at_s: f64,
    pub rss_kib: u64,
    /// Peak so far.
    pub peak_rss_kib: u64,
    /// Proportional set size; sampled less often.
    pub pss_kib: Option<u64>,
}

/// Memory statistics of a process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Memory {
    pub samples: usize,
    /// Resident memory, first sample.
    pub rss_first_kib: u64,
    /// The same, last sample.
    pub rss_last_kib: u64,
    /// Peak.
    pub peak_rss_kib: u64,
    /// Proportional set size, last sample.
    pub pss_last_kib: Option<u64>,
    /// Slope of the resident memory; null for a short record.
    pub slope_kib_per_h: Option<f64>,
    /// Growth of the median from the second quarter to the last; null for a short record.
    pub growth_percent: Option<f64>,
}

impl Memory {
    /// Statistics of a record in the order of time.
    pub(crate) fn of(record: &[Sample]) -> Self {
        let Some((first, last)) = record.first().zip(record.last()) else { return Self::default() };
        let start_s = first.at_s + START_S.min((last.at_s - first.at_s) / 4.0);
        let settled: Vec<_> = record.iter().filter(|sample| sample.at_s >= start_s).collect();
        let enough = settled.len() >= FEWEST_SAMPLES;
        let points: Vec<_> = settled.iter().map(|sample| (sample.at_s, sample.rss_kib as f64)).collect();
        let quarter = settled.len() / 4;
        let median_of =
            |from: usize, to: usize| middle(points[from..to].iter().map(|(_, rss_kib)| *rss_kib).collect());
        Self {
            samples: record.len(),
            rss_first_kib: first.rss_kib,
            rss_last_kib: last.rss_kib,
            peak_rss_kib: record.iter().map(|sample| sample.peak_rss_kib).max().unwrap_or(0),
            pss_last_kib: record.iter().rev().find_map(|sample| sample.pss_kib),
            slope_kib_per_h: (enough && last.at_s - start_s >= SLOPE_NEEDS_S)
                .then(|| slope(&points) * 3600.0),
            growth_percent: enough
                .then(|| median_of(points.len() - quarter, points.len()) / median_of(quarter, 2 * quarter))
                .map(|ratio| (ratio - 1.0) * 100.0),
        }
    }

    /// Whether memory is constant; `None` when the record is too short.
    pub(crate) fn is_flat(&self) -> Option<bool> {
        let slope_kept = self.slope_kib_per_h.is_none_or(|slope| slope < SLOPE_LIMIT_KIB_PER_H);
        let small = |growth_percent: f64| {
            self.slope_kib_per_h.is_none()
                && growth_percent / 100.0 * (self.rss_last_kib as f64) < SHORT_GROWTH_KIB
        };
        self.growth_percent.map(|growth| slope_kept && (growth < GROWTH_LIMIT_PERCENT || small(growth)))
    }
}

/// Median of the slopes of all pairs.
fn slope(points: &[(f64, f64)]) -> f64 {
    let points: Vec<_> = points.iter().step_by(points.len().div_ceil(PAIRED_SAMPLES)).collect();
    let mut slopes = Vec::with_capacity(points.len() * points.len() / 2);
    for (place, (from, low)) in points.iter().enumerate() {
        slopes.extend(points[place + 1..].iter().map(|(to, high)| (high - low) / (to - from)));
    }
    middle(slopes)
}

/// The median; 0 for no values.
fn middle(values: Vec<f64>) -> f64 {
    median(values).map_or(0.0, |median| median.value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record of one sample a second.
    fn record(seconds: u32, rss_kib: impl Fn(f64) -> f64) -> Memory {
        let sample = |second: u32| {
            let rss_kib = rss_kib(f64::from(second)) as u64;
            Sample { at_s: f64::from(second), rss_kib, peak_rss_kib: rss_kib, pss_kib: Some(rss_kib / 2) }
        };
        Memory::of(&(0..seconds).map(sample).collect::<Vec<_>>())
    }

    #[test]
    fn a_start_that_grows_and_a_spike_are_flat() {
        let memory = record(300, |at_s| match at_s {
            at_s if at_s < 50.0 => 10_000.0 + 200.0 * at_s,
            at_s if (200.0..204.0).contains(&at_s) => 40_000.0,
            _ => 20_000.0,
        });
        assert_eq!((memory.is_flat(), memory.slope_kib_per_h), (Some(true), Some(0.0)));
        assert_eq!(
            (memory.rss_first_kib, memory.rss_last_kib, memory.peak_rss_kib),
            (10_000, 20_000, 40_000)
        );
        assert_eq!(memory.pss_last_kib, Some(10_000));
    }

    #[test]
    fn a_leak_is_found_by_its_slope_and_a_staircase_by_its_quarters() {
        let leak = record(300, |at_s| 200_000.0 + 2.0 * at_s);
        assert_eq!(leak.is_flat(), Some(false));
        assert!((leak.slope_kib_per_h.unwrap() - 7200.0).abs() < 60.0, "{leak:?}");
        assert!(leak.growth_percent.unwrap() < GROWTH_LIMIT_PERCENT, "too slow for the quarters: {leak:?}");
        let stairs = record(300, |at_s| if at_s < 230.0 { 20_000.0 } else { 20_300.0 });
        assert_eq!((stairs.slope_kib_per_h, stairs.is_flat()), (Some(0.0), Some(false)));
    }

    #[test]
    fn a_short_record_is_judged_by_its_quarters_and_a_very_short_one_not_at_all() {
        let short = record(40, |at_s| 20_000.0 + 3.0 * at_s);
        assert_eq!((short.slope_kib_per_h, short.is_flat()), (None, Some(true)));
        assert_eq!(record(40, |at_s| 20_000.0 + 60.0 * at_s).is_flat(), Some(false));
        assert_eq!(record(40, |at_s| 20_000.0 + 20.0 * at_s).is_flat(), Some(true), "2 %, but 400 KiB");
        assert_eq!(record(10, |_| 20_000.0).is_flat(), None);
        assert_eq!(Memory::of(&[]), Memory::default());
    }
}
