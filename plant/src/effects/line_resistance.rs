//! line-resistance: the lines between valve and chambers are resistances: the drop grows with the flow squared and with 1/p.
//!
//! ```text
//! p_port - p_chamber = dp (q |q| / q_full^2) (p_ref / p_chamber)
//! q_full = 12.95 K_V,max p_supply        p_ref = p_supply / 2
//! ```
//!
//! q normal flow into the chamber, m^3/s; p_chamber absolute, Pa, positive; dp drop of q_full into a chamber at p_ref, Pa, in
//! [0, 1 bar]; K_V,max the supply edge's largest. The valve sees the pressure of its own end of the line: above the chamber's
//! while it fills, below while it vents. Turbulent pipe flow at the mean density of the chamber, so valid while the drop is
//! small against p; the compressible law p1^2 - p2^2 ~ q^2 has the same first order and half the drop where it is not small
//! (full flow into an empty chamber). A large outflow could make the sum negative: there the edge's flow points inwards, so
//! the implicit solution for q never goes there. No regularisation: smooth, with zero slope at q = 0.
//!
//! Properties: opposes the flow; odd in q; quadruple at twice the flow; half at twice the pressure; dp at the reference; dp =
//! 0 adds nothing; a valve that never opens has no drop.
//!
//! Source: Darcy and Weisbach for gases, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7, tubes; range:
//! textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::valve::FLOW_PER_KV;

effect_numbers! {
    struct Numbers {
        drop_pa: EffectKey {
            name: "drop_bar",
            unit: Unit::Bar,
            max: 1.0,
            drawn: [0.05, 0.5],
            meaning: "dp, drop at the full flow of the supply edge into a chamber at half the supply pressure",
            ..EffectKey::USUAL
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LineResistance {
    /// dp p_ref / q_full^2, Pa^2 per (m^3/s)^2.
    resistance: f64,
}

impl Effect for LineResistance {
    const SHEET: Sheet = Sheet {
        name: "line-resistance",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "the lines between valve and chambers are resistances: the drop grows with the flow squared and with 1/p",
        source: "pipe friction, Beater 2007; range: textbook prior",
        distinguished_by: &[ManualMeasurement::PortPressure, ManualMeasurement::ConstantVolume],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        let reference_pa = rig.supply().pressure_pa / 2.0;
        let full_flow = full_flow_m3_per_s(rig);
        let Numbers { drop_pa } = Numbers::of(numbers);
        let resistance = if full_flow > 0.0 { drop_pa * reference_pa / (full_flow * full_flow) } else { 0.0 };
        LineResistance { resistance }
    }
}

/// q_full, what a supply edge passes at most: fully open, choked, from the supply's nominal pressure.
pub(super) fn full_flow_m3_per_s(rig: &RigParameters) -> f64 {
    let kv_max = rig.valve().kv_supply_m3_per_h.into_iter().fold(0.0, f64::max);
    FLOW_PER_KV * kv_max * rig.supply().pressure_pa / 2.0
}

impl LineResistance {
    /// What is added to the chamber's pressure for that of the valve's port, Pa; flow in m^3/s, pressure absolute, Pa.
    pub(crate) fn term(&self, flow_m3_per_s: f64, chamber_pa: f64) -> f64 {
        self.resistance * flow_m3_per_s * flow_m3_per_s.abs() / chamber_pa
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn effect(drop_pa: f64) -> LineResistance {
        LineResistance::new(&[drop_pa], &RigParameters::baseline())
    }

    #[test]
    fn the_drop_is_the_given_one_at_the_reference() {
        // 12.95 x 0.66 x 7 = 59.829 m^3/h.
        let full = 59.829 / 3600.0;
        assert!((full_flow_m3_per_s(&RigParameters::baseline()) - full).abs() < 1e-14 * full);
        assert!((effect(3e4).term(full, 3.5e5) - 3e4).abs() < 1e-13 * 3e4);
    }

    #[test]
    fn a_valve_that_never_opens_has_no_drop() {
        let rig = RigParameters::baseline().with("valve.kv_supply_m3_per_h", &[0.0; 6]).expect("in range");
        assert_eq!(LineResistance::new(&[1e5], &rig).term(0.0, 1e5), 0.0);
    }

    proptest! {
        #[test]
        fn it_opposes_the_flow_and_grows_with_its_square_and_the_thin_air(
            drop in 0.0..1e5_f64, flow in -0.05..0.05_f64, pressure in 1e4..1.2e6_f64,
        ) {
            let effect = effect(drop);
            let term = effect.term(flow, pressure);
            prop_assert!(term * flow >= 0.0);
            prop_assert_eq!(effect.term(-flow, pressure), -term);
            // Powers of two do not round.
            prop_assert_eq!(effect.term(2.0 * flow, pressure), 4.0 * term);
            prop_assert_eq!(effect.term(flow, 2.0 * pressure), term / 2.0);
            prop_assert_eq!(effect.term(0.0, pressure), 0.0);
            prop_assert_eq!(LineResistance { resistance: 0.0 }.term(flow, pressure), 0.0);
        }
    }
}
