//! The writer's account against the loop's own, and the log second by second against both.

use crate::common;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use hdrhistogram::Histogram;
use realtime::{
    Clock, CycleStages, Instant, IntervalLog, OverrunPolicy, PeriodicConfig, PeriodicLoop, StageAccount,
    VirtualClock,
};

const PERIOD: Duration = Duration::from_millis(1);

/// Lines of a log by tag: start in s, length in s, histogram.
type Lines = BTreeMap<String, Vec<(f64, f64, Histogram<u64>)>>;

fn lines(path: &Path) -> Lines {
    let mut lines = Lines::new();
    for (tag, start, length, histogram) in common::intervals(path) {
        lines.entry(tag).or_default().push((start.as_secs_f64(), length.as_secs_f64(), histogram));
    }
    lines
}

fn sum(lines: &Lines, tag: &str) -> Histogram<u64> {
    let mut parts = lines[tag].iter().map(|(_, _, histogram)| histogram);
    let mut sum = parts.next().expect("a line").clone();
    parts.for_each(|part| sum.add(part).expect("equal bounds"));
    sum
}

/// Runs a loop of `cycles` cycles, each of which works for as long as `work` says.
fn run(
    folder: &Path,
    cycles: u64,
    work: impl Fn(u64) -> Duration,
) -> (PeriodicLoop<VirtualClock>, StageAccount) {
    let clock = VirtualClock::new();
    let config = PeriodicConfig { period: PERIOD, policy: OverrunPolicy::CatchUp, spin: None };
    let start = clock.now() + PERIOD;
    let mut periodic = PeriodicLoop::new(clock, config, start);
    let mut account = StageAccount::new("emulator", PERIOD);
    let log = IntervalLog::create(&folder.join("emulator.hlog"), 1_763_600_000.0, Instant::from_nanos(0));
    account.log_to(log.expect("made"));
    while let Ok(cycle) = periodic.next_cycle() {
        periodic.clock.advance(work(cycle.index));
        let done = periodic.end_of_work().expect("a cycle");
        let row = CycleStages {
            cycle: cycle.index,
            skipped: cycle.skipped,
            due_ns: cycle.scheduled.as_nanos(),
            woke_ns: cycle.woke.as_nanos(),
            receive_ns: 1000,
            step_ns: 2000,
            send_ns: 3000,
            done_ns: done.as_nanos(),
        };
        account.record(&row).expect("written");
        if cycle.index >= cycles {
            break;
        }
    }
    (periodic, account)
}

#[test]
fn without_dropped_rows_the_log_adds_up_to_what_the_loop_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two stalls: one within a second, one from second 2 into second 3.
    let work = |cycle| match cycle {
        700 => Duration::from_micros(50_300),
        2980 => Duration::from_micros(70_000),
        cycle => Duration::from_nanos(100_000 + cycle * 17 % 9000),
    };
    let (periodic, mut account) = run(folder.path(), 3500, work);
    let end = periodic.clock.now();
    let figures = account.finish(end).expect("written");
    let statistics = &periodic.statistics;
    assert_eq!(figures.wakeup_ns.count, statistics.cycles + statistics.skipped);
    let lines = lines(&folder.path().join("emulator.hlog"));
    assert_eq!(lines.len(), 7, "{:?}", lines.keys());
    for (stage, recorder) in [
        ("wakeup", &statistics.wakeup_ns),
        ("execution", &statistics.execution_ns),
        ("period-error", &statistics.period_error_ns),
    ] {
        assert_eq!(&sum(&lines, &format!("emulator-{stage}")), recorder.histogram(), "{stage}");
    }
    let of_loop = [&statistics.wakeup_ns, &statistics.execution_ns, &statistics.period_error_ns];
    let of_account = [figures.wakeup_ns, figures.execution_ns, figures.period_error_ns];
    assert_eq!(of_loop.map(|recorder| recorder.percentiles()), of_account);
    assert_eq!(sum(&lines, "emulator-receive").len(), statistics.cycles);
    assert_eq!(figures.completion_ns.count, figures.wakeup_ns.count, "missed cycles are completed late too");
    assert_eq!(figures.send_ns.max.map(|ns| ns / 10), Some(300));
}

