//! Whether an axis is settled: still, and at its set-point, for long enough.
//!
//! ```text
//!   still   = peak to peak of the position over the window     < still_m
//!   there   = position axis:  largest |error| over the window  < position_error_m
//!             force axis:     |mean error| over the window     < the larger of force_error_n and force_error_n_per_n |set-point|
//!   settled = still and there in every cycle of settling_s
//! ```
//!
//! The window of 200 ms is kept as ten buckets of 20 ms, so that a cycle costs ten comparisons. What was not seen is not known:
//! after more than 20 cycles without a sample, for which a valve command is stale too, the window begins anew.

use super::{cycles, elapsed_s};
use settings::parameters::declare;

/// Section of a program file that holds the bounds; also the task in their names as variables.
pub const TABLE: &str = "settled";

settings::parameters! {
    /// Bounds on position and control error of a settled axis, read once.
    pub struct Bounds {
        still_m: declare("m", [1e-5, 0.1], 0.5e-3, "peak to peak of the position of an axis at rest").at_start_only(),
        position_error_m: declare("m", [1e-5, 0.5], 2e-3, "largest position error of a settled axis").at_start_only(),
        force_error_n: declare("N", [0.1, 2000.0], 20.0, "largest mean force error of a settled axis").at_start_only(),
        force_error_n_per_n: declare("N/N", [0.0, 1.0], 0.1, "the same as a share of the force set-point").at_start_only(),
    }
}

/// Cycles of one bucket, and the longest gap between samples.
const BUCKET_CYCLES: u64 = 20;
const BUCKETS: usize = 10;
const WINDOW_CYCLES: u64 = BUCKET_CYCLES * BUCKETS as u64;

/// Control error of an axis in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ControlError {
    /// It has no set-point: only stillness counts.
    None,
    /// Set-point less position, m.
    Position { error_m: f64 },
    /// Set-point less force, N, and the set-point.
    Force { error_n: f64, set_force_n: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Bucket {
    number: u64,
    low_m: f64,
    high_m: f64,
    error_sum: f64,
    error_most: f64,
    samples: f64,
}

/// Detects from samples of position and control error whether an axis is settled.
#[derive(Clone, Debug)]
pub(crate) struct SettlingDetector {
    bounds: Bounds,
    buckets: [Option<Bucket>; BUCKETS],
    /// First and last sample of the window without a gap.
    sampled_cycles: Option<(u64, u64)>,
    /// First cycle in which the axis was still and at its set-point without a break.
    since: Option<u64>,
    /// The position keeps still, whatever the set-point.
    pub(super) still: bool,
}

impl SettlingDetector {
    pub(crate) fn new(bounds: Bounds) -> Self {
        Self { bounds, buckets: [None; BUCKETS], sampled_cycles: None, since: None, still: false }
    }

    /// Takes the sample of `cycle`: position sensor less its offset, unfiltered, and control error.
    pub(crate) fn take(&mut self, cycle: u64, position_m: f64, error: ControlError) {
        let gap = self.sampled_cycles.is_some_and(|(_, last)| cycle < last || cycle - last > BUCKET_CYCLES);
        if gap {
            self.clear();
        }
        let first = self.sampled_cycles.map_or(cycle, |(first, _)| first);
        self.sampled_cycles = Some((first, cycle));
        self.add_sample(cycle, position_m, error);
        self.still = self.window_is_full(cycle) && self.range_m(cycle) < self.bounds.still_m;
        let settled = self.still && self.is_at_set_point(cycle, error);
        self.since = if settled { self.since.or(Some(cycle)) } else { None };
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.bounds);
    }

    /// Whether the axis has been settled for `settling_s` since cycle `from`.
    pub(crate) fn settled_for(&self, settling_s: f64, from: u64, cycle: u64) -> bool {
        self.since.is_some_and(|since| cycles(elapsed_s(since.max(from), cycle)) >= cycles(settling_s))
    }

    fn add_sample(&mut self, cycle: u64, position_m: f64, error: ControlError) {
        let value = match error {
            ControlError::None => 0.0,
            ControlError::Position { error_m } => error_m,
            ControlError::Force { error_n, .. } => error_n,
        };
        let number = cycle / BUCKET_CYCLES;
        let place = &mut self.buckets[(number % BUCKETS as u64) as usize];
        let bucket = place.get_or_insert(Bucket::empty(number));
        if bucket.number != number {
            *bucket = Bucket::empty(number);
        }
        // A non-finite position makes the range infinite, so the axis is not settled.
        let [low_m, high_m] = if position_m.is_finite() { [position_m; 2] } else { [f64::MIN, f64::MAX] };
        bucket.low_m = bucket.low_m.min(low_m);
        bucket.high_m = bucket.high_m.max(high_m);
        bucket.error_sum += value;
        bucket.error_most = bucket.error_most.max(if value.is_finite() { value.abs() } else { f64::MAX });
        bucket.samples += 1.0;
    }

    fn window(&self, cycle: u64) -> impl Iterator<Item = &Bucket> {
        let number = cycle / BUCKET_CYCLES;
        self.buckets.iter().flatten().filter(move |bucket| bucket.number + BUCKETS as u64 > number)
    }

    /// The newest bucket is being filled, so the window lacks up to one bucket of its length.
    fn window_is_full(&self, cycle: u64) -> bool {
        self.sampled_cycles.is_some_and(|(first, _)| cycle - first >= WINDOW_CYCLES - BUCKET_CYCLES)
    }

    fn range_m(&self, cycle: u64) -> f64 {
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = self
            .window(cycle)
            .fold(ends, |(low, high), bucket| (low.min(bucket.low_m), high.max(bucket.high_m)));
        high - low
    }

    fn is_at_set_point(&self, cycle: u64, error: ControlError) -> bool {
        match error {
            ControlError::None => true,
            ControlError::Position { .. } => {
                self.window(cycle).all(|bucket| bucket.error_most < self.bounds.position_error_m)
            }
            ControlError::Force { set_force_n, .. } => {
                let (sum, samples) = self.window(cycle).fold((0.0, 0.0), |(sum, samples), bucket| {
                    (sum + bucket.error_sum, samples + bucket.samples)
                });
                let bound_n =
                    self.bounds.force_error_n.max(self.bounds.force_error_n_per_n * set_force_n.abs());
                f64::abs(sum / samples) < bound_n
            }
        }
    }
}

