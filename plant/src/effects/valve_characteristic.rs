//! valve-characteristic: the K_V tables are bent over the opening, or supply and exhaust edges stand in another ratio.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValveCharacteristic {
    /// C of K_V(o + 2 c o (1 - o)): more passes at half opening if positive.
    pub(crate) bend: f64,
    /// R: supply edges times 1 + r/2, exhaust edges times 1 - r/2.
    pub(crate) edge_ratio: f64,
}

impl Effect for ValveCharacteristic {
    const SHEET: Sheet = Sheet {
        name: "valve-characteristic",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the K_V tables are bent over the opening, or supply and exhaust edges stand in another ratio",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "bend_percent",
            unit: Unit::Percent,
            min: -40.0,
            max: 40.0,
            drawn: [5.0, 25.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "c of K_V(o + 2 c o (1 - o)): more passes at half opening if positive",
        },
        EffectKey {
            name: "edge_ratio_percent",
            unit: Unit::Percent,
            min: -40.0,
            max: 40.0,
            drawn: [5.0, 25.0],
            signed: true,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "r: supply edges times 1 + r/2, exhaust edges times 1 - r/2",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ValveCharacteristic { bend: numbers[0], edge_ratio: numbers[1] }
    }
}
