//! inclination: a constant force along x: gravity on an inclined axis, a hanging load.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inclination {
    /// Force in +x of the rig.
    pub(crate) force_n: f64,
}

impl Effect for Inclination {
    const SHEET: Sheet = Sheet {
        name: "inclination",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "a constant force along x: gravity on an inclined axis, a hanging load",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "force_n",
            unit: Unit::Newton,
            min: -200.0,
            max: 200.0,
            drawn: [2.0, 50.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "force in +x of the rig",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Inclination { force_n: numbers[0] }
    }
}
