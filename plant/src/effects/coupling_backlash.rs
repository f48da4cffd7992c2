//! coupling-backlash: the gap of the load's eye differs from the file.
//!
//! ```text
//! e = d -+ s/2 outside the gap, 0 inside, with s in place of linkage.gap_mm           term = s - gap
//! ```
//!
//! s gap in all, both sides together, m, >= 0; gap that of the file, m; d distance of the rods. The term is what the gap has
//! above the file's, m, either sign: it replaces the number, it does not add a second gap.
//!
//! Valid as the baseline's contact is: rigid sides, no wear within a run. Linking needs |d| <= s/2. No regularisation.
//!
//! Properties: baseline and term together are the effect's own gap, whatever the file says; the file's number changes
//! nothing.
//!
//! Source: rig-model.md, Masses and linkage, for the contact; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Excitation, Group, ManualMeasurement, PlaceKind, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct CouplingBacklash {
        gap_m: EffectKey {
            name: "gap_mm",
            unit: Unit::Millimetre,
            max: 5.0,
            drawn: [0.05, 2.0],
            neutral: Some(0.2),
            meaning: "s, gap in all, in place of linkage.gap_mm",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for CouplingBacklash {
    const SHEET: Sheet = Sheet {
        name: "coupling-backlash",
        group: Group::Motion,
        place: PlaceKind::Linkage,
        law: "the gap of the eye differs from the file",
        source: "rig-model.md, Masses and linkage; range: effects.md, textbook prior",
        moves_start_states: true,
        excited_by: Excitation::LinkedRods,
        distinguished_by: &[ManualMeasurement::Uncoupling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl CouplingBacklash {
    /// What the gap has above the file's, both m.
    pub(crate) fn term(&self, baseline: f64) -> f64 {
        self.gap_m - baseline
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn it_replaces_the_gap_of_any_file() {
        for file_m in [0.0, 2e-4, 5e-3] {
            let effect = CouplingBacklash { gap_m: 1e-3 };
            // One rounding of 5 mm.
            assert!((file_m + effect.term(file_m) - 1e-3).abs() < 1e-18);
        }
    }

    #[test]
    fn the_neutral_value_is_the_shipped_files_and_changes_nothing() {
        let rig = RigParameters::baseline();
        let key = CouplingBacklash::SHEET.keys[0];
        let neutral = key.unit.to_si(key.neutral.expect("has one"));
        assert_eq!(neutral, rig.linkage().gap_m);
        assert_eq!(CouplingBacklash::new(&[neutral], &rig).term(rig.linkage().gap_m), 0.0);
    }
}
