//! A volume behind one orifice of eq. (4): what a supply node and a silencer's volume have in common.
//!
//! ```text
//! V dp/dt = p_N (c g(p) + q)            q held over the span
//! g(p) =  sqrt((p_far - m) m)           p <= p_far,   m = max(p, p_far / 2)
//! g(p) = -sqrt((p - m) m)               p >= p_far,   m = max(p_far, p / 2)    [Neugebauer 2011, eq. 4]
//! ```
//!
//! p pressure of the volume, p_far pressure behind the orifice (absolute, Pa, positive); V volume, m^3; c conductance of the
//! orifice, m^3/s per Pa; q normal flow into the volume from elsewhere, m^3/s, negative where it is drawn; p_N normal pressure.
//!
//! g falls with p everywhere and is vertical at p = p_far: explicit steps rattle there, however short. Each step is therefore
//! Alexander's two-stage implicit rule (second order, L-stable),
//!
//! ```text
//! p1 = p  + z h f(p1)                                   z = 1 - 1/sqrt(2)
//! p2 = p  + (1 - z) h f(p1) + z h f(p2)                                             [Alexander 1977, sec. 2]
//! ```
//!
//! and each stage `p = P + w g(p)` with w = z h p_N c / V has a closed form: linear where the orifice is choked, a quadratic
//! where it is not. There is no iteration, and nothing that could fail to converge.
//!
//! The exact solution of one equation of first order moves from its start towards its equilibrium and never past it; so the
//! result is kept between these two, which can only make it better. Where more is drawn than the orifice passes when choked
//! there is no equilibrium; then the volume keeps at least half of its pressure in a span, and stays positive.
//!
//! Properties: the equilibrium stays to the bit; no overshoot; positive; second order away from p = p_far; any span.
//!
//! Source: [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6; [Alexander 1977] SIAM J. Numer. Anal. 14, DOI 10.1137/0714068.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// z of the implicit rule.
const STAGE: f64 = 1.0 - FRAC_1_SQRT_2;

/// (1 - z) / z, the weight of the first stage's change in the second.
const CARRIED: f64 = 1.0 + SQRT_2;

/// The volume and its orifice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    /// c, m^3/s per Pa, finite and not negative.
    pub(super) conductance: f64,
    /// V, positive.
    pub(super) volume_m3: f64,
    /// p_N.
    pub(super) normal_pa: f64,
}

impl Node {
    /// The pressure a span later, Pa absolute; `fed_m3_per_s` is q.
    pub(super) fn advance(&self, node_pa: f64, far_pa: f64, fed_m3_per_s: f64, span_s: f64) -> f64 {
        let scale = STAGE * span_s * self.normal_pa / self.volume_m3;
        let (weight, fed_pa) = (scale * self.conductance, scale * fed_m3_per_s);
        let first = stage(node_pa + fed_pa, weight, far_pa);
        let second = stage(node_pa + CARRIED * (first - node_pa) + fed_pa, weight, far_pa);
        let goal = self.equilibrium(far_pa, fed_m3_per_s).unwrap_or(node_pa / 2.0);
        second.max(node_pa.min(goal)).min(node_pa.max(goal))
    }

    /// The pressure at which orifice and flow balance, Pa absolute; none where the orifice cannot pass what is drawn.
    pub(super) fn equilibrium(&self, far_pa: f64, fed_m3_per_s: f64) -> Option<f64> {
        if fed_m3_per_s == 0.0 {
            return Some(far_pa);
        }
        let root = fed_m3_per_s / self.conductance;
        if root > far_pa {
            Some(2.0 * root)
        } else if root > 0.0 {
            Some(far_pa + root * (root / far_pa))
        } else if -root <= far_pa / 2.0 {
            Some((far_pa + ((far_pa + 2.0 * root) * (far_pa - 2.0 * root)).sqrt()) / 2.0)
        } else {
            None
        }
    }
}

