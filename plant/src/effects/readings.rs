//! Readings with effects: what each sensor shows before noise and steps, as the truth and its named terms.

use super::OpenBalance;
use super::acting::Effects;
use super::declared::{Target, TermInputs};
use super::memory::axis_conditions_at;
use super::sums::{ForceReading, PositionReading, PressureReading};
use super::tabulated::AxisConditions;
use crate::integrator::{Integrator, Lanes};

impl Effects {
    /// What skew adds to a channel (position, force, a, b) that would show this now.
    fn skew(&self, axis: usize, channel: usize, now: f64) -> f64 {
        let history = self.on[axis].time_skew[channel].zip(self.memory.channels[axis][channel].as_ref());
        history.map_or(0.0, |(effect, history)| {
            effect.term(history.before(effect.delay_s / self.substep_s), now)
        })
    }

    /// Terms of the position reading of an axis, by its true position, m.
    pub(crate) fn position_reading(&self, axis: usize, truth: f64, at: &TermInputs<'_>) -> PositionReading {
        let on = &self.on[axis];
        PositionReading {
            time_skew: self.skew(axis, 0, truth),
            position_sensor_lag: on
                .position_sensor_lag
                .map_or(0.0, |_| self.memory.states.axes[axis].lag_output[0] - truth),
            position_sensor_gain: on.position_sensor_gain.map_or(0.0, |effect| effect.term(truth)),
            position_sensor_offset: on.position_sensor_offset.map_or(0.0, |effect| effect.offset_m),
            declared_reading: on.declared.reading(Target::Position, at),
            added: on.added(OpenBalance::PositionReading { truth_m: truth }),
        }
    }

    /// Terms of the force reading of an axis, by what its sensor should show, N.
    pub(crate) fn force_reading(&self, axis: usize, truth: f64, at: &TermInputs<'_>) -> ForceReading {
        let on = &self.on[axis];
        ForceReading {
            time_skew: self.skew(axis, 1, truth),
            force_sensor_gain: on.force_sensor_gain.map_or(0.0, |effect| effect.term(truth)),
            force_sensor_offset: on.force_sensor_offset.map_or(0.0, |effect| effect.offset_n),
            declared_reading: on.declared.reading(Target::ForceReading, at),
            added: on.added(OpenBalance::ForceReading { truth_n: truth }),
        }
    }

    /// Terms of the pressure reading of a chamber, by its true pressure, Pa.
    pub(crate) fn pressure_reading(
        &self,
        axis: usize,
        chamber: usize,
        truth: f64,
        at: &TermInputs<'_>,
    ) -> PressureReading {
        let on = &self.on[axis];
        PressureReading {
            time_skew: self.skew(axis, 2 + chamber, truth),
            pressure_sensor_lag: on.pressure_sensor_lag[chamber]
                .map_or(0.0, |_| self.memory.states.axes[axis].lag_output[1 + chamber] - truth),
            pressure_sensor_gain: on.pressure_sensor_gain[chamber].map_or(0.0, |effect| effect.term(truth)),
            pressure_sensor_offset: on.pressure_sensor_offset[chamber].map_or(0.0, |effect| effect.offset_pa),
            declared_reading: on.declared.reading([Target::PressureA, Target::PressureB][chamber], at),
            added: on.added(OpenBalance::PressureReading { chamber, truth_pa: truth }),
        }
    }

    /// Remembers what sensors of an axis will show of this instant.
    pub(super) fn keep_readings(&mut self, of: &Integrator, axis: usize, lanes: &Lanes) {
        let span_s = self.substep_s;
        let AxisConditions { extension_m, pressure_pa: [a, b], .. } = axis_conditions_at(of, lanes, axis);
        let x = if axis == 0 { extension_m } else { self.stroke_m - extension_m };
        let (on, axis_states) = (&self.on[axis], &mut self.memory.states.axes[axis]);
        for (i, truth) in [x, a, b].into_iter().enumerate() {
            let (output, input) = (axis_states.lag_output[i], axis_states.lag_input[i]);
            axis_states.lag_output[i] = match i {
                0 => on.position_sensor_lag.map_or(truth, |lag| lag.advance(output, input, truth, span_s)),
                _ => on.pressure_sensor_lag[i - 1]
                    .map_or(truth, |lag| lag.advance(output, input, truth, span_s)),
            };
            axis_states.lag_input[i] = truth;
        }
        for (channel, truth) in [(0, x), (2, a), (3, b)] {
            self.memory.channels[axis][channel].iter_mut().for_each(|history| history.push(truth));
        }
    }
}
