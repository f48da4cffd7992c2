//! position-dependent-force: a force over x that does not flip with the velocity: hose or cable spring, cogging.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionDependentForce {
    /// Force at x = 0, falling in a straight line to its negative at the other end; positive centres.
    pub(crate) spring_n: f64,
    /// Amplitude of the cogging.
    pub(crate) ripple_n: f64,
    /// Period of the cogging.
    pub(crate) pitch_m: f64,
}

impl Effect for PositionDependentForce {
    const SHEET: Sheet = Sheet {
        name: "position-dependent-force",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "a force over x that does not flip with the velocity: hose or cable spring, cogging",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "spring_n",
            unit: Unit::Newton,
            min: -200.0,
            max: 200.0,
            drawn: [2.0, 60.0],
            signed: true,
            default: None,
            neutral: Some(0.0),
            meaning: "force at x = 0, falling in a straight line to its negative at the other end; positive centres",
        },
        EffectKey {
            name: "ripple_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 30.0],
            signed: false,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "amplitude of the cogging",
        },
        EffectKey {
            name: "pitch_mm",
            unit: Unit::Millimetre,
            min: 2.0,
            max: 500.0,
            drawn: [20.0, 100.0],
            signed: false,
            default: Some(50.0),
            neutral: None,
            meaning: "period of the cogging",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PositionDependentForce { spring_n: numbers[0], ripple_n: numbers[1], pitch_m: numbers[2] }
    }
}
