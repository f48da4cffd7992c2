//! Standard deviation of a channel's noise, rounding included, from the record alone.
//!
//! ```text
//!   blocks of 200 ──► the quietest, by the drift of their thirds ──► V_k = mean (y_t+k - 2 y_t + y_t-k)^2 / 6
//!
//!   V_k = white + coloured (6 - 8 r^k + 2 r^2k) / 6 + motion k^4          r = exp(-1 / correlation time)
//! ```
//!
//! White noise has the same V at every lag k, autocorrelated noise a V that grows to a plateau, and a smooth motion one that
//! grows with k^4. Non-negative least squares separates the three; the noise is the square root of white + coloured. Blocks are
//! selected by their slow drift, which is independent of the noise, so that the selection does not bias it.
//!
//! Source: the lags are those of a variogram of second differences, Cressie 1993, Statistics for Spatial Data, 2.4.

use model_fit::stats::median;

/// Samples of a block.
const BLOCK_SAMPLES: usize = 200;
/// The same in a short record.
const SHORT_BLOCK_SAMPLES: usize = 75;
/// Share of the blocks that are taken as quiet at first, and how many at least.
const QUIETEST: f64 = 0.08;
const FEWEST: usize = 8;
/// Lags, in samples.
const LAGS: [usize; 9] = [1, 2, 3, 4, 6, 8, 12, 16, 24];
/// Grid of correlation times of coloured noise, in samples.
const CORRELATION_TIMES: [f64; 7] = [2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0];
/// Drift over a block, in standard deviations of the noise, up to which it is quiet.
const DRIFT: f64 = 1.0;
/// How far a quiet block's lags may lie above the mean of the quietest.
const ABOVE: f64 = 2.2;

#[derive(Clone, Copy, Debug)]
struct Block {
    drift: f64,
    lags: [f64; LAGS.len()],
}

/// The noise of a series on its grid; `None` when there is too little of it or nothing but one value.
pub(super) fn of(values: &[Option<f64>]) -> Option<f64> {
    let length = if values.len() < 5 * BLOCK_SAMPLES { SHORT_BLOCK_SAMPLES } else { BLOCK_SAMPLES };
    let mut blocks: Vec<Block> = (0..values.len().saturating_sub(length - 1))
        .step_by(length / 2)
        .filter_map(|from| block(&values[from..from + length]))
        .collect();
    if blocks.is_empty() {
        return None;
    }
    blocks.sort_by(|one, other| one.drift.total_cmp(&other.drift));
    let first = ((QUIETEST * blocks.len() as f64).ceil() as usize).max(FEWEST).min(blocks.len());
    let quiet = mean(&without_outliers(&blocks[..first]));
    let guess = fitted(&quiet).sqrt();
    let also: Vec<Block> = blocks
        .iter()
        .filter(|block| block.drift <= DRIFT * guess)
        .filter(|block| block.lags.iter().zip(&quiet).all(|(lag, quiet)| *lag <= ABOVE * quiet))
        .copied()
        .collect();
    let noise = if also.len() > first { fitted(&mean(&also)).sqrt() } else { guess };
    (noise > 0.0).then_some(noise)
}

/// Drift and lags of a block; `None` where a tenth of it or more is missing.
fn block(values: &[Option<f64>]) -> Option<Block> {
    let present = values.iter().flatten().count();
    if present * 10 <= values.len() * 9 {
        return None;
    }
    let third = values.len() / 3;
    let thirds = [0, 1, 2].map(|part| {
        let part = &values[part * third..(part + 1) * third];
        part.iter().flatten().sum::<f64>() / part.iter().flatten().count().max(1) as f64
    });
    let most = thirds.into_iter().fold(f64::MIN, f64::max);
    let least = thirds.into_iter().fold(f64::MAX, f64::min);
    let lags = LAGS.map(|lag| {
        let (mut sum, mut count) = (0.0, 0_usize);
        for at in lag..values.len() - lag {
            if let (Some(before), Some(here), Some(after)) = (values[at - lag], values[at], values[at + lag])
            {
                let second = after - 2.0 * here + before;
                sum += second * second;
                count += 1;
            }
        }
        sum / (6 * count.max(1)) as f64
    });
    Some(Block { drift: most - least, lags })
}

/// Blocks without those that move fast while they do not drift.
fn without_outliers(blocks: &[Block]) -> Vec<Block> {
    let middle: Vec<f64> = (0..LAGS.len())
        .map(|lag| median(&mut blocks.iter().map(|block| block.lags[lag]).collect::<Vec<_>>()).unwrap_or(0.0))
        .collect();
    let near = |block: &&Block| block.lags.iter().zip(&middle).all(|(lag, middle)| *lag <= 2.5 * middle);
    let kept: Vec<Block> = blocks.iter().filter(near).copied().collect();
    if kept.is_empty() { blocks.to_vec() } else { kept }
}

