//! force-sensor-offset: the force sensor reads too much by a constant.
//!
//! ```text
//! term = o
//! ```
//!
//! o offset, N, either sign, positive reads too much: F shown = F + o. Valid for a zero that has drifted or a preload of the
//! mounting. The reading is saturated at the ends of its range after that, as without the offset. The truth does not feel it,
//! a controller does. No regularisation.
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
    pub(crate) struct ForceSensorOffset {
        offset_n: EffectKey {
            name: "offset_n",
            unit: Unit::Newton,
            min: -100.0,
            max: 100.0,
            drawn: [1.0, 20.0],
            signed: true,
            meaning: "o, what it reads too much",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for ForceSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "force-sensor-offset",
        group: Group::Sensor,
        law: "the force sensor reads too much by a constant",
        source: "zero error of a transducer; range: effects.md, textbook prior",
        sensor_error: Some((SensorError::Offset, Some(Element::Force))),
        distinguished_by: &[ManualMeasurement::Tilting, ManualMeasurement::KnownWeight],
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
        for offset in [12.0, 0.0, -(12.0)] {
            assert_eq!(ForceSensorOffset::new(&[offset], &RigParameters::baseline()).offset_n, offset);
        }
    }
}
