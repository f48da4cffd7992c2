//! line-delay: what passes the valve reaches the chambers one acoustic travel time later.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LineDelay {
    /// Length of each line between valve and chamber; 2.9 ms per metre.
    pub(crate) length_m: f64,
}

impl Effect for LineDelay {
    const SHEET: Sheet = Sheet {
        name: "line-delay",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "what passes the valve reaches the chambers one acoustic travel time later",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "length_m",
            unit: Unit::Metre,
            min: 0.0,
            max: 5.0,
            drawn: [0.5, 4.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "length of each line between valve and chamber; 2.9 ms per metre",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        LineDelay { length_m: numbers[0] }
    }
}
