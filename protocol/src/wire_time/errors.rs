//! Errors of the wire: which attempts at sending are hit, and after how many bits.
//!
//! Drawn from a seeded generator of its own, so that the same frames at the same times meet the same errors, whatever else is
//! drawn.

use super::WireTiming;
use super::bits::INTERMISSION_BITS;
use crate::can::CanFrame;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Bits that follow the bit in error: superposed error flags of sender and receivers 12 at most, delimiter 8, intermission 3.
pub(super) const ERROR_BITS: u32 = 12 + 8 + INTERMISSION_BITS;
/// Bits that an error-passive sender waits after its transmission; others may begin meanwhile.
pub(super) const SUSPEND_BITS: u32 = 8;

/// The longest time that one error can cost besides sending the frame again, in bits. What was sent of the frame up to the
/// error is less than the frame.
pub const WORST_ERROR_BITS: u32 = ERROR_BITS + SUSPEND_BITS;

/// Makes the draws differ from those of injected loss, which begin with the same seed.
const STREAM: u64 = 0x5749_5245; // "WIRE"

pub(super) struct Errors {
    /// An attempt is hit when the next 64 random bits are not above this; `None` draws nothing.
    threshold: Option<u64>,
    id: Option<u32>,
    from_ns: u64,
    to_ns: u64,
    random: Pcg64Mcg,
}

impl Errors {
    pub(super) fn new(timing: &WireTiming, seed: u64) -> Self {
        let ns = |ms: u64| ms.saturating_mul(1_000_000);
        Self {
            // `as` saturates: a probability of 1 hits always.
            threshold: (timing.error_rate > 0.0).then_some((timing.error_rate * u64::MAX as f64) as u64),
            id: timing.errors_id,
            from_ns: ns(timing.errors_from_ms),
            to_ns: timing.errors_to_ms.map_or(u64::MAX, ns),
            random: Pcg64Mcg::seed_from_u64(seed ^ STREAM),
        }
    }

    /// The bit of a frame of `bits` bits that is hit when it is sent at `now_ns`; counted from 1, none of them in the
    /// intermission.
    pub(super) fn hit(&mut self, frame: &CanFrame, bits: u32, now_ns: u64) -> Option<u32> {
        let threshold = self.threshold?;
        let meant = self.id.is_none_or(|id| id == frame.raw_id());
        if !meant || !(self.from_ns..self.to_ns).contains(&now_ns) || self.random.next_u64() > threshold {
            return None;
        }
        let places = u64::from(bits - INTERMISSION_BITS);
        Some(1 + (self.random.next_u64() % places) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hits(timing: WireTiming, id: u16, now_ns: u64) -> usize {
        let mut errors = Errors::new(&timing, 1);
        let frame = CanFrame::new(id, &[0; 8]);
        let hits: Vec<_> = (0..10_000).filter_map(|_| errors.hit(&frame, 130, now_ns)).collect();
        assert!(hits.iter().all(|place| (1..=127).contains(place)));
        hits.len()
    }

    #[test]
    fn errors_follow_probability_identifier_and_time() {
        let none = WireTiming::at(1_000_000);
        let hundredth = WireTiming { error_rate: 0.01, ..none };
        let of_one = WireTiming { error_rate: 1.0, errors_id: Some(0x110), ..none };
        let window = WireTiming { error_rate: 1.0, errors_from_ms: 2, errors_to_ms: Some(3), ..none };
        assert_eq!(hits(none, 0x110, 0), 0);
        // Binomial: 100 expected, standard deviation 10; five of them.
        assert!((50..150).contains(&hits(hundredth, 0x110, 0)));
        assert_eq!([0x110, 0x111].map(|id| hits(of_one, id, 0)), [10_000, 0]);
        let at = [1_999_999, 2_000_000, 2_999_999, 3_000_000].map(|now_ns| hits(window, 1, now_ns));
        assert_eq!(at, [0, 10_000, 10_000, 0]);
    }
}
