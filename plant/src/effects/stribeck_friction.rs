//! stribeck-friction: sliding friction falls from the break-away force to its level as the speed grows.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StribeckFriction {
    /// V_s, Stribeck velocity.
    pub(crate) velocity_m_per_s: f64,
    /// D.
    pub(crate) exponent: f64,
}

impl Effect for StribeckFriction {
    const SHEET: Sheet = Sheet {
        name: "stribeck-friction",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "sliding friction falls from the break-away force to its level as the speed grows",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "velocity_mm_per_s",
            unit: Unit::MillimetrePerSecond,
            min: 0.01,
            max: 200.0,
            drawn: [2.0, 50.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "v_s, Stribeck velocity",
        },
        EffectKey {
            name: "exponent",
            unit: Unit::One,
            min: 0.5,
            max: 3.0,
            drawn: [0.8, 2.0],
            signed: false,
            default: Some(2.0),
            neutral: None,
            meaning: "d",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        StribeckFriction { velocity_m_per_s: numbers[0], exponent: numbers[1] }
    }
}
