//! inclination: a constant force along x: gravity on an inclined axis, a hanging load.
//!
//! ```text
//! term = F_g            (m g sin of the angle, for an axis that is not level)
//! ```
//!
//! F_g force in +x of the rig, N, either sign: on the drive along its extension, on the load against it (the load faces the
//! drive). Acts always, at rest too, whatever position and velocity. No regularisation.
//!
//! It does not grow with added weights: the file holds a force, not an angle, because only the force can be distinguished from a
//! record.
//!
//! Properties: a constant of either sign; 0 changes nothing.
//!
//! Source: Newton's second law; range: effects.md, textbook prior (5 kg at 45 degrees are 35 N, added weights more).

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct Inclination {
        force_n: EffectKey {
            name: "force_n",
            unit: Unit::Newton,
            min: -200.0,
            max: 200.0,
            drawn: [2.0, 50.0],
            signed: true,
            meaning: "F_g, force in +x of the rig",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for Inclination {
    const SHEET: Sheet = Sheet {
        name: "inclination",
        group: Group::Motion,
        laws: &[Law::Force],
        law: "a constant force along x: gravity on an inclined axis, a hanging load",
        source: "gravity along the axis; range: effects.md, textbook prior",
        distinguished_by: &[ManualMeasurement::Tilting, ManualMeasurement::KnownWeight],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn it_is_a_constant_of_either_sign() {
        for force in [-50.0, 0.0, 12.5] {
            assert_eq!(Inclination::new(&[force], &RigParameters::baseline()).force_n, force);
        }
    }
}
