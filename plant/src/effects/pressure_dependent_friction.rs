//! pressure-dependent-friction: friction grows with the sum of the gauge pressures that press the seals on.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PressureDependentFriction {
    /// Friction force per bar of the sum.
    pub(crate) slope_n_per_pa: f64,
}

impl Effect for PressureDependentFriction {
    const SHEET: Sheet = Sheet {
        name: "pressure-dependent-friction",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "friction grows with the sum of the gauge pressures that press the seals on",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "slope_n_per_bar",
            unit: Unit::NewtonPerBar,
            min: 0.0,
            max: 20.0,
            drawn: [0.2, 10.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "friction force per bar of the sum",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PressureDependentFriction { slope_n_per_pa: numbers[0] }
    }
}
