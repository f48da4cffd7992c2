//! rod-leakage: laminar leakage to the atmosphere: past the rod seal out of b, past the cap's static seal out of a.
//!
//! ```text
//! q_out = k (p^2 - p_atm^2)        k = q_ref / ((6 bar)^2 - (1 bar)^2)        term: -q_out into the chamber
//! ```
//!
//! q_out normal flow out of the chamber, m^3/s, negative when the atmosphere enters; p chamber, p_atm atmosphere, absolute,
//! Pa, positive; q_ref leakage from 6 to 1 bar absolute, m^3/s, in [0, 50 Nl/min]. The gap is that of piston-leakage:
//! isothermal and viscous. Valid for sound and worn seals; a rod seal that lifts off with pressure or speed is none. No
//! regularisation: smooth.
//!
//! Properties: from high to low; 0 at atmospheric pressure; q_ref at the reference; q_ref = 0 adds nothing.
//!
//! Source: laminar gap flow of a gas, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7; range: textbook prior.

use super::laminar_gap::LaminarGap;
use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, PlaceKind, Sheet, effect_numbers};
use crate::parameters::RigParameters;

effect_numbers! {
    struct Numbers {
        leakage_m3_per_s: LaminarGap::KEY,
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RodLeakage {
    gap: LaminarGap,
}

impl Effect for RodLeakage {
    const SHEET: Sheet = Sheet {
        name: "rod-leakage",
        group: Group::Chamber,
        place: PlaceKind::Chamber,
        laws: &[Law::StoredAir],
        law: "laminar leakage to the atmosphere: past the rod seal out of b, past the cap's static seal out of a",
        source: "laminar gap flow, Beater 2007; range: textbook prior",
        distinguished_by: &[ManualMeasurement::LockedHold],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        RodLeakage { gap: LaminarGap::of(Numbers::of(numbers).leakage_m3_per_s) }
    }
}

impl RodLeakage {
    /// q_out, normal flow out of the chamber, m^3/s; pressures absolute, Pa.
    pub(crate) fn flow(&self, chamber_pa: f64, atmospheric_pa: f64) -> f64 {
        self.gap.flow(chamber_pa, atmospheric_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ATMOSPHERE_PA: f64 = 101_325.0;

    fn effect(leakage_m3_per_s: f64) -> RodLeakage {
        RodLeakage::new(&[leakage_m3_per_s], &RigParameters::baseline())
    }

    #[test]
    fn from_six_to_one_bar_it_is_the_given_leakage() {
        // Four roundings.
        assert!((effect(1e-4).flow(6e5, 1e5) - 1e-4).abs() < 1e-19);
    }

    proptest! {
        #[test]
        fn air_leaves_above_the_atmosphere_and_enters_below(leakage in 0.0..1e-3_f64, chamber in 1e4..1.2e6_f64) {
            let flow = effect(leakage).flow(chamber, ATMOSPHERE_PA);
            prop_assert!(flow * (chamber - ATMOSPHERE_PA) >= 0.0);
            prop_assert_eq!(effect(leakage).flow(ATMOSPHERE_PA, ATMOSPHERE_PA), 0.0);
            prop_assert_eq!(effect(0.0).flow(chamber, ATMOSPHERE_PA), 0.0);
        }
    }
}
