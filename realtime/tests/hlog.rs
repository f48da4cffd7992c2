//! What `write_hlog` writes, hdrhistogram's own reader reads back equal.

use crate::common;
use std::fs;
use std::io::ErrorKind;
use std::time::Duration;

use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use realtime::{Recorder, write_hlog};

fn recorder_of(values: impl IntoIterator<Item = u64>) -> Recorder {
    let mut recorder = Recorder::new();
    values.into_iter().for_each(|ns| recorder.record(ns));
    recorder
}

#[test]
fn a_log_is_read_back_equal_with_its_tags_and_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.hlog");
    let wakeup = recorder_of((0..10_000).map(|n| n * n));
    let execution = recorder_of([0, 1, u64::MAX]);
    let empty = Recorder::new();
    let parts = [
        ("wakeup_ns", wakeup.histogram()),
        ("execution_ns", execution.histogram()),
        ("period_error_ns", empty.histogram()),
    ];
    write_hlog(&path, &parts, 1_763_600_000.25, Duration::from_millis(12_345)).expect("written");

    let log = fs::read(&path).expect("the log");
    let entries = IntervalLogIterator::new(&log).collect::<Result<Vec<_>, _>>().expect("well-formed");
    let start = Duration::from_millis(1_763_600_000_250);
    let [LogEntry::StartTime(start_time), LogEntry::BaseTime(base_time), intervals @ ..] = &entries[..]
    else {
        panic!("start time and base time, then intervals, not {entries:?}");
    };
    assert_eq!((*start_time, *base_time), (start, start));
    assert_eq!(intervals.len(), parts.len());
    for (entry, (tag, histogram)) in intervals.iter().zip(parts) {
        let LogEntry::Interval(interval) = entry else { panic!("an interval, not {entry:?}") };
        assert_eq!(interval.tag().expect("a tag").as_str(), tag);
        assert_eq!(interval.start_timestamp(), Duration::ZERO);
        assert_eq!(interval.duration(), Duration::from_millis(12_345));
        let read = common::histogram(interval.encoded_histogram());
        assert_eq!(&read, histogram, "{tag}");
    }
}

#[test]
fn a_tag_that_would_break_a_line_and_a_start_that_is_no_time_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.hlog");
    let recorder = Recorder::new();
    for (tag, start) in [("a b", 0.0), ("a,b", 0.0), ("", 0.0), ("a", -1.0), ("a", f64::NAN)] {
        let error =
            write_hlog(&path, &[(tag, recorder.histogram())], start, Duration::ZERO).expect_err("refused");
        assert_eq!(error.kind(), ErrorKind::InvalidInput, "{error}");
        assert!(!path.exists());
    }
}

#[test]
fn a_folder_that_is_not_there_is_an_error_of_the_file_system() {
    let folder = tempfile::tempdir().expect("a folder");
    let error =
        write_hlog(&folder.path().join("no/run.hlog"), &[], 0.0, Duration::ZERO).expect_err("no folder");
    assert_eq!(error.kind(), ErrorKind::NotFound);
}
