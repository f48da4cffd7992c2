//! friction-asymmetry: sliding, break-away and viscous friction differ with the direction.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrictionAsymmetry {
    /// A: times 1 + a as the rod extends, times 1 - a as it retracts.
    pub(crate) asymmetry: f64,
}

impl Effect for FrictionAsymmetry {
    const SHEET: Sheet = Sheet {
        name: "friction-asymmetry",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "sliding, break-away and viscous friction differ with the direction",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "asymmetry_percent",
            unit: Unit::Percent,
            min: -90.0,
            max: 90.0,
            drawn: [5.0, 60.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "a: times 1 + a as the rod extends, times 1 - a as it retracts",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        FrictionAsymmetry { asymmetry: numbers[0] }
    }
}
