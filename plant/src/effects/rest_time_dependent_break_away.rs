//! rest-time-dependent-break-away: the break-away force grows with the logarithm of the time at rest.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RestTimeDependentBreakAway {
    /// Growth of the break-away force after 10 s at rest.
    pub(crate) growth: f64,
    /// T_0 of ln(1 + t / t_0).
    pub(crate) onset_s: f64,
}

impl Effect for RestTimeDependentBreakAway {
    const SHEET: Sheet = Sheet {
        name: "rest-time-dependent-break-away",
        group: Group::Motion,
        place: PlaceKind::Axis,
        law: "the break-away force grows with the logarithm of the time at rest",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "growth_percent",
            unit: Unit::Percent,
            min: 0.0,
            max: 100.0,
            drawn: [10.0, 50.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "growth of the break-away force after 10 s at rest",
        },
        EffectKey {
            name: "onset_s",
            unit: Unit::Second,
            min: 0.001,
            max: 5.0,
            drawn: [0.05, 0.5],
            signed: false,
            default: Some(0.1),
            neutral: None,
            meaning: "t_0 of ln(1 + t / t_0)",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        RestTimeDependentBreakAway { growth: numbers[0], onset_s: numbers[1] }
    }
}
