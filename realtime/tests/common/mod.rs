//! Reads logs as other tools do, with hdrhistogram's own reader.

#![allow(dead_code, reason = "each test takes what it needs")]

use std::path::Path;
use std::time::Duration;

use hdrhistogram::Histogram;
use hdrhistogram::serialization::Deserializer;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};

pub(crate) fn histogram(encoded: &str) -> Histogram<u64> {
    let bytes = from_base64(encoded);
    Deserializer::new().deserialize(&mut &bytes[..]).expect("a histogram")
}

/// All lines of a log: tag, start, length, histogram.
pub(crate) fn intervals(path: &Path) -> Vec<(String, Duration, Duration, Histogram<u64>)> {
    let log = std::fs::read(path).expect("the log");
    let entries = IntervalLogIterator::new(&log).collect::<Result<Vec<_>, _>>().expect("well-formed");
    let intervals = entries.iter().filter_map(|entry| match entry {
        LogEntry::Interval(interval) => Some(interval),
        _ => None,
    });
    let read = intervals.map(|interval| {
        let tag = interval.tag().expect("a tag").as_str().to_owned();
        (tag, interval.start_timestamp(), interval.duration(), histogram(interval.encoded_histogram()))
    });
    read.collect()
}

/// Standard base64 with padding, RFC 4648: the one step between the log's reader and the histogram's.
fn from_base64(text: &str) -> Vec<u8> {
    const ALPHABET: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::new();
    let (mut bits, mut filled) = (0_u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let six = ALPHABET.iter().position(|&known| known == letter).expect("a base64 letter");
        bits = bits << 6 | six as u32;
        filled += 6;
        if filled >= 8 {
            filled -= 8;
            bytes.push((bits >> filled) as u8);
        }
    }
    bytes
}
