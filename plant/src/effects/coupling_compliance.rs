//! coupling-compliance: stiffness and damping of the linkage differ from the file.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CouplingCompliance {
    /// K, in place of linkage.stiffness_n_per_m.
    pub(crate) stiffness_n_per_m: f64,
    /// C, in place of linkage.damping_n_s_per_m.
    pub(crate) damping_n_s_per_m: f64,
}

impl Effect for CouplingCompliance {
    const SHEET: Sheet = Sheet {
        name: "coupling-compliance",
        group: Group::Motion,
        place: PlaceKind::Linkage,
        law: "stiffness and damping of the linkage differ from the file",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 10000.0,
            max: 10000000.0,
            drawn: [100000.0, 10000000.0],
            signed: false,
            default: None,
            neutral: Some(2e6),
            meaning: "k, in place of linkage.stiffness_n_per_m",
        },
        EffectKey {
            name: "damping_n_s_per_m",
            unit: Unit::NewtonSecondPerMetre,
            min: 0.0,
            max: 10000.0,
            drawn: [500.0, 5000.0],
            signed: false,
            default: Some(2e3),
            neutral: Some(2e3),
            meaning: "c, in place of linkage.damping_n_s_per_m",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        CouplingCompliance { stiffness_n_per_m: numbers[0], damping_n_s_per_m: numbers[1] }
    }
}
