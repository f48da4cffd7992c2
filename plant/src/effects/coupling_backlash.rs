//! coupling-backlash: the gap of the eye differs from the file.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CouplingBacklash {
    /// Gap in all, in place of linkage.gap_mm.
    pub(crate) gap_m: f64,
}

impl Effect for CouplingBacklash {
    const SHEET: Sheet = Sheet {
        name: "coupling-backlash",
        group: Group::Motion,
        place: PlaceKind::Linkage,
        law: "the gap of the eye differs from the file",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "gap_mm",
            unit: Unit::Millimetre,
            min: 0.0,
            max: 5.0,
            drawn: [0.05, 2.0],
            signed: false,
            default: None,
            neutral: Some(0.2),
            meaning: "gap in all, in place of linkage.gap_mm",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        CouplingBacklash { gap_m: numbers[0] }
    }
}
