//! time-skew: a channel shows the truth of a fixed time before.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TimeSkew {
    /// How old the value is when it is sampled.
    pub(crate) delay_s: f64,
}

impl Effect for TimeSkew {
    const SHEET: Sheet = Sheet {
        name: "time-skew",
        group: Group::Sensor,
        place: PlaceKind::Channel,
        law: "a channel shows the truth of a fixed time before",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "delay_ms",
            unit: Unit::Millisecond,
            min: 0.0,
            max: 10.0,
            drawn: [0.3, 6.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "how old the value is when it is sampled",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        TimeSkew { delay_s: numbers[0] }
    }
}
