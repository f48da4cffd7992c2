//! The periodic loop: a cycle at each absolute deadline, and an honest account of every one that came late.
//!
//! # The re-arm rule: after the deadline, never after the wake-up
//! ```text
//! deadline n = start + n · period
//! ```
//! A loop that re-arms after the wake-up ("sleep one period, again") adds up its delays: woken 70 us late each time, a
//! 1 kHz loop has lost 70 us · 1000 = 70 ms after the first second and runs at 934.6 Hz, not at 1 kHz. Re-armed after
//! the deadline it is 70 us late in every cycle, for ever, and cycle 86 400 000 still belongs to 24 h exactly.
//!
//! # Overrun
//! Woken at deadline n + d, floor(d / period) cycles have been missed:
//! ```text
//! period 1 ms             n        n+1       n+2       n+3       n+4
//! deadlines        ───────┼─────────┼─────────┼─────────┼─────────┼──
//! woken at n + 2.6 ms      ··················· ·····▲
//!                                                   └─ cycle n+2, scheduled at n+2, skipped = 2 (n and n+1)
//! ```
//! [`OverrunPolicy::CatchUp`] hands out cycle n+2 with `skipped = 2` and lets the caller compute what was missed;
//! [`OverrunPolicy::Stop`] ends the loop. Neither is silent.
//!
//! # Coordinated omission
//! A stall of 50 ms makes one late wake-up, but fifty late cycles. Recording one sample for it would hide the other
//! forty-nine, just because the loop was too busy to measure them. So each missed cycle is recorded too, with the
//! lateness against its own scheduled time: 50, 49, … 1 ms.
//!
//! # Terms
//! - *Wake-up latency*: woke − scheduled.
//! - *Execution time*: from the wake-up to [`PeriodicLoop::end_of_work`].
//! - *Period error*: |woke_n − woke_m − period · (n − m)| between two cycles handed out one after the other.
//! - *Late completion*: work that ended after the next deadline.
//!
//! # Source
//! [rt-tests] `cyclictest.c`, `timerthread`; [Tene 2013] "How NOT to measure latency" for coordinated omission.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use serde::Serialize;

use crate::clock::{Clock, Instant};
use crate::histogram::{BOUND_NS, Recorder};

/// What happens when whole cycles were missed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OverrunPolicy {
    /// Go on with the newest cycle that is due, and report how many were skipped.
    CatchUp,
    /// End the loop with an [`Overrun`].
    Stop,
}

impl fmt::Display for OverrunPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::CatchUp => "catch-up",
            Self::Stop => "stop",
        })
    }
}

impl FromStr for OverrunPolicy {
    type Err = UnknownPolicy;

    fn from_str(text: &str) -> Result<Self, UnknownPolicy> {
        match text {
            "catch-up" => Ok(Self::CatchUp),
            "stop" => Ok(Self::Stop),
            _ => Err(UnknownPolicy(text.to_owned())),
        }
    }
}

/// The text names no overrun policy.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("overrun policy {0:?}: only \"catch-up\" and \"stop\" are known")]
pub struct UnknownPolicy(pub String);

/// The read-only part of a loop.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PeriodicConfig {
    /// Time from deadline to deadline; above zero.
    pub period: Duration,
    /// What happens when whole cycles were missed.
    pub policy: OverrunPolicy,
    /// Wake early by this and read the clock until the deadline; below the period. Costs this share of the CPU.
    pub spin: Option<Duration>,
}

impl PeriodicConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.period.is_zero() || self.period > MOST_PERIOD {
            return Err(ConfigError::Period { period: self.period });
        }
        match self.spin {
            Some(spin) if spin >= self.period => Err(ConfigError::Spin { spin, period: self.period }),
            _ => Ok(()),
        }
    }
}

/// The longest period, 60 s: what the histograms distinguish.
const MOST_PERIOD: Duration = Duration::from_nanos(BOUND_NS);

