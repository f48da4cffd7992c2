//! pressure-sensor-lag: the pressure sensor sits at the end of a sense line: a first-order lag.
//!
//! ```text
//! tau dp_shown/dt = p - p_shown                 term = p_shown - p
//! ```
//!
//! p what the sensor sees, Pa; p_shown what it shows before gain, offset, noise and rounding, Pa; tau time constant, s, >= 0.
//! The term is what the reading has above the truth, Pa, either sign.
//!
//! Valid for a sense line whose resistance fills the volume before the sensor; a second pole or a travelling wave is not in
//! it. The truth does not feel it. Exact for a truth that goes in a straight line over the span, so no span is too long and
//! tau = 0 shows the truth. No regularisation.
//!
//! Properties: a step is followed exponentially, a ramp one tau late; it rests where the truth rests; it shows nothing that
//! was not true before or is now; how a span is cut does not matter (tests of first_order.rs, the formula shared by the
//! lags).
//!
//! Source: first-order lag, sense line as one resistance and one volume; range 1 to 10 ms: effects.md, textbook prior.

use super::first_order;
use super::sheet::{
    Effect, EffectKey, Group, Law, ManualMeasurement, PlaceKind, SensorError, Sheet, effect_numbers,
};
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

effect_numbers! {
    pub(crate) struct PressureSensorLag {
        time_constant_s: EffectKey {
            name: "time_constant_ms",
            unit: Unit::Millisecond,
            max: 20.0,
            drawn: [1.0, 10.0],
            meaning: "tau, time constant of the pressure sensor",
            ..EffectKey::USUAL
        },
    }
}

impl Effect for PressureSensorLag {
    const SHEET: Sheet = Sheet {
        name: "pressure-sensor-lag",
        group: Group::Sensor,
        place: PlaceKind::Chamber,
        laws: &[Law::PastReadings],
        law: "the pressure sensor sits at the end of a sense line: a first-order lag",
        source: "first-order lag, sense line as one resistance and one volume; range: effects.md, textbook prior",
        has_memory: true,
        sensor_error: Some((SensorError::Delay, None)),
        distinguished_by: &[ManualMeasurement::PortPressure],
        keys: Self::KEYS,
        ..Sheet::USUAL
    };

    fn new(numbers: &[f64], _rig: &RigParameters) -> Self {
        Self::of(numbers)
    }
}

impl PressureSensorLag {
    /// What it shows at the end of a span, s, over which the truth goes in a straight line; all in Pa.
    pub(crate) fn advance(&self, output: f64, truth_from: f64, truth_to: f64, span_s: f64) -> f64 {
        first_order::advance(self.time_constant_s, output, truth_from, truth_to, span_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    fn lag(time_constant_s: f64) -> PressureSensorLag {
        PressureSensorLag::new(&[time_constant_s], &RigParameters::baseline())
    }

    #[test]
    fn a_time_constant_leaves_one_part_in_e_of_a_step() {
        let left = 3e5 - lag(0.004).advance(1e5, 3e5, 3e5, 0.004);
        let step = 3e5 - 1e5;
        // Roundings of the numbers of the step.
        assert!((left - step / std::f64::consts::E).abs() < 1e-15 * 3e5);
    }

    #[test]
    fn it_rests_where_the_truth_rests_and_without_a_time_constant_shows_it() {
        let truth = 3e5;
        assert_eq!(lag(0.004).advance(truth, truth, truth, 1e-3), truth);
        assert_eq!(lag(0.0).advance(1e5, 3e5, 3e5, 1e-4), truth);
    }
}
