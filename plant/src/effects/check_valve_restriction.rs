//! check-valve-restriction: a non-return valve at each chamber port needs a pressure to crack and restricts as a second orifice.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CheckValveRestriction {
    /// Pressure difference below which the port stays shut, either way.
    pub(crate) cracking_pa: f64,
    /// K_V of the orifice in series; 100 is practically none.
    pub(crate) orifice_kv_m3_per_h: f64,
}

impl Effect for CheckValveRestriction {
    const SHEET: Sheet = Sheet {
        name: "check-valve-restriction",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "a non-return valve at each chamber port needs a pressure to crack and restricts as a second orifice",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "cracking_pressure_bar",
            unit: Unit::Bar,
            min: 0.0,
            max: 1.0,
            drawn: [0.05, 0.5],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "pressure difference below which the port stays shut, either way",
        },
        EffectKey {
            name: "orifice_kv_m3_per_h",
            unit: Unit::CubicMetrePerHour,
            min: 0.2,
            max: 100.0,
            drawn: [0.6, 3.0],
            signed: false,
            default: Some(100.0),
            neutral: Some(100.0),
            meaning: "K_V of the orifice in series; 100 is practically none",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        CheckValveRestriction { cracking_pa: numbers[0], orifice_kv_m3_per_h: numbers[1] }
    }
}
