//! position-sensor-offset: the position sensor reads too much by a constant.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionSensorOffset {
    /// What it reads too much, beside the load sensor's own offset.
    pub(crate) offset_m: f64,
}

impl Effect for PositionSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "position-sensor-offset",
        group: Group::Sensor,
        place: PlaceKind::Axis,
        law: "the position sensor reads too much by a constant",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "offset_mm",
            unit: Unit::Millimetre,
            min: -10.0,
            max: 10.0,
            drawn: [0.1, 2.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much, beside the load sensor's own offset",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PositionSensorOffset { offset_m: numbers[0] }
    }
}
