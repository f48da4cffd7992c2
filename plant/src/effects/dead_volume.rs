//! dead-volume: dead volume and hose of the axis' chambers differ from the file.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DeadVolume {
    /// V_0 of each chamber, in place of cylinder.dead_volume_cm3.
    pub(crate) volume_m3: f64,
}

impl Effect for DeadVolume {
    const SHEET: Sheet = Sheet {
        name: "dead-volume",
        group: Group::Chamber,
        place: PlaceKind::Axis,
        law: "dead volume and hose of the axis' chambers differ from the file",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 5.0,
            max: 200.0,
            drawn: [5.0, 60.0],
            signed: false,
            default: None,
            neutral: Some(20.0),
            meaning: "V_0 of each chamber, in place of cylinder.dead_volume_cm3",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        DeadVolume { volume_m3: numbers[0] }
    }
}
