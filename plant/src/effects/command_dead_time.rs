//! command-dead-time: the command acts a fixed time late.

use super::sheet::{Effect, EffectKey, Group, PlaceKind, Sheet};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The numbers of this effect at one place, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CommandDeadTime {
    /// Time from the command to its effect on the spool, beside the period it is latched in.
    pub(crate) delay_s: f64,
}

impl Effect for CommandDeadTime {
    const SHEET: Sheet = Sheet {
        name: "command-dead-time",
        group: Group::Flow,
        place: PlaceKind::Axis,
        law: "the command acts a fixed time late",
        source: "effects.md, textbook prior",
        keys: &[
        EffectKey {
            name: "delay_ms",
            unit: Unit::Millisecond,
            min: 0.0,
            max: 10.0,
            drawn: [0.3, 5.0],
            signed: false,
            default: None,
            neutral: Some(0.0),
            meaning: "time from the command to its effect on the spool, beside the period it is latched in",
        },
        ],
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        CommandDeadTime { delay_s: numbers[0] }
    }
}
