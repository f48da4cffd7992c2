//! presliding: bristles: before it breaks away the piston moves elastically.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Presliding {
    /// S_0, stiffness of the bristles.
    pub(crate) stiffness_n_per_m: f64,
}

impl Effect for Presliding {
    const SHEET: Sheet = Sheet {
        name: "presliding",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "bristles: before it breaks away the piston moves elastically",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 30000.0,
            max: 30000000.0,
            drawn: [100000.0, 10000000.0],
            signed: false,
            default: None,
            neutral: Some(f64::INFINITY),
            meaning: "s_0, stiffness of the bristles",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Presliding { stiffness_n_per_m: numbers[0] }
    }
}
