//! Recorders for nanoseconds that never allocate, their percentiles, and HdrHistogram logs.
//!
//! A mean hides the one late cycle in ten thousand, and a list of all samples grows inside the loop. An HdrHistogram
//! keeps every sample in a bin of fixed relative width, 4 ns a record, in memory that is taken once.
//!
//! # Terms
//! - *Percentile*: p99 = 31 000 says that 99 % of all samples were at most 31 000 ns. It is the upper end of its bin, so
//!   it is never below the sample and at most 0.1 % above it (three significant digits).
//! - *Bound*: samples above 60 s stand in the last bin, and are counted apart: a figure that was clipped says so.
//!
//! # Source
//! HdrHistogram, <https://hdrhistogram.org>, and its interval log, format version 1.3 with tags, each histogram in
//! encoding V2, deflated, in base64: the format of the Java tool `HistogramLogProcessor` (not tried here). The Python
//! package `hdrhistogram` read a log of ours in November 2026 with the same counts in the bins. Its percentiles may
//! differ by one sample: it takes the sample of rank round(q · count), this crate that of rank ceil(q · count), which
//! in a thin tail is another bin (3000 samples: p99 103.2 us there, 106.3 us here).

use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, IntervalLogWriterError, Tag};
use serde::{Deserialize, Serialize, Serializer};

use crate::deflate::DeflateSerializer;

pub use hdrhistogram::Histogram;

/// The largest value that a recorder distinguishes, 60 s: a loop that stalls longer has stopped.
pub const BOUND_NS: u64 = 60_000_000_000;

const SIGNIFICANT_DIGITS: u8 = 3;

/// Collects lengths of time in nanoseconds, without allocating.
///
/// Serialises as its [`Percentiles`].
#[derive(Clone)]
pub struct Recorder {
    histogram: Histogram<u64>,
    /// How many samples were above [`BOUND_NS`] and stand in the last bin.
    pub beyond_bound: u64,
}

impl Recorder {
    /// An empty recorder, its 220 kB taken and touched.
    pub fn new() -> Self {
        let histogram = Histogram::new_with_bounds(1, BOUND_NS, SIGNIFICANT_DIGITS);
        let mut histogram = histogram.expect("1 ns to 60 s with 3 digits are legal bounds");
        // The allocator hands out untouched zero pages; writing them here keeps page faults out of the loop.
        histogram.reset();
        Self { histogram, beyond_bound: 0 }
    }

    /// Counts one sample of `ns` nanoseconds.
    pub fn record(&mut self, ns: u64) {
        self.record_n(ns, 1);
    }

    /// Counts `n` samples of `ns` nanoseconds.
    pub fn record_n(&mut self, ns: u64, n: u64) {
        if ns > BOUND_NS {
            self.beyond_bound += n;
        }
        // Clipped here too: the histogram's last bins reach beyond the bound that it was given.
        self.histogram.saturating_record_n(ns.min(BOUND_NS), n);
    }

    /// The usual percentiles of all samples so far.
    pub fn percentiles(&self) -> Percentiles {
        Percentiles::of(&self.histogram)
    }

    /// The histogram itself, for logs and pictures.
    pub fn histogram(&self) -> &Histogram<u64> {
        &self.histogram
    }

    /// Forgets all samples and keeps the memory.
    pub fn reset(&mut self) {
        self.histogram.reset();
        self.beyond_bound = 0;
    }
}

impl Default for Recorder {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Recorder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { histogram: _, beyond_bound } = self;
        f.debug_struct("Recorder")
            .field("percentiles", &self.percentiles())
            .field("beyond_bound", beyond_bound)
            .finish()
    }
}

impl Serialize for Recorder {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.percentiles().serialize(serializer)
    }
}

