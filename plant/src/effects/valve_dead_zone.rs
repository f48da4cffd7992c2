//! valve-dead-zone: the spool overlaps its edges: nothing opens below d, and the rest of the way is stretched.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValveDeadZone {
    /// D, of full opening, beside the tables' own dead band.
    pub(crate) dead_zone: f64,
}

impl Effect for ValveDeadZone {
    const SHEET: Sheet = Sheet {
        name: "valve-dead-zone",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the spool overlaps its edges: nothing opens below d, and the rest of the way is stretched",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "dead_zone_percent",
            unit: Unit::Percent,
            min: 0.0,
            max: 20.0,
            drawn: [0.5, 5.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "d, of full opening, beside the tables' own dead band",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ValveDeadZone { dead_zone: numbers[0] }
    }
}
