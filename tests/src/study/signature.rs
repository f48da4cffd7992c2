//! What an effect changes in a record, as an ideal observer sees it.
//!
//! ```text
//! J = (readings of the plant with the effect - readings of the baseline) / noise of the sensors        in windows of 100 ms
//! M = 1 - S S^+          S: what the readings change with x, v, p_a, p_b at the start of the window
//! |M J|                  how many standard deviations the matched filter of the effect lies from nothing
//! ```
//!
//! Every window starts at the true x, v, p_a, p_b of the record, and with the same inputs; what else moves (spool, lagged flow, the
//! effects' memories) goes on from the window before, of each plant its own. The observer does not know the true initial state: what
//! a change of it could explain is projected out, window by window.
//!
//! That holds for the sensors' effects too, without an exception. A constant offset of the position is a change of x at the
//! start as far as the readings of x go; what is left of it is what only the true x would do to the rest: volumes and with them the
//! rates of the pressures, cushions and stops, the gap of the linkage against the other axis. An offset of a pressure is left in the
//! flow (which depends on the absolute pressure) and in the force balance; one of the force sensor is left whole, since no initial
//! state shifts a force. At rest with shut valves an offset is truly invisible, and no sum over such windows brings it back.
//! Windows know nothing of each other: the creep of a leak over seconds counts only for what it is within each 100 ms, and
//! an observer of longer windows sees such effects below these limits.
//!
//! Noise: that of the sensor and of its rounding together, sqrt(sigma^2 + step^2/12). The readings are the plant's own, before noise
//! and rounding. The first window is left out: memories fill in it [rig-model.md: a record is judged after 0.1 s].
//!
//! Sensitivities are differences over a change that is small against the noise. Through stick and slip they are what they are: one
//! side of a kink. Source: discrepancy-notes.md, 1 and 6; Kay 1998, Fundamentals of Statistical Signal Processing II, 4.3.

use crate::study::course::{Course, POINT_NUMBERS, Point, WINDOW};
use nalgebra::DMatrix;
use plant::{Inputs, Plant, RigParameters, State, Truth};

/// Readings of an axis: position, force, pressures a and b.
const CHANNELS: usize = 4;
/// Share of the largest singular value below which a direction of the initial state changes nothing.
const RANK: f64 = 1e-6;

/// The observer of one record.
#[derive(Debug)]
pub struct Observer {
    course: Course,
    noise: [f64; CHANNELS],
    baseline: Vec<f64>,
    /// For each window an orthonormal basis of what its initial state explains.
    explained: Vec<Vec<Vec<f64>>>,
}

impl Observer {
    /// The observer of a course.
    #[must_use]
    pub fn new(course: Course) -> Self {
        let sensors = course.rig.sensors();
        let with_rounding = |noise: f64, step: f64| (noise * noise + step * step / 12.0).sqrt();
        let pressure = with_rounding(sensors.pressure_noise_pa, sensors.pressure_step_pa());
        let noise = [
            with_rounding(sensors.position_noise_m, sensors.position_step_m()),
            with_rounding(sensors.force_noise_n, sensors.force_step_n()),
            pressure,
            pressure,
        ];
        let mut observer = Observer { course, noise, baseline: Vec::new(), explained: Vec::new() };
        let (baseline, starts) = observer.run(&observer.course.rig);
        observer.baseline = baseline;
        observer.explained = (0..starts.len()).map(|window| observer.explained_in(window, &starts[window])).collect();
        observer
    }

    /// M J of a rig against the baseline.
    #[must_use]
    pub fn signature(&self, rig: &RigParameters) -> Vec<f64> {
        let (mut difference, _) = self.run(rig);
        for (own, baseline) in difference.iter_mut().zip(&self.baseline) {
            *own -= baseline;
        }
        let rows = self.rows();
        difference[..rows].fill(0.0);
        for (window, basis) in difference.chunks_exact_mut(rows).zip(&self.explained) {
            for direction in basis {
                let share = dot(window, direction);
                window.iter_mut().zip(direction).for_each(|(own, part)| *own -= share * part);
            }
        }
        difference
    }

