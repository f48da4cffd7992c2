//! pressure-dependent-friction: friction grows with the sum of the gauge pressures that press the seals on.
//!
//! ```text
//! term = c max(0, p_a + p_b - 2 p_atm)
//! ```
//!
//! p_a, p_b chamber pressures, Pa; c slope, N/Pa (N/bar in the file), >= 0. The term is a level, N, >= 0, of sliding friction
//! and of the break-away force alike; its sign is that of the motion.
//!
//! Valid for lip and O-ring seals of the piston, each pressed on by its chamber, at the pressures of a 6 bar supply. Seals
//! are not pulled off by less than the atmosphere: below a sum of 0 the term is 0, a corner that no running axis meets.
//!
//! Properties: nothing at atmosphere; linear in the sum; both chambers count alike; never negative.
//!
//! Source: growth of a pneumatic cylinder's friction with its pressures, measured: Tran, Yanada, "Dynamic friction behaviors
//! of pneumatic cylinders", Intelligent Control and Automation 4(2), 2013; linear form and range: effects.md, textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PressureDependentFriction {
        slope_n_per_pa: EffectKey {
            name: "slope_n_per_bar",
            unit: Unit::NewtonPerBar,
            max: 20.0,
            drawn: [0.2, 10.0],
            meaning: "c, friction force per bar of the sum",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PressureDependentFriction {
    const SHEET: Sheet = Sheet {
        name: "pressure-dependent-friction",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "friction grows with the sum of the gauge pressures that press the seals on",
        source: "Tran, Yanada 2013, Intelligent Control and Automation 4(2); linear form and range: effects.md, textbook prior",
        distinguished_by: &[ManualMeasurement::Pulling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl PressureDependentFriction {
    /// What the levels of friction have above their baseline under these gauge pressures, Pa; N.
    pub(crate) fn term(&self, gauge_a_pa: f64, gauge_b_pa: f64) -> f64 {
        self.slope_n_per_pa * (gauge_a_pa + gauge_b_pa).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(slope_n_per_bar: f64) -> PressureDependentFriction {
        PressureDependentFriction { slope_n_per_pa: slope_n_per_bar / 1e5 }
    }

    #[test]
    fn five_bar_of_two_newton_per_bar_are_ten_newton() {
        // Three roundings of 10 N.
        assert!((of(2.0).term(3e5, 2e5) - 10.0).abs() < 1e-14);
        assert_eq!(of(2.0).term(0.0, 0.0), 0.0);
        assert_eq!(of(0.0).term(6e5, 6e5), 0.0);
    }

    proptest! {
        #[test]
        fn both_chambers_count_alike_and_friction_is_never_negative(
            slope in 0.0..20.0_f64,
            a in -1e5..6e5_f64,
            b in -1e5..6e5_f64,
        ) {
            prop_assert_eq!(of(slope).term(a, b), of(slope).term(b, a));
            prop_assert!(of(slope).term(a, b) >= 0.0);
        }
    }
}
