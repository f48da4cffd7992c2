//! Lengths of time of one kind, with what a report says of them: percentiles, bins, maxima.

use super::model::{Bin, PercentilesNs};
use hdrhistogram::Histogram;
use realtime::histogram::BOUND_NS;

/// Bins to a decade of the logarithmic axis: each is 26 % wider than the one before.
const BINS_PER_DECADE: i32 = 10;

/// Names of what [`PercentilesNs`] holds, in its order.
pub(crate) const PERCENTILES: [&str; 7] = ["p50", "p90", "p99", "p99.9", "p99.99", "max", "count"];

pub(crate) type Pick = fn(&PercentilesNs) -> Option<u64>;

/// Samples in ns, in a histogram of three significant digits up to [`BOUND_NS`]; what is longer stands in its last bin.
#[derive(Clone)]
pub struct Samples {
    histogram: Histogram<u64>,
}

impl Default for Samples {
    fn default() -> Self {
        let histogram = Histogram::new_with_bounds(1, BOUND_NS, 3);
        Self { histogram: histogram.expect("1 ns to 60 s with 3 digits are legal bounds") }
    }
}

impl std::fmt::Debug for Samples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.percentiles_ns().fmt(f)
    }
}

impl FromIterator<u64> for Samples {
    fn from_iter<I: IntoIterator<Item = u64>>(values_ns: I) -> Self {
        let mut samples = Self::default();
        values_ns.into_iter().for_each(|ns| samples.record(ns, 1));
        samples
    }
}

impl Samples {
    /// Those of a histogram with bounds of its own.
    pub(crate) fn from_histogram(other: &Histogram<u64>) -> Self {
        let mut samples = Self::default();
        samples.add_histogram(other);
        samples
    }

    /// Counts `n` samples of `ns`.
    pub fn record(&mut self, ns: u64, n: u64) {
        self.histogram.saturating_record_n(ns.min(BOUND_NS), n);
    }

    /// Adds all samples of another.
    pub fn add(&mut self, other: &Self) {
        self.add_histogram(&other.histogram);
    }

    /// Adds all samples of a histogram with bounds of its own.
    pub fn add_histogram(&mut self, other: &Histogram<u64>) {
        if self.histogram.add(other).is_err() {
            // Beyond our bound: one by one, clipped.
            other.iter_recorded().for_each(|bin| self.record(bin.value_iterated_to(), bin.count_at_value()));
        }
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.histogram.len()
    }

    /// The largest, ns; nothing without samples.
    pub fn max_ns(&self) -> Option<u64> {
        (!self.histogram.is_empty()).then(|| self.histogram.max())
    }

    /// The histogram of the samples, ns.
    pub fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }

    /// Percentiles; one that needs more samples than there are to differ from the maximum is null.
    pub fn percentiles_ns(&self) -> PercentilesNs {
        supported(PercentilesNs::of(&self.histogram))
    }

    /// Bins on a logarithmic axis, ten to a decade; what is 0 stands in one from 0 to 1 ns.
    pub fn bins(&self) -> Vec<Bin> {
        let mut bins: Vec<Bin> = Vec::new();
        for recorded in self.histogram.iter_recorded() {
            // The middle of the recorder's own bin, which is a hundred times finer.
            let ns = self.histogram.median_equivalent(recorded.value_iterated_to());
            let (from_ns, to_ns) = bin_of(ns);
            let count = recorded.count_at_value();
            match bins.last_mut().filter(|bin| bin.from_ns == from_ns) {
                Some(bin) => bin.count += count,
                None => bins.push(Bin { from_ns, to_ns, count }),
            }
        }
        bins
    }
}

/// The percentiles that the number of samples supports; a higher one would be the maximum again, and is null.
pub(crate) fn supported(all: PercentilesNs) -> PercentilesNs {
    let at = |value: Option<u64>, least: u64| value.filter(|_| all.count >= least);
    PercentilesNs {
        p90: at(all.p90, 10),
        p99: at(all.p99, 100),
        p999: at(all.p999, 1000),
        p9999: at(all.p9999, 10_000),
        ..all
    }
}

/// Ends of the bin that holds `ns`.
fn bin_of(ns: u64) -> (u64, u64) {
    let edge = |place: i32| 10f64.powf(f64::from(place) / f64::from(BINS_PER_DECADE)).round() as u64;
    if ns == 0 {
        return (0, 1);
    }
    // Edges of small values are whole numbers too, so that several places may round to one edge.
    let mut place = ((ns as f64).log10() * f64::from(BINS_PER_DECADE)).floor() as i32 - 1;
    while edge(place + 1) <= ns {
        place += 1;
    }
    let mut next = place + 1;
    while edge(next) <= edge(place) {
        next += 1;
    }
    (edge(place), edge(next))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_is_within_its_bin_and_bins_join() {
        for ns in (1..2000).chain([9_999, 10_000, 12_589, 999_999, 1_000_000, BOUND_NS]) {
            let (from, to) = bin_of(ns);
            assert!(from <= ns && ns < to, "{from} {ns} {to}");
            assert_eq!(bin_of(to).0, to, "a bin begins where another ends");
        }
        assert_eq!(bin_of(10_000), (10_000, 12_589));
    }

    #[test]
    fn bins_hold_every_sample_once() {
        let samples: Samples = (0..10_000).chain([5_000_000; 7]).collect();
        let bins = samples.bins();
        assert_eq!(bins.iter().map(|bin| bin.count).sum::<u64>(), samples.count());
        assert!(bins.windows(2).all(|pair| pair[0].to_ns <= pair[1].from_ns));
        assert_eq!(bins.last().unwrap().count, 7);
    }

    #[test]
    fn a_percentile_that_too_few_samples_cannot_tell_is_null() {
        let reported = (0..999).collect::<Samples>().percentiles_ns();
        assert!(reported.p99.is_some() && reported.p999.is_none() && reported.p9999.is_none());
        assert_eq!(Samples::default().percentiles_ns(), PercentilesNs::default());
    }
}
