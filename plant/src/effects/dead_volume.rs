//! dead-volume: dead volume and hose of the axis' chambers differ from the file.
//!
//! ```text
//! V_0' = V_own        term = V_own - V_0
//! ```
//!
//! V_own dead volume of each chamber of the axis, m^3, in [5, 200] cm^3, hose and fittings included; V_0 that of the rig
//! file. It takes the file's place, so the chambers' volumes are V_own + A xi. Valid while the air in the hose has the
//! chamber's pressure. No regularisation: a constant.
//!
//! Properties: the sum is V_own whatever the file says; at the file's value nothing is added; it counts most near
//! the end of the stroke, where the chamber is small.
//!
//! Source: inactive volume at the ends of the stroke, Richer and Hurmuzlu 2000, part I, DOI 10.1115/1.1286336; range:
//! textbook prior.

use super::sheet::{Effect, EffectKey, Excitation, Group, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct DeadVolume {
        volume_m3: EffectKey {
            name: "volume_cm3",
            unit: Unit::CubicCentimetre,
            min: 5.0,
            max: 200.0,
            drawn: [5.0, 60.0],
            neutral: Some(20.0),
            meaning: "V_own of each chamber, in place of cylinder.dead_volume_cm3",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for DeadVolume {
    const SHEET: Sheet = Sheet {
        name: "dead-volume",
        group: Group::Chamber,
        law: "dead volume and hose of the axis' chambers differ from the file",
        source: "inactive volume, Richer and Hurmuzlu 2000, DOI 10.1115/1.1286336; range: textbook prior",
        excited_by: Excitation::NearEnd,
        distinguished_by: &[ManualMeasurement::ConstantVolume, ManualMeasurement::PressedEnds],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl DeadVolume {
    /// What is added to the file's dead volume, m^3.
    pub(crate) fn term(&self, file_m3: f64) -> f64 {
        self.volume_m3 - file_m3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_neutral_value_is_that_of_the_shipped_file() {
        let rig = RigParameters::baseline();
        let key = DeadVolume::SHEET.keys[0];
        let neutral = key.unit.to_si(key.neutral.expect("the file has one"));
        assert_eq!(neutral, rig.cylinder().dead_volume_m3);
        assert_eq!(DeadVolume::new(&[neutral], &rig).term(rig.cylinder().dead_volume_m3), 0.0);
    }

    #[test]
    fn the_sum_is_the_own_volume_whatever_the_file_says() {
        for file_m3 in [5e-6, 20e-6, 200e-6] {
            // The difference and the sum are rounded once each.
            assert!((file_m3 + DeadVolume { volume_m3: 37e-6 }.term(file_m3) - 37e-6).abs() < 1e-19);
        }
    }

    #[test]
    fn it_counts_most_near_the_end_of_the_stroke() {
        let rig = RigParameters::baseline();
        let (file_m3, area_m2) = (rig.cylinder().dead_volume_m3, rig.cylinder().piston_area_m2);
        let share = |extension_m: f64| {
            DeadVolume { volume_m3: 40e-6 }.term(file_m3) / (file_m3 + area_m2 * extension_m)
        };
        assert_eq!(share(0.0), 1.0);
        assert!(share(0.5) < 0.021);
    }
}
