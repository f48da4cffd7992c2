//! The flight recorder: windows, severity, what is kept.

use super::*;

const MS: u64 = 1_000_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp(u64);

impl Stamped for Stamp {
    fn at_ns(&self) -> u64 {
        self.0
    }
}

type Recorder = FlightRecorder<Stamp, Stamp>;

fn overrun(at_ms: u64, late_ms: u64) -> Trigger {
    let severity = Severity::Overrun { ns: late_ms * MS };
    let at = Instant::from_nanos(at_ms * MS);
    Trigger { severity, cycle: at_ms, at, late_ns: late_ms * MS, slow_ns: 0 }
}

fn at(ms: u64) -> Instant {
    Instant::from_nanos(ms * MS)
}

/// A recorder with a row each millisecond up to `ms`.
fn fed(ms: u64) -> Recorder {
    let mut flight = Recorder::default();
    (0..=ms).for_each(|ms| flight.row(Stamp(ms * MS)));
    flight
}

#[test]
fn a_dump_is_handed_out_when_its_window_is_over_and_holds_nothing_else() {
    let mut flight = fed(5000);
    flight.frame(Stamp(4001 * MS + 1));
    flight.frame(Stamp(4001 * MS));
    flight.frame(Stamp(100 * MS));
    flight.trigger(overrun(5000, 2));
    flight.advance(at(5299), |dump| panic!("too early: {dump:?}"));
    (5001..5400).for_each(|ms| flight.row(Stamp(ms * MS)));
    let mut dump_seen = None;
    flight.advance(at(5300), |dump| {
        let (first, last) = (*dump.rows[0], *dump.rows[dump.rows.len() - 1]);
        let frames: Vec<_> = dump.frames.iter().map(|frame| frame.0 - 4001 * MS).collect();
        dump_seen = Some((first, last, dump.rows.len(), frames, dump.replaces));
    });
    assert_eq!(dump_seen, Some((Stamp(3998 * MS), Stamp(5300 * MS), 1303, vec![0, 1], None)));
    assert_eq!((flight.dumps(), flight.dropped), (1, 0));
    flight.finish(|dump| panic!("handed out twice: {dump:?}"));
}

#[test]
fn triggers_within_a_window_join_it_and_the_most_severe_names_it() {
    let mut flight = fed(3000);
    flight.trigger(overrun(3000, 1));
    flight.trigger(overrun(3100, 4));
    flight.trigger(overrun(3200, 2));
    let mut named = Vec::new();
    flight.finish(|dump| named.push((dump.trigger.cycle, dump.to)));
    assert_eq!(named, [(3100, at(3300))]);
    flight.trigger(overrun(4000, 1));
    flight.trigger(Trigger::other(Severity::Signal, 4001, at(4001)));
    flight.trigger(Trigger::other(Severity::Fault, 4002, at(4002)));
    flight.finish(|dump| named.push((dump.trigger.cycle, dump.to)));
    assert_eq!(named[1], (4001, at(4300)));
}

#[test]
fn an_event_after_a_window_that_nobody_handed_out_yet_begins_one_of_its_own() {
    let mut flight = fed(2000);
    flight.trigger(overrun(2000, 1));
    // Stopped within the window, continued long after it.
    flight.row(Stamp(7000 * MS));
    flight.trigger(overrun(7000, 4900));
    let mut named = Vec::new();
    flight.advance(at(7004), |dump| named.push((dump.trigger.cycle, dump.rows.len())));
    assert_eq!(named, [(2000, 1002)]);
    flight.advance(at(7300), |dump| named.push((dump.trigger.cycle, dump.rows.len())));
    assert_eq!(named[1], (7000, 902));
}

#[test]
fn after_a_stall_of_any_length_the_rows_before_it_are_there() {
    let mut flight = fed(3000);
    flight.row(Stamp(9000 * MS));
    flight.trigger(overrun(9000, 6000));
    flight.finish(|dump| {
        assert_eq!(dump.from, at(2000));
        assert_eq!(dump.rows.len(), 1002);
    });
}

#[test]
fn a_signal_too_many_is_known_before_anything_is_promised() {
    let mut flight = Recorder::default();
    let mut written = 0;
    for n in 0..=MOST_DUMPS as u64 {
        flight.trigger(Trigger::other(Severity::Signal, n, at(10_000 * n)));
        // The last ones wait for their ends together.
        assert_eq!(flight.will_keep(Severity::Signal), n < MOST_DUMPS as u64, "{n}");
        if n < 15 {
            flight.finish(|_| written += 1);
        }
    }
    flight.finish(|_| written += 1);
    assert_eq!((written, flight.dropped), (MOST_DUMPS, 1));
}

#[test]
fn a_signal_takes_the_place_of_less_severe_dumps() {
    let mut flight = Recorder::default();
    for n in 0..MOST_DUMPS as u64 {
        flight.trigger(overrun(10_000 * (n + 1), 1));
        flight.finish(|_| ());
    }
    flight.trigger(Trigger::other(Severity::Signal, 1, at(900_000)));
    assert!(flight.will_keep(Severity::Signal));
    let mut replaced = false;
    flight.finish(|dump| replaced = dump.replaces.is_some());
    assert!(replaced);
}

#[test]
fn of_more_dumps_than_are_kept_the_least_severe_goes() {
    let mut flight = Recorder::default();
    let mut gone = Vec::new();
    let mut written = Vec::new();
    for late_ms in (1..=MOST_DUMPS as u64).chain([1, 30]) {
        flight.trigger(overrun(10_000 + late_ms, late_ms));
        flight.finish(|dump| {
            written.push(late_ms);
            gone.extend(dump.replaces.map(|trigger| trigger.late_ns / MS));
        });
    }
    assert_eq!(written.len(), MOST_DUMPS + 1, "a second one of 1 ms is not worth another's place");
    assert_eq!(gone, [1]);
    assert_eq!((flight.dumps(), flight.dropped), (MOST_DUMPS as u64, 2));
}

#[test]
fn the_ring_holds_its_seconds_and_no_more() {
    let mut flight = fed(10_000);
    (0..100_000).for_each(|ns| flight.frame(Stamp(ns)));
    assert_eq!((flight.rows.len(), flight.frames.len()), (ROWS, FRAMES));
    assert_eq!(flight.frames.back(), Some(&Stamp(99_999)));
}

#[test]
fn a_cycle_is_judged_by_what_is_worst_about_it() {
    let judge = |skipped, woke_us: u64, done_us: u64| {
        let (limit, period) = (Duration::from_micros(500), Duration::from_millis(1));
        let row =
            CycleStages { skipped, woke_ns: woke_us * 1000, done_ns: done_us * 1000, ..Default::default() };
        Lateness { limit, period }.judge(&row).map(|trigger| trigger.severity)
    };
    assert_eq!(judge(0, 500, 1000), None);
    assert_eq!(judge(0, 501, 600), Some(Severity::Late { ns: 501_000 }));
    assert_eq!(judge(0, 100, 700), Some(Severity::Slow { ns: 600_000 }));
    assert_eq!(judge(2, 100, 200), Some(Severity::Overrun { ns: 2_100_000 }));
}
