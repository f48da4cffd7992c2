//! spool-second-order: the spool is a second-order system in place of the first-order lag.
//!
//! ```text
//! d2s/dt2 = w^2 (target - s) - 2 z w ds/dt            w = 2 pi f
//!
//! with e = s - target, v = ds/dt, a = z w, D = (z^2 - 1) w^2 and the target held over t:
//! e(t) = exp(-a t) (e C + (v + a e) S)        C = cosh(sqrt(D) t)
//! v(t) = exp(-a t) (v C - (a v + w^2 e) S)    S = sinh(sqrt(D) t) / sqrt(D)
//! ```
//!
//! s spool, share of full opening; target in [-1, 1]; f natural frequency, Hz, in [20, 400]; z damping, in [0.2, 1.5]. For D
//! < 0 C and S are the cosine and sine of sqrt(-D) t; where |D| t^2 < 1e-4 the series serves, whose error is below 1e-16, so
//! that critical damping is no special case. The solution is exact for any span. Valid for a position-controlled spool below
//! its rate limit; with z < 1 the spool swings past the target, at full command past 1, where the edges stay as open as they
//! get.
//!
//! Properties: at rest on the target it stays to the bit; two spans are one of their sum; the energy v^2 + w^2 e^2 never
//! grows; steady state is the target.
//!
//! Source: Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7, valves with position-controlled spool; range:
//! textbook prior around the 100 Hz of the rig's valve.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct SpoolSecondOrder {
        natural_frequency_hz: EffectKey {
            name: "natural_frequency_hz",
            unit: Unit::Hertz,
            min: 20.0,
            max: 400.0,
            drawn: [60.0, 120.0],
            neutral: None,
            meaning: "f, natural frequency of the spool with its control",
            ..EffectKey::USUAL
        },
        damping: EffectKey {
            name: "damping",
            unit: Unit::One,
            min: 0.2,
            max: 1.5,
            drawn: [0.5, 0.9],
            signed: false,
            default: Some(0.7),
            neutral: None,
            meaning: "z, share of critical damping",
        },
    }
}

