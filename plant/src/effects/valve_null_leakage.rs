//! valve-null-leakage: every edge keeps a floor of its largest K_V.
//!
//! ```text
//! K_V' = max(K_V, e K_V,max)        term = K_V' - K_V
//! ```
//!
//! K_V of an edge at its opening, not negative, in any unit; K_V,max its largest, in the same unit; e floor, in [0, 0.1]. All
//! four edges of the valve have it, so a shut valve joins supply and exhaust through both chambers, and holds them at one
//! level between. Valid for the radial clearance of a spool, whose leakage is hidden by the opening as soon as that is wider;
//! the path of the air is short, so eq. (4) serves. No regularisation: continuous, with one corner.
//!
//! Properties: never negative; nothing where the edge is open beyond the floor; no edge passes less than its floor; e = 0
//! adds nothing.
//!
//! Source: centre leakage of a spool with clearance, Merritt, Hydraulic Control Systems, 1967, chapter 5; range: textbook
//! prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ValveNullLeakage {
        share: EffectKey {
            name: "leakage_percent",
            unit: Unit::Percent,
            max: 10.0,
            drawn: [0.2, 2.0],
            meaning: "floor of each edge, of its own largest K_V",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ValveNullLeakage {
    const SHEET: Sheet = Sheet {
        name: "valve-null-leakage",
        group: Group::Flow,
        laws: &[Law::Air],
        law: "every edge keeps a floor of its largest K_V",
        source: "spool clearance, Merritt 1967 ch. 5; range: textbook prior",
        distinguished_by: &[ManualMeasurement::LockedHold],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl ValveNullLeakage {
    /// What is added to the K_V of one edge, in the unit of both.
    pub(crate) fn term(&self, kv: f64, kv_max: f64) -> f64 {
        kv.max(self.share * kv_max) - kv
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_shut_edge_passes_its_floor_and_an_open_one_what_it_did() {
        let effect = ValveNullLeakage { share: 0.02 };
        assert_eq!(effect.term(0.0, 0.5), 0.01);
        assert_eq!(effect.term(0.01, 0.5), 0.0);
        assert_eq!(effect.term(0.3, 0.5), 0.0);
    }

    proptest! {
        #[test]
        fn it_never_takes_away_and_leaves_no_edge_below_the_floor(
            share in 0.0..=0.1_f64, kv in 0.0..3.0_f64, more in 0.0..3.0_f64,
        ) {
            let (effect, kv_max) = (ValveNullLeakage { share }, kv + more);
            let term = effect.term(kv, kv_max);
            // The difference and the sum are rounded once each.
            prop_assert!(term >= 0.0 && kv + term >= share * kv_max * (1.0 - 3e-16));
            prop_assert_eq!(ValveNullLeakage { share: 0.0 }.term(kv, kv_max), 0.0);
        }
    }
}
