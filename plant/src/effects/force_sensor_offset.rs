//! force-sensor-offset: the force sensor reads too much by a constant.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ForceSensorOffset {
    /// What it reads too much.
    pub(crate) offset_n: f64,
}

impl Effect for ForceSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "force-sensor-offset",
        group: Group::Sensor,
        place: PlaceKind::Axis,
        law: "the force sensor reads too much by a constant",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "offset_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [1.0, 20.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ForceSensorOffset { offset_n: numbers[0] }
    }
}