    /// The baseline that this observer has.
    #[must_use]
    pub fn rig(&self) -> &RigParameters {
        &self.course.rig
    }

    /// Whitened readings in a window.
    fn rows(&self) -> usize {
        WINDOW * CHANNELS * self.course.measured.iter().filter(|measured| **measured).count()
    }

    /// The readings of a rig in all windows, and the state that each begins with.
    fn run(&self, rig: &RigParameters) -> (Vec<f64>, Vec<State>) {
        let windows = self.course.windows();
        let mut readings = Vec::with_capacity(windows * self.rows());
        let mut starts = Vec::with_capacity(windows);
        let mut plant = self.plant(rig, &self.course.start);
        for window in 0..windows {
            let start = seated(&plant, &self.course.points[window * WINDOW]);
            starts.push(start);
            plant = restarted(plant, rig, &start);
            self.read(&mut plant, window, &mut readings);
        }
        (readings, starts)
    }

    /// Steps through a window and appends its readings.
    fn read(&self, plant: &mut Plant, window: usize, readings: &mut Vec<f64>) {
        for inputs in &self.course.inputs[window * WINDOW..][..WINDOW] {
            let shown = shown(&plant.truth(inputs));
            for (axis, _) in shown.iter().zip(self.course.measured).filter(|(_, measured)| *measured) {
                readings.extend(axis.iter().zip(self.noise).map(|(value, noise)| value / noise));
            }
            plant.step(inputs);
        }
    }

    /// What a change of the initial state can explain in a window.
    fn explained_in(&self, window: usize, start: &State) -> Vec<Vec<f64>> {
        let rows = self.rows();
        let baseline = &self.baseline[window * rows..][..rows];
        let mut sensitivities = Vec::new();
        for axis in (0..2).filter(|axis| self.course.measured[*axis]) {
            for number in 0..POINT_NUMBERS {
                let mut points = self.course.points[window * WINDOW];
                points[axis] = points[axis].nudged(number);
                let plant = self.plant(&self.course.rig, start);
                let mut plant = self.plant(&self.course.rig, &seated(&plant, &points));
                let mut readings = Vec::with_capacity(rows);
                self.read(&mut plant, window, &mut readings);
                readings.iter_mut().zip(baseline).for_each(|(own, baseline)| *own -= baseline);
                // The scale of a column is no matter, but it decides what the rank is.
                let length = dot(&readings, &readings).sqrt();
                if length > 0.0 {
                    sensitivities.extend(readings.iter().map(|own| own / length));
                }
            }
        }
        let columns = sensitivities.len() / rows;
        if columns == 0 {
            return Vec::new();
        }
        let parts = DMatrix::from_vec(rows, columns, sensitivities).svd(true, false);
        let u = parts.u.expect("it was asked for");
        let least = RANK * parts.singular_values.max();
        let kept = (0..columns).filter(|column| parts.singular_values[*column] > least);
        kept.map(|column| u.column(column).iter().copied().collect()).collect()
    }

    fn plant(&self, rig: &RigParameters, state: &State) -> Plant {
        Plant::in_state(rig, state).expect("the states of a record are some that the rig can be in")
    }
}

/// A plant's state with the mechanical state and the pressures of a record; the rest stays its own.
fn seated(plant: &Plant, points: &[Point; 2]) -> State {
    let mut state = *plant.state();
    let truth = plant.truth(&Inputs::default());
    let cylinder = plant.rig().cylinder();
    for ((own, point), axis) in state.axes.iter_mut().zip(points).zip(&truth.axes) {
        let way_m = point.extension_m.clamp(0.0, cylinder.stroke_m) - own.extension_m;
        // The volumes are the plant's own: an effect may have changed them.
        let volume_a = axis.stored_air_a_j / axis.pressure_a_pa + cylinder.piston_area_m2 * way_m;
        let volume_b = axis.stored_air_b_j / axis.pressure_b_pa - cylinder.annulus_area_m2 * way_m;
        own.extension_m += way_m;
        own.rod_velocity_m_per_s = point.rod_velocity_m_per_s;
        own.stored_air_a_j = point.pressures_pa[0] * volume_a;
        own.stored_air_b_j = point.pressures_pa[1] * volume_b;
    }
    state
}

