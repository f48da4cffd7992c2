//! valve-null-leakage: every edge keeps a floor of its largest K_V.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ValveNullLeakage {
    /// Floor of each edge, of its own largest K_V.
    pub(crate) share: f64,
}

impl Effect for ValveNullLeakage {
    const SHEET: Sheet = Sheet {
        name: "valve-null-leakage",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "every edge keeps a floor of its largest K_V",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "leakage_percent",
            unit: Unit::Percent,
            min: 0.0,
            max: 10.0,
            drawn: [0.2, 2.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "floor of each edge, of its own largest K_V",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        ValveNullLeakage { share: numbers[0] }
    }
}
