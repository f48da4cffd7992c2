//! coupling-compliance: stiffness and damping of the linkage differ from the file.
//!
//! ```text
//! F_c = k' e + c' dd/dt, never pulling          stiffness term = k' - k          damping term = c' - c
//! ```
//!
//! k' stiffness, N/m, > 0; c' damping, N s/m, >= 0; k, c those of the file; e how far beyond the gap, dd/dt speed at which
//! the rods part. The terms are what the numbers have above the file's, in their units: they replace, they do not add a
//! spring.
//!
//! Valid as the baseline's contact is: linear, below the forces that deform for good. The contact is solved implicitly, so
//! that the stiffest joint needs no smaller step. No regularisation.
//!
//! Properties: baseline and terms together are the effect's own numbers, whatever the file says; the file's change nothing.
//!
//! Source: Kelvin-Voigt contact of rig-model.md, Masses and linkage; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Excitation, Group, ManualMeasurement, PlaceKind, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct CouplingCompliance {
        stiffness_n_per_m: EffectKey {
            name: "stiffness_n_per_m",
            unit: Unit::NewtonPerMetre,
            min: 10000.0,
            max: 10000000.0,
            drawn: [100000.0, 10000000.0],
            neutral: Some(2e6),
            meaning: "k', in place of linkage.stiffness_n_per_m",
            ..EffectKey::USUAL
        },
        damping_n_s_per_m: EffectKey {
            name: "damping_n_s_per_m",
            unit: Unit::NewtonSecondPerMetre,
            max: 10000.0,
            drawn: [500.0, 5000.0],
            default: Some(2e3),
            neutral: Some(2e3),
            meaning: "c', in place of linkage.damping_n_s_per_m",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for CouplingCompliance {
    const SHEET: Sheet = Sheet {
        name: "coupling-compliance",
        group: Group::Motion,
        place: PlaceKind::Linkage,
        law: "stiffness and damping of the linkage differ from the file",
        source: "rig-model.md, Masses and linkage; range: effects.md, textbook prior",
        // Damping alone absorbs the errors of the start states.
        defined_by_first: true,
        excited_by: Excitation::LinkedRods,
        distinguished_by: &[ManualMeasurement::Uncoupling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl CouplingCompliance {
    /// What the stiffness has above the file's, both N/m.
    pub(crate) fn stiffness_term(&self, baseline: f64) -> f64 {
        self.stiffness_n_per_m - baseline
    }

    /// What the damping has above the file's, both N s/m.
    pub(crate) fn damping_term(&self, baseline: f64) -> f64 {
        self.damping_n_s_per_m - baseline
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn it_replaces_the_numbers_of_any_file() {
        let effect = CouplingCompliance { stiffness_n_per_m: 3e5, damping_n_s_per_m: 700.0 };
        for (stiffness, damping) in [(2e6, 2e3), (1e4, 0.0), (1e7, 1e4)] {
            // Whole numbers: no rounding.
            assert_eq!(stiffness + effect.stiffness_term(stiffness), 3e5);
            assert_eq!(damping + effect.damping_term(damping), 700.0);
        }
    }

    #[test]
    fn the_neutral_values_are_the_shipped_files_and_change_nothing() {
        let rig = RigParameters::baseline();
        let neutral =
            CouplingCompliance::SHEET.keys.iter().map(|key| key.unit.to_si(key.neutral.expect("has one")));
        let neutral: Vec<f64> = neutral.collect();
        assert_eq!(neutral, [rig.linkage().stiffness_n_per_m, rig.linkage().damping_n_s_per_m]);
        let effect = CouplingCompliance::new(&neutral, &rig);
        assert_eq!(effect.stiffness_term(rig.linkage().stiffness_n_per_m), 0.0);
        assert_eq!(effect.damping_term(rig.linkage().damping_n_s_per_m), 0.0);
    }
}
