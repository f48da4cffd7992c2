//! When the stages of a cycle happened, and histograms of each, kept by a thread of normal priority.
//!
//! ```text
//!   due ──────── woke ─── receive, step, send (in the order of the process) ─── done
//!    │  wakeup    │                     execution                                │
//!    │                                completion                                 │
//! ```
//! The real-time thread hands a [`CycleStages`] for each cycle through a bounded queue; the writer thread feeds a
//! [`StageAccount`], which writes the log second by second and knows the percentiles of the whole run.
//!
//! | tag | sample |
//! |---|---|
//! | `-wakeup` | woke − due of each cycle that was due, missed ones too (coordinated omission, [`crate::periodic`]) |
//! | `-receive`, `-step`, `-send` | length of the stage |
//! | `-execution` | done − woke |
//! | `-completion` | done − due of each cycle that was due, missed ones too: the cycle that followed them did their work |
//! | `-period-error` | change of the wake-up latency from one cycle to the next, as [`crate::periodic`] defines it |
//! | further ones | whatever the process adds by [`StageAccount::add`] |
//!
//! ```no_run
//! use realtime::{Clock, CycleStages, IntervalLog, MonotonicClock, StageAccount};
//! # fn main() -> std::io::Result<()> {
//! # let (unix_s, next_row) = (0.0, || None::<CycleStages>);
//! let mut account = StageAccount::new("controller-drive", std::time::Duration::from_millis(1));
//! let answered = account.add("drive-answer");
//! account.log_to(IntervalLog::create("controller-drive.hlog".as_ref(), unix_s, MonotonicClock.now())?);
//! while let Some(row) = next_row() {
//!     account.record(&row)?;
//!     account.record_extra(answered, 12_000);
//! }
//! account.advance(MonotonicClock.now())?; // at each poll: writes a second that is over though nothing newer came
//! let figures = account.finish(MonotonicClock.now())?;
//! # Ok(()) }
//! ```
//! A controller has no schedule of its own: it is due when the sensors that wake it arrive. It says `skipped: 0`, and tells the
//! sensors that waited meanwhile one by one with [`StageAccount::record_waited`], as late as the row that answered after them.
//!
//! So wake-up and completion count the same cycles, and the longest completion is never shorter than the longest wake-up.
//!
//! Without dropped rows the totals equal those of the loop ([`crate::LoopStatistics`]); a test holds them together.

use std::io;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::clock::Instant;
use crate::histogram::Percentiles;
use crate::interval_log::{IntervalLog, TaggedRecorder};
use crate::periodic::record_missed;

/// When everything of a cycle happened, in ns of the monotonic clock; stages are lengths in ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleStages {
    /// Number of the cycle.
    pub cycle: u64,
    /// Cycles right before this one that were due and missed.
    pub skipped: u64,
    /// When it was due.
    pub due_ns: u64,
    /// When the thread woke for it.
    pub woke_ns: u64,
    /// Length of the stage that takes frames.
    pub receive_ns: u64,
    /// Length of the stage that computes.
    pub step_ns: u64,
    /// Length of the stage that sends frames.
    pub send_ns: u64,
    /// When everything of the cycle was done.
    pub done_ns: u64,
}

impl CycleStages {
    /// Wake-up latency of this cycle.
    #[must_use]
    pub fn late_ns(&self) -> u64 {
        self.woke_ns.saturating_sub(self.due_ns)
    }

    /// From waking to done.
    #[must_use]
    pub fn execution_ns(&self) -> u64 {
        self.done_ns.saturating_sub(self.woke_ns)
    }
}

/// Percentiles of a run, as JSON files show them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct StageFigures {
    /// Wake-up latency of each cycle that was due.
    pub wakeup_ns: Percentiles,
    /// Stage that takes frames.
    pub receive_ns: Percentiles,
    /// Stage that computes.
    pub step_ns: Percentiles,
    /// Stage that sends frames.
    pub send_ns: Percentiles,
    /// From waking to done.
    pub execution_ns: Percentiles,
    /// From due to done, of each cycle that was due.
    pub completion_ns: Percentiles,
    /// Size of the change of the wake-up latency from one cycle to the next.
    pub period_error_ns: Percentiles,
}

/// Handle of a histogram that a process added by [`StageAccount::add`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtraHistogram(usize);

/// Places in the account.
#[derive(Clone, Copy)]
enum Stage {
    Wakeup,
    Receive,
    Step,
    Send,
    Execution,
    Completion,
    PeriodError,
}

/// Names of the places, in their order.
const STAGES: [&str; 7] = ["wakeup", "receive", "step", "send", "execution", "completion", "period-error"];

/// Histograms of the stages of one process, whole and second by second.
pub struct StageAccount {
    period_ns: u64,
    recorders: Vec<TaggedRecorder>,
    previous_late_ns: Option<u64>,
    log: Option<IntervalLog>,
}

