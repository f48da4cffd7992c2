//! silencer-back-pressure: both exhausts of a cylinder end in one volume that vents through a silencer.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SilencerBackPressure {
    /// K_V of the silencer, in units of the exhaust edge's largest.
    pub(crate) kv_ratio: f64,
    /// Volume between the exhaust edges and the silencer.
    pub(crate) volume_m3: f64,
}

impl Effect for SilencerBackPressure {
    const SHEET: Sheet = Sheet {
        name: "silencer-back-pressure",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "both exhausts of a cylinder end in one volume that vents through a silencer",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "silencer_kv_ratio",
            unit: Unit::One,
            min: 0.1,
            max: 100.0,
            drawn: [0.3, 3.0],
            signed: false,
            default: None,
            neutral: Some(f64::INFINITY),
            meaning: "K_V of the silencer, in units of the exhaust edge's largest",
        },
        EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 5.0,
            max: 1000.0,
            drawn: [30.0, 100.0],
            signed: false,
            default: Some(60.0),
            neutral: None,
            meaning: "volume between the exhaust edges and the silencer",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        SilencerBackPressure { kv_ratio: numbers[0], volume_m3: numbers[1] }
    }
}
