//! valve-offset: the spool's null lies beside the command's.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValveOffset {
    /// U_0, of full command.
    pub(crate) offset: f64,
}

impl Effect for ValveOffset {
    const SHEET: Sheet = Sheet {
        name: "valve-offset",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the spool's null lies beside the command's",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "offset_percent",
            unit: Unit::Percent,
            min: -10.0,
            max: 10.0,
            drawn: [0.5, 3.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "u_0, of full command",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ValveOffset { offset: numbers[0] }
    }
}
