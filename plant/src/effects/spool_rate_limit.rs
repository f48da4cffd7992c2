//! spool-rate-limit: the spool moves no faster than its actuator can.
//!
//! ```text
//! |ds/dt| <= rate:    s(t + h) = s + min(max(s_free - s, -rate h), rate h)
//! ```
//!
//! s spool, share of full opening; s_free where lag or second-order system would have it after the span h, s; rate in [5,
//! 2000] 1/s, full opening counts 1. Valid for an actuator whose force saturates against a viscous load, both ways alike.
//! Linear for small steps: the 1.6 ms lag asks for 625 1/s times its step. No regularisation: the limit acts on the way of a
//! span, so the spool lies on the exact ramp at the ends of the spans.
//!
//! Properties: no way is longer than rate times span; a way that is short enough is kept to the bit; never past s_free; odd;
//! a ramp does not depend on how the span is cut.
//!
//! Source: slew rate of saturated actuators, Merritt, Hydraulic Control Systems, 1967, chapter 7; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct SpoolRateLimit {
        rate_per_s: EffectKey {
            name: "rate_per_s",
            unit: Unit::PerSecond,
            min: 5.0,
            max: 2000.0,
            drawn: [20.0, 200.0],
            neutral: Some(f64::INFINITY),
            meaning: "largest |ds/dt|; full opening counts 1",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for SpoolRateLimit {
    const SHEET: Sheet = Sheet {
        name: "spool-rate-limit",
        group: Group::Flow,
        laws: &[Law::Spool],
        law: "the spool moves no faster than its actuator can",
        source: "saturated actuators, Merritt 1967 ch. 7; range: textbook prior",
        nonlinear_in_amplitude: true,
        has_memory: true,
        distinguished_by: &[ManualMeasurement::SpoolSignal],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl SpoolRateLimit {
    /// Where the spool is a span after `from`, if without the limit it were at `to`.
    pub(crate) fn limit(&self, from: f64, to: f64, span_s: f64) -> f64 {
        let reach = self.rate_per_s * span_s;
        if (to - from).abs() <= reach { to } else { from + reach.copysign(to - from) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_full_step_takes_the_time_of_the_ramp_and_a_small_one_none() {
        let effect = SpoolRateLimit { rate_per_s: 50.0 };
        let ramp = |spans: u32| (0..spans).fold(0.0, |spool, _| effect.limit(spool, 1.0, 1e-4));
        assert_eq!(ramp(0), 0.0);
        // 50 1/s over 10 ms; each of the hundred sums rounds once.
        assert!((ramp(100) - 0.5).abs() < 1e-14);
        assert_eq!(ramp(201), 1.0);
        assert_eq!(effect.limit(0.3, 0.304, 1e-4), 0.304);
    }

    proptest! {
        #[test]
        fn the_way_is_never_longer_than_the_rate_allows_and_never_past_the_free_one(
            rate in 5.0..2000.0_f64, from in -1.0..1.0_f64, to in -1.0..1.0_f64, span in 0.0..1e-3_f64,
        ) {
            let effect = SpoolRateLimit { rate_per_s: rate };
            let after = effect.limit(from, to, span);
            // The sum is rounded once, at the size of 1.
            prop_assert!((after - from).abs() <= rate * span + 3e-16);
            prop_assert!((from.min(to)..=from.max(to)).contains(&after));
            prop_assert_eq!(effect.limit(-from, -to, span), -after);
        }

        #[test]
        fn the_ramp_does_not_depend_on_the_cut(rate in 5.0..2000.0_f64, to in -1.0..1.0_f64, parts in 1..20_u32) {
            let effect = SpoolRateLimit { rate_per_s: rate };
            let part_s = 1e-3 / f64::from(parts);
            let cut = (0..parts).fold(0.0, |spool, _| effect.limit(spool, to, part_s));
            prop_assert!((cut - effect.limit(0.0, to, 1e-3)).abs() < 1e-14);
        }
    }
}
