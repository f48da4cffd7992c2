//! The runs of a campaign: each depends on the campaign's file and its number alone.
//!
//! ```text
//! run = combination * draws + draw
//! combination   counts through the lists, the last [[vary]] fastest
//! draw          what is drawn: the seed of the sensors' noise, a hidden effect's place and numbers, a value from each range
//! ```
//!
//! A draw depends on the campaign's seed and the number of the draw, not on the combination: all combinations have the same
//! draws (common random numbers), so that they are compared in pairs. PCG-64 is seeded with the SHA-256 of both numbers, since
//! streams of neighbouring seeds are correlated at first.

use crate::factor::{Factor, Value, Values};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use sha2::{Digest, Sha256};

#[derive(Clone, Debug)]
pub(crate) struct Points {
    pub factors: Vec<Factor>,
    seed: u64,
    draws: u64,
    /// Number of combinations of the lists.
    pub combinations: u64,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// Its number, from 0.
    pub run: u64,
    pub draw: u64,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Seed of a hidden effect's place and numbers.
    pub hidden_seed: u64,
    /// A value for each factor, in their order.
    pub values: Vec<Value>,
}

/// A campaign with more than [`MOST_RUNS`] runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the lists and draws make more than {MOST_RUNS} runs; shorten a list, or draw from a range instead")]
pub(crate) struct TooManyRuns;

pub(crate) const MOST_RUNS: u64 = 1_000_000_000;

impl Points {
    pub(crate) fn new(factors: &[Factor], draws: u64, seed: u64) -> Result<Self, TooManyRuns> {
        let combinations = factors
            .iter()
            .try_fold(1_u64, |product, factor| product.checked_mul(factor.values.listed() as u64))
            .filter(|product| product.checked_mul(draws).is_some_and(|runs| runs <= MOST_RUNS))
            .ok_or(TooManyRuns)?;
        Ok(Self { factors: factors.to_vec(), seed, draws, combinations })
    }

    pub(crate) fn runs(&self) -> u64 {
        self.combinations * self.draws
    }

    /// The run of this number.
    ///
    /// # Panics
    /// If `run` is not below [`Points::runs`].
    pub(crate) fn point(&self, run: u64) -> Point {
        assert!(run < self.runs(), "run {run} of {}", self.runs());
        let (mut combination, draw) = (run / self.draws, run % self.draws);
        let mut random = self.random(draw);
        let seed = random.next_u64() >> 32;
        let hidden_seed = random.next_u64() >> 32;
        // Values are drawn in the order of the file; combinations count from its end.
        let mut values: Vec<Value> = self
            .factors
            .iter()
            .map(|factor| match &factor.values {
                Values::Range(range) => Value::Number(range.at(uniform(&mut random))),
                Values::List(list) => list[0].clone(),
            })
            .collect();
        for (factor, value) in self.factors.iter().zip(&mut values).rev() {
            if let Values::List(list) = &factor.values {
                *value = list[(combination % list.len() as u64) as usize].clone();
                combination /= list.len() as u64;
            }
        }
        Point { run, draw, seed, hidden_seed, values }
    }

    fn random(&self, draw: u64) -> Pcg64 {
        let mut hash = Sha256::new();
        hash.update(b"airbench campaign draw\0");
        hash.update(self.seed.to_le_bytes());
        hash.update(draw.to_le_bytes());
        Pcg64::from_seed(hash.finalize().into())
    }
}

/// Uniform in [0, 1) with 53 bits.
fn uniform(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::factor::{Changes, Range};

    fn factor(name: &str, values: Values) -> Factor {
        Factor { name: name.into(), changes: Changes::Rig(name.into()), values }
    }

    fn points() -> Points {
        let list = |numbers: &[f64]| Values::List(numbers.iter().copied().map(Value::Number).collect());
        let factors = [
            factor("a", list(&[1.0, 2.0])),
            factor("b", Values::Range(Range { ends: [10.0, 20.0], log: false })),
            factor("c", list(&[5.0, 6.0, 7.0])),
        ];
        Points::new(&factors, 4, 9).unwrap()
    }

    fn numbers(run: u64) -> [f64; 3] {
        std::array::from_fn(|place| match points().point(run).values[place] {
            Value::Number(number) => number,
            Value::Text(_) => unreachable!("all are numbers"),
        })
    }

    #[test]
    fn lists_are_gone_through_with_the_last_fastest() {
        assert_eq!((points().runs(), points().combinations), (24, 6));
        let listed: Vec<_> = (0..6).map(|c| numbers(c * 4)).map(|[a, _, c]| (a, c)).collect();
        assert_eq!(listed, [(1.0, 5.0), (1.0, 6.0), (1.0, 7.0), (2.0, 5.0), (2.0, 6.0), (2.0, 7.0)]);
    }

    #[test]
    fn every_combination_meets_the_same_draws() {
        for draw in 0..4 {
            let first = points().point(draw);
            for combination in 1..6 {
                let other = points().point(combination * 4 + draw);
                assert_eq!((other.draw, other.seed), (draw, first.seed));
                assert_eq!(other.values[1], first.values[1]);
            }
        }
        assert_ne!(points().point(0).values[1], points().point(1).values[1]);
        assert_ne!(points().point(0).seed, points().point(1).seed);
    }

    #[test]
    fn what_is_drawn_fills_its_range_evenly() {
        let factors = [factor("b", Values::Range(Range { ends: [0.0, 1.0], log: false }))];
        let points = Points::new(&factors, 10_000, 1).unwrap();
        let mut tenths = [0_u32; 10];
        for run in 0..points.runs() {
            let Value::Number(number) = points.point(run).values[0] else { unreachable!("a number") };
            tenths[(number * 10.0) as usize] += 1;
        }
        // Binomial with n = 10 000, p = 0.1: standard deviation 30, so five of them.
        assert!(tenths.iter().all(|count| count.abs_diff(1000) < 150), "{tenths:?}");
    }

    #[test]
    fn more_runs_than_can_be_counted_are_refused() {
        let long = Values::List((0..1000).map(f64::from).map(Value::Number).collect());
        let factors: Vec<_> = ["a", "b", "c"].iter().map(|name| factor(name, long.clone())).collect();
        assert_eq!(Points::new(&factors, 1, 1).unwrap().runs(), MOST_RUNS);
        assert_eq!(Points::new(&factors, 2, 1).unwrap_err(), TooManyRuns);
        assert_eq!(Points::new(&factors, u64::MAX, 1).unwrap_err(), TooManyRuns);
    }
}
