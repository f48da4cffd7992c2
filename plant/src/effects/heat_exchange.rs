//! heat-exchange: the gas of each chamber has its own temperature and exchanges heat with the wall.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HeatExchange {
    /// H, heat transfer coefficient to the wetted wall.
    pub(crate) coefficient_w_per_m2_k: f64,
}

impl Effect for HeatExchange {
    const SHEET: Sheet = Sheet {
        name: "heat-exchange",
        group: Group::Chamber,
        place: PlaceKind::Axis,
        law: "the gas of each chamber has its own temperature and exchanges heat with the wall",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "coefficient_w_per_m2_k",
            unit: Unit::WattPerSquareMetreKelvin,
            min: 1.0,
            max: 100000.0,
            drawn: [10.0, 150.0],
            signed: false,
            default: None,
            neutral: Some(f64::INFINITY),
            meaning: "h, heat transfer coefficient to the wetted wall",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        HeatExchange { coefficient_w_per_m2_k: numbers[0] }
    }
}
