//! pressure-sensor-offset: the pressure sensor reads too much by a constant.
//!
//! ```text
//! term = o
//! ```
//!
//! o offset, Pa, either sign, positive reads too much: p shown = p + o. Valid for a zero that has drifted; absolute pressure.
//! The reading is saturated at the ends of its range after that, as without the offset. The truth does not feel it, a
//! controller does. No regularisation.
//!
//! Properties: a constant of either sign; 0 changes nothing.
//!
//! Source: zero error of a transducer's data sheet; range: effects.md, textbook prior.

use super::sheet::{
    Effect, EffectKey, Group, ManualMeasurement, PlaceKind, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PressureSensorOffset {
        offset_pa: EffectKey {
            name: "offset_mbar",
            unit: Unit::Millibar,
            min: -500.0,
            max: 500.0,
            drawn: [10.0, 100.0],
            signed: true,
            meaning: "o, what it reads too much",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PressureSensorOffset {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-offset",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        law: "the pressure sensor reads too much by a constant",
        source: "zero error of a transducer; range: effects.md, textbook prior",
        sensor_error: Some((SensorError::Offset, None)),
        distinguished_by: &[ManualMeasurement::Venting, ManualMeasurement::Tilting],
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
        for offset in [-3e3, 0.0, -(-3e3)] {
            assert_eq!(PressureSensorOffset::new(&[offset], &RigParameters::baseline()).offset_pa, offset);
        }
    }
}