/// Percentiles of a distribution, in the unit of the samples; `None`, in JSON `null`, without samples.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Percentiles {
    /// Half of the samples were at most this.
    pub p50: Option<u64>,
    /// 90 % of the samples were at most this.
    pub p90: Option<u64>,
    /// 99 % of the samples were at most this.
    pub p99: Option<u64>,
    /// 99.9 % of the samples were at most this.
    pub p999: Option<u64>,
    /// 99.99 % of the samples were at most this; below 10 000 samples it is the largest one, see `count`.
    pub p9999: Option<u64>,
    /// No sample was above this (rounded up by at most 0.1 %, like the others).
    pub max: Option<u64>,
    /// Number of samples.
    pub count: u64,
}

impl Percentiles {
    /// The percentiles of `histogram`.
    pub fn of(histogram: &Histogram<u64>) -> Self {
        let quantile = |q| (!histogram.is_empty()).then(|| histogram.value_at_quantile(q));
        Self {
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p999: quantile(0.999),
            p9999: quantile(0.9999),
            max: (!histogram.is_empty()).then(|| histogram.max()),
            count: histogram.len(),
        }
    }
}

/// One line: `p50 13.1 us, …`, for a terminal.
impl fmt::Display for Percentiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { p50, p90, p99, p999, p9999, max, count } = self;
        let named =
            [("p50", p50), ("p90", p90), ("p99", p99), ("p99.9", p999), ("p99.99", p9999), ("max", max)];
        for (name, value_ns) in named {
            match value_ns {
                Some(ns) => write!(f, "{name} {:.1} us, ", *ns as f64 * 1e-3)?,
                None => write!(f, "{name} -, ")?,
            }
        }
        write!(f, "{count} samples")
    }
}

/// Writes histograms of one interval, each under its tag, as an HdrHistogram log that other tools read.
///
/// - `parts`: tag and histogram; the values keep their unit (nanoseconds).
/// - `started_unix_s`: start of the interval, seconds since 1970; written as start and base time, to the millisecond.
/// - `duration`: length of the interval.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] when a tag is empty or holds a comma, a space or a line end, or when the start is
/// negative or not finite; else what the file system says.
pub fn write_hlog(
    path: &Path,
    parts: &[(&str, &Histogram<u64>)],
    started_unix_s: f64,
    duration: Duration,
) -> io::Result<()> {
    // Checked before there is a file.
    start_of_log(started_unix_s)?;
    parts.iter().try_for_each(|(name, _)| tag(name).map(drop))?;
    let mut file = BufWriter::new(File::create(path)?);
    let intervals = parts.iter().map(|&(tag, histogram)| (tag, histogram, (Duration::ZERO, duration)));
    write_intervals(&mut file, started_unix_s, intervals)?;
    file.flush()
}

/// Writes a log of several intervals in the order given: tag, histogram, and when it began after the base time and how long it
/// was. The base time is in seconds since 1970.
///
/// # Errors
/// As [`write_hlog`]; the lines before one with a bad tag are written.
pub fn write_intervals<'a>(
    out: &mut impl Write,
    base_unix_s: f64,
    intervals: impl IntoIterator<Item = (&'a str, &'a Histogram<u64>, (Duration, Duration))>,
) -> io::Result<()> {
    let mut serializer = DeflateSerializer::new();
    write_head(out, start_of_log(base_unix_s)?)?;
    for (name, histogram, when) in intervals {
        write_interval(out, &mut serializer, tag(name)?, histogram, when)?;
    }
    Ok(())
}

/// The start of a log as a length of time since 1970.
pub(crate) fn start_of_log(started_unix_s: f64) -> io::Result<Duration> {
    Duration::try_from_secs_f64(started_unix_s)
        .map_err(|error| invalid(format!("start of the log, {started_unix_s} s since 1970: {error}")))
}

