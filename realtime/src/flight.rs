//! The flight recorder: a ring of the last seconds, frozen and handed out when something happens.
//!
//! A thread of normal priority feeds it with rows (one a cycle) and frames, as they come out of their queues, and tells it what
//! happened. What was going on before and after is known a moment later:
//!
//! ```text
//!   rows, frames   ···─────────────────────────────────────────────────···
//!   window                 [─────── 1 s ────────▲─── 0.3 s ───]
//!                                               │trigger      └─ here the dump is handed out
//!                                                  ▲ further triggers join; the most severe names the dump
//! ```
//! A stall counts to the event: the window begins 1 s before the thread should have woken. Dumps beyond [`MOST_DUMPS`] are not
//! kept: the least severe goes, which may be the new one. A signal (somebody asked) outranks a fault, that an overrun, that a
//! cycle that was late or slow; within a kind the longer one is the more severe.
//!
//! Nothing here touches a file or a clock: times are handed in, dumps go to a closure.
//!
//! ```
//! use realtime::flight::{FlightRecorder, Lateness, Severity, Stamped, Trigger};
//! use realtime::{CycleStages, Instant};
//! use std::time::Duration;
//!
//! #[derive(Clone, Copy)]
//! struct Row(u64);
//! impl Stamped for Row {
//!     fn at_ns(&self) -> u64 { self.0 }
//! }
//!
//! let limit = Lateness { limit: Duration::from_micros(500), period: Duration::from_millis(1) };
//! let mut flight: FlightRecorder<Row, Row> = FlightRecorder::new();
//! let late = CycleStages { cycle: 7, due_ns: 7_000_000, woke_ns: 7_600_000, done_ns: 7_650_000, ..Default::default() };
//! flight.row(Row(late.woke_ns));
//! if let Some(trigger) = limit.judge(&late) {
//!     flight.trigger(trigger);
//! }
//! let mut named = Vec::new();
//! flight.advance(Instant::from_nanos(400_000_000), |dump| named.push(dump.trigger.severity));
//! assert_eq!(named, [Severity::Late { ns: 600_000 }]);
//! ```

use std::cmp::Ordering;
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::time::Duration;

use crate::clock::Instant;
use crate::stages::CycleStages;

/// Rows that the ring holds: 3 s of cycles.
pub const ROWS: usize = 3000;
/// Frames that the ring holds: ten for each of those cycles.
pub const FRAMES: usize = 30_000;
/// Dumps that are kept.
pub const MOST_DUMPS: usize = 20;
/// How much before the event is handed out.
const BEFORE_NS: u64 = 1_000_000_000;
/// How much after it.
const AFTER_NS: u64 = 300_000_000;

/// Something with a time on the monotonic clock.
pub trait Stamped {
    /// That time, ns.
    fn at_ns(&self) -> u64;
}

/// What happened. Ordered: the greater, the more severe.
#[derive(Clone, Copy, Debug)]
pub enum Severity {
    /// A cycle woke late.
    Late {
        /// By so much.
        ns: u64,
    },
    /// A cycle took long.
    Slow {
        /// So long.
        ns: u64,
    },
    /// Whole cycles were missed.
    Overrun {
        /// Lateness of the first of them.
        ns: u64,
    },
    /// A fault was latched.
    Fault,
    /// Somebody asked.
    Signal,
}

impl Severity {
    /// Late and slow are one kind, whose length counts.
    fn rank(self) -> (u8, u64) {
        match self {
            Self::Late { ns } | Self::Slow { ns } => (0, ns),
            Self::Overrun { ns } => (1, ns),
            Self::Fault => (2, 0),
            Self::Signal => (3, 0),
        }
    }
}

/// Equal is what is equally severe, so that equality and order agree.
impl PartialEq for Severity {
    fn eq(&self, other: &Self) -> bool {
        self.rank() == other.rank()
    }
}

impl Eq for Severity {}

impl PartialOrd for Severity {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Severity {
    fn cmp(&self, other: &Self) -> Ordering {
        self.rank().cmp(&other.rank())
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Late { .. } => "late",
            Self::Slow { .. } => "slow",
            Self::Overrun { .. } => "overrun",
            Self::Fault => "fault",
            Self::Signal => "signal",
        })
    }
}

/// What freezes the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// What happened.
    pub severity: Severity,
    /// Cycle in which it was noticed.
    pub cycle: u64,
    /// When.
    pub at: Instant,
    /// Lateness of the wake-up, that of the first missed cycle if there are any; 0 when it is not about that.
    pub late_ns: u64,
    /// From waking to done; 0 when it is not about that.
    pub slow_ns: u64,
}

impl Trigger {
    /// A trigger that is not about lateness.
    #[must_use]
    pub fn other(severity: Severity, cycle: u64, at: Instant) -> Self {
        Self { severity, cycle, at, late_ns: 0, slow_ns: 0 }
    }
}

/// From when on a cycle is worth a dump.
#[derive(Clone, Copy, Debug)]
pub struct Lateness {
    /// Longest wake-up latency and longest execution that are not.
    pub limit: Duration,
    /// Time from one cycle to the next, for the lateness of missed ones.
    pub period: Duration,
}

