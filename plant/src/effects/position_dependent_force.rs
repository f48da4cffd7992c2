//! position-dependent-force: a force over x that does not flip with the velocity: hose or cable spring, cogging.
//!
//! ```text
//! term = -F_c (x - L/2) / (L/2) + F_r sin(2 pi x / P)
//! ```
//!
//! x position of the rig, m, 0 to L; L stroke, m; F_c force of the spring at x = 0, N, in +x, falling in a straight line to
//! -F_c at x = L (positive centres, negative drives apart); F_r, P amplitude, N, and period, m, of the cogging. The term is a
//! force in +x of the rig, N, also at rest.
//!
//! Valid between the ends; hoses and cable chains bend further out than they spring back in, which this law has not. No
//! regularisation: smooth.
//!
//! Properties: the same both ways, so a closed path gives back what it took; the spring is 0 at mid-stroke; the ripple
//! repeats; zeros change nothing.
//!
//! Source: Hooke's law for the spring; cogging as a sine of its pitch is usual for linear drives; both shapes and the range:
//! effects.md, textbook prior.

use super::over_stroke::{Ripple, line};
use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    struct Numbers {
        spring_n: EffectKey {
            name: "spring_n",
            unit: Unit::Newton,
            min: -200.0,
            max: 200.0,
            drawn: [2.0, 60.0],
            signed: true,
            meaning: "F_c, force at x = 0, falling in a straight line to its negative at the other end; positive centres",
            ..EffectKey::USUAL
        },
        ripple_n: EffectKey {
            name: "ripple_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 30.0],
            default: Some(0.0),
            meaning: "F_r, amplitude of the cogging",
            ..EffectKey::USUAL
        },
        pitch_m: Ripple::PITCH,
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionDependentForce {
    numbers: Numbers,
    /// L/2 of the rig.
    pub(crate) half_stroke_m: f64,
}

impl Effect for PositionDependentForce {
    const SHEET: Sheet = Sheet {
        name: "position-dependent-force",
        group: Group::Motion,
        laws: &[Law::Force],
        law: "a force over x that does not flip with the velocity: hose or cable spring, cogging",
        source: "Hooke's law, cogging as a sine of its pitch; range: effects.md, textbook prior",
        distinguished_by: &[ManualMeasurement::Tilting, ManualMeasurement::Pulling],
        keys: Numbers::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], rig: &RigParameters) -> Self {
        PositionDependentForce { numbers: Numbers::of(numbers), half_stroke_m: rig.cylinder().stroke_m / 2.0 }
    }
}

impl PositionDependentForce {
    /// Force in +x of the rig at this position, m; N.
    pub(crate) fn term(&self, position_m: f64) -> f64 {
        let Numbers { spring_n, ripple_n, pitch_m } = self.numbers;
        let ripple = Ripple { amplitude_n: ripple_n, pitch_m };
        -spring_n * line(self.half_stroke_m, position_m) + ripple.at(position_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn of(spring_n: f64, ripple_n: f64) -> PositionDependentForce {
        PositionDependentForce::new(&[spring_n, ripple_n, 0.05], &RigParameters::baseline())
    }

    #[test]
    fn the_spring_centres() {
        assert_eq!([0.0, 0.25, 0.5].map(|x| of(20.0, 0.0).term(x)), [20.0, 0.0, -20.0]);
    }

    #[test]
    fn the_cogging_repeats_after_its_pitch() {
        // Roundings of an angle of 30 rad.
        for (x, force) in [(0.0125, 6.0), (0.2625, 6.0), (0.0375, -6.0), (0.2, 0.0)] {
            assert!((of(0.0, 6.0).term(x) - force).abs() < 1e-13, "{x} m");
        }
    }

    #[test]
    fn a_closed_path_gives_back_what_it_took() {
        // 0.1 m out and back in steps of 0.1 mm: the same forces with the other sign, but for roundings of 1 J.
        let way = |i: u32| 0.3 + 1e-4 * f64::from(i);
        let out: f64 = (0..1000).map(|i| of(20.0, 6.0).term((way(i) + way(i + 1)) / 2.0) * 1e-4).sum();
        let back: f64 =
            (0..1000).rev().map(|i| of(20.0, 6.0).term((way(i) + way(i + 1)) / 2.0) * -1e-4).sum();
        assert!(out < -0.5, "against the spring");
        assert!((out + back).abs() < 1e-13, "{out} J and {back} J");
    }

    #[test]
    fn zeros_change_nothing() {
        assert_eq!(of(0.0, 0.0).term(0.1).abs(), 0.0);
    }
}
