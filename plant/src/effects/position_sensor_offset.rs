//! position-sensor-offset: the position sensor reads too much by a constant.
//!
//! ```text
//! term = o
//! ```
//!
//! o offset, m, either sign, positive reads too much: x shown = x + o. On the load it comes beside the +0.8 mm of the rig
//! file. Valid for a shifted mounting. The reading is saturated at the ends of its range after that, as without the offset.
//! The truth does not feel it, a controller does. No regularisation.
//!
//! Properties: a constant of either sign; 0 changes nothing.
//!
//! Source: zero error of a transducer's data sheet; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Element, Group, ManualMeasurement, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PositionSensorOffset {
        offset_m: EffectKey {
            name: "offset_mm",
            unit: Unit::Millimetre,
            min: -10.0,
            max: 10.0,
            drawn: [0.1, 2.0],
            signed: true,
            meaning: "o, what it reads too much, beside the load sensor's own offset",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PositionSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "position-sensor-offset",
        group: Group::Sensor,
        law: "the position sensor reads too much by a constant",
        source: "zero error of a transducer; range: effects.md, textbook prior",
        sensor_error: Some((SensorError::Offset, Some(Element::Position))),
        distinguished_by: &[ManualMeasurement::PressedEnds, ManualMeasurement::Uncoupling],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn it_is_a_constant_of_either_sign() {
        for offset in [-0.8e-3, 0.0, -(-0.8e-3)] {
            assert_eq!(PositionSensorOffset::new(&[offset], &RigParameters::baseline()).offset_m, offset);
        }
    }
}
