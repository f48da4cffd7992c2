//! rod-leakage: laminar leakage to the atmosphere: past the rod seal out of b, past the cap's static seal out of a.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RodLeakage {
    /// Flow from 6 bar to 1 bar absolute.
    pub(crate) leakage_m3_per_s: f64,
}

impl Effect for RodLeakage {
    const SHEET: Sheet = Sheet {
        name: "rod-leakage",
        group: Group::Chamber,
        place: PlaceKind::Chamber,
        law: "laminar leakage to the atmosphere: past the rod seal out of b, past the cap's static seal out of a",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "leakage_nl_per_min",
            unit: Unit::NormalLitrePerMinute,
            min: 0.0,
            max: 50.0,
            drawn: [0.2, 10.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "flow from 6 bar to 1 bar absolute",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        RodLeakage { leakage_m3_per_s: numbers[0] }
    }
}
