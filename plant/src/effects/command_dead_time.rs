//! command-dead-time: the command acts a fixed time late.
//!
//! ```text
//! target(t) = u(t - d)        term = u(t - d) - u(t)
//! ```
//!
//! u command as latched for the period, in [-1, 1]; d dead time, s, in [0, 10 ms], beside the period that the command is
//! latched in. Valid for bus, driver and coil together, as long as their delay is constant; a jittering one is none. Before
//! the first command there was the first one. No regularisation: the memory holds what was commanded.
//!
//! Properties: while u stands the term is 0; an edge is taken back whole until it is d old.
//!
//! Source: dead time of sampled loops, Astrom and Wittenmark, Computer-Controlled Systems, 1997; range: textbook prior.

use super::sheet::{Effect, EffectKey, Group, Law, ManualMeasurement, Sheet, effect_numbers};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct CommandDeadTime {
        delay_s: EffectKey {
            name: "delay_ms",
            unit: Unit::Millisecond,
            max: 10.0,
            drawn: [0.3, 5.0],
            meaning: "time from the command to its effect on the spool, beside the period it is latched in",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for CommandDeadTime {
    const SHEET: Sheet = Sheet {
        name: "command-dead-time",
        group: Group::Flow,
        laws: &[Law::Spool],
        law: "the command acts a fixed time late",
        source: "dead time of sampled loops, Astrom and Wittenmark 1997; range: textbook prior",
        has_memory: true,
        distinguished_by: &[ManualMeasurement::SpoolSignal],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl CommandDeadTime {
    /// What is added to the command `now`, from the one `delay_s` before.
    pub(crate) fn term(&self, delayed: f64, now: f64) -> f64 {
        delayed - now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_command_is_not_late_and_an_edge_is_taken_back_whole() {
        let effect = CommandDeadTime::new(&[2e-3], &RigParameters::baseline());
        assert_eq!(effect.delay_s, 2e-3);
        assert_eq!(effect.term(0.3, 0.3), 0.0);
        assert_eq!(0.75 + effect.term(-0.5, 0.75), -0.5);
    }
}
