//! friction-asymmetry: sliding friction, break-away force and viscous friction differ with the direction.
//!
//! ```text
//! F_sli, F_stat, b  times  1 + a extending,  1 - a retracting            term = direction a baseline
//! ```
//!
//! a asymmetry, share, -0.9 to 0.9, positive brakes more as the rod extends; direction +1 extending, -1 retracting; baseline
//! the level of the rig file (N, or N s/m for b), and the term in the same unit.
//!
//! Valid for lip seals, which bear on one side, and for rods pressed on their guide; outside +-0.9 a level would be nearly
//! gone. No regularisation: which direction counts is decided at standstill by the force that pulls.
//!
//! Properties: the mean of both directions is the baseline's; changing the direction flips the term; no level turns negative.
//!
//! Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); viscous friction that differs with the
//! direction was found on the EMPS axis [Janot, Gautier, Brunot 2019]; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct FrictionAsymmetry {
        asymmetry: EffectKey {
            name: "asymmetry_percent",
            unit: Unit::Percent,
            min: -90.0,
            max: 90.0,
            drawn: [5.0, 60.0],
            signed: true,
            meaning: "a: times 1 + a as the rod extends, times 1 - a as it retracts",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for FrictionAsymmetry {
    const SHEET: Sheet = Sheet {
        name: "friction-asymmetry",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "sliding, break-away and viscous friction differ with the direction",
        source: "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); range: effects.md, textbook prior",
        distinguished_by: &[ManualMeasurement::Tilting, ManualMeasurement::Pulling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl FrictionAsymmetry {
    /// What a level has in a direction (+1 extending, -1 retracting) above its baseline, in the baseline's unit.
    pub(crate) fn term(&self, baseline: f64, direction: f64) -> f64 {
        direction * self.asymmetry * baseline
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn asymmetry(asymmetry: f64) -> FrictionAsymmetry {
        FrictionAsymmetry { asymmetry }
    }

    #[test]
    fn the_mean_of_both_directions_is_the_baseline() {
        let [out, back] = [1.0, -1.0].map(|direction| asymmetry(0.3).term(26.0, direction));
        assert_eq!(out + back, 0.0);
        assert!((26.0 + out - 1.3 * 26.0).abs() < 1e-14, "roundings of 34 N");
    }

    #[test]
    fn no_level_turns_negative_over_the_range() {
        let key = FrictionAsymmetry::SHEET.keys[0];
        for percent in [key.min, key.max] {
            for direction in [1.0, -1.0] {
                assert!(1100.0 + asymmetry(key.unit.to_si(percent)).term(1100.0, direction) > 0.0);
            }
        }
    }

    #[test]
    fn zero_changes_nothing() {
        assert_eq!(asymmetry(0.0).term(35.0, 1.0), 0.0);
    }
}
