//! spool-rate-limit: the spool moves no faster than its actuator can.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SpoolRateLimit {
    /// Largest |ds/dt|; full opening counts 1.
    pub(crate) rate_per_s: f64,
}

impl Effect for SpoolRateLimit {
    const SHEET: Sheet = Sheet {
        name: "spool-rate-limit",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the spool moves no faster than its actuator can",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "rate_per_s",
            unit: Unit::PerSecond,
            min: 5.0,
            max: 2000.0,
            drawn: [20.0, 200.0],
            signed: false,
            default: None,
            neutral: Some(f64::INFINITY),
            meaning: "largest |ds/dt|; full opening counts 1",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        SpoolRateLimit { rate_per_s: numbers[0] }
    }
}
