//! Supervises an algorithm, shipped or foreign: its result must be finite and come within its time limit.
//!
//! ```text
//!            NaN or infinite            ┌────────────────────┐
//!   runs ─────────────────────────────► │ latched fault:     │  restart (main chain alone)
//!    ▲  one step over 20 ms             │ valve shut,        │ ──────────────────────────────► runs, after a reset
//!    │  10 running over 1 ms            │ no more calls      │
//!    └───────────────── each step       └────────────────────┘
//! ```
//!
//! A finite result of any size passes: the post-controller limits it to what the valve can do. Time is checked where it
//! is real; a rehearsal and a run in lockstep have no clock here, so that their results do not depend on the machine.
//! The guard sees a step only when it has returned. For one that never does, the rig shuts its valve on commands older than 20
//! cycles, the partner misses this controller, and another thread ends the process: see [`HangDetector`].

use crate::algorithm::{Algorithm, AlgorithmInput};
use realtime::Clock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant as WallInstant};

/// One step longer than this is a fault: 20 cycles, after which the rig itself calls commands stale.
pub const LONGEST_ONCE: Duration = Duration::from_millis(20);
/// Steps longer than this, the basic cycle, are a fault when they come [`SUCCESSIVE`] running.
const LONGEST_EACH: Duration = Duration::from_millis(1);
/// How many successive steps over [`LONGEST_EACH`] are a fault.
const SUCCESSIVE: u32 = 10;

/// Wall time in one call after which an algorithm counts as hung.
const HANG_LIMIT: Duration = Duration::from_secs(2);

/// Calls of algorithms begun and ended in this process: odd while one is being called. All are called by one thread.
static CALLS: AtomicU64 = AtomicU64::new(0);

/// Detects, from another thread, an algorithm that does not return. Nothing else can end its process in good order: the thread
/// that would handle Ctrl-C is the one that hangs.
#[derive(Debug)]
pub struct HangDetector {
    /// Value of [`CALLS`] in the last check.
    calls: u64,
    /// When the call in progress was first seen; between calls, the time of the last check.
    since: WallInstant,
}

impl Default for HangDetector {
    fn default() -> Self {
        Self { calls: CALLS.load(Ordering::Relaxed), since: WallInstant::now() }
    }
}

impl HangDetector {
    /// Whether an algorithm has been in one and the same call for [`HANG_LIMIT`].
    pub fn is_hung(&mut self) -> bool {
        let calls = CALLS.load(Ordering::Relaxed);
        if calls != self.calls || calls.is_multiple_of(2) {
            (self.calls, self.since) = (calls, WallInstant::now());
        }
        self.since.elapsed() > HANG_LIMIT
    }
}

/// Message about an algorithm that does not return.
pub const HANG_MESSAGE: &str = "an algorithm has not returned for 2 s; its valve is shut by the rig for want of commands. \
What was recorded so far is saved; look for an endless loop or a wait in the step of the library";

/// Why an algorithm is no longer called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AlgorithmFault {
    /// Its result was NaN or infinite.
    #[error(
        "the algorithm's result is not a number: look for a division by zero or a square root of a negative"
    )]
    NotANumber,
    /// It took too long, once or again and again.
    #[error(
        "the algorithm is too slow: its last call took {took:?}; at most {LONGEST_ONCE:?} once, and over {LONGEST_EACH:?} \
         fewer than {SUCCESSIVE} times running"
    )]
    TooSlow {
        /// Duration of the call that latched it.
        took: Duration,
    },
}

/// A supervised algorithm.
pub struct Guarded {
    algorithm: Box<dyn Algorithm>,
    clock: Option<Box<dyn Clock + Send>>,
    /// Successive steps over [`LONGEST_EACH`].
    slow: u32,
    /// Latched fault, since which the algorithm is not called; `None` before one.
    fault: Option<AlgorithmFault>,
}