/// The comments, the start and the base time of a log.
pub(crate) fn write_head(out: &mut impl Write, started: Duration) -> io::Result<()> {
    let mut serializer = DeflateSerializer::new();
    let started = SystemTime::UNIX_EPOCH + started;
    IntervalLogWriterBuilder::new()
        .add_comment("[Histogram log format version 1.3]")
        .add_comment("[Values are nanoseconds]")
        .with_start_time(started)
        .with_base_time(started)
        .begin_log_with(out, &mut serializer)?;
    Ok(())
}

/// One line: a histogram of the interval that begins `from` after the base time and lasts `length`.
pub(crate) fn write_interval(
    out: &mut impl Write,
    serializer: &mut DeflateSerializer,
    tag: Tag<'_>,
    histogram: &Histogram<u64>,
    (from, length): (Duration, Duration),
) -> io::Result<()> {
    // Without comments and times the builder writes no head of its own.
    let mut log = IntervalLogWriterBuilder::new().begin_log_with(out, serializer)?;
    log.write_histogram(histogram, from, length, Some(tag)).map_err(|error| match error {
        IntervalLogWriterError::IoError(error) => error,
        IntervalLogWriterError::SerializeError(error) => io::Error::other(error),
    })
}

pub(crate) fn tag(name: &str) -> io::Result<Tag<'_>> {
    Tag::new(name)
        .filter(|tag| !tag.is_empty())
        .ok_or_else(|| invalid(format!("tag {name:?}: not empty, no comma, no space, no line end")))
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_an_empty_recorder_are_null() {
        let json = serde_json::to_string(&Recorder::new()).expect("serialises");
        assert_eq!(
            json,
            r#"{"p50":null,"p90":null,"p99":null,"p999":null,"p9999":null,"max":null,"count":0}"#
        );
        serde_json::from_str::<Percentiles>(&json).expect("read as it was written");
    }

    #[test]
    fn percentiles_without_their_count_are_refused() {
        let refusal = serde_json::from_str::<Percentiles>(r#"{"p50":1,"max":2}"#).expect_err("no count");
        assert!(refusal.to_string().contains("missing field `count`"), "{refusal}");
    }

    #[test]
    fn percentiles_are_never_below_the_sample_and_at_most_a_thousandth_above() {
        let mut recorder = Recorder::new();
        (1..=1000).for_each(|n| recorder.record(n * 1000));
        let got = recorder.percentiles();
        for (value, exact) in [
            (got.p50, 500_000),
            (got.p90, 900_000),
            (got.p99, 990_000),
            (got.p999, 999_000),
            (got.p9999, 1_000_000),
            (got.max, 1_000_000),
        ] {
            let value = value.expect("not empty");
            assert!((exact..=exact + exact / 1000).contains(&value), "{value} for {exact}");
        }
        assert_eq!(got.count, 1000);
    }

    #[test]
    fn zero_is_a_sample() {
        let mut recorder = Recorder::new();
        recorder.record(0);
        assert_eq!(recorder.percentiles().max, Some(0));
        assert_eq!(recorder.percentiles().count, 1);
    }

    #[test]
    fn values_beyond_the_bound_are_kept_at_the_bound_and_counted() {
        let mut recorder = Recorder::new();
        recorder.record(BOUND_NS);
        assert_eq!(recorder.beyond_bound, 0);
        recorder.record(BOUND_NS + 1);
        recorder.record_n(u64::MAX, 2);
        assert_eq!(recorder.beyond_bound, 3);
        assert_eq!(recorder.percentiles().count, 4);
        // 65 s lies beyond the bound and within the last bins of the histogram.
        recorder.record(65_000_000_000);
        assert_eq!(recorder.beyond_bound, 4);
        let at_bound = recorder.histogram().highest_equivalent(BOUND_NS);
        assert_eq!(recorder.percentiles().max, Some(at_bound));
    }

    #[test]
    fn reset_forgets_everything() {
        let mut recorder = Recorder::new();
        recorder.record(u64::MAX);
        recorder.reset();
        assert_eq!(recorder.percentiles(), Recorder::new().percentiles());
        assert_eq!(recorder.beyond_bound, 0);
    }
}
