//! critical-pressure-ratio: an edge's flow is the ellipse of ISO 6358 with its own critical pressure ratio b instead of 0.5.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CriticalPressureRatio {
    /// B, the pressure ratio below which the flow is choked.
    pub(crate) critical_ratio: f64,
}

impl Effect for CriticalPressureRatio {
    const SHEET: Sheet = Sheet {
        name: "critical-pressure-ratio",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "an edge's flow is the ellipse of ISO 6358 with its own critical pressure ratio b instead of 0.5",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "critical_ratio",
            unit: Unit::One,
            min: 0.05,
            max: 0.6,
            drawn: [0.15, 0.45],
            signed: false,
            default: None,
            neutral: Some(0.5),
            meaning: "b, the pressure ratio below which the flow is choked",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        CriticalPressureRatio { critical_ratio: numbers[0] }
    }
}
