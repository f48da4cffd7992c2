//! Where a rig's pistons were, by readings that its sensors may have changed.
//!
//! ```text
//!   y(t) = g x(t - d) + o     =>     x(t) = (y(t + d) - o) / g          a lag of tau delays smooth motion by tau
//! ```
//!
//! Windows start where the record says that the pistons were. When the rig under simulation has a sensor that lies, it was
//! somewhere else: the start is moved by what is known of the sensor, so that the readings, and not the truth, begin at the
//! record's. Source: effects.md, Sensors.

use crate::gridded_record::{GriddedRecord, Point};
use plant::effects::sheet::{Element, Part};
use plant::{Axis, PERIOD_S, RigParameters};

/// What stands between a quantity and its reading.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    delay_s: f64,
    gain: f64,
    offset: f64,
}

impl Reading {
    const TRUE: Reading = Reading { delay_s: 0.0, gain: 1.0, offset: 0.0 };

    fn undo(self, value: f64) -> f64 {
        (value - self.offset) / self.gain
    }
}

/// The readings of position and both pressures of each axis.
#[derive(Clone, Copy, Debug)]
pub struct SensorInverse {
    axes: [[Reading; 3]; 2],
    stroke_m: f64,
    is_true: bool,
}

impl SensorInverse {
    /// What the sensors of a rig do.
    #[must_use]
    pub fn of(rig: &RigParameters) -> Self {
        let mut axes = [[Reading::TRUE; 3]; 2];
        for effect in rig.effects() {
            let axis = match effect.place.part {
                Part::Drive => 0,
                Part::Load => 1,
                Part::Linkage | Part::Supply => continue,
            };
            let pressure = match effect.place.element {
                Some(Element::A) => 1,
                Some(Element::B) => 2,
                _ => 0,
            };
            let number = effect.numbers[0];
            let reading = &mut axes[axis];
            match effect.name {
                "position-sensor-lag" => reading[0].delay_s += number * 1e-3,
                "pressure-sensor-lag" => reading[pressure].delay_s += number * 1e-3,
                "time-skew" if effect.place.element != Some(Element::Force) => {
                    reading[pressure].delay_s += number * 1e-3;
                }
                "position-sensor-offset" => reading[0].offset += number * 1e-3,
                "position-sensor-gain" => reading[0].gain += number * 1e-2,
                "pressure-sensor-offset" => reading[pressure].offset += number * 1e2,
                "pressure-sensor-gain" => reading[pressure].gain += number * 1e-2,
                _ => {}
            }
        }
        let is_true = axes.iter().flatten().all(|reading| *reading == Reading::TRUE);
        SensorInverse { axes, stroke_m: rig.cylinder().stroke_m, is_true }
    }

    /// The points from which the readings begin as the record's at a period; `own` are the record's points there, made better.
    #[must_use]
    pub fn points(&self, record: &GriddedRecord, period: usize, starts: &[Point; 2]) -> [Point; 2] {
        let mut points = *starts;
        if self.is_true {
            return points;
        }
        for axis in Axis::ALL {
            let i = axis.index();
            let [position, a, b] = self.axes[i];
            let later = |reading: Reading, of: &dyn Fn(&Point) -> f64| {
                let (then, now) = (at(record, i, period, reading.delay_s, of), of(&record.points[period][i]));
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
        points
    }
}

/// A number of the record's points some time after a period.
fn at(record: &GriddedRecord, axis: usize, period: usize, delay_s: f64, of: &dyn Fn(&Point) -> f64) -> f64 {
    let place = (period as f64 + delay_s / PERIOD_S).min((record.len() - 1) as f64);
    let (before, share) = (place.floor() as usize, place.fract());
    let after = (before + 1).min(record.len() - 1);
    let [before, after] = [before, after].map(|place| of(&record.points[place][axis]));
    // Between rest and motion there is no half-way.
    if share == 0.0 || before == 0.0 || after == 0.0 {
        return if share < 0.5 { before } else { after };
    }
    before + share * (after - before)
}
