//! piston-leakage: laminar leakage past the piston seal, from chamber to chamber.
//!
//! ```text
//! q_ab = k (p_a^2 - p_b^2)        k = q_ref / ((6 bar)^2 - (1 bar)^2)
//! terms: -q_ab into a, +q_ab into b
//! ```
//!
//! q_ab normal flow from a to b, m^3/s; p_a, p_b absolute, Pa, positive; q_ref leakage from 6 to 1 bar absolute, m^3/s, in
//! [0, 50 Nl/min]. Isothermal, viscous gas in a narrow gap: mean density times difference of pressures. Valid for a sound or
//! worn seal; a torn lip is an orifice, whose flow chokes. No regularisation: smooth everywhere.
//!
//! Properties: from high to low; what a loses b gains, to the bit; 0 at equal pressures; q_ref at the reference; q_ref = 0
//! adds nothing.
//!
//! Source: laminar gap flow of a gas, Beater, Pneumatic Drives, 2007, DOI 10.1007/978-3-540-69471-7; leakage between the
//! chambers also in Richer and Hurmuzlu 2000, DOI 10.1115/1.1286336; range: textbook prior.

use super::laminar_gap::LaminarGap;
use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;

effect_numbers! {
    struct Numbers {
        leakage_m3_per_s: LaminarGap::KEY,
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PistonLeakage {
    gap: LaminarGap,
}

impl Effect for PistonLeakage {
    const SHEET: Sheet = Sheet {
        name: "piston-leakage",
        group: Group::Chamber,
        laws: &[Law::StoredAir],
        law: "laminar leakage past the piston seal, from chamber to chamber",
        source: "laminar gap flow, Beater 2007; range: textbook prior",
        distinguished_by: &[ManualMeasurement::LockedHold],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PistonLeakage { gap: LaminarGap::of(Numbers::of(numbers).leakage_m3_per_s) }
    }
}

impl PistonLeakage {
    /// q_ab, normal flow from chamber a to chamber b, m^3/s; pressures absolute, Pa.
    pub(crate) fn flow(&self, pressure_a_pa: f64, pressure_b_pa: f64) -> f64 {
        self.gap.flow(pressure_a_pa, pressure_b_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn effect(leakage_m3_per_s: f64) -> PistonLeakage {
        PistonLeakage::new(&[leakage_m3_per_s], &RigParameters::baseline())
    }

    #[test]
    fn from_six_to_one_bar_it_is_the_given_leakage() {
        let leakage = PistonLeakage::SHEET.keys[0].unit.to_si(6.0);
        assert_eq!(leakage, 1e-4);
        // Four roundings.
        assert!((effect(leakage).flow(6e5, 1e5) - leakage).abs() < 1e-19);
    }

    proptest! {
        #[test]
        fn it_goes_from_high_to_low_and_one_loses_what_the_other_gains(
            leakage in 0.0..1e-3_f64, a in 1e4..1.2e6_f64, b in 1e4..1.2e6_f64,
        ) {
            let flow = effect(leakage).flow(a, b);
            prop_assert!(flow * (a - b) >= 0.0);
            prop_assert_eq!(flow, -effect(leakage).flow(b, a));
            prop_assert_eq!(effect(leakage).flow(a, a), 0.0);
            prop_assert_eq!(effect(0.0).flow(a, b), 0.0);
        }

        #[test]
        fn a_greater_difference_never_passes_less(a in 1e5..1.2e6_f64, b in 1e5..1.2e6_f64, more in 0.0..1e5_f64) {
            prop_assert!(effect(1e-4).flow(a + more, b) >= effect(1e-4).flow(a, b));
        }
    }
}
