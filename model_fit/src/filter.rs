//! Zero-phase low passes: Butterworth and Chebyshev I, run forth and back.
//!
//! ```text
//! analogue poles   p_k = -sinh(m) sin(t_k) + i cosh(m) cos(t_k)     t_k = (2 k + 1) pi / (2 n)
//! Butterworth      sinh(m) = cosh(m) = 1          Chebyshev I     m = asinh(1 / e) / n,  e^2 = 10^(ripple / 10 dB) - 1
//! bilinear         z = (1 + W p) / (1 - W p)      W = tan(pi f / 2), f the edge over the Nyquist frequency
//! ```
//!
//! Gain at 0 Hz is 1; that of a Chebyshev I of even order is its ripple, 1 / sqrt(1 + e^2), and twice that forth and back. Model
//! and data go through the same filter, so that numbers do not change, but residuals are the smaller for it.
//!
//! Before a run the samples are extended at both ends by their point reflections, 3 (n + 1) of them, and the sections begin in
//! the steady state of the first. Poles come in pairs, each a section of second order: no polynomial of order n is ever made.
//!
//! No crate: what is published designs Butterworth alone, or stands on an older nalgebra. Source: Oppenheim, Schafer,
//! Discrete-Time Signal Processing, 3rd ed., 2010, 7.1; Gustafsson 1996, IEEE Trans. Signal Processing 44(4), on running forth
//! and back; the ends are those of scipy.signal.filtfilt, whose results the tests hold against these.

use std::f64::consts::{FRAC_PI_2, PI};

/// A low pass in sections of second order.
#[derive(Clone, Debug)]
pub(crate) struct LowPass {
    order: usize,
    sections: Vec<Section>,
}

/// `y = b0 x + s1;  s1 = b1 x - a1 y + s2;  s2 = b2 x - a2 y`.
#[derive(Clone, Copy, Debug)]
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

impl LowPass {
    /// A Butterworth low pass; `edge_ratio` is its -3 dB frequency over the Nyquist frequency, above 0 and below 1.
    pub(crate) fn butterworth(order: usize, edge_ratio: f64) -> Self {
        Self::of(order, edge_ratio, 1.0, 1.0, 1.0)
    }

    /// A Chebyshev I low pass; `edge_ratio` is the frequency at which its ripple ends over the Nyquist frequency.
    pub(crate) fn chebyshev(order: usize, ripple_db: f64, edge_ratio: f64) -> Self {
        let square = 10.0_f64.powf(ripple_db / 10.0) - 1.0;
        let bend = (1.0 / square.sqrt()).asinh() / order as f64;
        let at_rest = if order.is_multiple_of(2) { 1.0 / (1.0 + square).sqrt() } else { 1.0 };
        Self::of(order, edge_ratio, bend.sinh(), bend.cosh(), at_rest)
    }

    fn of(order: usize, edge_ratio: f64, across: f64, along: f64, at_rest: f64) -> Self {
        let warped = (FRAC_PI_2 * edge_ratio).tan();
        let mut sections: Vec<Section> = (0..order.div_ceil(2))
            .map(|k| {
                let angle = (2 * k + 1) as f64 * PI / (2 * order) as f64;
                let (re, im) = (-warped * across * angle.sin(), warped * along * angle.cos());
                if 2 * k + 1 == order {
                    Section::single((1.0 + re) / (1.0 - re))
                } else {
                    Section::pair(re, im)
                }
            })
            .collect();
        if let Some(first) = sections.first_mut() {
            first.b = first.b.map(|b| b * at_rest);
        }
        Self { order, sections }
    }

    /// The samples, run forth and back; as long as they were. Fewer than two samples come back as they are.
    pub(crate) fn zero_phase(&self, samples: &[f64]) -> Vec<f64> {
        let Some((first, last)) = samples.first().zip(samples.last()).filter(|_| samples.len() > 1) else {
            return samples.to_vec();
        };
        let more = (3 * (self.order + 1)).min(samples.len() - 1);
        let before = (1..=more).rev().map(|at| 2.0 * first - samples[at]);
        let after = (1..=more).map(|at| 2.0 * last - samples[samples.len() - 1 - at]);
        let mut run: Vec<f64> = before.chain(samples.iter().copied()).chain(after).collect();
        self.forth(&mut run);
        run.reverse();
        self.forth(&mut run);
        run.reverse();
        run[more..more + samples.len()].to_vec()
    }

    /// One way, from the steady state of the first sample.
    fn forth(&self, samples: &mut [f64]) {
        for section in &self.sections {
            let Section { b, a } = *section;
            let first = samples.first().copied().unwrap_or(0.0);
            let rest = section.at_rest() * first;
            let mut states = [rest - b[0] * first, b[2] * first - a[1] * rest];
            for sample in samples.iter_mut() {
                let out = b[0] * *sample + states[0];
                states = [b[1] * *sample - a[0] * out + states[1], b[2] * *sample - a[1] * out];
                *sample = out;
            }
        }
    }
}