/// A loop cannot run with these numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ConfigError {
    /// The period is out of range.
    #[error("period {period:?}: allowed is more than 0 s and at most 60 s")]
    Period {
        /// As asked.
        period: Duration,
    },
    /// The loop would spin all the time and leave the CPU to nobody.
    #[error("spin {spin:?}: allowed is less than the period, {period:?}")]
    Spin {
        /// As asked.
        spin: Duration,
        /// The period that it must stay below.
        period: Duration,
    },
}

/// One cycle as it was handed out.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cycle {
    /// Its number; it is due at start + index · period.
    pub index: u64,
    /// When it was due.
    pub scheduled: Instant,
    /// When the loop woke for it.
    pub woke: Instant,
    /// How many cycles right before this one were missed: index − skipped … index − 1.
    pub skipped: u64,
}

impl Cycle {
    /// Wake-up latency of this cycle. The longest lateness of the wake-up is this plus `skipped` periods.
    pub fn wakeup_latency(&self) -> Duration {
        self.woke.saturating_duration_since(self.scheduled)
    }
}

/// Whole cycles were missed, and the policy says stop.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "overrun: cycle {index} woke {late_by:?} late, {skipped} cycles were missed, and the policy is to stop"
)]
pub struct Overrun {
    /// The first cycle missed.
    pub index: u64,
    /// How late the loop woke for it.
    pub late_by: Duration,
    /// How many cycles were missed, this one included.
    pub skipped: u64,
}

/// The written part of a loop. Serialises with percentiles for histograms.
///
/// Each cycle that was due stands in `wakeup_ns` exactly once: its count is `cycles + skipped`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LoopStatistics {
    /// Cycles handed out.
    pub cycles: u64,
    /// Cycles missed.
    pub skipped: u64,
    /// Wake-ups at which at least one cycle had been missed.
    pub overruns: u64,
    /// Cycles whose work ended after the next deadline.
    pub late_completions: u64,
    /// Wake-up latency of each cycle, missed ones too, against its own scheduled time, in ns.
    pub wakeup_ns: Recorder,
    /// Execution time of each cycle whose end of work was reported, in ns.
    pub execution_ns: Recorder,
    /// Period error of each cycle handed out but the first, in ns.
    pub period_error_ns: Recorder,
}

/// Hands out one cycle at each deadline and keeps the account. Nothing allocates after `new`.
#[derive(Debug)]
pub struct PeriodicLoop<C: Clock> {
    /// What the loop runs on.
    pub clock: C,
    config: PeriodicConfig,
    period_ns: u64,
    start: Instant,
    next_index: u64,
    working: Option<Cycle>,
    previous_latency: Option<Duration>,
    stopped: Option<Overrun>,
    /// The account so far.
    pub statistics: LoopStatistics,
}

impl<C: Clock> PeriodicLoop<C> {
    /// A loop whose cycle 0 is due at `start`: a little in the future, or it begins with an overrun.
    ///
    /// # Panics
    /// When [`PeriodicConfig::check`] finds an error; whoever takes numbers from a person asks it first.
    pub fn new(clock: C, config: PeriodicConfig, start: Instant) -> Self {
        if let Err(error) = config.check() {
            panic!("{error}");
        }
        Self {
            clock,
            config,
            period_ns: config.period.as_nanos() as u64, // at most MOST_PERIOD
            start,
            next_index: 0,
            working: None,
            previous_latency: None,
            stopped: None,
            statistics: LoopStatistics::default(),
        }
    }

    /// Waits for the next deadline and hands out the newest cycle that is then due.
    ///
    /// # Errors
    /// [`Overrun`] when cycles were missed and the policy is to stop. A stopped loop stays stopped: each further call
    /// gives the same error at once.
    pub fn next_cycle(&mut self) -> Result<Cycle, Overrun> {
        if let Some(overrun) = self.stopped {
            return Err(overrun);
        }
        let first = self.next_index;
        let woke = self.wait_for(self.deadline(first));
        let late_by = woke.saturating_duration_since(self.deadline(first));
        let skipped = late_by.as_nanos() as u64 / self.period_ns;

        record_missed(&mut self.statistics.wakeup_ns, late_by.as_nanos() as u64, skipped, self.period_ns);
        if skipped > 0 {
            self.statistics.overruns += 1;
            self.statistics.skipped += skipped;
            if self.config.policy == OverrunPolicy::Stop {
                let overrun = Overrun { index: first, late_by, skipped };
                self.stopped = Some(overrun);
                self.working = None;
                return Err(overrun);
            }
        }

        let index = first + skipped;
        let cycle = Cycle { index, scheduled: self.deadline(index), woke, skipped };
        self.record_handed_out(&cycle);
        self.next_index = index + 1;
        self.working = Some(cycle);
        Ok(cycle)
    }

