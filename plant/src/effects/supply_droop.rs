//! supply-droop: the supply node is a volume fed through a regulator that gives way under flow.
//!
//! ```text
//! V dp/dt = p_N (Q(p_set -> p) - q_drawn)          Q: eq. (4), either way, with the conductance c
//! c sqrt((p_supply - m) m) = q_full                m = max(p_supply - dp, p_supply / 2),  q_full = 12.95 K_V,max p_supply
//! ```
//!
//! p node that feeds the supply edges of both axes, p_set what the regulator holds without flow (the baseline's node, which
//! an emergency stop discharges), absolute, Pa; q_drawn normal flow drawn by both axes, m^3/s, negative where chambers feed
//! back; V volume, m^3, in [50, 10000] cm^3; dp droop, Pa, in [0, 2 bar]: the fall of the node while one full supply edge
//! draws. Valid for a self-relieving regulator whose set-point is quick and stiff, so that hose and seat alone give way; the
//! overshoot of a real one after a step is left out. At equal pressures the law is vertical; the step of `node.rs` solves it
//! without regularisation. A droop below 1 mPa counts as 1 mPa, and of 0 the node is p_set to the bit.
//!
//! Properties: without flow the set pressure stays to the bit; one full edge makes dp; recovers at rest; positive; never past
//! the equilibrium; dp = 0 adds nothing.
//!
//! Source: flow-pressure characteristic of regulators, ISO 6953-2:2015; Beater, Pneumatic Drives, 2007, DOI
//! 10.1007/978-3-540-69471-7; one orifice for seat and hose is this catalogue's own shape; range: textbook prior.

use super::line_resistance::full_flow_m3_per_s;
use super::node::Node;
use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, PlaceKind, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        droop_pa: EffectKey {
            name: "droop_bar",
            unit: Unit::Bar,
            max: 2.0,
            drawn: [0.1, 1.0],
            meaning: "dp, fall of the node while one full supply edge draws steadily",
            ..EffectKey::USUAL
        },
        volume_m3: EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 50.0,
            max: 10000.0,
            drawn: [200.0, 2000.0],
            signed: false,
            default: Some(500.0),
            neutral: None,
            meaning: "volume of the node",
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SupplyDroop {
    /// None where nothing droops.
    node: Option<Node>,
}

impl Effect for SupplyDroop {
    const SHEET: Sheet = Sheet {
        name: "supply-droop",
        group: Group::Flow,
        place: PlaceKind::Supply,
        laws: &[Law::Supply],
        law: "the supply node is a volume fed through a regulator that gives way under flow",
        source: "ISO 6953-2:2015, Beater 2007; range: textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        let Numbers { droop_pa, volume_m3 } = Numbers::of(numbers);
        let supply_pa = rig.supply().pressure_pa;
        let fall_pa = droop_pa.max(LEAST_DROOP_PA).min(supply_pa / 2.0);
        let conductance = full_flow_m3_per_s(rig) / (fall_pa * (supply_pa - fall_pa)).sqrt();
        let node = Node { conductance, volume_m3, normal_pa: rig.gas().normal_pressure_pa };
        SupplyDroop { node: (droop_pa > 0.0).then_some(node) }
    }
}

/// A regulator stiffer than this would be a number without bounds.
const LEAST_DROOP_PA: f64 = 1e-3;

impl SupplyDroop {
    /// Pressure of the node a span later; pressures absolute, Pa, flow in m^3/s and held over the span.
    pub(crate) fn advance(&self, node_pa: f64, set_pa: f64, drawn_m3_per_s: f64, span_s: f64) -> f64 {
        self.node.map_or(set_pa, |node| node.advance(node_pa, set_pa, -drawn_m3_per_s, span_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SET_PA: f64 = 7e5;

    fn effect(droop_bar: f64, volume_cm3: f64) -> SupplyDroop {
        SupplyDroop::new(&[droop_bar * 1e5, volume_cm3 / 1e6], &RigParameters::baseline())
    }

    fn after(effect: &SupplyDroop, from_pa: f64, drawn: f64, spans: u32) -> f64 {
        (0..spans).fold(from_pa, |node, _| effect.advance(node, SET_PA, drawn, 1e-4))
    }

    #[test]
    fn without_flow_the_set_pressure_stays_to_the_bit() {
        for span in [1.25e-5, 1e-4, 1e-3] {
            assert_eq!(effect(1.0, 500.0).advance(SET_PA, SET_PA, 0.0, span), SET_PA);
        }
    }

    #[test]
    fn no_droop_is_the_set_pressure_to_the_bit() {
        assert_eq!(effect(0.0, 500.0).advance(3e5, SET_PA, 0.02, 1e-4), SET_PA);
    }

    #[test]
    fn one_full_edge_makes_the_droop_and_rest_takes_it_back() {
        let full = full_flow_m3_per_s(&RigParameters::baseline());
        for droop_bar in [1e-6, 0.1, 0.5, 1.0, 2.0] {
            let effect = effect(droop_bar, 500.0);
            // The softest one has a time constant of 0.2 s: fifty of them.
            let loaded = after(&effect, SET_PA, full, 100_000);
            // The approach stalls where the roundings of a step, 1.2e-10 Pa, outweigh its share of the way, 5e-4 or more.
            assert!((SET_PA - loaded - droop_bar * 1e5).abs() < 1e-6, "{droop_bar}: {loaded}");
            // Unloaded, the law is a parabola that meets the set pressure in finite time.
            assert_eq!(after(&effect, loaded, 0.0, 50_000), SET_PA);
        }
    }

    #[test]
    fn a_node_that_is_discharged_follows_its_regulator() {
        let effect = effect(0.5, 500.0);
        let mut node = SET_PA;
        for step in 0..5000 {
            let set = 101_325.0 + (SET_PA - 101_325.0) * (-f64::from(step) * 1e-4 / 0.05).exp();
            let next = effect.advance(node, set, 0.0, 1e-4);
            assert!(next >= set.min(node) && next <= node.max(set));
            node = next;
        }
        // After ten time constants the set pressure has 27 Pa left to fall.
        assert!(node - 101_325.0 < 60.0, "{node}");
    }

    proptest! {
        #[test]
        fn it_stays_positive_and_between_its_start_and_the_equilibrium(
            droop in -5.0..0.3_f64, volume in 50.0..10_000.0_f64, node in 1e5..1.2e6_f64, set in 1e5..1.2e6_f64,
            drawn in -0.05..0.1_f64, span in prop::sample::select(vec![1.25e-5, 1e-4, 1e-3]),
        ) {
            let effect = effect(10_f64.powf(droop), volume);
            let after = effect.advance(node, set, drawn, span);
            let goal = effect.node.and_then(|node| node.equilibrium(set, -drawn)).unwrap_or(node / 2.0);
            prop_assert!(after > 0.0 && (node.min(goal)..=node.max(goal)).contains(&after));
        }
    }
}
