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
//! let mut flight: FlightRecorder<Row, Row> = FlightRecorder::default();
//! let late = CycleStages { cycle: 7, due_ns: 7_000_000, woke_ns: 7_600_000, done_ns: 7_650_000, ..Default::default() };
//! flight.row(Row(late.woke_ns));
//! if let Some(trigger) = limit.judge(&late) {
//!     flight.trigger(trigger);
//! }
//! let mut named = Vec::new();
//! flight.advance(Instant::from_nanos(400_000_000), |dump| named.push(dump.trigger.severity));
//! assert_eq!(named, [Severity::Late { ns: 600_000 }]);
//! ```

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

/// Kind of an event, and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// The greater, the more severe. Late and slow are one kind, whose length counts.
    fn rank(self) -> (u8, u64) {
        match self {
            Self::Late { ns } | Self::Slow { ns } => (0, ns),
            Self::Overrun { ns } => (1, ns),
            Self::Fault => (2, 0),
            Self::Signal => (3, 0),
        }
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

/// An event that freezes the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// Its kind and size.
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

/// Limits beyond which a cycle triggers a dump.
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

/// The window around an event.
#[derive(Debug)]
pub struct Dump<'a, R, F> {
    /// Its most severe trigger, which names it.
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

/// A window that is not over yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    trigger: Trigger,
    from: Instant,
    to: Instant,
}

/// Whether there is a place for a dump.
enum DumpSlot {
    Free,
    /// The dump of this less severe trigger is removed for it.
    Replaces(Trigger),
    Full,
}

/// Rows of the last seconds, from which the window around an event is taken.
#[derive(Debug)]
pub struct FlightRecorder<R, F> {
    rows: VecDeque<R>,
    frames: VecDeque<F>,
    /// Windows that wait for their end, which follow one another.
    pending: VecDeque<Pending>,
    kept: Vec<Trigger>,
    /// Dumps that were not kept, or that gave way to more severe ones.
    pub dropped: u64,
}

impl<R: Stamped, F: Stamped> FlightRecorder<R, F> {
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
                if trigger.severity.rank() > pending.trigger.severity.rank() {
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
        kept.chain(pending).filter(|other| other.rank() >= severity.rank()).count() <= MOST_DUMPS
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
        let replaces = match self.find_slot(&trigger) {
            DumpSlot::Free => None,
            DumpSlot::Replaces(less_severe) => Some(less_severe),
            DumpSlot::Full => return,
        };
        self.kept.push(trigger);
        let within = |at_ns: u64| (from.as_nanos()..=to.as_nanos()).contains(&at_ns);
        let rows = self.rows.iter().filter(|row| within(row.at_ns())).collect();
        let mut frames: Vec<_> = self.frames.iter().filter(|frame| within(frame.at_ns())).collect();
        // A command is read a cycle after it arrived.
        frames.sort_by_key(|frame| frame.at_ns());
        write(Dump { trigger, from, to, rows, frames, replaces });
    }

    fn find_slot(&mut self, trigger: &Trigger) -> DumpSlot {
        if self.kept.len() < MOST_DUMPS {
            return DumpSlot::Free;
        }
        self.dropped += 1;
        // Of equals the newest goes: what began a trouble says more than its hundredth repetition.
        let least = self.kept.iter().enumerate().rev().min_by_key(|(_, kept)| kept.severity.rank());
        match least.map(|(place, kept)| (place, kept.severity)) {
            Some((place, severity)) if severity.rank() < trigger.severity.rank() => {
                DumpSlot::Replaces(self.kept.remove(place))
            }
            _ => DumpSlot::Full,
        }
    }

    /// Dumps kept.
    #[must_use]
    pub fn dumps(&self) -> u64 {
        self.kept.len() as u64
    }
}

impl<R: Stamped, F: Stamped> Default for FlightRecorder<R, F> {
    /// An empty ring, its memory taken.
    fn default() -> Self {
        Self {
            rows: VecDeque::with_capacity(ROWS),
            frames: VecDeque::with_capacity(FRAMES),
            pending: VecDeque::new(),
            kept: Vec::with_capacity(MOST_DUMPS),
            dropped: 0,
        }
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
mod tests;
