//! check-valve-restriction: a non-return valve at each chamber port needs a pressure to crack and restricts as a second
//! orifice.
//!
//! ```text
//! shut while |p_far - p_chamber| <= p_c
//! p_port - p_chamber = sign(q) p_c + drop of the orifice                          sign(0) = 0
//! inflow,  p_up from q = k g(p_up, p_chamber):    drop = (q/k)^2 / p_chamber      while <= p_chamber
//!                                                 drop = 2 q/k - p_chamber        beyond: choked
//! outflow, p_down from -q = k g(p_chamber, p_down):
//!        drop = -(p_chamber - sqrt(p_chamber^2 - 4 (q/k)^2)) / 2                  while |q| <= k p_chamber / 2
//!        drop = -p_chamber                                                        beyond: no more flows
//! g(p_up, p_down) = sqrt((p_up - p_down) p_down), choked p_up / 2                 [Neugebauer 2011, eq. 4]
//! ```
//!
//! q normal flow into the chamber, m^3/s; p_chamber absolute, Pa, positive; p_c cracking pressure, Pa, in [0, 1 bar], the
//! spring against the flow either way, as of a piloted valve that opens both ways; k conductance of the orifice, m^3/s per
//! Pa; 100 m^3/h, the largest number of the file, counts as no orifice. The orifice lies next to the chamber. At -q = k
//! p_chamber / 2 it is choked and the port may have any lower pressure; a larger outflow is answered by a port without air,
//! so that the implicit solution for q stays at or below. No regularisation: the caller solves q against a drop that never
//! falls with q; at q = 0 it jumps by 2 p_c, which is the band in which no flow passes.
//!
//! Properties: opposes the flow; never falls with q; through valve and orifice the choked outflow is never exceeded; vents
//! stop p_c above the exhaust; p_c = 0 and 100 m^3/h add nothing.
//!
//! Source: two resistances in series, ISO 6358-3:2014; spring of the non-return valve, Beater, Pneumatic Drives, 2007, DOI
//! 10.1007/978-3-540-69471-7; [Neugebauer 2011] is DOI 10.2478/v10180-011-0014-6; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::valve::FLOW_PER_KV;

/// K_V that stands for no orifice, m^3/h.
const NO_ORIFICE: f64 = 100.0;

effect_numbers! {
    struct Numbers {
        cracking_pa: EffectKey {
            name: "cracking_pressure_bar",
            unit: Unit::Bar,
            max: 1.0,
            drawn: [0.05, 0.5],
            meaning: "p_c, pressure difference below which the port stays shut, either way",
            ..EffectKey::USUAL
        },
        orifice_kv_m3_per_h: EffectKey {
            name: "orifice_kv_m3_per_h",
            unit: Unit::CubicMetrePerHour,
            min: 0.2,
            max: 100.0,
            drawn: [0.6, 3.0],
            signed: false,
            default: Some(NO_ORIFICE),
            neutral: Some(NO_ORIFICE),
            meaning: "K_V of the orifice in series; 100 is none",
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CheckValveRestriction {
    /// p_c.
    pub(crate) cracking_pa: f64,
    /// k, m^3/s per Pa; infinite for no orifice.
    conductance: f64,
}

impl Effect for CheckValveRestriction {
    const SHEET: Sheet = Sheet {
        name: "check-valve-restriction",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "a non-return valve at each chamber port needs a pressure to crack and restricts as a second orifice",
        source: "ISO 6358-3:2014, Beater 2007; range: textbook prior",
        // Without cracking pressure it is a line resistance.
        defined_by_first: true,
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        let Numbers { cracking_pa, orifice_kv_m3_per_h: kv } = Numbers::of(numbers);
        let conductance = if kv >= NO_ORIFICE { f64::INFINITY } else { kv * FLOW_PER_KV };
        CheckValveRestriction { cracking_pa, conductance }
    }
}

impl CheckValveRestriction {
    /// What is added to the chamber's pressure for that of the valve's port, Pa; flow in m^3/s, pressure absolute, Pa.
    pub(crate) fn term(&self, flow_m3_per_s: f64, chamber_pa: f64) -> f64 {
        let root = flow_m3_per_s / self.conductance;
        if flow_m3_per_s > 0.0 {
            let drop = if root <= chamber_pa { root * (root / chamber_pa) } else { 2.0 * root - chamber_pa };
            self.cracking_pa + drop
        } else if flow_m3_per_s < 0.0 {
            let square = (chamber_pa + 2.0 * root) * (chamber_pa - 2.0 * root);
            // Written without a difference: 2 r^2 / (p + sqrt(p^2 - 4 r^2)).
            let drop =
                if square >= 0.0 { 2.0 * root * root / (chamber_pa + square.sqrt()) } else { chamber_pa };
            -self.cracking_pa - drop
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valve::single_edge_flow;
    use proptest::prelude::*;

    fn effect(cracking_pa: f64, kv: f64) -> CheckValveRestriction {
        CheckValveRestriction::new(&[cracking_pa, kv], &RigParameters::baseline())
    }

    #[test]
    fn without_spring_and_orifice_it_adds_nothing() {
        for flow in [-0.02, 0.0, 0.02] {
            assert_eq!(effect(0.0, 100.0).term(flow, 2e5), 0.0);
        }
    }

    #[test]
    fn standing_air_has_no_drop_and_moving_air_at_least_the_cracking_pressure() {
        let effect = effect(2e4, 1.0);
        assert_eq!(effect.term(0.0, 3e5), 0.0);
        // The least flow leaves no drop at the orifice.
        assert_eq!((effect.term(1e-12, 3e5), effect.term(-1e-12, 3e5)), (2e4, -2e4));
    }

    #[test]
    fn more_than_the_choked_outflow_meets_a_port_without_air() {
        let effect = effect(0.0, 1.0);
        let choked = FLOW_PER_KV * 3e5 / 2.0;
        // The root of a difference of 1e-12 leaves 1e-6 of the half.
        assert!((effect.term(-choked * (1.0 - 1e-12), 3e5) + 1.5e5).abs() < 1.0);
        assert_eq!(effect.term(-choked * 1.000_001, 3e5), -3e5);
    }

    proptest! {
        #[test]
        fn the_orifice_passes_just_this_flow_at_this_drop(kv in 0.2..3.0_f64, flow in -1.0..2.0_f64, chamber in 5e4..1.2e6_f64) {
            let conductance = kv * FLOW_PER_KV;
            let flow = flow * 0.999 * conductance * chamber / 2.0;
            let port = chamber + effect(0.0, kv).term(flow, chamber);
            let passed = single_edge_flow(conductance, port, chamber);
            // A rounding of the pressure is one of the flow's square: the root of 1e-16 next to equal pressures, and relative to
            // the choked flow.
            prop_assert!((passed - flow).abs() <= 4e-8 * conductance * chamber);
        }

        #[test]
        fn the_drop_opposes_the_flow_and_never_falls_with_it(
            cracking in 0.0..1e5_f64, kv in 0.2..100.0_f64, chamber in 1e4..1.2e6_f64,
            less in -0.05..0.05_f64, more in 0.0..0.02_f64,
        ) {
            let effect = effect(cracking, kv);
            let term = effect.term(less, chamber);
            prop_assert!(term.is_finite() && term * less >= 0.0);
            prop_assert!(effect.term(less + more, chamber) >= term * (1.0 - 1e-15 * term.signum()));
        }
    }
}
