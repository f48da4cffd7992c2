//! valve-characteristic: the K_V tables are bent over the opening, or supply and exhaust edges stand in another ratio.
//!
//! ```text
//! w = o + 2 c o (1 - o)
//! K_V,supply'  = (1 + r/2) K_V,supply(w)
//! K_V,exhaust' = (1 - r/2) K_V,exhaust(w)        terms = K_V' - K_V(o)
//! ```
//!
//! o = |s| opening, in [0, 1]; c bend, in [-0.4, 0.4], positive passes more at half opening; r ratio of the edges, in [-0.4,
//! 0.4], positive favours the supply edges; K_V in any unit, that of the tables handed in.
//!
//! |c| <= 1/2 keeps w growing with o, so that a bent table still never falls, and within [0, 1]; the dead band of the tables
//! narrows or widens by the bend with them. A common factor on both edges is no effect but `parameter:kv-scale`. No
//! regularisation: the tables have the only corners.
//!
//! Properties: shut and full opening of the bend stay; no table falls; c = r = 0 adds nothing; with c = 0 the edges stand as
//! (1 + r/2) to (1 - r/2).
//!
//! Source: flow gain of a spool with shaped or round ports, Merritt, Hydraulic Control Systems, 1967, chapter 5; bend and
//! ratio are this catalogue's own shape; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ValveCharacteristic {
        bend: EffectKey {
            name: "bend_percent",
            unit: Unit::Percent,
            min: -40.0,
            max: 40.0,
            drawn: [5.0, 25.0],
            signed: true,
            meaning: "c of K_V(o + 2 c o (1 - o)): more passes at half opening if positive",
            ..EffectKey::USUAL
        },
        edge_ratio: EffectKey {
            name: "edge_ratio_percent",
            unit: Unit::Percent,
            min: -40.0,
            max: 40.0,
            drawn: [5.0, 25.0],
            signed: true,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "r: supply edges times 1 + r/2, exhaust edges times 1 - r/2",
        },
    }
}

impl Effect for ValveCharacteristic {
    const SHEET: Sheet = Sheet {
        name: "valve-characteristic",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "the K_V tables are bent over the opening, or supply and exhaust edges stand in another ratio",
        source: "spool port shapes, Merritt 1967 ch. 5; range: textbook prior",
        distinguished_by: &[ManualMeasurement::ConstantVolume],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl ValveCharacteristic {
    /// What is added to K_V of supply and exhaust edge at `opening` in [0, 1]; `kv` gives both from the tables.
    pub(crate) fn terms(&self, kv: impl Fn(f64) -> [f64; 2], opening: f64) -> [f64; 2] {
        let bent = opening + 2.0 * self.bend * opening * (1.0 - opening);
        let [supply, exhaust] = kv(bent.clamp(0.0, 1.0));
        let [supply_before, exhaust_before] = kv(opening);
        let half = self.edge_ratio / 2.0;
        [supply * (1.0 + half) - supply_before, exhaust * (1.0 - half) - exhaust_before]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Axes, Pair};
    use crate::valve::{FLOW_PER_KV, Valve};
    use proptest::prelude::*;

    /// The baseline's tables, m^3/h.
    fn tables() -> impl Fn(f64) -> [f64; 2] {
        let valve = Valve::new(RigParameters::baseline().valve());
        move |opening| {
            let edges = valve.edges(Pair::both(opening), 7e5, 1e5);
            if opening > 0.0 {
                [edges.conductance_a.drive() / FLOW_PER_KV, edges.conductance_b.drive() / FLOW_PER_KV]
            } else {
                [0.0, 0.0]
            }
        }
    }

    fn changed(effect: ValveCharacteristic, opening: f64) -> [f64; 2] {
        let (kv, terms) = (tables()(opening), effect.terms(tables(), opening));
        [kv[0] + terms[0], kv[1] + terms[1]]
    }

    #[test]
    fn without_bend_and_ratio_it_adds_nothing() {
        let effect = ValveCharacteristic { bend: 0.0, edge_ratio: 0.0 };
        for step in 0..=100 {
            assert_eq!(effect.terms(tables(), f64::from(step) / 100.0), [0.0, 0.0]);
        }
    }

    #[test]
    fn the_bend_keeps_shut_and_full_opening() {
        for bend in [-0.4, -0.1, 0.25, 0.4] {
            let effect = ValveCharacteristic { bend, edge_ratio: 0.0 };
            assert_eq!(effect.terms(tables(), 0.0), [0.0, 0.0]);
            assert_eq!(effect.terms(tables(), 1.0), [0.0, 0.0]);
        }
    }

    #[test]
    fn a_positive_bend_passes_more_at_half_opening_as_the_table_says() {
        let effect = ValveCharacteristic { bend: 0.2, edge_ratio: 0.0 };
        // w = 0.5 + 0.4 x 0.25 = 0.6: a third of the way from 0.36 to 0.60 and from 0.30 to 0.52; some roundings of 1.
        let [supply, exhaust] = changed(effect, 0.5);
        assert!((supply - 0.44).abs() < 1e-14 && (exhaust - (0.30 + 0.22 / 3.0)).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn no_table_falls_and_none_is_negative(
            bend in -0.4..=0.4_f64, ratio in -0.4..=0.4_f64, opening in 0.0..=0.99_f64, more in 0.0..0.01_f64,
        ) {
            let effect = ValveCharacteristic { bend, edge_ratio: ratio };
            let (small, large) = (changed(effect, opening), changed(effect, opening + more));
            for edge in 0..2 {
                // Sum and difference of the same table value: two roundings of numbers below 1.
                prop_assert!(small[edge] >= -1e-15 && large[edge] >= small[edge] - 1e-15);
            }
        }

        #[test]
        fn the_edges_stand_in_the_given_ratio(ratio in -0.4..=0.4_f64, opening in 0.04..=1.0_f64) {
            let kv = tables()(opening);
            let now = changed(ValveCharacteristic { bend: 0.0, edge_ratio: ratio }, opening);
            let expected = (1.0 + ratio / 2.0) / (1.0 - ratio / 2.0);
            // Two differences of numbers that differ by a factor of 1.2 at most.
            prop_assert!((now[0] / now[1] / (kv[0] / kv[1]) - expected).abs() < 1e-14);
        }
    }
}