/// The plant in another state, with its memories.
fn restarted(_plant: Plant, rig: &RigParameters, state: &State) -> Plant {
    Plant::in_state(rig, state).expect("the states of a record are some that the rig can be in")
}

/// What the sensors of both axes show, before noise and rounding.
fn shown(truth: &Truth) -> [[f64; CHANNELS]; 2] {
    truth.axes.map(|axis| [axis.position_m, axis.sensor_force_n, axis.pressure_a_pa, axis.pressure_b_pa])
}

/// Length of a signature: standard deviations of the matched filter.
#[must_use]
pub fn length(signature: &[f64]) -> f64 {
    dot(signature, signature).sqrt()
}

/// How alike two signatures are, 0 to 1, whatever their sign; 0 if one is nothing.
#[must_use]
pub fn alike(left: &[f64], right: &[f64]) -> f64 {
    let lengths = length(left) * length(right);
    if lengths > 0.0 { (dot(left, right) / lengths).abs().min(1.0) } else { 0.0 }
}

fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::Setup;

    /// Two seconds of strokes of the drive, without a controller.
    pub(crate) fn course() -> Course {
        let rig = RigParameters::baseline();
        let mut plant = Plant::new(&rig, &Setup { carriage_position_m: 0.2, ..Setup::default() }).unwrap();
        let mut course =
            Course { rig, measured: [true, false], start: *plant.state(), inputs: Vec::new(), points: Vec::new() };
        for cycle in 0..2000 {
            let valve = 0.3 * libm_sin(cycle as f64 * 0.012) + if cycle % 500 < 100 { 0.3 } else { 0.0 };
            let inputs = Inputs { valve: [plant::quantise_valve(valve), 0.0], ..Inputs::default() };
            course.inputs.push(inputs);
            course.points.push(Point::of(&plant.truth(&inputs), 0.5));
            plant.step(&inputs);
        }
        course
    }

    fn libm_sin(angle: f64) -> f64 {
        angle.sin()
    }

    #[test]
    fn the_baseline_against_itself_is_nothing() {
        let observer = Observer::new(course());
        assert_eq!(length(&observer.signature(&RigParameters::baseline())), 0.0);
    }

    #[test]
    fn a_signature_is_proportional_to_its_amplitude_where_it_is_small() {
        let observer = Observer::new(course());
        let rig = |newton: f64| RigParameters::baseline().with("friction.sliding_force_n", &[26.0 + newton]).unwrap();
        let [one, two] = [0.5, 1.0].map(|newton| observer.signature(&rig(newton)));
        let ratio = length(&two) / length(&one);
        // Stops shift with the friction: a tenth beside the straight line.
        assert!((ratio - 2.0).abs() < 0.2, "{ratio}");
        assert!(alike(&one, &two) > 0.95, "{}", alike(&one, &two));
        assert!(length(&one) > 3.6, "{}", length(&one));
    }

    #[test]
    fn different_laws_leave_different_signatures() {
        let observer = Observer::new(course());
        let with = |path: &str, value| observer.signature(&RigParameters::baseline().with(path, &[value]).unwrap());
        let mass = with("mass.drive_kg", 5.2);
        let lag = with("valve.flow_lag_time_constant_ms", 8.5);
        assert!(alike(&mass, &lag) < 0.8, "{}", alike(&mass, &lag));
    }

    #[test]
    fn what_the_initial_state_explains_is_projected_out() {
        let observer = Observer::new(course());
        let rows = observer.rows();
        for (window, basis) in observer.explained.iter().enumerate() {
            assert!(basis.len() <= POINT_NUMBERS, "window {window}");
            for (at, one) in basis.iter().enumerate() {
                assert_eq!(one.len(), rows);
                // Orthonormal to rounding of a few hundred terms.
                for (other_at, other) in basis.iter().enumerate() {
                    let expected = f64::from(u8::from(at == other_at));
                    assert!((dot(one, other) - expected).abs() < 1e-12);
                }
            }
        }
    }
}
