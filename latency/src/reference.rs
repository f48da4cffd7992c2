//! cyclictest's `--json`: the reference that was measured on the same machine, in the same session.
//!
//! Without `-N` cyclictest counts whole us and leaves out the fraction: what it calls 13 lies between 13.0 and 13.999 us. It is
//! taken as 13.0 us here, which flatters the reference and never us. Samples beyond its histogram (`-h`) are only counted:
//! they are taken as its largest sample, which none of them exceeds.
//!
//! # Source
//! rt-tests 2.4 as Debian 12 ships it: keys `cmdline:` and `thread`, with `histogram`, `cycles`, `max` in each; read from a
//! file it wrote. `resolution_in_ns` is 1 with `-N`, else 0.

use super::samples::Samples;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The tag of the reference's wake-up latency.
pub(crate) const TAG: &str = "cyclictest";

/// A run of cyclictest.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    /// How it was called; empty when its file does not say.
    pub command_line: String,
    /// Whether its samples are whole us.
    pub whole_us: bool,
    /// Wake-up latencies of all its threads.
    pub samples: Samples,
    /// Samples that its histogram did not hold.
    pub beyond_histogram: u64,
}

/// The value of an option in a command line, by its letter and its long name: `-p 80`, `-p80`, `--priority 80`, `--priority=80`.
pub(crate) fn option<'a>(command_line: &'a str, letter: char, long: &str) -> Option<&'a str> {
    let short = format!("-{letter}");
    let mut words = command_line.split_whitespace();
    while let Some(word) = words.next() {
        if let Some(rest) = word.strip_prefix("--") {
            if rest == long {
                return words.next();
            }
            if let Some(value) = rest.strip_prefix(long).and_then(|rest| rest.strip_prefix('=')) {
                return Some(value);
            }
        } else if word == short {
            return words.next();
        } else if let Some(value) = word.strip_prefix(&short) {
            return Some(value);
        }
    }
    None
}

#[derive(Deserialize)]
struct File {
    #[serde(rename = "cmdline:", alias = "cmdline", default)]
    command_line: String,
    #[serde(default)]
    resolution_in_ns: u64,
    thread: BTreeMap<String, Thread>,
}

#[derive(Deserialize)]
struct Thread {
    #[serde(default)]
    histogram: BTreeMap<String, u64>,
    cycles: u64,
    max: u64,
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum ReferenceError {
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    #[error("histogram: bin \"{0}\" is no whole number")]
    Bin(String),
    #[error("it holds no histogram: start cyclictest with -h")]
    NoHistogram,
}

pub(crate) fn read(text: &str) -> Result<Reference, ReferenceError> {
    let file: File = serde_json::from_str(text)?;
    let whole_us = file.resolution_in_ns != 1;
    let to_ns = if whole_us { 1000 } else { 1 };
    let mut samples = Samples::default();
    let mut beyond_histogram = 0;
    for thread in file.thread.values() {
        let mut held = 0;
        for (bin, count) in &thread.histogram {
            let value: u64 = bin.parse().map_err(|_| ReferenceError::Bin(bin.clone()))?;
            samples.record(value.saturating_mul(to_ns), *count);
            held += count;
        }
        if held == 0 {
            return Err(ReferenceError::NoHistogram);
        }
        let beyond = thread.cycles.saturating_sub(held);
        samples.record(thread.max.saturating_mul(to_ns), beyond);
        beyond_histogram += beyond;
    }
    if samples.count() == 0 {
        return Err(ReferenceError::NoHistogram);
    }
    Ok(Reference { command_line: file.command_line, whole_us, samples, beyond_histogram })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(resolution: u64, thread: &str) -> String {
        format!(
            r#"{{"cmdline:": "cyclictest -p 80", "resolution_in_ns": {resolution}, "thread": {{"0": {thread}}}}}"#
        )
    }

    #[test]
    fn both_resolutions_are_ns_here() {
        let thread =
            r#"{"histogram": {"12": 3, "13": 222}, "cycles": 226, "min": 12, "max": 7939, "avg": 13.1}"#;
        let reported = read(&text(0, thread)).unwrap();
        assert!(reported.whole_us);
        assert_eq!((reported.samples.count(), reported.beyond_histogram), (226, 1));
        assert_eq!(reported.samples.percentiles_ns().p50.unwrap() / 1000, 13);
        assert!(reported.samples.max_ns().unwrap() >= 7_939_000);
        let fine = read(&text(1, &thread.replace("7939", "13"))).unwrap();
        assert!(!fine.whole_us);
        assert_eq!(fine.samples.percentiles_ns().p50, Some(13));
    }

    #[test]
    fn options_are_found_in_all_their_forms() {
        for line in ["cyclictest -m -p 80 -q", "cyclictest -p80", "c --priority=80 -a 1", "c --priority 80"] {
            assert_eq!(option(line, 'p', "priority"), Some("80"), "{line}");
        }
        assert_eq!(option("cyclictest -m --policy=fifo", 'p', "priority"), None);
    }

    #[test]
    fn a_reference_without_histogram_says_what_to_do() {
        let reported = read(&text(0, r#"{"cycles": 5, "min": 1, "max": 2, "avg": 1.0}"#)).unwrap_err();
        assert!(reported.to_string().contains("-h"), "{reported}");
        assert!(read("{").unwrap_err().to_string().contains("line 1"));
    }
}
