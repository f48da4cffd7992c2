//! position-dependent-friction: friction has a bump, a slope or a ripple over the stroke and flips with the velocity.
//!
//! ```text
//! term = F_b exp(-((xi - c) / w)^2) + F_s (xi - L/2) / (L/2) + F_r sin(2 pi xi / P)
//! ```
//!
//! | symbol | what | unit | domain, sign |
//! |---|---|---|---|
//! | xi | the rod's own extension | m | 0 to L |
//! | F_b, c, w | height, centre and half-width at 1/e of a bump (scored bore, dent) | N, m, m | w > 0 |
//! | F_s | growth from mid-stroke to the rod fully out (conical bore, side load) | N | either sign |
//! | F_r, P | amplitude and period of a ripple (guide, pitch of a machined surface) | N, m | P > 0 |
//! | L | stroke | m | > 0 |
//!
//! The term is a level of sliding friction and of the break-away force, N; the force has the sign of the motion, which is
//! what tells it from position-dependent-force. Valid between the ends. A negative term may exceed the level it is added to:
//! the sum of the levels is cut at 0 where it is made. No regularisation: smooth.
//!
//! Properties: the bump is highest at its centre and e times less at its width; the slope is odd about mid-stroke; the ripple
//! repeats; each part stands alone; zeros change nothing.
//!
//! Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7), on friction that depends on position; shapes
//! and range: effects.md, textbook prior.

use super::over_stroke::{Ripple, line};
use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        bump_n: EffectKey {
            name: "bump_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 40.0],
            meaning: "F_b, height of the bump",
            ..EffectKey::USUAL
        },
        centre_m: EffectKey {
            name: "centre_mm",
            unit: Unit::Millimetre,
            max: 500.0,
            drawn: [100.0, 400.0],
            default: Some(250.0),
            neutral: None,
            meaning: "c, extension at which the bump is highest",
            ..EffectKey::USUAL
        },
        width_m: EffectKey {
            name: "width_mm",
            unit: Unit::Millimetre,
            min: 5.0,
            max: 500.0,
            drawn: [30.0, 120.0],
            signed: false,
            default: Some(60.0),
            neutral: None,
            meaning: "w, half-width of the bump at 1/e",
        },
        slope_n: EffectKey {
            name: "slope_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 40.0],
            signed: true,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "F_s, growth from mid-stroke to the rod fully out",
        },
        ripple_n: EffectKey {
            name: "ripple_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 20.0],
            default: Some(0.0),
            meaning: "F_r, amplitude of the ripple",
            ..EffectKey::USUAL
        },
        pitch_m: Ripple::PITCH,
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionDependentFriction {
    numbers: Numbers,
    /// L/2 of the rig.
    pub(crate) half_stroke_m: f64,
}

impl Effect for PositionDependentFriction {
    const SHEET: Sheet = Sheet {
        name: "position-dependent-friction",
        group: Group::Motion,
        laws: &[Law::Friction],
        law: "friction has a bump, a slope or a ripple over the stroke and flips with the velocity",
        source: "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Automatica 30(7); shapes and range: effects.md, textbook prior",
        // A bump elsewhere does not resemble the one in the middle.
        also_screened: &[-0.45, 0.45],
        distinguished_by: &[ManualMeasurement::Pulling],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        PositionDependentFriction {
            numbers: Numbers::of(numbers),
            half_stroke_m: rig.cylinder().stroke_m / 2.0,
        }
    }
}

impl PositionDependentFriction {
    /// What the levels of friction have above their baseline at this extension, m; N.
    pub(crate) fn term(&self, extension_m: f64) -> f64 {
        let Numbers { bump_n, centre_m, width_m, slope_n, ripple_n, pitch_m } = self.numbers;
        let from_bump = (extension_m - centre_m) / width_m;
        let bump_n = bump_n * libm::exp(-from_bump * from_bump);
        let ripple = Ripple { amplitude_n: ripple_n, pitch_m };
        bump_n + slope_n * line(self.half_stroke_m, extension_m) + ripple.at(extension_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Bump, slope and ripple of these forces, N; centre 200 mm, width 60 mm, pitch 50 mm.
    fn of([bump, slope, ripple]: [f64; 3]) -> PositionDependentFriction {
        PositionDependentFriction::new(&[bump, 0.2, 0.06, slope, ripple, 0.05], &RigParameters::baseline())
    }

    #[test]
    fn the_bump_is_highest_at_its_centre_and_a_part_in_e_at_its_width() {
        let bump = of([10.0, 0.0, 0.0]);
        assert_eq!(bump.term(0.2), 10.0);
        for side in [0.14, 0.26] {
            // 1e-16 of 0.2 m is 4e-15 of 60 mm: some roundings of 10 N.
            assert!((bump.term(side) - 10.0 / std::f64::consts::E).abs() < 1e-13);
        }
        assert!(bump.term(0.5) < 1e-9);
    }

    #[test]
    fn the_slope_is_odd_about_mid_stroke() {
        let slope = of([0.0, 8.0, 0.0]);
        assert_eq!([0.0, 0.25, 0.5].map(|x| slope.term(x)), [-8.0, 0.0, 8.0]);
    }

    #[test]
    fn the_ripple_repeats_after_its_pitch() {
        let ripple = of([0.0, 0.0, 5.0]);
        // Roundings of an angle of 30 rad.
        assert!((ripple.term(0.0125) - 5.0).abs() < 1e-13);
        assert!((ripple.term(0.2125) - 5.0).abs() < 1e-13);
        assert!(ripple.term(0.225).abs() < 1e-13);
    }

    proptest! {
        #[test]
        fn each_part_stands_alone(bump in 0.0..40.0_f64, slope in -40.0..40.0_f64, ripple in 0.0..20.0_f64, x in 0.0..0.5_f64) {
            let parts = [[bump, 0.0, 0.0], [0.0, slope, 0.0], [0.0, 0.0, ripple]].map(|part| of(part).term(x));
            // Roundings of 100 N.
            prop_assert!((of([bump, slope, ripple]).term(x) - parts.iter().sum::<f64>()).abs() < 1e-13);
            prop_assert_eq!(of([0.0; 3]).term(x), 0.0);
        }
    }
}
