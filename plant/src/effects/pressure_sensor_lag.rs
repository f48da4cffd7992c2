//! pressure-sensor-lag: the pressure sensor sits at the end of a sense line: a first-order lag.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PressureSensorLag {
    /// Time constant.
    pub(crate) time_constant_s: f64,
}

impl Effect for PressureSensorLag {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-lag",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        law: "the pressure sensor sits at the end of a sense line: a first-order lag",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "time_constant_ms",
            unit: Unit::Millisecond,
            min: 0.0,
            max: 20.0,
            drawn: [1.0, 10.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "time constant",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PressureSensorLag { time_constant_s: numbers[0] }
    }
}
