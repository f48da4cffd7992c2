//! valve-hysteresis: a play of half-width h lies between command and spool.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValveHysteresis {
    /// H, of full command.
    pub(crate) half_width: f64,
}

impl Effect for ValveHysteresis {
    const SHEET: Sheet = Sheet {
        name: "valve-hysteresis",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "a play of half-width h lies between command and spool",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "half_width_percent",
            unit: Unit::Percent,
            min: 0.0,
            max: 10.0,
            drawn: [0.2, 3.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "h, of full command",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ValveHysteresis { half_width: numbers[0] }
    }
}
