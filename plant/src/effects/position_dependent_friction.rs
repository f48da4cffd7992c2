//! position-dependent-friction: friction has a bump, a slope or a ripple over the stroke and flips with the velocity.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PositionDependentFriction {
    /// Height of the bump.
    pub(crate) bump_n: f64,
    /// Extension at which the bump is highest.
    pub(crate) centre_m: f64,
    /// Half-width of the bump at 1/e.
    pub(crate) width_m: f64,
    /// Growth from mid-stroke to the rod fully out.
    pub(crate) slope_n: f64,
    /// Amplitude of the ripple.
    pub(crate) ripple_n: f64,
    /// Period of the ripple.
    pub(crate) pitch_m: f64,
}

impl Effect for PositionDependentFriction {
    const SHEET: Sheet = Sheet {
        name: "position-dependent-friction",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "friction has a bump, a slope or a ripple over the stroke and flips with the velocity",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "bump_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 40.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "height of the bump",
        },
        EffectKey {
            name: "centre_mm",
            unit: Unit::Millimetre,
            min: 0.0,
            max: 500.0,
            drawn: [100.0, 400.0],
            signed: false,
            default: Some(250.0),
            neutral: None,
            meaning: "extension at which the bump is highest",
        },
        EffectKey {
            name: "width_mm",
            unit: Unit::Millimetre,
            min: 5.0,
            max: 500.0,
            drawn: [30.0, 120.0],
            signed: false,
            default: Some(60.0),
            neutral: None,
            meaning: "half-width of the bump at 1/e",
        },
        EffectKey {
            name: "slope_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 40.0],
            signed: true,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "growth from mid-stroke to the rod fully out",
        },
        EffectKey {
            name: "ripple_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [2.0, 20.0],
            signed: false,
            default: Some(0.0),
            neutral: Some(0.0),
            meaning: "amplitude of the ripple",
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
            meaning: "period of the ripple",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        PositionDependentFriction { bump_n: numbers[0], centre_m: numbers[1], width_m: numbers[2], slope_n: numbers[3], ripple_n: numbers[4], pitch_m: numbers[5] }
    }
}
