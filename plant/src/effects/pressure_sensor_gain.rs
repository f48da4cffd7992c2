//! pressure-sensor-gain: the pressure sensor reads too much by a share.
//!
//! ```text
//! term = g p
//! ```
//!
//! g error of the gain, share, either sign, positive reads too much: p shown = (1 + g) p; p truth, Pa. p is absolute: the
//! error is g p_atm at rest. Valid for a wrong calibration; curvature is not in it. The truth does not feel it, a controller
//! does. No regularisation.
//!
//! Properties: proportional to the truth, 0 with it; 0 changes nothing.
//!
//! Source: gain error of a transducer's data sheet; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Group, ManualMeasurement, PlaceKind, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PressureSensorGain {
        gain: EffectKey {
            name: "gain_percent",
            unit: Unit::Percent,
            min: -10.0,
            max: 10.0,
            drawn: [0.25, 2.0],
            signed: true,
            meaning: "g, what it reads too much, of the absolute pressure",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PressureSensorGain {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-gain",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        law: "the pressure sensor reads too much by a share",
        source: "gain error of a transducer; range: effects.md, textbook prior",
        sensor_error: Some((SensorError::Gain, None)),
        distinguished_by: &[ManualMeasurement::Venting, ManualMeasurement::Tilting],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl PressureSensorGain {
    /// What the reading has above the truth, both Pa.
    pub(crate) fn term(&self, truth: f64) -> f64 {
        self.gain * truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn gain(gain: f64) -> PressureSensorGain {
        PressureSensorGain::new(&[gain], &RigParameters::baseline())
    }

    #[test]
    fn it_is_proportional_to_the_truth() {
        // Powers of two: no rounding.
        assert_eq!(gain(0.015625).term(4e5), 4e5 / 64.0);
        assert_eq!(gain(0.015625).term(2.0 * 4e5), 2.0 * gain(0.015625).term(4e5));
        assert_eq!(gain(-0.015625).term(4e5), -gain(0.015625).term(4e5));
        assert_eq!(gain(0.25).term(0.0), 0.0);
    }

    #[test]
    fn zero_changes_nothing() {
        assert_eq!(gain(0.0).term(4e5).abs(), 0.0);
    }
}