impl Section {
    /// Two conjugate analogue poles, gain 1 at 0 Hz.
    fn pair(re: f64, im: f64) -> Self {
        // z = (1 + p) / (1 - p), split into real part and square of its magnitude.
        let below = (1.0 - re).powi(2) + im * im;
        let real = (1.0 - re * re - im * im) / below;
        let square = ((1.0 + re).powi(2) + im * im) / below;
        let gain = (1.0 - 2.0 * real + square) / 4.0;
        Section { b: [gain, 2.0 * gain, gain], a: [-2.0 * real, square] }
    }

    /// One real pole, gain 1 at 0 Hz.
    fn single(pole: f64) -> Self {
        let gain = (1.0 - pole) / 2.0;
        Section { b: [gain, gain, 0.0], a: [-pole, 0.0] }
    }

    fn at_rest(&self) -> f64 {
        self.b.iter().sum::<f64>() / (1.0 + self.a[0] + self.a[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// b and a of the sections multiplied out.
    fn polynomials(filter: &LowPass) -> (Vec<f64>, Vec<f64>) {
        let times = |p: &[f64], q: &[f64]| {
            let mut product = vec![0.0; p.len() + q.len() - 1];
            for (i, x) in p.iter().enumerate() {
                for (j, y) in q.iter().enumerate() {
                    product[i + j] += x * y;
                }
            }
            product
        };
        let mut b = vec![1.0];
        let mut a = vec![1.0];
        for section in &filter.sections {
            b = times(&b, &section.b);
            a = times(&a, &[1.0, section.a[0], section.a[1]]);
        }
        (b[..=filter.order].to_vec(), a[..=filter.order].to_vec())
    }

    fn near(computed: &[f64], other: &[f64], tolerance: f64) {
        assert_eq!(computed.len(), other.len());
        for (computed, other) in computed.iter().zip(other) {
            assert!((computed - other).abs() < tolerance * other.abs().max(1.0), "{computed} is not {other}");
        }
    }

    #[test]
    fn the_designs_are_those_of_an_independent_tool() {
        // scipy.signal 1.17.1: butter(4, 0.2), cheby1(4, 0.5, 0.04), butter(3, 0.3), cheby1(3, 1, 0.25), as printed.
        let check = |filter: LowPass, b: &[f64], a: &[f64]| {
            let (computed_b, computed_a) = polynomials(&filter);
            near(&computed_b, b, 1e-8);
            near(&computed_a, a, 1e-8);
        };
        check(
            LowPass::butterworth(4, 0.2),
            &[0.00482434, 0.01929737, 0.02894606, 0.01929737, 0.00482434],
            &[1.0, -2.36951301, 2.31398841, -1.05466541, 0.18737949],
        );
        check(
            LowPass::chebyshev(4, 0.5, 0.04),
            &[5.17989561e-6, 2.07195825e-5, 3.10793737e-5, 2.07195825e-5, 5.17989561e-6],
            &[1.0, -3.83422877, 5.53076322, -3.55677708, 0.86033042],
        );
        check(
            LowPass::butterworth(3, 0.3),
            &[0.049533, 0.14859899, 0.14859899, 0.049533],
            &[1.0, -1.16191748, 0.69594276, -0.1377613],
        );
        check(
            LowPass::chebyshev(3, 1.0, 0.25),
            &[0.0210747, 0.06322409, 0.06322409, 0.0210747],
            &[1.0, -1.86636889, 1.49862368, -0.46365721],
        );
    }

    #[test]
    fn forth_and_back_is_that_of_an_independent_tool_to_the_very_ends() {
        let samples: Vec<f64> =
            (0..60).map(|at| (f64::from(at) * 0.3).sin() + 0.02 * f64::from(at).powf(1.5)).collect();
        // scipy.signal 1.17.1: filtfilt, samples 0, 1, 20, 58, 59.
        for (filter, expected) in [
            (
                LowPass::butterworth(4, 0.2),
                [
                    -0.000_232_310_048_572,
                    0.326_939_925_285,
                    1.510_054_123_974,
                    7.910_566_303_029,
                    8.157_025_317_841,
                ],
            ),
            (
                LowPass::chebyshev(4, 0.5, 0.04),
                [
                    -0.329_699_960_005,
                    -0.289_446_338_017,
                    1.461_602_635_338,
                    6.404_578_201_243,
                    6.425_543_122_070,
                ],
            ),
        ] {
            let computed = filter.zero_phase(&samples);
            // The polynomials of the other tool lose some digits at an edge of 0.04.
            near(&[0, 1, 20, 58, 59].map(|at| computed[at]), &expected, 1e-8);
        }
    }

    #[test]
    fn a_constant_and_a_straight_line_stay_what_they_are_to_the_very_ends() {
        let line: Vec<f64> = (0..400).map(|at| 3.0 + 0.5 * f64::from(at)).collect();
        let computed = LowPass::butterworth(4, 0.3).zero_phase(&line);
        // Ripples of the ends' reflections have decayed to nothing in a filter that settles within 20 samples.
        near(&computed[50..350], &line[50..350], 1e-9);
        near(&LowPass::butterworth(4, 0.3).zero_phase(&[7.0; 50]), &[7.0; 50], 1e-12);
    }

    #[test]
    fn too_few_samples_come_back() {
        assert_eq!(LowPass::butterworth(4, 0.3).zero_phase(&[2.0]), [2.0]);
        assert!(LowPass::butterworth(4, 0.3).zero_phase(&[]).is_empty());
    }
}