#[test]
fn a_stall_of_fifty_milliseconds_leaves_fifty_samples_a_millisecond_apart() {
    let folder = tempfile::tempdir().expect("a folder");
    let work = |cycle| Duration::from_micros(if cycle == 100 { 51_000 } else { 10 });
    let (periodic, mut account) = run(folder.path(), 200, work);
    account.finish(periodic.clock.now()).expect("written");
    let lines = lines(&folder.path().join("emulator.hlog"));
    // The cycle that follows the stall is done 10 us after it woke, and with it those that it made good.
    for (tag, after_ns) in [("emulator-wakeup", 0), ("emulator-completion", 10_000)] {
        let samples = sum(&lines, tag);
        for late_ms in 1..=50_u64 {
            let expected_ns = late_ms * 1_000_000 + after_ns;
            // Three digits: a bin is at most a thousandth wide.
            let near_ns = 2000 + expected_ns / 1000;
            let near = samples.count_between(expected_ns - near_ns, expected_ns + near_ns);
            assert_eq!(near, 1, "{tag}: {late_ms} ms late");
        }
    }
    assert!(sum(&lines, "emulator-completion").max() >= sum(&lines, "emulator-wakeup").max());
}

#[test]
fn what_waited_and_what_nothing_followed_is_in_the_completion_too() {
    let mut account = StageAccount::new("controller", PERIOD);
    account.record_waited(5_000_000, 5_040_000);
    account.record_missed(3_000_000, 3);
    let figures = account.finish(Instant::from_nanos(0)).expect("no log");
    assert_eq!((figures.wakeup_ns.count, figures.completion_ns.count), (4, 4));
    let about = |value: Option<u64>, ns: u64| value.is_some_and(|value| value.abs_diff(ns) < ns / 500);
    assert!(about(figures.wakeup_ns.max, 5_000_000), "{figures:?}");
    assert!(about(figures.completion_ns.max, 5_040_000), "{figures:?}");
}

#[test]
fn each_second_has_its_own_line_and_its_own_maximum() {
    let folder = tempfile::tempdir().expect("a folder");
    let work = |cycle| Duration::from_micros(100 * (1 + cycle / 1000));
    let (periodic, mut account) = run(folder.path(), 2500, work);
    account.finish(periodic.clock.now()).expect("written");
    let lines = lines(&folder.path().join("emulator.hlog"));
    let execution = &lines["emulator-execution"];
    let starts: Vec<_> = execution.iter().map(|(start, ..)| *start).collect();
    assert_eq!(starts, [0.0, 1.0, 2.0]);
    let maxima: Vec<_> = execution.iter().map(|(_, _, histogram)| histogram.max() / 99_000).collect();
    assert_eq!(maxima, [1, 2, 3]);
    assert_eq!(execution[0].1, 1.0);
    assert!((0.4..0.6).contains(&execution[2].1), "the last line is as long as what was left");
}

#[test]
fn what_was_measured_is_in_the_file_a_second_later_however_the_process_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_periodic, account) = run(folder.path(), 3400, |_| Duration::from_micros(10));
    // Killed: nothing finishes the account.
    std::mem::forget(account);
    let log = lines(&folder.path().join("emulator.hlog"));
    assert!(sum(&log, "emulator-wakeup").len() >= 2998);
    assert!(std::fs::read(folder.path().join("emulator.hlog")).expect("the log").ends_with(b"\n"));
}

#[test]
fn a_second_is_written_though_nothing_newer_comes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("controller.hlog");
    let mut account = StageAccount::new("controller", PERIOD);
    let extra = account.add("controller-answer");
    account.log_to(IntervalLog::create(&path, 0.0, Instant::from_nanos(0)).expect("made"));
    account.record_waited(5_000_000, 5_010_000);
    account.record_extra(extra, 7);
    account.advance(Instant::from_nanos(1_100_000_000)).expect("written");
    assert!(lines(&path).is_empty(), "rows may still be in the queue");
    account.advance(Instant::from_nanos(1_300_000_000)).expect("written");
    assert_eq!(
        lines(&path).keys().collect::<Vec<_>>(),
        ["controller-answer", "controller-completion", "controller-wakeup"]
    );
    assert_eq!(account.extra_percentiles(extra).max, Some(7));
}
