//! Detects whether somebody set the time of day during a run.
//!
//! Everything is scheduled and stamped on the monotonic clock, so a step of the wall clock must change nothing; that it happened
//! belongs into the record all the same. The two clocks differ by an offset, which the slewing of a time daemon moves by at most
//! 500 us a second and a step moves at once.
//!
//! Looked at by a thread of normal priority: it may lose the CPU between two readings, so each look brackets the wall clock
//! between two monotonic ones and takes the tightest of a few tries.

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

use crate::clock::{Clock, Instant, MonotonicClock};

/// Smallest change that counts as a step.
const LEAST_STEP_NS: u64 = 1_000_000;
/// A bracket as tight as this is good at once.
const TIGHT_NS: u64 = 20_000;
const TRIES: u32 = 5;

/// A step of the wall clock.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct WallClockStep {
    /// When it was noticed, in s after the start.
    pub at_s: f64,
    /// How far the clock was set, in s, forward being positive.
    pub step_s: f64,
}

/// Detects steps by comparing the wall clock with the monotonic one.
#[derive(Debug)]
pub struct WallClockStepDetector {
    began: Instant,
    offset_ns: i128,
}

impl WallClockStepDetector {
    /// Starts with the offset of now.
    #[must_use]
    pub fn begin() -> Self {
        let (began, offset_ns) = offset_ns();
        Self { began, offset_ns }
    }

    /// The step since the last look, if any.
    pub fn look(&mut self) -> Option<WallClockStep> {
        let (now, offset_ns) = offset_ns();
        self.judge(now, offset_ns)
    }

    fn judge(&mut self, now: Instant, offset_ns: i128) -> Option<WallClockStep> {
        let step_ns = offset_ns - std::mem::replace(&mut self.offset_ns, offset_ns);
        let at_s = now.saturating_duration_since(self.began).as_secs_f64();
        (step_ns.unsigned_abs() > u128::from(LEAST_STEP_NS))
            .then_some(WallClockStep { at_s, step_s: step_ns as f64 * 1e-9 })
    }
}

/// Wall clock minus monotonic clock, and when that was.
fn offset_ns() -> (Instant, i128) {
    let mut best: Option<(u64, Instant, i128)> = None;
    for _ in 0..TRIES {
        let before = MonotonicClock.now();
        let wall = clock_gettime(ClockId::Realtime);
        let after = MonotonicClock.now();
        let width = after.as_nanos() - before.as_nanos();
        let middle = i128::from(before.as_nanos() + width / 2);
        let offset = i128::from(wall.tv_sec) * 1_000_000_000 + i128::from(wall.tv_nsec) - middle;
        if best.is_none_or(|(least, ..)| width < least) {
            best = Some((width, after, offset));
        }
        if width < TIGHT_NS {
            break;
        }
    }
    best.map_or((Instant::from_nanos(0), 0), |(_, at, offset)| (at, offset))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_reported_once_and_a_slew_never() {
        let mut detector = WallClockStepDetector { began: Instant::from_nanos(0), offset_ns: 1_000_000_000 };
        let at = |ms: u64| Instant::from_nanos(ms * 1_000_000);
        assert_eq!(detector.judge(at(4), 1_000_002_000), None);
        let reported = detector.judge(at(2000), 4_600_002_000);
        assert_eq!(reported, Some(WallClockStep { at_s: 2.0, step_s: 3.6 }));
        assert_eq!(detector.judge(at(2004), 4_600_004_000), None);
        let back = detector.judge(at(2008), 1_000_004_000);
        assert_eq!(back.map(|step| step.step_s), Some(-3.6));
    }

    #[test]
    fn an_untouched_clock_does_not_step() {
        let mut detector = WallClockStepDetector::begin();
        assert_eq!((0..100).filter_map(|_| detector.look()).count(), 0);
    }
}
