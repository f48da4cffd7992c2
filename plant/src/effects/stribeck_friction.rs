//! stribeck-friction: sliding friction falls from the break-away force to its level as the speed grows.
//!
//! ```text
//! F(v) = F_sli + (F_stat - F_sli) exp(-(|v| / v_s)^d)            term = (F_stat - F_sli) exp(-(|v| / v_s)^d)
//! ```
//!
//! |v| speed of the rod, m/s, >= 0; v_s Stribeck velocity, m/s, > 0; d exponent, 0.5 to 3 (2 is a Gaussian, 1 an exponential);
//! F_stat, F_sli break-away force and sliding friction of the rig file, N. The term is a level, N, >= 0; its sign is that of
//! the motion. Viscous friction stays beside it.
//!
//! Valid for steady and slowly changing speeds: the film between seal and bore follows a change of speed with a lag that this
//! law has not. No regularisation: at rest the level is the break-away force, so that breaking away no longer jumps.
//!
//! Properties: F_stat at rest; never rises with the speed; gone far above v_s; nothing when F_stat = F_sli.
//!
//! Source: Armstrong-Helouvry, Dupont, Canudas de Wit, "A survey of models, analysis tools and compensation methods for the
//! control of machines with friction", Automatica 30(7), 1994, with d = 1 and 2 in use; range of v_s: textbook prior.

use super::sheet::{Effect, EffectKey, Excitation, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        velocity_m_per_s: EffectKey {
            name: "velocity_mm_per_s",
            unit: Unit::MillimetrePerSecond,
            min: 0.01,
            max: 200.0,
            drawn: [2.0, 50.0],
            meaning: "v_s, Stribeck velocity",
            ..EffectKey::USUAL
        },
        exponent: EffectKey {
            name: "exponent",
            unit: Unit::One,
            min: 0.5,
            max: 3.0,
            drawn: [0.8, 2.0],
            signed: false,
            default: Some(2.0),
            neutral: None,
            meaning: "d, how sharply it falls: 1 exponential, 2 Gaussian",
        },
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StribeckFriction {
    numbers: Numbers,
    /// F_stat - F_sli of the rig.
    pub(crate) excess_n: f64,
}

impl Effect for StribeckFriction {
    const SHEET: Sheet = Sheet {
        name: "stribeck-friction",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "sliding friction falls from the break-away force to its level as the speed grows",
        source: "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); range: effects.md, textbook prior",
        nonlinear_in_amplitude: true,
        excited_by: Excitation::Creeping,
        distinguished_by: &[ManualMeasurement::Pulling],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        let friction = rig.friction();
        StribeckFriction {
            numbers: Numbers::of(numbers),
            excess_n: friction.break_away_force_n - friction.sliding_force_n,
        }
    }
}

impl StribeckFriction {
    /// What sliding friction has above its level at this speed, m/s, not negative; N.
    pub(crate) fn term(&self, speed_m_per_s: f64) -> f64 {
        if speed_m_per_s == 0.0 {
            return self.excess_n;
        }
        let Numbers { velocity_m_per_s, exponent } = self.numbers;
        self.excess_n * libm::exp(-libm::pow(speed_m_per_s / velocity_m_per_s, exponent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stribeck(velocity_m_per_s: f64, exponent: f64) -> StribeckFriction {
        StribeckFriction::new(&[velocity_m_per_s, exponent], &RigParameters::baseline())
    }

    #[test]
    fn it_is_the_break_away_force_at_rest_and_gone_far_above_the_stribeck_velocity() {
        for exponent in [0.5, 1.0, 2.0, 3.0] {
            assert_eq!(stribeck(0.01, exponent).term(0.0), 35.0 - 26.0);
        }
        assert_eq!(stribeck(0.01, 2.0).term(3.0), 0.0);
        assert_eq!(stribeck(1e-5, 3.0).term(f64::MAX), 0.0, "no overflow on the way to 0");
    }

    #[test]
    fn a_stribeck_velocity_leaves_one_part_in_e() {
        for exponent in [0.5, 2.0, 3.0] {
            // Roundings of one product and one exponential.
            assert!((stribeck(0.02, exponent).term(0.02) - 9.0 / std::f64::consts::E).abs() < 1e-14);
        }
    }

    #[test]
    fn equal_levels_leave_nothing() {
        let rig = RigParameters::baseline().with("friction.sliding_force_n", &[35.0]).expect("allowed");
        assert_eq!(StribeckFriction::new(&[0.01, 2.0], &rig).term(0.005), 0.0);
    }

    proptest! {
        #[test]
        fn it_never_rises_with_the_speed(
            velocity in 1e-5..0.2_f64,
            exponent in 0.5..3.0_f64,
            slow in 0.0..3.0_f64,
            more in 0.0..1.0_f64,
        ) {
            let effect = stribeck(velocity, exponent);
            // One rounding of 9 N.
            prop_assert!(effect.term(slow + more) <= effect.term(slow) + 2e-15);
            prop_assert!(effect.term(slow) >= 0.0);
        }
    }
}