impl Effect for SpoolSecondOrder {
    const SHEET: Sheet = Sheet {
        name: "spool-second-order",
        group: Group::Flow,
        laws: &[Law::Spool],
        law: "the spool is a second-order system in place of the first-order lag",
        source: "Beater 2007, position-controlled spools; range: textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::SpoolSignal],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

/// Below this |D| t^2 the series of C and S serve.
const SERIES: f64 = 1e-4;

impl SpoolSecondOrder {
    /// Spool and its rate, 1/s, a span later.
    pub(crate) fn advance(&self, spool: f64, rate_per_s: f64, target: f64, span_s: f64) -> (f64, f64) {
        let frequency = 2.0 * std::f64::consts::PI * self.natural_frequency_hz;
        let decay = self.damping * frequency;
        let square = (self.damping * self.damping - 1.0) * frequency * frequency;
        let (even, odd_s) = decaying(decay, square, span_s);
        let error = spool - target;
        let error_after = error * even + (rate_per_s + decay * error) * odd_s;
        let rate_after = rate_per_s * even - (decay * rate_per_s + frequency * frequency * error) * odd_s;
        (target + error_after, rate_after)
    }
}

/// exp(-a t) C and exp(-a t) S of the module's head; S in seconds.
fn decaying(decay_per_s: f64, square_per_s2: f64, time_s: f64) -> (f64, f64) {
    let x = square_per_s2 * time_s * time_s;
    if x.abs() < SERIES {
        let left = libm::exp(-decay_per_s * time_s);
        let even = 1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0));
        let odd = time_s * (1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0)));
        (left * even, left * odd)
    } else if x < 0.0 {
        let left = libm::exp(-decay_per_s * time_s);
        let root = (-square_per_s2).sqrt();
        let (sine, cosine) = libm::sincos(root * time_s);
        (left * cosine, left * sine / root)
    } else {
        // As two decays, of which neither overflows.
        let root = square_per_s2.sqrt();
        let slow = libm::exp(-(decay_per_s - root) * time_s);
        let fast = libm::exp(-(decay_per_s + root) * time_s);
        ((slow + fast) / 2.0, (slow - fast) / (2.0 * root))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn effect(natural_frequency_hz: f64, damping: f64) -> SpoolSecondOrder {
        SpoolSecondOrder { natural_frequency_hz, damping }
    }

    /// Step response from 0 to 1 as the textbooks have it.
    fn step_response(f: f64, z: f64, t: f64) -> f64 {
        let w = 2.0 * PI * f;
        if z < 1.0 {
            let (root, angle) = ((1.0 - z * z).sqrt(), z.acos());
            1.0 - (-z * w * t).exp() / root * (w * root * t + angle).sin()
        } else if z == 1.0 {
            1.0 - (-w * t).exp() * (1.0 + w * t)
        } else {
            let root = (z * z - 1.0).sqrt();
            let [slow, fast] = [w * (z - root), w * (z + root)];
            1.0 - (fast * (-slow * t).exp() - slow * (-fast * t).exp()) / (fast - slow)
        }
    }

    #[test]
    fn the_step_response_is_the_textbooks_in_all_three_regimes() {
        for z in [0.2, 0.7, 0.99, 1.0, 1.01, 1.5] {
            for t in [0.0, 1.25e-5, 1e-4, 1e-3, 5e-3, 0.5] {
                let (spool, _) = effect(100.0, z).advance(0.0, 0.0, 1.0, t);
                // The oracle divides by sqrt(|1 - z^2|), 0.14 at the least, and so loses a digit or two of 1e-16.
                assert!((spool - step_response(100.0, z, t)).abs() < 1e-14, "z = {z}, t = {t}");
            }
        }
    }

    #[test]
    fn it_swings_over_by_the_share_that_the_damping_says() {
        let (f, z) = (80.0, 0.5_f64);
        let root = (1.0 - z * z).sqrt();
        let (top, rate) = effect(f, z).advance(0.0, 0.0, 1.0, PI / (2.0 * PI * f * root));
        assert!((top - 1.0 - (-PI * z / root).exp()).abs() < 1e-14);
        // At the top: a rate of 500 1/s, rounded.
        assert!(rate.abs() < 1e-11);
    }

    #[test]
    fn at_rest_on_the_target_it_stays_to_the_bit() {
        for target in [0.0, 0.37, -1.0] {
            assert_eq!(effect(100.0, 0.7).advance(target, 0.0, target, 1e-4), (target, 0.0));
        }
    }

    proptest! {
        #[test]
        fn no_time_changes_nothing(
            z in 0.2..1.5_f64, s in -1.0..1.0_f64, v in -500.0..500.0_f64, target in -1.0..1.0_f64,
        ) {
            let (spool, rate) = effect(100.0, z).advance(s, v, target, 0.0);
            // The distance from the target is taken and given back.
            prop_assert!((spool - s).abs() < 1e-15 && rate == v);
        }

        #[test]
        fn two_spans_are_one_of_their_sum(
            f in 20.0..400.0_f64, z in 0.2..1.5_f64, s in -1.0..1.0_f64, v in -500.0..500.0_f64,
            target in -1.0..1.0_f64, first in 0.0..1e-3_f64, second in 0.0..1e-3_f64,
        ) {
            let effect = effect(f, z);
            let (middle, rate) = effect.advance(s, v, target, first);
            let twice = effect.advance(middle, rate, target, second);
            let once = effect.advance(s, v, target, first + second);
            // States up to 1 + v / w = 5, with the angle of w t = 5 rounded to 1e-15; rates larger by w = 2500 1/s.
            prop_assert!((twice.0 - once.0).abs() < 1e-13 && (twice.1 - once.1).abs() < 1e-13 * 2.0 * PI * f + 1e-10);
        }

        #[test]
        fn the_energy_never_grows(
            f in 20.0..400.0_f64, z in 0.2..1.5_f64, s in -1.0..1.0_f64, v in -500.0..500.0_f64, t in 1e-6..1e-2_f64,
        ) {
            let w = 2.0 * PI * f;
            let energy = |(s, v): (f64, f64)| v * v + w * w * s * s;
            prop_assert!(energy(effect(f, z).advance(s, v, 0.0, t)) <= energy((s, v)) * (1.0 + 1e-14));
        }

        #[test]
        fn nearly_critical_damping_is_met_from_both_sides(f in 20.0..400.0_f64, t in 1e-5..1e-3_f64, near in -8.0..-2.0_f64) {
            // The response differs by less than w t dz from the critical one, w t up to 2.5.
            let dz = 10_f64.powf(near);
            let critical = effect(f, 1.0).advance(0.0, 0.0, 1.0, t).0;
            for z in [1.0 - dz, 1.0 + dz] {
                prop_assert!((effect(f, z).advance(0.0, 0.0, 1.0, t).0 - critical).abs() < 2.6 * dz + 1e-15);
            }
        }
    }
}
