//! pressure-sensor-gain: the pressure sensor reads too much by a share.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PressureSensorGain {
    /// What it reads too much, of the absolute pressure.
    pub(crate) gain: f64,
}

impl Effect for PressureSensorGain {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-gain",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        law: "the pressure sensor reads too much by a share",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -10.0,
            max: 10.0,
            drawn: [0.25, 2.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much, of the absolute pressure",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PressureSensorGain { gain: numbers[0] }
    }
}
