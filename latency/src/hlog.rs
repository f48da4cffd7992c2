//! HdrHistogram interval logs: read with their tags and times, and written for other tools.
//!
//! A log names its base time once and then holds a line for each interval: tag, start, length, largest value, histogram.
//! A killed process leaves a last line without its end; it is left out, the others stand.
//!
//! # Source
//! HdrHistogram, <https://hdrhistogram.org>: interval log, format version 1.3 with tags; histograms in encoding V2, deflated,
//! in base64.

use super::samples::Samples;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::Deserializer;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use std::io::{self, Write};
use std::time::Duration;

/// A histogram of a stretch of time.
#[derive(Clone, Debug)]
pub struct Interval {
    /// Name of the distribution.
    pub tag: String,
    /// Start, s from the log's base time.
    pub start_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// What was measured in it, ns.
    pub samples: Samples,
}

/// An interval log that is damaged at a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct LogError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

/// An interval while its log is read: dropped before the next one is read, since an hour of them would fill the memory.
#[derive(Clone, Copy, Debug)]
pub struct BorrowedInterval<'a> {
    /// Name of the distribution.
    pub tag: &'a str,
    /// Start, s from the log's base time.
    pub start_s: f64,
    /// Length, s.
    pub duration_s: f64,
    /// What was measured in it, ns.
    pub histogram: &'a Histogram<u64>,
}

/// Hands each interval of a log to `take`.
///
/// # Errors
/// [`LogError`] at the first line that is no interval; those before it were handed out.
pub fn each(text: &str, mut take: impl FnMut(BorrowedInterval<'_>)) -> Result<(), LogError> {
    let mut deserializer = Deserializer::new();
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    for (place, line) in whole.split_inclusive('\n').enumerate() {
        let failed = |reason: String| LogError { line: place + 1, reason };
        for entry in IntervalLogIterator::new(line.as_bytes()) {
            match entry {
                Ok(LogEntry::Interval(reported)) => {
                    let histogram =
                        decode(reported.encoded_histogram(), &mut deserializer).map_err(failed)?;
                    take(BorrowedInterval {
                        tag: reported.tag().map_or("", |tag| tag.as_str()),
                        start_s: reported.start_timestamp().as_secs_f64(),
                        duration_s: reported.duration().as_secs_f64(),
                        histogram: &histogram,
                    });
                }
                Ok(_) => {}
                Err(_) => return Err(failed("neither an interval nor a comment".into())),
            }
        }
    }
    Ok(())
}

/// Reads a log of few intervals.
pub fn read(text: &str) -> Result<Vec<Interval>, LogError> {
    let mut intervals = Vec::new();
    each(text, |BorrowedInterval { tag, start_s, duration_s, histogram }| {
        let samples = Samples::from_histogram(histogram);
        intervals.push(Interval { tag: tag.to_owned(), start_s, duration_s, samples });
    })?;
    Ok(intervals)
}

/// A histogram from its base64.
pub fn decode(text: &str, deserializer: &mut Deserializer) -> Result<Histogram<u64>, String> {
    let bytes = STANDARD.decode(text).map_err(|error| error.to_string())?;
    deserializer.deserialize(&mut bytes.as_slice()).map_err(|error| error.to_string())
}

/// Writes intervals, in the order given, as a log with this base time in s since 1970.
///
/// # Errors
/// What `out` says; [`io::ErrorKind::InvalidInput`] for a time that a log cannot hold, before anything is written, and for such a
/// tag, after the lines before it.
pub fn write<'a>(
    out: &mut impl Write,
    base_unix_s: f64,
    intervals: impl IntoIterator<Item = &'a Interval>,
) -> io::Result<()> {
    let tagged = intervals.into_iter().map(|Interval { tag, start_s, duration_s, samples }| {
        let when = (seconds(*start_s)?, seconds(*duration_s)?);
        Ok((tag.as_str(), samples.histogram(), when))
    });
    let tagged = tagged.collect::<io::Result<Vec<_>>>()?;
    realtime::write_intervals(out, base_unix_s, tagged)
}

fn seconds(seconds: f64) -> io::Result<Duration> {
    let invalid = |error| io::Error::new(io::ErrorKind::InvalidInput, format!("{seconds} s: {error}"));
    Duration::try_from_secs_f64(seconds).map_err(invalid)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(tag: &str, start_s: f64, values_ns: &[u64]) -> Interval {
        Interval { tag: tag.into(), start_s, duration_s: 1.0, samples: values_ns.iter().copied().collect() }
    }

    fn log() -> String {
        let mut out = Vec::new();
        let parts = [interval("a", 0.0, &[5, 5, 90_000]), interval("b", 1.5, &[1_000_000_000])];
        write(&mut out, 1e9, &parts).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_log_reads_back_with_equal_counts_and_times() {
        let read = read(&log()).unwrap();
        let counts: Vec<_> =
            read.iter().map(|part| (part.tag.as_str(), part.start_s, part.samples.count())).collect();
        assert_eq!(counts, [("a", 0.0, 3), ("b", 1.5, 1)]);
        assert_eq!(read[0].samples.histogram().count_at(5), 2);
        assert_eq!(read[0].samples.histogram().count_at(90_000), 1);
    }

    #[test]
    fn a_half_line_is_left_out_and_a_damaged_one_is_named() {
        let text = log();
        assert_eq!(read(&text[..text.len() - 9]).unwrap().len(), 1);
        let lines: Vec<_> = text.lines().collect();
        let place = lines.iter().position(|line| line.starts_with("Tag=a")).unwrap() + 1;
        for damaged in [text.replace("Tag=a,0.000", "Tag=a,zero"), text.replacen("HISTF", "HIST*", 1)] {
            assert_eq!(read(&damaged).unwrap_err().line, place, "{damaged}");
        }
    }
}