/// The p that solves `p = given + weight g(p)`.
fn stage(given_pa: f64, weight: f64, far_pa: f64) -> f64 {
    if given_pa > far_pa {
        // With y = sqrt(p - p_far): y^2 + w sqrt(p_far) y = P - p_far; written without a difference of roots.
        let excess = given_pa - far_pa;
        let linear = weight * far_pa.sqrt();
        let root = 2.0 * excess / (linear + (linear * linear + 4.0 * excess).sqrt());
        let above = root * root;
        if above > far_pa { given_pa / (1.0 + weight / 2.0) } else { far_pa + above }
    } else if given_pa < far_pa {
        let choked = given_pa + weight * far_pa / 2.0;
        if choked <= far_pa / 2.0 {
            return choked;
        }
        // With d = p_far - p and D = p_far - P: (1 + w^2) d^2 - (2 D + w^2 p_far) d + D^2 = 0, the smaller root. The
        // discriminant is positive, since D < (1 + w) p_far / 2 here; max guards its rounding alone.
        let short = far_pa - given_pa;
        let square = weight * weight;
        let linear = 2.0 * short + square * far_pa;
        let discriminant = square * (4.0 * short * (far_pa - short) + square * far_pa * far_pa);
        far_pa - 2.0 * short * short / (linear + discriminant.max(0.0).sqrt())
    } else {
        far_pa
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valve::{FLOW_PER_KV, single_edge_flow};
    use proptest::prelude::*;

    const FAR_PA: f64 = 101_325.0;

    fn node(kv: f64, volume_cm3: f64) -> Node {
        Node { conductance: kv * FLOW_PER_KV, volume_m3: volume_cm3 / 1e6, normal_pa: 101_325.0 }
    }

    fn in_spans(node: &Node, from_pa: f64, fed_m3_per_s: f64, time_s: f64, spans: u32) -> f64 {
        let span_s = time_s / f64::from(spans);
        (0..spans).fold(from_pa, |pressure, _| node.advance(pressure, FAR_PA, fed_m3_per_s, span_s))
    }

    #[test]
    fn each_stage_solves_its_equation() {
        for given in [-1e5, 1e3, 4e4, 9e4, 101_324.0, FAR_PA, 101_326.0, 1.5e5, 2.5e5, 9e5] {
            for weight in [0.0, 1e-6, 0.01, 0.3, 1.0, 30.0, 1e4] {
                let pressure = stage(given, weight, FAR_PA);
                let flow =
                    if pressure > 0.0 { single_edge_flow(1.0, FAR_PA, pressure) } else { FAR_PA / 2.0 };
                let residual = pressure - given - weight * flow;
                // Rounding the pressure to half an ulp moves w g by w |g'| / 2 ulp, where |g'| is far / 2 |g| at most; next to
                // the vertical, |g| is no less than the root of far times an ulp, 1.2e-3 Pa^(1/2) x far^(1/2).
                let ulp = 2e-16 * FAR_PA.max(given.abs()) * (1.0 + weight);
                let slope = FAR_PA / flow.abs().max(1e-3);
                assert!(residual.abs() <= 4.0 * ulp * (1.0 + slope), "{given} {weight}: {residual}");
            }
        }
    }

    #[test]
    fn no_time_changes_nothing() {
        for start in [3e4, 9e4, FAR_PA, 1.5e5, 7e5] {
            let after = node(0.6, 60.0).advance(start, FAR_PA, 2e-3, 0.0);
            // Two sums and a root of the pressure's size.
            assert!((after - start).abs() <= 8.0 * f64::EPSILON * start, "{start} {after}");
        }
    }

    #[test]
    fn the_equilibrium_stays_to_the_bit_for_any_flow() {
        for fed in [0.0, 1e-5, 1e-3, 2e-2, -1e-5, -1e-3, -2.1e-3] {
            let node = node(0.6, 60.0);
            let still = node.equilibrium(FAR_PA, fed).expect("below choking");
            for span in [1.25e-5, 1e-4, 1e-3] {
                assert_eq!(node.advance(still, FAR_PA, fed, span), still, "{fed}");
            }
            // Orifice and flow balance: the root next to the vertical doubles the relative rounding of p - p_far.
            let passed = single_edge_flow(node.conductance, FAR_PA, still);
            assert!((passed + fed).abs() <= 1e-8 * fed.abs().max(1e-6), "{fed} {passed}");
        }
    }

    #[test]
    fn the_choked_node_falls_exponentially() {
        let node = node(0.6, 60.0);
        let rate = node.normal_pa * node.conductance / node.volume_m3 / 2.0;
        let exact = |time_s: f64| 7e5 * (-rate * time_s).exp();
        assert_eq!(exact(0.0), 7e5);
        // rate = 36.4 1/s, so 20 ms end at 3.4e5 Pa, still choked. Error of the rule: 0.041 (rate h)^3 each step, and so
        // 0.041 (rate h)^2 rate T of the pressure in all.
        for spans in [20, 40] {
            let step = rate * 0.02 / f64::from(spans);
            let error = in_spans(&node, 7e5, 0.0, 0.02, spans) - exact(0.02);
            assert!(error.abs() < 1.1 * 0.0405 * step * step * rate * 0.02 * exact(0.02), "{spans}: {error}");
        }
    }

    #[test]
    fn the_open_node_falls_on_a_parabola_and_ends_at_the_pressure_outside() {
        let node = node(0.6, 60.0);
        let slope = node.normal_pa * node.conductance / node.volume_m3 * FAR_PA.sqrt() / 2.0;
        let start = 8e4_f64;
        let exact = |time_s: f64| FAR_PA + (start.sqrt() - slope * time_s).max(0.0).powi(2);
        assert!((exact(0.0) - FAR_PA - start).abs() < 1e-9);
        let end_s = start.sqrt() / slope;
        for share in [0.25, 0.5, 0.75] {
            // dp/dt is linear in the root, whose curvature the rule meets to second order: (h / end)^2 of the way, h = end / 200.
            let error = in_spans(&node, FAR_PA + start, 0.0, share * end_s, 200) - exact(share * end_s);
            assert!(error.abs() < start / 200.0 / 200.0, "{share}: {error}");
        }
        assert_eq!(in_spans(&node, FAR_PA + start, 0.0, 1.2 * end_s, 200), FAR_PA);
    }

    #[test]
    fn halving_the_span_quarters_the_error() {
        for (start, fed) in [(1.9e5, 1.5e-3), (1.1e5, 4e-3), (9.5e4, -1.2e-3), (6e4, -5e-4)] {
            let node = node(0.6, 60.0);
            let limit = in_spans(&node, start, fed, 4e-3, 4096);
            let error = |spans| (in_spans(&node, start, fed, 4e-3, spans) - limit).abs();
            let ratio = error(16) / error(32);
            assert!((3.0..5.0).contains(&ratio), "{start} {fed}: {ratio}");
        }
    }

    proptest! {
        #[test]
        fn it_stays_positive_and_never_passes_its_equilibrium(
            start in 1e3..1.6e6_f64, far in 9e4..1.2e6_f64, fed in -0.1..0.1_f64,
            kv in -4.0..2.5_f64, volume in 0.5..4.0_f64, span in -5.0..-3.0_f64,
        ) {
            let node = node(10_f64.powf(kv), 10_f64.powf(volume));
            let after = node.advance(start, far, fed, 10_f64.powf(span));
            prop_assert!(after.is_finite() && after > 0.0);
            let goal = node.equilibrium(far, fed).unwrap_or(start / 2.0);
            prop_assert!((start.min(goal)..=start.max(goal)).contains(&after));
        }

        #[test]
        fn an_undisturbed_node_is_as_good_in_one_span_as_in_many(
            start in 5e4..7e5_f64, kv in -1.0..1.8_f64, volume in 0.7..3.0_f64,
        ) {
            let node = node(10_f64.powf(kv), 10_f64.powf(volume));
            let (one, many) = (in_spans(&node, start, 0.0, 1e-4, 1), in_spans(&node, start, 0.0, 1e-4, 256));
            // Worst where the whole transient fits in the span: the rule leaves at most a tenth of the way.
            prop_assert!((one - many).abs() <= 0.1 * (start - FAR_PA).abs() + 1e-6, "{one} {many}");
        }
    }
}
