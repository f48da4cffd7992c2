//! The clock as a value: what a loop needs to know of time, and the real clock behind it.
//!
//! The same loop runs on the system's clock and, in a test or in lockstep, on a [`VirtualClock`] that jumps. So time
//! is a trait with two questions, "what is it now?" and "come back at …", and a point in time is a type, so that it
//! cannot be mixed up with a length of time or a number of cycles.
//!
//! # Terms
//! - *Epoch*: the zero of a clock. Instants of two clocks have nothing to do with each other.
//! - *Absolute wait*: until a point in time, not for a length of time. A wait that was interrupted or that began late
//!   still ends on time; relative sleeps add up every delay.
//!
//! # Source
//! [POSIX 2024] `clock_nanosleep` with `TIMER_ABSTIME`; `man 2 clock_nanosleep`: an interrupted absolute wait is
//! repeated with the same argument.

#[cfg(debug_assertions)]
use std::cell::Cell;
use std::ops::{Add, Sub};
use std::time::Duration;

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

pub use crate::virtual_clock::VirtualClock;

const NANOS_PER_SECOND: u64 = 1_000_000_000;

/// A source of time that can be read and waited for.
pub trait Clock {
    /// The reading of the clock, never earlier than the one before.
    fn now(&self) -> Instant;

    /// Returns when the clock shows `deadline` or later; at once if it already does.
    fn wait_until(&self, deadline: Instant);

    /// Reads the clock over and over until it shows `deadline` or later, and returns that last reading.
    ///
    /// Costs the whole CPU meanwhile. A clock that does not run by itself overrides this.
    fn spin_until(&self, deadline: Instant) -> Instant {
        loop {
            let now = self.now();
            if now >= deadline {
                return now;
            }
            std::hint::spin_loop();
        }
    }
}

impl<C: Clock + ?Sized> Clock for &C {
    fn now(&self) -> Instant {
        (**self).now()
    }

    fn wait_until(&self, deadline: Instant) {
        (**self).wait_until(deadline);
    }

    fn spin_until(&self, deadline: Instant) -> Instant {
        (**self).spin_until(deadline)
    }
}

/// A point in time: nanoseconds since its clock's epoch, up to 584 years.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Instant(u64);

impl Instant {
    /// The instant `nanos` after the epoch.
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the epoch.
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// The time from `earlier` to this, or zero if `earlier` is the later one.
    pub const fn saturating_duration_since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }

    /// The instant `duration` before this one, or the epoch if that is nearer.
    pub fn saturating_sub(self, duration: Duration) -> Self {
        Self(u64::try_from(duration.as_nanos()).map_or(0, |nanos| self.0.saturating_sub(nanos)))
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    /// # Panics
    /// When the sum lies more than 584 years after the epoch.
    fn add(self, duration: Duration) -> Self {
        let nanos = u64::try_from(duration.as_nanos()).ok().and_then(|nanos| self.0.checked_add(nanos));
        Self(nanos.expect("an instant stays within 584 years of its clock's epoch"))
    }
}

impl Sub for Instant {
    type Output = Duration;

    /// Checked: the time from `earlier` to this.
    ///
    /// # Panics
    /// When `earlier` is the later one: the caller's order is wrong. Where either order is legal, ask
    /// [`Instant::saturating_duration_since`].
    fn sub(self, earlier: Self) -> Duration {
        let nanos = self.0.checked_sub(earlier.0);
        Duration::from_nanos(nanos.expect("an instant is subtracted only from a later one"))
    }
}

/// The system's monotonic clock, `CLOCK_MONOTONIC`: no steps, no time of day, stands still in suspend.
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

impl Clock for MonotonicClock {
    fn now(&self) -> Instant {
        let time = clock_gettime(ClockId::Monotonic);
        let now = Instant(time.tv_sec as u64 * NANOS_PER_SECOND + time.tv_nsec as u64);
        #[cfg(debug_assertions)]
        assert_not_earlier_than_before(now);
        now
    }

    fn wait_until(&self, deadline: Instant) {
        let request = Timespec {
            tv_sec: (deadline.0 / NANOS_PER_SECOND) as i64,
            tv_nsec: (deadline.0 % NANOS_PER_SECOND) as i64,
        };
        loop {
            match clock_nanosleep_absolute(ClockId::Monotonic, &request) {
                Ok(()) => return,
                // A signal came; the deadline is absolute, so waiting again for the same one loses nothing.
                Err(Errno::INTR) => {}
                // EINVAL and EFAULT: the request above is well-formed, and the clock exists on every Linux.
                Err(error) => panic!("CLOCK_MONOTONIC cannot be waited for: {error}"),
            }
        }
    }
}

#[cfg(debug_assertions)]
thread_local! {
    /// The last reading of this thread. Readings of two threads may be compared in the wrong order, so each keeps its own.
    static LAST_READING: Cell<u64> = const { Cell::new(0) };
}

#[cfg(debug_assertions)]
fn assert_not_earlier_than_before(now: Instant) {
    let before = LAST_READING.replace(now.0);
    assert!(before <= now.0, "the monotonic clock went back from {before} ns to {} ns", now.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instant_and_a_duration_add_and_subtract_exactly() {
        let early = Instant::from_nanos(1_999_999_999);
        let late = early + Duration::from_nanos(2);
        assert_eq!(late.as_nanos(), 2_000_000_001);
        assert_eq!(late - early, Duration::from_nanos(2));
        assert_eq!(late.saturating_sub(Duration::from_nanos(2)), early);
    }

    #[test]
    fn saturating_differences_stop_at_zero_and_at_the_epoch() {
        let (early, late) = (Instant::from_nanos(1), Instant::from_nanos(2));
        assert_eq!(early.saturating_duration_since(late), Duration::ZERO);
        assert_eq!(early.saturating_sub(Duration::from_secs(1)), Instant::from_nanos(0));
        assert_eq!(early.saturating_sub(Duration::MAX), Instant::from_nanos(0));
    }

    #[test]
    #[should_panic(expected = "only from a later one")]
    fn subtracting_a_later_instant_is_a_bug_that_panics() {
        let _ = Instant::from_nanos(1) - Instant::from_nanos(2);
    }

    #[test]
    fn the_monotonic_clock_never_wakes_before_its_deadline() {
        let clock = MonotonicClock;
        for nanos in [0, 1, 50_000, 2_000_000] {
            let deadline = clock.now() + Duration::from_nanos(nanos);
            clock.wait_until(deadline);
            assert!(clock.now() >= deadline);
            assert!(clock.spin_until(deadline) >= deadline);
        }
    }

    #[test]
    fn waiting_for_the_past_returns() {
        MonotonicClock.wait_until(Instant::from_nanos(0));
    }
}
