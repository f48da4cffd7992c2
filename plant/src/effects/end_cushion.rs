//! end-cushion: near both ends the chamber that is being emptied vents through a cushion orifice, and an elastic stop ends the stroke.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EndCushion {
    /// K_V of the cushion's orifice.
    pub(crate) cushion_kv_m3_per_h: f64,
    /// Length of the cushion before each end.
    pub(crate) length_m: f64,
    /// K_stop of the elastic stop over the last millimetre.
    pub(crate) stop_stiffness_n_per_m: f64,
}

impl Effect for EndCushion {
    const SHEET: Sheet = Sheet {
        name: "end-cushion",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "near both ends the chamber that is being emptied vents through a cushion orifice, and an elastic stop ends the stroke",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "cushion_kv_m3_per_h",
            unit: Unit::CubicMetrePerHour,
            min: 0.005,
            max: 100.0,
            drawn: [0.02, 0.3],
            signed: false,
            default: None,
            neutral: Some(f64::INFINITY),
            meaning: "K_V of the cushion's orifice",
        },
        EffectKey {
            name: "length_mm",
            unit: Unit::Millimetre,
            min: 1.0,
            max: 50.0,
            drawn: [10.0, 25.0],
            signed: false,
            default: Some(20.0),
            neutral: None,
            meaning: "length of the cushion before each end",
        },
        EffectKey {
            name: "stop_stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 10000.0,
            max: 5000000.0,
            drawn: [100000.0, 2000000.0],
            signed: false,
            default: Some(1e6),
            neutral: None,
            meaning: "k_stop of the elastic stop over the last millimetre",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        EndCushion { cushion_kv_m3_per_h: numbers[0], length_m: numbers[1], stop_stiffness_n_per_m: numbers[2] }
    }
}
