//! position-sensor-gain: the position sensor reads too much by a share.
//!
//! ```text
//! term = g x
//! ```
//!
//! g error of the gain, share, either sign, positive reads too much: x shown = (1 + g) x; x truth, m. x counts from the
//! retracted end: the error is largest with the rod out. Valid for a wrong calibration; curvature is not in it. The truth
//! does not feel it, a controller does. No regularisation.
//!
//! Properties: proportional to the truth, 0 with it; 0 changes nothing.
//!
//! Source: gain error of a transducer's data sheet; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Element, Group, ManualMeasurement, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PositionSensorGain {
        gain: EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -5.0,
            max: 5.0,
            drawn: [0.1, 1.0],
            signed: true,
            meaning: "g, what it reads too much, of the position",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PositionSensorGain {
    const SHEET: Sheet = Sheet {
        name: "position-sensor-gain",
        group: Group::Sensor,
        law: "the position sensor reads too much by a share",
        source: "gain error of a transducer; range: effects.md, textbook prior",
        sensor_error: Some((SensorError::Gain, Some(Element::Position))),
        distinguished_by: &[ManualMeasurement::PressedEnds],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl PositionSensorGain {
    /// What the reading has above the truth, both m.
    pub(crate) fn term(&self, truth: f64) -> f64 {
        self.gain * truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn gain(gain: f64) -> PositionSensorGain {
        PositionSensorGain::new(&[gain], &RigParameters::baseline())
    }

    #[test]
    fn it_is_proportional_to_the_truth() {
        // Powers of two: no rounding.
        assert_eq!(gain(0.015625).term(0.4), 0.4 / 64.0);
        assert_eq!(gain(0.015625).term(2.0 * 0.4), 2.0 * gain(0.015625).term(0.4));
        assert_eq!(gain(-0.015625).term(0.4), -gain(0.015625).term(0.4));
        assert_eq!(gain(0.25).term(0.0), 0.0);
    }

    #[test]
    fn zero_changes_nothing() {
        assert_eq!(gain(0.0).term(0.4).abs(), 0.0);
    }
}