impl Bucket {
    fn empty(number: u64) -> Self {
        Self {
            number,
            low_m: f64::INFINITY,
            high_m: f64::NEG_INFINITY,
            error_sum: 0.0,
            error_most: 0.0,
            samples: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First cycle at which the axis has been settled for 0.5 s.
    fn first(position_m: impl Fn(u64) -> f64, error: impl Fn(u64) -> ControlError) -> Option<u64> {
        let mut settling = SettlingDetector::new(Bounds::default());
        (0..3000).find(|&cycle| {
            settling.take(cycle, position_m(cycle), error(cycle));
            settling.settled_for(0.5, 0, cycle)
        })
    }

    #[test]
    fn an_axis_at_rest_is_settled_after_window_and_settling_time() {
        assert_eq!(first(|_| 0.1, |_| ControlError::None), Some(680));
    }

    #[test]
    fn an_oscillation_beyond_the_bound_never_settles() {
        let wave = |amplitude_m: f64| move |cycle: u64| 0.1 + amplitude_m * libm::sin(cycle as f64 * 0.05);
        assert_eq!(first(wave(0.26e-3), |_| ControlError::None), None);
        assert_eq!(first(wave(0.2e-3), |_| ControlError::None), Some(680));
    }

    #[test]
    fn an_axis_that_is_still_elsewhere_is_not_settled() {
        assert_eq!(first(|_| 0.1, |_| ControlError::Position { error_m: -2.1e-3 }), None);
        assert_eq!(first(|_| 0.1, |_| ControlError::Position { error_m: -1.9e-3 }), Some(680));
    }

    #[test]
    fn a_force_may_wobble_around_its_set_point() {
        let wobble = |mean_n: f64, set_force_n: f64| {
            move |cycle: u64| ControlError::Force {
                error_n: mean_n + if cycle.is_multiple_of(2) { 50.0 } else { -50.0 },
                set_force_n,
            }
        };
        assert_eq!(first(|_| 0.1, wobble(0.0, 100.0)), Some(680));
        assert_eq!(first(|_| 0.1, wobble(21.0, 100.0)), None);
        assert!(first(|_| 0.1, wobble(21.0, 300.0)).is_some(), "a tenth of 300 N is allowed");
    }

    #[test]
    fn a_single_step_begins_the_settling_time_anew() {
        let settled = first(|cycle| if cycle < 600 { 0.1 } else { 0.101 }, |_| ControlError::None);
        // The step leaves the window with its bucket, up to 200 ms later; then 0.5 s follow.
        assert!((1260..=1300).contains(&settled.unwrap()), "{settled:?}");
    }

    #[test]
    fn the_settling_time_counts_from_the_state_at_the_earliest() {
        let mut settling = SettlingDetector::new(Bounds::default());
        (0..2000).for_each(|cycle| settling.take(cycle, 0.1, ControlError::None));
        assert!(!settling.settled_for(0.5, 1600, 1999));
        assert!(settling.settled_for(0.5, 1499, 1999));
        assert!(settling.settled_for(0.0, 1999, 1999));
    }

    #[test]
    fn skipped_cycles_are_no_gap_until_a_command_is_stale() {
        for (skipped, still) in [(20, true), (21, false)] {
            let mut settling = SettlingDetector::new(Bounds::default());
            (0..500).for_each(|cycle| settling.take(cycle, 0.1, ControlError::None));
            settling.take(499 + skipped, 0.1, ControlError::None);
            assert_eq!(settling.still, still);
        }
    }

    #[test]
    fn a_rig_that_begins_anew_is_a_gap() {
        let mut settling = SettlingDetector::new(Bounds::default());
        (0..500).for_each(|cycle| settling.take(cycle, 0.1, ControlError::None));
        settling.take(0, 0.1, ControlError::None);
        assert!(!settling.still);
    }

    #[test]
    fn what_is_no_number_is_not_settled() {
        assert_eq!(first(|_| f64::NAN, |_| ControlError::None), None);
        assert_eq!(first(|_| 0.1, |_| ControlError::Position { error_m: f64::NAN }), None);
        let force = |_| ControlError::Force { error_n: f64::NAN, set_force_n: 0.0 };
        assert_eq!(first(|_| 0.1, force), None);
    }

    #[test]
    fn the_defaults_are_those_of_the_table() {
        let values: Vec<f64> = Bounds::TABLE.iter().map(|parameter| parameter.default).collect();
        assert_eq!(Bounds::of(&values), Bounds::default());
    }
}
