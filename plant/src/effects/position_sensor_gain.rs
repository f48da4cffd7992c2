//! position-sensor-gain: the position sensor reads too much by a share.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionSensorGain {
    /// What it reads too much, of the position.
    pub(crate) gain: f64,
}

impl Effect for PositionSensorGain {
    const SHEET: Sheet = Sheet {
        name: "position-sensor-gain",
        group: Group::Sensor,
        place: PlaceKind::Axis,
        law: "the position sensor reads too much by a share",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -5.0,
            max: 5.0,
            drawn: [0.1, 1.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much, of the position",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PositionSensorGain { gain: numbers[0] }
    }
}
