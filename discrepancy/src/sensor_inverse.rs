//! Inverts the sensor models of a rig: from readings to states.
//!
//! ```text
//!   y(t) = g x(t - d) + o     =>     x(t) = (y(t + d) - o) / g          a lag of tau delays smooth motion by tau
//! ```
//!
//! Windows start from recorded readings. If the simulated rig has a sensor with delay, gain or offset, the true state differs
//! from the reading; the start state is corrected by the inverse of the sensor. A declared term of a reading is taken off at the
//! reading itself, which is right to the first order of the term. Source: effects.md, Sensors.

use crate::gridded_record::{AxisState, GriddedRecord};
use plant::effects::declared::{Declared, Target};
use plant::effects::sheet;
use plant::effects::sheet::{Element, Part, SensorError};
use plant::{Axis, PERIOD_S, RigParameters};

#[derive(Clone, Copy, Debug, PartialEq)]
struct SensorModel {
    delay_s: f64,
    gain: f64,
    offset: f64,
}

impl SensorModel {
    const TRUE: SensorModel = SensorModel { delay_s: 0.0, gain: 1.0, offset: 0.0 };

    fn undo(self, value: f64) -> f64 {
        (value - self.offset) / self.gain
    }
}

/// Inverse of the position and pressure sensors of each axis.
#[derive(Clone, Debug)]
pub(crate) struct SensorInverse {
    axes: [[SensorModel; 3]; 2],
    /// Terms of readings that the rig declares.
    declared: Vec<Declared>,
    stroke_m: f64,
    is_true: bool,
}

impl SensorInverse {
    /// Takes the sensor models from the effects of a rig.
    pub(crate) fn of(rig: &RigParameters) -> Self {
        let mut axes = [[SensorModel::TRUE; 3]; 2];
        for effect in rig.effects() {
            let sheet = sheet(effect.name).expect("an effect that is on has a sheet");
            let Some((error, sensor)) = sheet.sensor_error else { continue };
            let [position, a, b] = &mut axes[usize::from(effect.place.part == Part::Load)];
            let reading = match effect.place.element.or(sensor) {
                Some(Element::Position) => position,
                Some(Element::A) => a,
                Some(Element::B) => b,
                Some(Element::Force) | None => continue,
            };
            // In SI by a product, whose rounding is not that of `to_si`.
            let size = effect.numbers[0] * sheet.keys[0].unit.to_si(1.0);
            match error {
                SensorError::Delay => reading.delay_s += size,
                SensorError::Gain => reading.gain += size,
                SensorError::Offset => reading.offset += size,
            }
        }
        let of_readings = [Target::Position, Target::PressureA, Target::PressureB];
        let declared: Vec<Declared> =
            rig.terms().iter().filter(|term| of_readings.contains(&term.target)).cloned().collect();
        let is_true =
            declared.is_empty() && axes.iter().flatten().all(|reading| *reading == SensorModel::TRUE);
        SensorInverse { axes, declared, stroke_m: rig.cylinder().stroke_m, is_true }
    }

    /// True states whose readings are those of the record at a period; `starts` are its estimated points there.
    pub(crate) fn points(
        &self,
        record: &GriddedRecord,
        period: usize,
        starts: &[AxisState; 2],
    ) -> [AxisState; 2] {
        let mut points = *starts;
        if self.is_true {
            return points;
        }
        for axis in Axis::ALL {
            let i = axis.index();
            let [position, a, b] = self.axes[i];
            let later = |reading: SensorModel, of: &dyn Fn(&AxisState) -> f64| {
                let (then, now) =
                    (at(record, i, period, reading.delay_s, of), of(&record.smoothed_states[period][i]));
                of(&starts[i]) + then - now
            };
            let extension_m = later(position, &|point| point.extension_m);
            let rate = later(position, &|point| point.rod_velocity_m_per_s);
            // The sensor reads the rig's coordinate.
            let to_rig =
                |extension_m: f64| if axis == Axis::Load { self.stroke_m - extension_m } else { extension_m };
            points[i].extension_m = to_rig(position.undo(to_rig(extension_m))).clamp(0.0, self.stroke_m);
            points[i].rod_velocity_m_per_s = rate / position.gain;
            points[i].pressures_pa = [
                a.undo(later(a, &|point| point.pressures_pa[0])),
                b.undo(later(b, &|point| point.pressures_pa[1])),
            ];
        }
        for term in &self.declared {
            let i = term.axis.index();
            let at = |period: usize| {
                let (point, inputs) = (&record.smoothed_states[period][i], &record.inputs[period]);
                let ([a, b], valve) = (point.pressures_pa, inputs.valve[i]);
                let time_s = record.since_start(period) as f64 * PERIOD_S;
                term.value(&[point.extension_m, point.rod_velocity_m_per_s, a, b, valve, valve, time_s, 0.0])
            };
            let (now, next) = (at(period), at((period + 1).min(record.len() - 1)));
            match term.target {
                Target::PressureA => points[i].pressures_pa[0] -= now,
                Target::PressureB => points[i].pressures_pa[1] -= now,
                _ => {
                    // The sensor reads the rig's coordinate.
                    let along = if term.axis == Axis::Load { -1.0 } else { 1.0 };
                    points[i].extension_m = (points[i].extension_m - along * now).clamp(0.0, self.stroke_m);
                    if points[i].rod_velocity_m_per_s != 0.0 {
                        points[i].rod_velocity_m_per_s -= along * (next - now) / PERIOD_S;
                    }
                }
            }
        }
        points
    }
}

/// A number of the points at some time after a period, interpolated.
fn at(
    record: &GriddedRecord,
    axis: usize,
    period: usize,
    delay_s: f64,
    of: &dyn Fn(&AxisState) -> f64,
) -> f64 {
    let place = (period as f64 + delay_s / PERIOD_S).min((record.len() - 1) as f64);
    let (before, share) = (place.floor() as usize, place.fract());
    let after = (before + 1).min(record.len() - 1);
    let [before, after] = [before, after].map(|place| of(&record.smoothed_states[place][axis]));
    // Rest and motion are not interpolated.
    if share == 0.0 || before == 0.0 || after == 0.0 {
        return if share < 0.5 { before } else { after };
    }
    before + share * (after - before)
}