fn mean(blocks: &[Block]) -> [f64; LAGS.len()] {
    std::array::from_fn(|lag| blocks.iter().map(|block| block.lags[lag]).sum::<f64>() / blocks.len() as f64)
}

/// Variance of the noise in these lags.
fn fitted(lags: &[f64; LAGS.len()]) -> f64 {
    if lags.iter().any(|lag| *lag <= 0.0) {
        return lags.iter().copied().fold(0.0, f64::max);
    }
    let last = LAGS[LAGS.len() - 1] as f64;
    let motion = LAGS.map(|lag| (lag as f64 / last).powi(4));
    let white = [1.0; LAGS.len()];
    let mut best = (f64::INFINITY, 0.0);
    for correlation_time in CORRELATION_TIMES {
        let coloured = LAGS.map(|lag| {
            let left = (-(lag as f64) / correlation_time).exp();
            (6.0 - 8.0 * left + 2.0 * left * left) / 6.0
        });
        // Sets of terms from the simplest on; a further term must improve the fit.
        for set in [0b001, 0b010, 0b101, 0b011, 0b110, 0b111] {
            let terms = [&white, &coloured, &motion];
            let Some((error, shares)) = shares(lags, &terms, set) else { continue };
            if error < 0.9 * best.0 {
                best = (error, shares[0] + shares[1]);
            }
        }
    }
    if best.0.is_finite() { best.1 } else { lags[0] }
}

/// Shares of a set of terms by least squares of relative errors, and the error; `None` when one is negative.
fn shares(lags: &[f64; LAGS.len()], terms: &[&[f64; LAGS.len()]; 3], set: u8) -> Option<(f64, [f64; 3])> {
    let used: Vec<usize> = (0..3).filter(|term| set & (1 << term) != 0).collect();
    let count = used.len();
    let matrix =
        nalgebra::DMatrix::from_fn(LAGS.len(), count, |lag, column| terms[used[column]][lag] / lags[lag]);
    let ones = nalgebra::DVector::from_element(LAGS.len(), 1.0);
    let solved = (matrix.transpose() * &matrix).cholesky()?.solve(&(matrix.transpose() * &ones));
    if solved.iter().any(|share| *share < 0.0) {
        return None;
    }
    let mut shares = [0.0; 3];
    used.iter().zip(solved.iter()).for_each(|(term, share)| shares[*term] = *share);
    Some(((matrix * solved - ones).norm_squared(), shares))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    /// Noise of 1 with a correlation time in samples, over a motion.
    fn series(seed: u64, correlation_time: f64, motion: impl Fn(f64) -> f64) -> Vec<Option<f64>> {
        let mut stream = Pcg64::seed_from_u64(seed);
        // Twelve uniform numbers of variance 1/12 make a normal one, near enough.
        let mut normal =
            || (0..12).map(|_| (stream.next_u64() >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0;
        let kept = if correlation_time > 0.0 { (-1.0 / correlation_time).exp() } else { 0.0 };
        let mut last = normal();
        (0..20_000)
            .map(|at| {
                last = kept * last + (1.0 - kept * kept).sqrt() * normal();
                Some(last + motion(f64::from(at)))
            })
            .collect()
    }

    #[test]
    fn white_and_coloured_noise_at_rest_are_found_within_a_tenth() {
        for seed in 0..6 {
            for correlation_time in [0.0, 5.0] {
                let found = of(&series(seed, correlation_time, |_| 7.0)).unwrap();
                // 200 blocks of at least 20 independent samples: 1 % of a standard error.
                assert!((found - 1.0).abs() < 0.05, "{correlation_time}: {found}");
            }
        }
    }

    #[test]
    fn motion_does_not_count_as_noise() {
        for correlation_time in [0.0, 5.0] {
            let moving = of(&series(1, correlation_time, |at| 2000.0 * (at / 300.0).sin())).unwrap();
            assert!((moving - 1.0).abs() < 0.25, "never at rest, {correlation_time}: {moving}");
            let resting =
                of(&series(1, correlation_time, |at| 2000.0 * (at.min(18_000.0) / 300.0).sin())).unwrap();
            assert!((resting - 1.0).abs() < 0.1, "at rest for a tenth, {correlation_time}: {resting}");
        }
    }

    #[test]
    fn a_constant_channel_has_no_noise_estimate() {
        assert_eq!(of(&vec![Some(1.0); 3000]), None);
        assert_eq!(of(&[None; 3000]), None);
    }
}