    /// Records the execution time of the cycle since its wake-up, and returns when that was. Without a cycle, or
    /// called twice, it does nothing.
    pub fn end_of_work(&mut self) -> Option<Instant> {
        let cycle = self.working.take()?;
        let now = self.clock.now();
        self.statistics.execution_ns.record(now.saturating_duration_since(cycle.woke).as_nanos() as u64);
        if now > self.deadline(cycle.index + 1) {
            self.statistics.late_completions += 1;
        }
        Some(now)
    }

    /// When cycle `index` is due. The re-arm rule, and the only place where it stands.
    pub fn deadline(&self, index: u64) -> Instant {
        // 64 bits of nanoseconds are 584 years: no loop gets there, and overflow checks guard the tests.
        Instant::from_nanos(self.start.as_nanos() + index * self.period_ns)
    }

    fn wait_for(&self, deadline: Instant) -> Instant {
        match self.config.spin {
            None => {
                self.clock.wait_until(deadline);
                self.clock.now()
            }
            Some(early) => {
                self.clock.wait_until(deadline.saturating_sub(early));
                self.clock.spin_until(deadline)
            }
        }
    }

    fn record_handed_out(&mut self, cycle: &Cycle) {
        let latency = cycle.wakeup_latency();
        self.statistics.cycles += 1;
        self.statistics.wakeup_ns.record(latency.as_nanos() as u64);
        // woke_n − woke_m − period · (n − m) is latency_n − latency_m, since the deadlines lie exactly n − m periods apart.
        if let Some(previous) = self.previous_latency.replace(latency) {
            self.statistics.period_error_ns.record(latency.abs_diff(previous).as_nanos() as u64);
        }
    }
}

/// Records each of the `skipped` missed cycles against its own scheduled time; the first of them came `late_ns` too late. The
/// only place where coordinated omission is undone.
pub(crate) fn record_missed(wakeup_ns: &mut Recorder, late_ns: u64, skipped: u64, period_ns: u64) {
    // Cycles beyond the recorder's bound all land in one bin: recorded at one go, so that hours of stall (a debugger,
    // a clock step) cost no more than the 60 s that the recorder distinguishes.
    let clipped = (late_ns.saturating_sub(BOUND_NS).div_ceil(period_ns)).min(skipped);
    if clipped > 0 {
        wakeup_ns.record_n(late_ns, clipped);
    }
    for missed in clipped..skipped {
        wakeup_ns.record(late_ns - missed * period_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policy_reads_what_it_prints_and_names_the_choices_otherwise() {
        for policy in [OverrunPolicy::CatchUp, OverrunPolicy::Stop] {
            assert_eq!(policy.to_string().parse(), Ok(policy));
        }
        let error = "ignore".parse::<OverrunPolicy>().expect_err("unknown");
        assert_eq!(error.to_string(), r#"overrun policy "ignore": only "catch-up" and "stop" are known"#);
    }

    #[test]
    fn a_period_of_zero_and_a_spin_of_a_whole_period_are_refused() {
        let ms = Duration::from_millis(1);
        let config = |period, spin| PeriodicConfig { period, policy: OverrunPolicy::Stop, spin };
        assert_eq!(config(ms, None).check(), Ok(()));
        assert_eq!(config(ms, Some(ms / 2)).check(), Ok(()));
        assert!(matches!(config(Duration::ZERO, None).check(), Err(ConfigError::Period { .. })));
        assert!(matches!(config(Duration::from_secs(61), None).check(), Err(ConfigError::Period { .. })));
        assert!(matches!(config(ms, Some(ms)).check(), Err(ConfigError::Spin { .. })));
    }
}
