//! spool-second-order: the spool is a second-order system in place of the first-order lag.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpoolSecondOrder {
    /// W / 2 pi.
    pub(crate) natural_frequency_hz: f64,
    /// Z, share of critical damping.
    pub(crate) damping: f64,
}

impl Effect for SpoolSecondOrder {
    const SHEET: Sheet = Sheet {
        name: "spool-second-order",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the spool is a second-order system in place of the first-order lag",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "natural_frequency_hz",
            unit: Unit::Hertz,
            min: 20.0,
            max: 400.0,
            drawn: [60.0, 120.0],
            signed: false,
            default: None,
            neutral: None,
            meaning: "w / 2 pi",
        },
        EffectKey {
            name: "damping",
            unit: Unit::One,
            min: 0.2,
            max: 1.5,
            drawn: [0.5, 0.9],
            signed: false,
            default: Some(0.7),
            neutral: None,
            meaning: "z, share of critical damping",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        SpoolSecondOrder { natural_frequency_hz: numbers[0], damping: numbers[1] }
    }
}