impl Lateness {
    /// The trigger that a cycle is, if it is one.
    #[must_use]
    pub fn judge(&self, row: &CycleStages) -> Option<Trigger> {
        let limit_ns = self.limit.as_nanos() as u64;
        let late_ns = row.late_ns() + row.skipped * self.period.as_nanos() as u64;
        let slow_ns = row.execution_ns();
        let severity = if row.skipped > 0 {
            Severity::Overrun { ns: late_ns }
        } else if slow_ns > limit_ns && slow_ns >= late_ns {
            Severity::Slow { ns: slow_ns }
        } else if late_ns > limit_ns {
            Severity::Late { ns: late_ns }
        } else {
            return None;
        };
        Some(Trigger { severity, cycle: row.cycle, at: Instant::from_nanos(row.woke_ns), late_ns, slow_ns })
    }
}

/// What is handed out.
#[derive(Debug)]
pub struct Dump<'a, R, F> {
    /// What names it.
    pub trigger: Trigger,
    /// Start of the window.
    pub from: Instant,
    /// End of the window.
    pub to: Instant,
    /// Rows within it, in the order in which they came.
    pub rows: Vec<&'a R>,
    /// Frames within it, by their stamps.
    pub frames: Vec<&'a F>,
    /// The dump that has to go for it.
    pub replaces: Option<Trigger>,
}

/// What is being waited for.
#[derive(Clone, Copy, Debug)]
struct Pending {
    trigger: Trigger,
    from: Instant,
    to: Instant,
}

/// Where a dump goes.
enum Room {
    Free,
    InPlaceOf(Trigger),
    None,
}

/// The ring.
#[derive(Debug)]
pub struct FlightRecorder<R, F> {
    rows: VecDeque<R>,
    frames: VecDeque<F>,
    /// Windows that wait for their end, which follow one another.
    pending: VecDeque<Pending>,
    kept: Vec<Trigger>,
    dropped: u64,
}

impl<R: Stamped, F: Stamped> FlightRecorder<R, F> {
    /// An empty ring, its memory taken.
    #[must_use]
    pub fn new() -> Self {
        Self {
            rows: VecDeque::with_capacity(ROWS),
            frames: VecDeque::with_capacity(FRAMES),
            pending: VecDeque::new(),
            kept: Vec::with_capacity(MOST_DUMPS),
            dropped: 0,
        }
    }

    /// Takes a row.
    pub fn row(&mut self, row: R) {
        push(&mut self.rows, row, ROWS);
    }

    /// Takes a frame.
    pub fn frame(&mut self, frame: F) {
        push(&mut self.frames, frame, FRAMES);
    }

    /// Something happened. It joins the window that it lies in, or begins a new one.
    pub fn trigger(&mut self, trigger: Trigger) {
        let from = trigger.at.saturating_sub(Duration::from_nanos(trigger.late_ns.saturating_add(BEFORE_NS)));
        match self.pending.back_mut() {
            Some(pending) if trigger.at <= pending.to => {
                pending.from = pending.from.min(from);
                if trigger.severity > pending.trigger.severity {
                    pending.trigger = trigger;
                }
            }
            _ => {
                let to = trigger.at + Duration::from_nanos(AFTER_NS);
                self.pending.push_back(Pending { trigger, from, to });
            }
        }
    }

    /// Whether what was triggered last, this severe, will be handed out: not if [`MOST_DUMPS`] no less severe ones come first.
    #[must_use]
    pub fn will_keep(&self, severity: Severity) -> bool {
        let kept = self.kept.iter().map(|trigger| trigger.severity);
        let pending = self.pending.iter().map(|pending| pending.trigger.severity);
        kept.chain(pending).filter(|other| *other >= severity).count() <= MOST_DUMPS
    }

