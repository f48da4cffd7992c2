//! position-sensor-lag: the position sensor is a first-order lag.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionSensorLag {
    /// Time constant.
    pub(crate) time_constant_s: f64,
}

impl Effect for PositionSensorLag {
    const SHEET: Sheet = Sheet {
        name: "position-sensor-lag",
        group: Group::Sensor,
        place: PlaceKind::Axis,
        law: "the position sensor is a first-order lag",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "time_constant_ms",
            unit: Unit::Millisecond,
            min: 0.0,
            max: 20.0,
            drawn: [0.5, 8.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "time constant",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PositionSensorLag { time_constant_s: numbers[0] }
    }
}
