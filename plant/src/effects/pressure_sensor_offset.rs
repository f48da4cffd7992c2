//! pressure-sensor-offset: the pressure sensor reads too much by a constant.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PressureSensorOffset {
    /// What it reads too much.
    pub(crate) offset_pa: f64,
}

impl Effect for PressureSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-offset",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        law: "the pressure sensor reads too much by a constant",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "offset_mbar",
            unit: Unit::Millibar,
            min: -500.0,
            max: 500.0,
            drawn: [10.0, 100.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PressureSensorOffset { offset_pa: numbers[0] }
    }
}
