//! The first-order lag of a sensor, exact for a truth that goes in a straight line; position and pressure sensors share it.
//!
//! ```text
//! tau dy/dt = u - y        u from u_0 to u_1 over the span h        z = h / tau        phi_1(z) = (1 - e^-z) / z
//! y' = u_1 - (u_1 - u_0) phi_1 + (y - u_0) e^-z
//! ```
//!
//! y output, u truth, in the sensor's unit; tau time constant, s, >= 0; h, s, > 0. tau = 0 gives the truth. Both factors lie in
//! [0, 1], so that no span is too long; cut in parts, a span gives the same.
//!
//! Source: variation of constants.

/// Output of the sensor at the end of a span, in its unit.
pub(super) fn advance(time_constant_s: f64, output: f64, truth_from: f64, truth_to: f64, span_s: f64) -> f64 {
    if time_constant_s == 0.0 || span_s == 0.0 {
        return if time_constant_s == 0.0 { truth_to } else { output };
    }
    let z = span_s / time_constant_s;
    let risen = -libm::expm1(-z);
    truth_to - (truth_to - truth_from) * (risen / z) + (output - truth_from) * (1.0 - risen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TAU_S: f64 = 0.004;

    #[test]
    fn a_step_is_followed_exponentially() {
        let form = |t: f64| 1.0 - (-t / TAU_S).exp();
        assert_eq!(form(0.0), 0.0);
        for t in [1e-6, 1e-4, 1e-3, 0.02] {
            // Three roundings of 1.
            assert!((advance(TAU_S, 0.0, 1.0, 1.0, t) - form(t)).abs() < 1e-15, "{t} s");
        }
    }

    #[test]
    fn a_ramp_is_followed_one_time_constant_late() {
        // 0.5 m/s for 0.1 s, 25 time constants: 1e-11 of the start is left.
        assert!((advance(TAU_S, 0.0, 0.0, 0.05, 0.1) - 0.5 * (0.1 - TAU_S)).abs() < 1e-12);
    }

    #[test]
    fn what_stands_still_is_shown_as_it_is() {
        assert_eq!(advance(TAU_S, 3.7e5, 3.7e5, 3.7e5, 1e-3), 3.7e5);
    }

    #[test]
    fn no_time_constant_shows_the_truth_and_no_time_changes_nothing() {
        assert_eq!(advance(0.0, 0.0, 1.0, 2.0, 1e-3), 2.0);
        assert_eq!(advance(0.0, 0.0, 1.0, 2.0, 0.0), 2.0);
        assert_eq!(advance(TAU_S, 0.3, 1.0, 1.0, 0.0), 0.3);
        assert_eq!(advance(5e-324, 0.0, 1.0, 2.0, 1e-3), 2.0, "the limit");
    }

    proptest! {
        #[test]
        fn it_does_not_matter_how_a_span_is_cut(
            tau in 1e-6..0.02_f64,
            output in -1.0..1.0_f64,
            from in -1.0..1.0_f64,
            to in -1.0..1.0_f64,
            cut in 0.01..0.99_f64,
        ) {
            let span = 1e-3;
            let between = from + (to - from) * cut;
            let half = advance(tau, output, from, between, span * cut);
            let parts = advance(tau, half, between, to, span - span * cut);
            // Roundings of numbers up to 2.
            prop_assert!((advance(tau, output, from, to, span) - parts).abs() < 1e-14);
        }

        #[test]
        fn it_stays_between_what_it_shows_and_what_is_true(
            tau in 0.0..0.02_f64,
            output in -1.0..1.0_f64,
            from in -1.0..1.0_f64,
            to in -1.0..1.0_f64,
            span in 1e-6..1e-3_f64,
        ) {
            let next = advance(tau, output, from, to, span);
            let [low, high] = [output.min(from).min(to), output.max(from).max(to)];
            // Roundings of numbers up to 2.
            prop_assert!((low - 1e-15..=high + 1e-15).contains(&next));
        }
    }
}
