//! A clock that belongs to its test: time passes only when somebody waits or says so.
//!
//! With it a stall of 50 ms takes no time and gives the same numbers on every machine, so that the loop's rules can be
//! tested exactly. It does the three things that real clocks and real schedulers do to a loop:
//!
//! - *drift*: it runs fast or slow by a fixed rate against true time;
//! - *jitter*: wake-ups come late, as a script or a seed says;
//! - *step*: its reading jumps.
//!
//! ```text
//! reading = epoch + t + t · drift / 10⁹ + steps        t: true time since the clock was made
//! ```
//!
//! The reading is computed from `t` anew each time, so that roundings do not add up. No threads: state stands in
//! `Cell`s, and a loop borrows the clock (`&VirtualClock` is a [`Clock`] too).
//!
//! # Source
//! SplitMix64 [Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators", OOPSLA], in the form of Vigna's
//! `splitmix64.c`: a generator whose whole state fits into one `Cell<u64>`.

use std::cell::Cell;
use std::time::Duration;

use crate::clock::{Clock, Instant};

const BILLION: i128 = 1_000_000_000;

/// The largest drift, 10 %: far beyond any oscillator, and small enough that the clock always moves on.
const MOST_DRIFT_PPB: i64 = 100_000_000;

/// A clock that jumps to the deadline when somebody waits for it.
#[derive(Debug)]
pub struct VirtualClock {
    epoch_ns: u64,
    drift_ppb: i64,
    true_ns: Cell<u64>,
    stepped_ns: Cell<i64>,
    jitter: WakeupJitter,
}

/// How late each wake-up comes.
#[derive(Debug)]
enum WakeupJitter {
    None,
    Scripted { late: Vec<Duration>, next: Cell<usize> },
    Seeded { state: Cell<u64>, most_ns: u64 },
}

impl VirtualClock {
    /// A clock at its epoch, that runs true and wakes on time.
    pub fn new() -> Self {
        Self::starting_at(Instant::from_nanos(0))
    }

    /// A clock that shows `now`, runs true and wakes on time.
    pub fn starting_at(now: Instant) -> Self {
        Self {
            epoch_ns: now.as_nanos(),
            drift_ppb: 0,
            true_ns: Cell::new(0),
            stepped_ns: Cell::new(0),
            jitter: WakeupJitter::None,
        }
    }

    /// Lets the clock run fast (positive) or slow by `drift_ppb` nanoseconds in each second of true time.
    ///
    /// A clock that runs fast skips some readings: a wait may then end 1 ns after its deadline.
    ///
    /// # Panics
    /// When the drift is beyond ±10 %.
    pub fn with_drift_ppb(mut self, drift_ppb: i64) -> Self {
        assert!(
            (-MOST_DRIFT_PPB..=MOST_DRIFT_PPB).contains(&drift_ppb),
            "a drift of {drift_ppb} ppb is beyond ±{MOST_DRIFT_PPB} ppb"
        );
        self.drift_ppb = drift_ppb;
        self
    }

    /// Lets the k-th wait (from 0) wake late by `late[k]`; waits after the end of the script wake on time.
    ///
    /// Lateness counts from the deadline or, when that has passed, from the time of the call.
    pub fn with_late_wakeups(mut self, late: impl Into<Vec<Duration>>) -> Self {
        self.jitter = WakeupJitter::Scripted { late: late.into(), next: Cell::new(0) };
        self
    }

    /// Lets each wait wake late by something between zero and `most`, the same for the same seed.
    pub fn with_seeded_jitter(mut self, seed: u64, most: Duration) -> Self {
        let most_ns = u64::try_from(most.as_nanos()).expect("the jitter stays below 584 years");
        self.jitter = WakeupJitter::Seeded { state: Cell::new(seed), most_ns };
        self
    }

    /// Lets `duration` of true time pass: the work of a cycle, or a stall.
    pub fn advance(&self, duration: Duration) {
        let nanos = u64::try_from(duration.as_nanos()).expect("a virtual stall stays below 584 years");
        self.true_ns.set(self.true_ns.get() + nanos);
    }

    /// Lets the reading jump ahead, with no true time passing.
    pub fn step_forward(&self, by: Duration) {
        self.step(i64::try_from(by.as_nanos()).expect("a step stays below 292 years"));
    }

    /// Lets the reading jump back, with no true time passing; a monotonic clock never does that, a loop must survive it.
    ///
    /// # Panics
    /// At the next reading, when the clock was set to before its epoch.
    pub fn step_back(&self, by: Duration) {
        self.step(-i64::try_from(by.as_nanos()).expect("a step stays below 292 years"));
    }

    /// True time since the clock was made, as an ideal clock beside it would show it.
    pub fn true_elapsed(&self) -> Duration {
        Duration::from_nanos(self.true_ns.get())
    }

    fn step(&self, nanos: i64) {
        self.stepped_ns.set(self.stepped_ns.get() + nanos);
    }