    /// Hands out each window that is over at `now`. Asked at each poll, after rows and frames were taken.
    pub fn advance(&mut self, now: Instant, mut write: impl FnMut(Dump<'_, R, F>)) {
        while let Some(pending) = self.pending.pop_front_if(|pending| now >= pending.to) {
            self.hand_out(pending, &mut write);
        }
    }

    /// Hands out the windows that wait, over or not: at the end of a run.
    pub fn finish(&mut self, mut write: impl FnMut(Dump<'_, R, F>)) {
        while let Some(pending) = self.pending.pop_front() {
            self.hand_out(pending, &mut write);
        }
    }

    fn hand_out(&mut self, pending: Pending, write: &mut impl FnMut(Dump<'_, R, F>)) {
        let Pending { trigger, from, to } = pending;
        let replaces = match self.make_room(&trigger) {
            Room::Free => None,
            Room::InPlaceOf(less_severe) => Some(less_severe),
            Room::None => return,
        };
        self.kept.push(trigger);
        let within = |at_ns: u64| (from.as_nanos()..=to.as_nanos()).contains(&at_ns);
        let rows = self.rows.iter().filter(|row| within(row.at_ns())).collect();
        let mut frames: Vec<_> = self.frames.iter().filter(|frame| within(frame.at_ns())).collect();
        // A command is read a cycle after it arrived.
        frames.sort_by_key(|frame| frame.at_ns());
        write(Dump { trigger, from, to, rows, frames, replaces });
    }

    fn make_room(&mut self, trigger: &Trigger) -> Room {
        if self.kept.len() < MOST_DUMPS {
            return Room::Free;
        }
        self.dropped += 1;
        // Of equals the newest goes: what began a trouble tells more than its hundredth repetition.
        let least = self.kept.iter().enumerate().rev().min_by_key(|(_, kept)| kept.severity);
        match least.map(|(place, kept)| (place, kept.severity)) {
            Some((place, severity)) if severity < trigger.severity => {
                Room::InPlaceOf(self.kept.remove(place))
            }
            _ => Room::None,
        }
    }

    /// Dumps kept.
    #[must_use]
    pub fn dumps(&self) -> u64 {
        self.kept.len() as u64
    }

    /// Dumps that were not kept, or that gave way to more severe ones.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

impl<R: Stamped, F: Stamped> Default for FlightRecorder<R, F> {
    fn default() -> Self {
        Self::new()
    }
}

/// Keeps the first failure of several dumps: it says why, and what follows may follow from it.
pub fn keep_first(written: &mut io::Result<()>, next: io::Result<()>) {
    if written.is_ok() {
        *written = next;
    }
}

fn push<T>(ring: &mut VecDeque<T>, item: T, most: usize) {
    if ring.len() == most {
        ring.pop_front();
    }
    ring.push_back(item);
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct At(u64);

    impl Stamped for At {
        fn at_ns(&self) -> u64 {
            self.0
        }
    }

    type Recorder = FlightRecorder<At, At>;

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
        let mut flight = Recorder::new();
        (0..=ms).for_each(|ms| flight.row(At(ms * MS)));
        flight
    }

    #[test]
    fn a_dump_is_handed_out_when_its_window_is_over_and_holds_nothing_else() {
        let mut flight = fed(5000);
        flight.frame(At(4001 * MS + 1));
        flight.frame(At(4001 * MS));
        flight.frame(At(100 * MS));
        flight.trigger(overrun(5000, 2));
        flight.advance(at(5299), |dump| panic!("too early: {dump:?}"));
        (5001..5400).for_each(|ms| flight.row(At(ms * MS)));
        let mut seen = None;
        flight.advance(at(5300), |dump| {
            let (first, last) = (*dump.rows[0], *dump.rows[dump.rows.len() - 1]);
            let frames: Vec<_> = dump.frames.iter().map(|frame| frame.0 - 4001 * MS).collect();
            seen = Some((first, last, dump.rows.len(), frames, dump.replaces));
        });
        assert_eq!(seen, Some((At(3998 * MS), At(5300 * MS), 1303, vec![0, 1], None)));
        assert_eq!((flight.dumps(), flight.dropped()), (1, 0));
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
        flight.row(At(7000 * MS));
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
        flight.row(At(9000 * MS));
        flight.trigger(overrun(9000, 6000));
        flight.finish(|dump| {
            assert_eq!(dump.from, at(2000));
            assert_eq!(dump.rows.len(), 1002);
        });
    }

    #[test]
    fn a_signal_too_many_is_known_before_anything_is_promised() {
        let mut flight = Recorder::new();
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
        assert_eq!((written, flight.dropped()), (MOST_DUMPS, 1));
    }

    #[test]
    fn a_signal_takes_the_place_of_less_severe_dumps() {
        let mut flight = Recorder::new();
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
        let mut flight = Recorder::new();
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
        assert_eq!((flight.dumps(), flight.dropped()), (MOST_DUMPS as u64, 2));
    }

    #[test]
    fn the_ring_holds_its_seconds_and_no_more() {
        let mut flight = fed(10_000);
        (0..100_000).for_each(|ns| flight.frame(At(ns)));
        assert_eq!((flight.rows.len(), flight.frames.len()), (ROWS, FRAMES));
        assert_eq!(flight.frames.back(), Some(&At(99_999)));
    }

    #[test]
    fn a_cycle_is_judged_by_what_is_worst_about_it() {
        let judge = |skipped, woke_us: u64, done_us: u64| {
            let (limit, period) = (Duration::from_micros(500), Duration::from_millis(1));
            let row = CycleStages {
                skipped,
                woke_ns: woke_us * 1000,
                done_ns: done_us * 1000,
                ..Default::default()
            };
            Lateness { limit, period }.judge(&row).map(|trigger| trigger.severity)
        };
        assert_eq!(judge(0, 500, 1000), None);
        assert_eq!(judge(0, 501, 600), Some(Severity::Late { ns: 501_000 }));
        assert_eq!(judge(0, 100, 700), Some(Severity::Slow { ns: 600_000 }));
        assert_eq!(judge(2, 100, 200), Some(Severity::Overrun { ns: 2_100_000 }));
    }
}
