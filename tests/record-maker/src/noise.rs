//! Random numbers of a record: one stream for each sensor and one for the sampling instants, all from the recipe's seed.
//!
//! Generator: xoshiro256++ [Blackman, Vigna 2021], its state filled by SplitMix64; normal numbers by Box and Muller's transform
//! with libm's functions, so that a recipe gives the same bytes on every machine. The generator differs from that of the
//! emulator's sensors, so that the noise of a record cannot be predicted from theirs.
//!
//! Source: Blackman, Vigna, "Scrambled linear pseudorandom number generators", ACM Trans. Math. Softw. 47(4), 2021.

use super::background::SLOW_NOISE_SAMPLES;

#[derive(Debug, Clone)]
pub(super) struct Stream {
    state: [u64; 4],
    /// The second of the last pair of normal numbers, if unused.
    spare: Option<f64>,
}

impl Stream {
    /// Stream `number` of a seed; streams of a seed do not depend on each other.
    pub(super) fn new(seed: u64, number: u64) -> Self {
        let mut mix = seed ^ number.wrapping_add(1).wrapping_mul(0xd1b5_4a32_d192_ed03);
        let state = std::array::from_fn(|_| {
            mix = mix.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = mix;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        });
        Stream { state, spare: None }
    }

    fn next_u64(&mut self) -> u64 {
        let [a, b, c, d] = &mut self.state;
        let result = a.wrapping_add(*d).rotate_left(23).wrapping_add(*a);
        let shifted = *b << 17;
        *c ^= *a;
        *d ^= *b;
        *b ^= *c;
        *a ^= *d;
        *c ^= shifted;
        *d = d.rotate_left(45);
        result
    }

    /// Uniform in (0, 1].
    pub(super) fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        ((self.next_u64() >> 11) + 1) as f64 * STEP
    }

    /// Normal with mean 0 and variance 1.
    pub(super) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * self.uniform());
        self.spare = Some(radius * sine);
        radius * cosine
    }
}

/// Noise of one sensor: white, or with a correlation time of 5 ms at the same rms; a share of its variance may be slow.
#[derive(Debug, Clone)]
pub(super) struct Noise {
    stream: Stream,
    rms: f64,
    /// Factor of the last sample in the next one.
    kept: f64,
    last: f64,
    slow: Option<SlowNoise>,
}

/// A part of the noise with a correlation of [`SLOW_NOISE_SAMPLES`].
#[derive(Debug, Clone)]
struct SlowNoise {
    share: f64,
    last: f64,
}

/// Correlation time of coloured noise, in samples of 1 ms.
const CORRELATION_SAMPLES: f64 = 5.0;

impl Noise {
    pub(super) fn new(stream: Stream, rms: f64, coloured: bool, slow: Option<f64>) -> Self {
        let kept = if coloured { libm::exp(-1.0 / CORRELATION_SAMPLES) } else { 0.0 };
        let mut noise = Noise { stream, rms, kept, last: 0.0, slow: None };
        noise.last = noise.stream.normal();
        noise.slow = slow.map(|share| SlowNoise { share, last: noise.stream.normal() });
        noise
    }

    /// The next sample, in the sensor's unit.
    pub(super) fn sample(&mut self) -> f64 {
        let fresh = self.stream.normal();
        self.last = self.kept * self.last + (1.0 - self.kept * self.kept).sqrt() * fresh;
        let Some(slow) = &mut self.slow else { return self.rms * self.last };
        let kept = libm::exp(-1.0 / SLOW_NOISE_SAMPLES);
        slow.last = kept * slow.last + (1.0 - kept * kept).sqrt() * self.stream.normal();
        self.rms * ((1.0 - slow.share).sqrt() * self.last + slow.share.sqrt() * slow.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws(coloured: bool) -> Vec<f64> {
        let mut noise = Noise::new(Stream::new(3, 1), 2.0, coloured, None);
        (0..200_000).map(|_| noise.sample()).collect()
    }

    fn mean_product(values: &[f64], lag: usize) -> f64 {
        values.iter().zip(&values[lag..]).map(|(one, other)| one * other).sum::<f64>() / values.len() as f64
    }

    #[test]
    fn white_noise_has_its_rms_and_no_memory() {
        let values = draws(false);
        // Variance 4 of 2e5 draws: standard error 4 sqrt(2 / 2e5) = 0.013; five of them. Products: 4 / sqrt(2e5) = 0.009.
        assert!((mean_product(&values, 0) - 4.0).abs() < 0.065);
        assert!(mean_product(&values, 1).abs() < 0.045);
    }

    #[test]
    fn coloured_noise_has_the_same_rms_and_5_ms_of_memory() {
        let values = draws(true);
        // As above with 2e5 (1 - k^2) / (1 + k^2) independent draws: standard error 0.028.
        assert!((mean_product(&values, 0) - 4.0).abs() < 0.14);
        assert!((mean_product(&values, 5) - 4.0 / std::f64::consts::E).abs() < 0.14);
    }

    #[test]
    fn streams_of_a_seed_differ() {
        let first = |number| Stream::new(7, number).next_u64();
        assert_ne!(first(0), first(1));
        assert_ne!(Stream::new(8, 0).next_u64(), first(0));
    }
}
