//! time-skew: a channel shows the truth of a fixed time before.
//!
//! ```text
//! y(t) = truth(t - d)                      term = truth(t - d) - truth(t)
//! ```
//!
//! d delay, s, >= 0: how old the value is when it is sampled; y and truth in the channel's unit, and so the term, either
//! sign. What is late is the truth; lag, gain and offset of the same sensor act beside it on the truth of now.
//!
//! Valid for a channel that is sampled or sent later than its neighbours by a constant; jitter is not in it. Before t = d the
//! channel shows the start. No regularisation; between two stored values the history is a straight line.
//!
//! Properties: nothing while the truth rests; a ramp is shown d late; baseline and term together are the delayed value; d = 0
//! changes nothing.
//!
//! Source: definition; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Group, Law, ManualMeasurement, PlaceKind, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct TimeSkew {
        delay_s: EffectKey {
            name: "delay_ms",
            unit: Unit::Millisecond,
            max: 10.0,
            drawn: [0.3, 6.0],
            meaning: "d, how old the value is when it is sampled",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for TimeSkew {
    const SHEET: Sheet = Sheet {
        name: "time-skew",
        group: Group::Sensor,
        place: PlaceKind::Channel,
        laws: &[Law::PastReadings],
        law: "a channel shows the truth of a fixed time before",
        source: "definition; range: effects.md, textbook prior",
        has_memory: true,
        sensor_error: Some((SensorError::Delay, None)),
        distinguished_by: &[
            ManualMeasurement::PositionSensor,
            ManualMeasurement::PortPressure,
            ManualMeasurement::Uncoupling,
        ],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl TimeSkew {
    /// What the channel shows above the truth of now, both and the truth of `delay_s` before in the channel's unit.
    pub(crate) fn term(&self, delayed: f64, now: f64) -> f64 {
        delayed - now
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn skew(delay_s: f64) -> TimeSkew {
        TimeSkew::new(&[delay_s], &RigParameters::baseline())
    }

    #[test]
    fn a_ramp_is_shown_late() {
        let truth = |t: f64| 0.1 + 0.5 * t;
        let effect = skew(0.004);
        let shown = truth(0.2) + effect.term(truth(0.2 - effect.delay_s), truth(0.2));
        // Roundings of 0.2 m.
        assert!((shown - truth(0.196)).abs() < 1e-16);
    }

    #[test]
    fn what_rests_and_what_is_not_late_is_shown_as_it_is() {
        assert_eq!(skew(0.006).term(3e5, 3e5), 0.0);
        let truth = |t: f64| t * t;
        assert_eq!(skew(0.0).term(truth(0.5 - skew(0.0).delay_s), truth(0.5)), 0.0);
    }
}