impl Guarded {
    /// Supervises `algorithm`; its time only with a `clock`, which belongs to runs in real time.
    #[must_use]
    pub fn new(algorithm: Box<dyn Algorithm>, clock: Option<Box<dyn Clock + Send>>) -> Self {
        Self { algorithm, clock, slow: 0, fault: None }
    }

    /// Clears the fault; only the restart of the chain may do so. A [`Guarded::reset`] follows before the next step.
    pub fn restart(&mut self) {
        self.fault = None;
        self.slow = 0;
    }

    /// The algorithm begins anew; a latched fault stays.
    ///
    /// # Errors
    /// The fault, latched before or now: the valve is to be shut.
    pub fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> Result<(), AlgorithmFault> {
        self.check_not_latched()?;
        let ((), took) = self.timed(|algorithm| algorithm.reset(input, parameters));
        // Only too slow at once: a reset may take longer than a step.
        self.slow = 0;
        match took {
            Some(took) if took > LONGEST_ONCE => Err(self.latch(AlgorithmFault::TooSlow { took })),
            _ => Ok(()),
        }
    }

    /// The wanted velocity of the axis's rod, m/s: a finite number.
    ///
    /// # Errors
    /// The fault, latched before or now: the valve is to be shut. The algorithm is not called again.
    pub fn step(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> Result<f64, AlgorithmFault> {
        self.check_not_latched()?;
        let (result, took) = self.timed(|algorithm| algorithm.step(input, parameters));
        if !result.is_finite() {
            return Err(self.latch(AlgorithmFault::NotANumber));
        }
        if let Some(took) = took {
            self.slow = if took > LONGEST_EACH { self.slow + 1 } else { 0 };
            if took > LONGEST_ONCE || self.slow >= SUCCESSIVE {
                return Err(self.latch(AlgorithmFault::TooSlow { took }));
            }
        }
        Ok(result)
    }

    fn check_not_latched(&self) -> Result<(), AlgorithmFault> {
        self.fault.map_or(Ok(()), Err)
    }

    fn latch(&mut self, fault: AlgorithmFault) -> AlgorithmFault {
        self.fault = Some(fault);
        fault
    }

    /// The result of a call, and how long it took where time is watched.
    fn timed<T>(&mut self, call: impl FnOnce(&mut dyn Algorithm) -> T) -> (T, Option<Duration>) {
        let started = self.clock.as_ref().map(|clock| clock.now());
        CALLS.fetch_add(1, Ordering::Relaxed);
        let result = call(&mut *self.algorithm);
        CALLS.fetch_add(1, Ordering::Relaxed);
        let took = self.clock.as_ref().zip(started);
        (result, took.map(|(clock, started)| clock.now().saturating_duration_since(started)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use realtime::Instant;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// A clock that the algorithm of the test advances.
    #[derive(Clone, Default)]
    struct ManualClock(Arc<AtomicU64>);

    impl Clock for ManualClock {
        fn now(&self) -> Instant {
            Instant::from_nanos(self.0.load(Ordering::Relaxed))
        }

        fn wait_until(&self, _deadline: Instant) {
            unreachable!("the guard never waits");
        }
    }

    /// Returns its first parameter and takes the second, ns; counts its calls.
    struct Scripted {
        clock: ManualClock,
        calls: Arc<AtomicU64>,
    }

    impl Algorithm for Scripted {
        fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]) {
            self.step(input, parameters);
        }

        fn step(&mut self, _input: &AlgorithmInput, parameters: &[f64]) -> f64 {
            self.calls.fetch_add(1, Ordering::Relaxed);
            self.clock.0.fetch_add(parameters[1] as u64, Ordering::Relaxed);
            parameters[0]
        }
    }

    struct Bench {
        guarded: Guarded,
        calls: Arc<AtomicU64>,
    }

    impl Bench {
        fn new(timed: bool) -> Self {
            let (clock, calls) = (ManualClock::default(), Arc::default());
            let algorithm = Box::new(Scripted { clock: clock.clone(), calls: Arc::clone(&calls) });
            let clock: Option<Box<dyn Clock + Send>> = if timed { Some(Box::new(clock)) } else { None };
            Self { guarded: Guarded::new(algorithm, clock), calls }
        }

        fn step(&mut self, result: f64, took_ns: f64) -> Result<f64, AlgorithmFault> {
            self.guarded.step(&AlgorithmInput::default(), &[result, took_ns])
        }

        fn calls(&self) -> u64 {
            self.calls.load(Ordering::Relaxed)
        }
    }

    const MS: f64 = 1e6;

    #[test]
    fn what_is_not_a_number_latches_and_the_algorithm_is_not_asked_again() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut bench = Bench::new(false);
            assert_eq!(bench.step(0.1, 0.0), Ok(0.1));
            assert_eq!(bench.step(bad, 0.0), Err(AlgorithmFault::NotANumber));
            assert_eq!(bench.step(0.1, 0.0), Err(AlgorithmFault::NotANumber));
            assert_eq!(
                bench.guarded.reset(&AlgorithmInput::default(), &[0.0, 0.0]),
                Err(AlgorithmFault::NotANumber),
                "a reset does not take it away"
            );
            assert_eq!(bench.calls(), 2);
            bench.guarded.restart();
            assert_eq!((bench.guarded.fault, bench.step(0.2, 0.0)), (None, Ok(0.2)));
        }
    }

