//! force-sensor-gain: the force sensor reads too much by a share.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ForceSensorGain {
    /// What it reads too much, of the force.
    pub(crate) gain: f64,
}

impl Effect for ForceSensorGain {
    const SHEET: Sheet = Sheet {
        name: "force-sensor-gain",
        group: Group::Sensor,
        place: PlaceKind::Axis,
        law: "the force sensor reads too much by a share",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -30.0,
            max: 30.0,
            drawn: [0.5, 8.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "what it reads too much, of the force",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ForceSensorGain { gain: numbers[0] }
    }
}
