//! critical-pressure-ratio: an edge's flow is the ellipse of ISO 6358 with its own critical pressure ratio b instead of 0.5.
//!
//! ```text
//! Q = c p_up / 2                                        r <= b                       choked
//! Q = c p_up / 2 sqrt(1 - ((r - b) / (1 - b))^2)        r >  b,   r = p_down / p_up   [ISO 6358-1, m = 0.5]
//! term = Q(b) - Q(0.5)
//! ```
//!
//! Q normal flow into the chamber, m^3/s, its sign that of p_far - p_port; c conductance of the edge, m^3/s per Pa, not
//! negative; p_far, p_port absolute, Pa, positive; b critical pressure ratio, in [0.05, 0.6].
//!
//! Both lines are one formula without a branch, c / (2 (1 - b)) sqrt((p_up - m) ((1 - 2 b) p_up + m)) with m = max(p_down, b
//! p_up); at b = 0.5 it is eq. (4) to the bit. Valid for one orifice and for two in series, for which b is small; a valve
//! with a moving seat or a spring has a fourth number, the cracking pressure, which is not here. Vertical at r = 1 as the
//! baseline is: no regularisation, the chamber's own state solves for it.
//!
//! Properties: choked flow is the same for every b; b = 0.5 adds nothing; a smaller b never passes more; turns with the
//! pressures.
//!
//! Source: ISO 6358-1:2013, flow-rate characteristics of components, with subsonic index m = 0.5; range: textbook prior for
//! valves of this size (Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7).

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::valve::single_edge_flow;

effect_numbers! {
    pub(crate) struct CriticalPressureRatio {
        critical_ratio: EffectKey {
            name: "critical_ratio",
            unit: Unit::One,
            min: 0.05,
            max: 0.6,
            drawn: [0.15, 0.45],
            neutral: Some(0.5),
            meaning: "b, the pressure ratio below which the flow is choked",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for CriticalPressureRatio {
    const SHEET: Sheet = Sheet {
        name: "critical-pressure-ratio",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "an edge's flow is the ellipse of ISO 6358 with its own critical pressure ratio b instead of 0.5",
        source: "ISO 6358-1:2013; range: textbook prior (Beater 2007)",
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl CriticalPressureRatio {
    /// What the edge passes into the chamber beside eq. (4), m^3/s; `conductance` in m^3/s per Pa, pressures absolute, Pa.
    pub(crate) fn term(&self, conductance: f64, far_pa: f64, port_pa: f64) -> f64 {
        self.flow(conductance, far_pa, port_pa) - single_edge_flow(conductance, far_pa, port_pa)
    }

    fn flow(&self, conductance: f64, far_pa: f64, port_pa: f64) -> f64 {
        let ratio = self.critical_ratio;
        let upstream = far_pa.max(port_pa);
        let throat = far_pa.min(port_pa).max(upstream * ratio);
        let root = ((upstream - throat) * (upstream * (1.0 - 2.0 * ratio) + throat)).sqrt();
        (conductance / (2.0 * (1.0 - ratio)) * root).copysign(far_pa - port_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CONDUCTANCE: f64 = 4.7e-8;

    fn effect(critical_ratio: f64) -> CriticalPressureRatio {
        CriticalPressureRatio { critical_ratio }
    }

    #[test]
    fn it_is_the_ellipse_of_the_standard() {
        for b in [0.15_f64, 0.3, 0.45, 0.55] {
            for r in [0.05_f64, 0.2, 0.4, 0.6, 0.8, 0.99] {
                let share = (1.0 - ((r - b).max(0.0) / (1.0 - b)).powi(2)).sqrt();
                let flow = effect(b).flow(CONDUCTANCE, 7e5, r * 7e5);
                // The standard's form loses digits next to r = 1: 2 / (1 - r) roundings.
                let printed = CONDUCTANCE * 7e5 / 2.0 * share;
                assert!((flow - printed).abs() <= 1e-13 / (1.0 - r) * printed, "b = {b}, r = {r}");
            }
        }
    }

    #[test]
    fn a_ratio_of_one_half_adds_nothing_to_the_bit() {
        for port in [1e5, 2.3e5, 3.5e5, 5e5, 6.99e5, 7e5, 9e5, 2e6] {
            assert_eq!(effect(0.5).term(CONDUCTANCE, 7e5, port), 0.0, "{port}");
        }
    }

    proptest! {
        #[test]
        fn choked_flow_is_the_same_for_every_ratio(b in 0.05..0.6_f64, far in 1e5..1.2e6_f64) {
            let port = far * 0.999 * b.min(0.5);
            // Five roundings of numbers of the flow's size.
            let choked = CONDUCTANCE * far / 2.0;
            prop_assert!(effect(b).term(CONDUCTANCE, far, port).abs() <= 1e-15 * choked);
        }

        #[test]
        fn a_smaller_ratio_passes_less_and_no_more_than_choked(
            b in 0.05..0.59_f64, more in 0.001..0.01_f64, far in 1e5..1.2e6_f64, port in 1e5..1.2e6_f64,
        ) {
            let [less, most] = [b, b + more].map(|b| effect(b).flow(CONDUCTANCE, far, port).abs());
            let choked = CONDUCTANCE * far.max(port) / 2.0;
            prop_assert!(less <= most + 1e-15 * choked && most <= choked * (1.0 + 1e-15));
        }

        #[test]
        fn the_flow_turns_with_the_pressures(b in 0.05..0.6_f64, far in 1e5..1.2e6_f64, port in 1e5..1.2e6_f64) {
            let term = effect(b).term(CONDUCTANCE, far, port);
            prop_assert_eq!(term, -effect(b).term(CONDUCTANCE, port, far));
            prop_assert_eq!(effect(b).term(CONDUCTANCE, far, far), 0.0);
        }
    }
}
