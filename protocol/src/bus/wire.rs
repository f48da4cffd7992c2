//! The wire of the embedded bus: which frames it loses.
//!
//! Loss is drawn for each frame from a seeded generator, so that the same frames in the same order lose the same
//! ones; a lost frame is lost for every receiver, as on a real wire where all nodes see one error frame.

use super::url::WireOptions;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A wire that loses frames with a given probability.
pub(super) struct Wire {
    /// A frame is lost when the next 64 random bits are below this; `None` loses nothing and draws nothing.
    threshold: Option<u64>,
    random: Pcg64Mcg,
}

impl Wire {
    pub(super) fn new(options: &WireOptions) -> Self {
        // `as` saturates, so a probability of 1 loses all but one frame in 2^64.
        let threshold = (options.loss > 0.0).then_some((options.loss * u64::MAX as f64) as u64);
        Self { threshold, random: Pcg64Mcg::seed_from_u64(options.seed) }
    }

    /// Whether the next frame is lost.
    pub(super) fn loses_next(&mut self) -> bool {
        self.threshold.is_some_and(|threshold| self.random.next_u64() < threshold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost_of_ten_thousand(loss: f64, seed: u64) -> Vec<bool> {
        let mut wire = Wire::new(&WireOptions { loss, seed, timing: None });
        (0..10_000).map(|_| wire.loses_next()).collect()
    }

    #[test]
    fn loss_follows_probability_and_seed() {
        assert!(lost_of_ten_thousand(0.0, 1).iter().all(|lost| !lost));
        assert!(lost_of_ten_thousand(1.0, 1).iter().all(|lost| *lost));
        let lost = lost_of_ten_thousand(0.01, 1);
        // Binomial: 100 expected, standard deviation 10; five of them.
        assert!((50..150).contains(&lost.iter().filter(|lost| **lost).count()));
        assert_eq!(lost, lost_of_ten_thousand(0.01, 1));
        assert_ne!(lost, lost_of_ten_thousand(0.01, 2));
    }
}
