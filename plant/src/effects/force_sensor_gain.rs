//! force-sensor-gain: the force sensor reads too much by a share.
//!
//! ```text
//! term = g F
//! ```
//!
//! g error of the gain, share, either sign, positive reads too much: F shown = (1 + g) F; F truth, N. F is signed: the error
//! flips with it. Valid for a wrong calibration; curvature is not in it. The truth does not feel it, a controller does. No
//! regularisation.
//!
//! Properties: proportional to the truth, 0 with it; 0 changes nothing.
//!
//! Source: gain error of a transducer's data sheet; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Element, Excitation, Group, ManualMeasurement, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct ForceSensorGain {
        gain: EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -30.0,
            max: 30.0,
            drawn: [0.5, 8.0],
            signed: true,
            meaning: "g, what it reads too much, of the force",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ForceSensorGain {
    const SHEET: Sheet = Sheet {
        name: "force-sensor-gain",
        group: Group::Sensor,
        law: "the force sensor reads too much by a share",
        source: "gain error of a transducer; range: effects.md, textbook prior",
        excited_by: Excitation::LinkedRods,
        sensor_error: Some((SensorError::Gain, Some(Element::Force))),
        distinguished_by: &[ManualMeasurement::KnownWeight],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl ForceSensorGain {
    /// What the reading has above the truth, both N.
    pub(crate) fn term(&self, truth: f64) -> f64 {
        self.gain * truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn gain(gain: f64) -> ForceSensorGain {
        ForceSensorGain::new(&[gain], &RigParameters::baseline())
    }

    #[test]
    fn it_is_proportional_to_the_truth() {
        // Powers of two: no rounding.
        assert_eq!(gain(0.015625).term(-300.0), -300.0 / 64.0);
        assert_eq!(gain(0.015625).term(2.0 * -300.0), 2.0 * gain(0.015625).term(-300.0));
        assert_eq!(gain(-0.015625).term(-300.0), -gain(0.015625).term(-300.0));
        assert_eq!(gain(0.25).term(0.0), 0.0);
    }

    #[test]
    fn zero_changes_nothing() {
        assert_eq!(gain(0.0).term(-300.0).abs(), 0.0);
    }
}