    #[test]
    fn one_step_over_20_ms_latches_and_one_of_20_ms_does_not() {
        let mut bench = Bench::new(true);
        assert_eq!(bench.step(0.1, 20.0 * MS), Ok(0.1));
        let took = Duration::from_nanos(20_000_001);
        assert_eq!(bench.step(0.1, 20.0 * MS + 1.0), Err(AlgorithmFault::TooSlow { took }));
        assert_eq!(bench.step(0.1, 0.0), Err(AlgorithmFault::TooSlow { took }));
        assert_eq!(bench.calls(), 2);
    }

    #[test]
    fn ten_steps_running_over_1_ms_latch_and_nine_do_not() {
        let mut bench = Bench::new(true);
        for _ in 0..5 {
            (0..9).for_each(|_| assert_eq!(bench.step(0.1, 1.5 * MS), Ok(0.1)));
            assert_eq!(bench.step(0.1, 1.0 * MS), Ok(0.1));
        }
        (0..9).for_each(|_| assert_eq!(bench.step(0.1, 1.5 * MS), Ok(0.1)));
        let fault = bench.step(0.1, 1.5 * MS).unwrap_err();
        assert_eq!(fault, AlgorithmFault::TooSlow { took: Duration::from_micros(1500) });
        assert!(fault.to_string().contains("1.5ms"), "{fault}");
    }

    #[test]
    fn a_reset_may_take_20_ms_and_no_more() {
        let mut bench = Bench::new(true);
        let mut reset = |ms: f64| bench.guarded.reset(&AlgorithmInput::default(), &[0.0, ms * MS]);
        (0..20).for_each(|_| assert_eq!(reset(19.0), Ok(())));
        assert!(matches!(reset(21.0), Err(AlgorithmFault::TooSlow { .. })));
    }

    #[test]
    fn without_a_clock_nothing_is_too_slow() {
        let mut bench = Bench::new(false);
        (0..20).for_each(|_| assert_eq!(bench.step(0.1, 1000.0 * MS), Ok(0.1)));
    }

    proptest! {
        #[test]
        fn only_finite_results_leave_and_only_before_the_first_fault(
            results in prop::collection::vec(prop::num::f64::ANY, 1..50),
        ) {
            let mut bench = Bench::new(true);
            let mut faulty = false;
            for result in results {
                faulty |= !result.is_finite();
                let expected = if faulty { Err(AlgorithmFault::NotANumber) } else { Ok(result) };
                prop_assert_eq!(bench.step(result, 0.0), expected);
            }
        }
    }
}