    /// Moves true time to the first nanosecond at which the clock shows `reading` or later; never back.
    fn run_to(&self, reading: Instant) {
        // reading = epoch + floor(t · rate / 10⁹) + steps, solved for the smallest t.
        let since_epoch =
            i128::from(reading.as_nanos()) - i128::from(self.epoch_ns) - i128::from(self.stepped_ns.get());
        let rate = BILLION + i128::from(self.drift_ppb);
        let true_ns = (since_epoch.max(0) * BILLION + rate - 1) / rate;
        let true_ns = u64::try_from(true_ns).expect("virtual time stays within 584 years");
        self.true_ns.set(self.true_ns.get().max(true_ns));
    }
}

impl Default for VirtualClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Instant {
        let rate = BILLION + i128::from(self.drift_ppb);
        let run = i128::from(self.true_ns.get()) * rate / BILLION;
        let reading = i128::from(self.epoch_ns) + run + i128::from(self.stepped_ns.get());
        Instant::from_nanos(u64::try_from(reading).expect("a virtual clock is not set to before its epoch"))
    }

    fn wait_until(&self, deadline: Instant) {
        let late = self.jitter.next_lateness();
        self.run_to(deadline.max(self.now()) + late);
    }

    /// Spinning has no scheduler to be late: the clock shows the deadline exactly.
    fn spin_until(&self, deadline: Instant) -> Instant {
        self.run_to(deadline);
        self.now()
    }
}

impl WakeupJitter {
    fn next_lateness(&self) -> Duration {
        match self {
            Self::None => Duration::ZERO,
            Self::Scripted { late, next } => {
                let index = next.replace(next.get() + 1);
                late.get(index).copied().unwrap_or(Duration::ZERO)
            }
            Self::Seeded { state, most_ns } => Duration::from_nanos(scaled_to(split_mix_64(state), *most_ns)),
        }
    }
}

/// Maps 64 random bits to 0..=most by their high part.
fn scaled_to(bits: u64, most: u64) -> u64 {
    ((u128::from(bits) * (u128::from(most) + 1)) >> 64) as u64
}

fn split_mix_64(state: &Cell<u64>) -> u64 {
    state.set(state.get().wrapping_add(0x9E37_79B9_7F4A_7C15));
    let mut z = state.get();
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn waiting_jumps_to_the_deadline_and_never_back() {
        let clock = VirtualClock::starting_at(Instant::from_nanos(1_000));
        let deadline = clock.now() + MS;
        clock.wait_until(deadline);
        assert_eq!(clock.now(), deadline);
        clock.wait_until(Instant::from_nanos(5));
        assert_eq!(clock.now(), deadline);
    }

    #[test]
    fn a_fast_clock_shows_more_than_true_time_and_roundings_do_not_add_up() {
        let clock = VirtualClock::new().with_drift_ppb(100_000);
        for n in 1..=10_000_u32 {
            clock.wait_until(Instant::from_nanos(0) + n * MS);
        }
        // 10 s on a clock 100 ppm fast are 10 s / 1.0001 of true time.
        assert_eq!(clock.true_elapsed(), Duration::from_nanos(9_999_000_100));
        clock.advance(Duration::from_secs(1));
        assert_eq!(clock.now() - Instant::from_nanos(10_000_000_000), Duration::from_nanos(1_000_100_000));
    }

    #[test]
    fn scripted_wake_ups_are_late_in_turn_and_then_on_time() {
        let clock = VirtualClock::new().with_late_wakeups([Duration::ZERO, 3 * MS]);
        for (deadline_ms, woke_ms) in [(1, 1), (2, 5), (6, 6)] {
            clock.wait_until(Instant::from_nanos(0) + deadline_ms * MS);
            assert_eq!(clock.now(), Instant::from_nanos(0) + woke_ms * MS);
        }
    }

    #[test]
    fn a_seed_gives_the_same_wobble_again_and_stays_within_its_bound() {
        let readings = |seed| {
            let clock = VirtualClock::new().with_seeded_jitter(seed, MS);
            (1..100_u32)
                .map(|n| {
                    let deadline = Instant::from_nanos(0) + n * 10 * MS;
                    clock.wait_until(deadline);
                    assert!(clock.now() - deadline <= MS);
                    clock.now()
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(readings(7), readings(7));
        assert_ne!(readings(7), readings(8));
    }

    #[test]
    fn split_mix_gives_the_published_sequence() {
        // The first values for seed 1234567, as in Vigna's splitmix64.c and the Rosetta Code task "Pseudo-random
        // numbers/Splitmix64".
        let state = Cell::new(1_234_567);
        let first: Vec<u64> = (0..3).map(|_| split_mix_64(&state)).collect();
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn steps_move_the_reading_and_no_true_time() {
        let clock = VirtualClock::starting_at(Instant::from_nanos(0) + 10 * MS);
        clock.step_forward(5 * MS);
        assert_eq!(clock.now(), Instant::from_nanos(0) + 15 * MS);
        clock.step_back(7 * MS);
        assert_eq!(clock.now(), Instant::from_nanos(0) + 8 * MS);
        assert_eq!(clock.true_elapsed(), Duration::ZERO);
        clock.wait_until(Instant::from_nanos(0) + 9 * MS);
        assert_eq!(clock.true_elapsed(), MS);
    }
}
