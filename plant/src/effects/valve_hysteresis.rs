//! valve-hysteresis: a play of half-width h lies between command and spool.
//!
//! ```text
//! y = min(max(y_previous, x - h), x + h)        term = y - x
//! ```
//!
//! x input, the command with dead time and offset, share of full; y what leaves the play and is remembered; h half-width, in
//! [0, 0.1]. The play operator is independent of the rate: only the reversals of x count, not how fast they are. Valid for
//! friction and magnetic remanence of a position-controlled spool taken together; minor loops are parallelograms. The memory
//! starts at y = x. No regularisation: y is a continuous function of x over time.
//!
//! Properties: |term| <= h; y stays while x moves less than 2 h back; between reversals y follows at distance h;
//! rate-independent; h = 0 adds nothing.
//!
//! Source: play operator, Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ValveHysteresis {
        half_width: EffectKey {
            name: "half_width_percent",
            unit: Unit::Percent,
            max: 10.0,
            drawn: [0.2, 3.0],
            meaning: "h, of full command",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ValveHysteresis {
    const SHEET: Sheet = Sheet {
        name: "valve-hysteresis",
        group: Group::Flow,
        laws: &[Law::Spool],
        law: "a play of half-width h lies between command and spool",
        source: "play operator, Krasnosel'skii and Pokrovskii 1989; range: textbook prior",
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

impl ValveHysteresis {
    /// What leaves the play, share of full command: the memory of the next call.
    pub(crate) fn output(&self, previous_output: f64, input: f64) -> f64 {
        previous_output.max(input - self.half_width).min(input + self.half_width)
    }

    /// What the play adds to its input.
    pub(crate) fn term(&self, previous_output: f64, input: f64) -> f64 {
        self.output(previous_output, input) - input
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const H: f64 = 0.03;

    fn follow(inputs: impl IntoIterator<Item = f64>, start: f64) -> f64 {
        inputs
            .into_iter()
            .fold(start, |output, input| ValveHysteresis { half_width: H }.output(output, input))
    }

    #[test]
    fn it_follows_at_its_half_width_and_stays_after_a_reversal() {
        // Differences of numbers below 1.
        let up = follow((0..=50).map(|i| f64::from(i) / 100.0), 0.0);
        assert!((up - (0.5 - H)).abs() < 1e-15);
        assert_eq!(follow([0.49, 0.47, 0.45], up), up, "less than 2 h back");
        let down = follow([0.4, 0.2], up);
        assert!((down - (0.2 + H)).abs() < 1e-15);
    }

    #[test]
    fn the_loop_of_a_triangle_is_two_half_widths_wide() {
        let up = |to: f64| follow([-1.0, to], 0.0);
        let down = |to: f64| follow([1.0, to], 0.0);
        for input in [-0.5, 0.0, 0.3] {
            assert!((down(input) - up(input) - 2.0 * H).abs() < 1e-15, "{input}");
        }
    }

    proptest! {
        #[test]
        fn the_term_is_within_the_half_width(
            h in 0.0..=0.1_f64, previous in -1.0..=1.0_f64, input in -1.0..=1.0_f64,
        ) {
            // The sum of input and half-width is rounded once, the difference once.
            let play = ValveHysteresis { half_width: h };
            prop_assert!(play.term(previous, input).abs() <= h + 3e-16);
            let none = ValveHysteresis { half_width: 0.0 };
            prop_assert_eq!(none.term(previous, input), 0.0);
        }

        #[test]
        fn the_rate_does_not_count(start in -0.5..=0.5_f64, end in -1.0..=1.0_f64, parts in 2..50_u32) {
            let way = (0..=parts).map(|i| start + (end - start) * f64::from(i) / f64::from(parts));
            let slow = follow(way, start);
            // The last input is the end up to its own rounding.
            prop_assert!((slow - follow([end], start)).abs() < 1e-15);
        }
    }
}