impl StageAccount {
    /// An account whose tags begin with `prefix` and whose cycles are due every `period`.
    #[must_use]
    pub fn new(prefix: &str, period: Duration) -> Self {
        let recorders = STAGES.iter().map(|stage| TaggedRecorder::new(format!("{prefix}-{stage}"))).collect();
        Self { period_ns: period.as_nanos() as u64, recorders, previous_late_ns: None, log: None }
    }

    /// Adds a histogram under a tag of its own.
    pub fn add(&mut self, tag: &str) -> ExtraHistogram {
        self.recorders.push(TaggedRecorder::new(tag.into()));
        ExtraHistogram(self.recorders.len() - 1)
    }

    /// Writes everything recorded from now on to `log`, a second at a time.
    pub fn log_to(&mut self, log: IntervalLog) {
        self.log = Some(log);
    }

    /// Lines that the log got since they were taken the last time, if it keeps copies ([`IntervalLog::with_copy`]).
    pub fn take_copy(&mut self) -> Vec<u8> {
        self.log.as_mut().map(IntervalLog::take_copy).unwrap_or_default()
    }

    /// Records a cycle; first writes the second that is over, when this cycle was done in a later one.
    ///
    /// # Errors
    /// What the system says when the log cannot be written, with the file's name.
    pub fn record(&mut self, row: &CycleStages) -> io::Result<()> {
        let done = Instant::from_nanos(row.done_ns);
        self.turn_if(done, IntervalLog::is_over)?;
        let late_ns = row.late_ns();
        let completion_ns = row.done_ns.saturating_sub(row.due_ns);
        let missed_ns = row.skipped * self.period_ns;
        self.record_missed_in(Stage::Wakeup, late_ns + missed_ns, row.skipped);
        self.record_missed_in(Stage::Completion, completion_ns + missed_ns, row.skipped);
        for (stage, ns) in [
            (Stage::Wakeup, late_ns),
            (Stage::Receive, row.receive_ns),
            (Stage::Step, row.step_ns),
            (Stage::Send, row.send_ns),
            (Stage::Execution, row.execution_ns()),
            (Stage::Completion, completion_ns),
        ] {
            self.recorders[stage as usize].record(ns);
        }
        if let Some(previous) = self.previous_late_ns.replace(late_ns) {
            self.recorders[Stage::PeriodError as usize].record(late_ns.abs_diff(previous));
        }
        Ok(())
    }

    /// Records `count` cycles in a row that were missed and that no cycle follows, the first of which was due `late_ns` ago.
    /// They were never completed: they count with the lateness that they had when the run ended.
    pub fn record_missed(&mut self, late_ns: u64, count: u64) {
        self.record_missed_in(Stage::Wakeup, late_ns, count);
        self.record_missed_in(Stage::Completion, late_ns, count);
    }

    fn record_missed_in(&mut self, stage: Stage, late_ns: u64, count: u64) {
        let period_ns = self.period_ns;
        self.recorders[stage as usize].each(|recorder| record_missed(recorder, late_ns, count, period_ns));
    }

    /// Records that something that should have woken the thread waited `ns` until it did, and `completion_ns` until the row that
    /// answered after it was done.
    pub fn record_waited(&mut self, ns: u64, completion_ns: u64) {
        self.recorders[Stage::Wakeup as usize].record(ns);
        self.recorders[Stage::Completion as usize].record(completion_ns.max(ns));
    }

    /// Records a sample of a histogram that was added.
    pub fn record_extra(&mut self, extra: ExtraHistogram, ns: u64) {
        self.recorders[extra.0].record(ns);
    }

    /// Percentiles of a histogram that was added.
    #[must_use]
    pub fn extra_percentiles(&self, extra: ExtraHistogram) -> Percentiles {
        self.recorders[extra.0].percentiles()
    }

    /// Writes a second that has been over for a while: asked at each poll, for when no newer cycle comes.
    ///
    /// # Errors
    /// As [`StageAccount::record`].
    pub fn advance(&mut self, now: Instant) -> io::Result<()> {
        self.turn_if(now, IntervalLog::is_long_over)
    }

    /// Writes what is left, and gives the percentiles of the run.
    ///
    /// # Errors
    /// As [`StageAccount::record`].
    pub fn finish(&mut self, now: Instant) -> io::Result<StageFigures> {
        self.turn_if(now, |_, _| true)?;
        Ok(self.figures())
    }

    /// Percentiles of the run so far.
    #[must_use]
    pub fn figures(&self) -> StageFigures {
        let of = |stage: Stage| self.recorders[stage as usize].percentiles();
        StageFigures {
            wakeup_ns: of(Stage::Wakeup),
            receive_ns: of(Stage::Receive),
            step_ns: of(Stage::Step),
            send_ns: of(Stage::Send),
            execution_ns: of(Stage::Execution),
            completion_ns: of(Stage::Completion),
            period_error_ns: of(Stage::PeriodError),
        }
    }

    fn turn_if(&mut self, at: Instant, due: impl Fn(&IntervalLog, Instant) -> bool) -> io::Result<()> {
        match &mut self.log {
            Some(log) if due(log, at) => log.turn(at, self.recorders.iter_mut()),
            _ => Ok(()),
        }
    }
}
