//! Signature of an effect: the change of a record as an ideal observer sees it.
//!
//! ```text
//! J = (readings of the plant with the effect - readings of the baseline) / noise of the sensors        in windows of 100 ms
//! M = 1 - S S^+          S: change of the readings with x, v, p_a, p_b at the start of the window
//! |M J|                  distance of the matched filter of the effect from zero, in standard deviations
//! ```
//!
//! Every window starts at the true x, v, p_a, p_b of the record, with the same inputs. The other states (spool, lagged flow,
//! memories of effects) continue from the previous window, in each plant separately. The observer does not know the true
//! initial state: what a change of it could explain is projected out, window by window.
//!
//! This includes the effects of sensors. A constant offset of the position is a change of x at the start as far as the readings
//! of x go. What remains is the effect of the true x on the rest: volumes and with them the rates of the pressures, cushions
//! and stops, the gap of the linkage against the other axis. An offset of a pressure remains in the flow (which depends on the
//! absolute pressure) and in the force balance; an offset of the force sensor remains entirely, since no initial state shifts a
//! force. At rest with closed valves an offset cannot be observed, and no sum over such windows changes that. Windows are
//! independent: a slow leak over seconds counts only for its change within each 100 ms, and an observer with longer windows
//! detects such effects below these limits.
//!
//! Noise: that of the sensor and of its rounding together, sqrt(sigma^2 + step^2/12). The readings are the plant's, before
//! noise and rounding. The first window is excluded, since memories build up in it [rig-model.md: a record is judged after 0.1
//! s].
//!
//! Where a piston stops, breaks away or reverses, and where the linkage makes contact, the force jumps. Microseconds decide on
//! which side of a sample such an event falls, and a difference of hundreds of newtons in one sample is then meaningless. The
//! readings of the force next to an event (of the baseline, of the plant with the effect, or of one with a perturbed initial
//! state) are excluded [rig-model.md, Accuracy: single samples of the force at stick and contact events excepted]. An event
//! that moves by more than a sample shows in the samples between.
//!
//! Sensitivities are finite differences over a change that is small against the noise. At stick and slip they are one-sided
//! derivatives. Source: discrepancy-notes.md, 1 and 6; Kay 1998, Fundamentals of Statistical Signal Processing II, 4.3.

use crate::trajectory::{POINT_NUMBERS, Point, TrueTrajectory, WINDOW};
use nalgebra::DMatrix;
use plant::{Inputs, Plant, RigParameters, State, Truth};
use record_maker::{Record, Row};

/// Readings of an axis: position, force, pressures a and b.
const CHANNELS: usize = 4;
/// Relative singular value below which a direction of the initial state counts as without effect.
const RANK: f64 = 1e-6;

/// Index of the force among the readings of an axis.
const FORCE: usize = 1;
/// Below this speed a piston counts as at rest, m/s: bristles creep.
const REST_M_PER_S: f64 = 1e-5;

#[derive(Debug)]
pub(crate) struct Observer {
    trajectory: TrueTrajectory,
    noise: [f64; CHANNELS],
    pub(crate) baseline: Run,
    /// Subspace of the initial state for each window.
    windows: Vec<Window>,
}

/// The whitened readings of a plant, and which of them are next to an event.
#[derive(Debug, Default)]
pub(crate) struct Run {
    readings: Vec<f64>,
    jumps: Vec<bool>,
}

#[derive(Debug)]
struct Window {
    /// One column for each number of the state, all of the same length.
    sensitivities: Vec<f64>,
    /// Readings next to an event of the baseline or of a perturbed plant.
    jumps: Vec<bool>,
    /// Orthonormal, 0 where `jumps`.
    basis: Vec<Vec<f64>>,
}

impl Observer {
    pub(crate) fn new(trajectory: TrueTrajectory) -> Self {
        let sensors = trajectory.rig.sensors();
        let with_rounding = |noise: f64, step: f64| (noise * noise + step * step / 12.0).sqrt();
        let pressure = with_rounding(sensors.pressure_noise_pa, sensors.pressure_step_pa());
        let noise = [
            with_rounding(sensors.position_noise_m, sensors.position_step_m()),
            with_rounding(sensors.force_noise_n, sensors.force_step_n()),
            pressure,
            pressure,
        ];
        let mut observer = Observer { trajectory, noise, baseline: Run::default(), windows: Vec::new() };
        let (baseline, starts) = observer.run(&observer.trajectory.rig);
        observer.baseline = baseline;
        observer.windows = (0..starts.len()).map(|window| observer.window(window, &starts[window])).collect();
        observer
    }

    /// M J of a rig against the baseline.
    pub(crate) fn signature(&self, rig: &RigParameters) -> Vec<f64> {
        self.between(&self.readings(rig), &self.baseline)
    }

    pub(crate) fn readings(&self, rig: &RigParameters) -> Run {
        self.run(rig).0
    }

    /// The readings of the record of the trajectory, without noise.
    pub(crate) fn observed(&self, record: &Record) -> Run {
        let measured: Vec<usize> = (0..2).filter(|axis| self.trajectory.measured[*axis]).collect();
        let whole = self.trajectory.windows() * WINDOW;
        let rows = &record.rows[..whole];
        let touches = |row: &Row| row.contact_force_n != 0.0;
        let mut run = Run::default();
        for (at, row) in rows.iter().enumerate() {
            for axis in &measured {
                let of = |row: &Row| (direction(row.axes[*axis].rod_velocity_m_per_s), touches(row));
                let near = [at.saturating_sub(1), (at + 1).min(whole - 1)];
                let jumps = near.iter().any(|near| of(&rows[*near]) != of(row));
                run.readings.extend(
                    row.without_noise[*axis].iter().zip(self.noise).map(|(value, noise)| value / noise),
                );
                run.jumps.extend((0..CHANNELS).map(|channel| jumps && channel == FORCE));
            }
        }
        run
    }

    /// M applied to the difference of two runs.
    pub(crate) fn between(&self, run: &Run, from: &Run) -> Vec<f64> {
        let rows = self.rows();
        let mut differences: Vec<f64> =
            run.readings.iter().zip(&from.readings).map(|(reading, from)| reading - from).collect();
        let settling = differences.len().min(rows * self.trajectory.settling);
        differences[..settling].fill(0.0);
        let jumps: Vec<bool> = run.jumps.iter().zip(&from.jumps).map(|(jump, from)| *jump || *from).collect();
        for ((difference, jumps), window) in
            differences.chunks_exact_mut(rows).zip(jumps.chunks_exact(rows)).zip(&self.windows)
        {
            window.project(difference, jumps);
        }
        differences
    }

    pub(crate) fn rig(&self) -> &RigParameters {
        &self.trajectory.rig
    }

    /// Number of readings in a window.
    pub(crate) fn rows(&self) -> usize {
        WINDOW * CHANNELS * self.trajectory.measured.iter().filter(|measured| **measured).count()
    }

    /// The readings of a rig in all windows, and the initial state of each.
    fn run(&self, rig: &RigParameters) -> (Run, Vec<State>) {
        let windows = self.trajectory.windows();
        let mut run = Run::default();
        let mut starts = Vec::with_capacity(windows);
        let mut plant = self.plant(rig, &self.trajectory.start);
        for window in 0..windows {
            let start = at_true_state(&plant, &self.trajectory.points[window * WINDOW]);
            starts.push(start);
            plant.go_on_in(&start).expect("the states of a record are some that the rig can be in");
            self.read(&mut plant, window, &mut run);
        }
        (run, starts)
    }

    /// Steps through a window and appends its readings.
    fn read(&self, plant: &mut Plant, window: usize, run: &mut Run) {
        let from = run.readings.len();
        let measured =
            || self.trajectory.measured.iter().enumerate().filter(|(_, measured)| **measured).map(|(i, _)| i);
        let mut phases = [Vec::with_capacity(WINDOW + 1), Vec::with_capacity(WINDOW + 1)];
        for inputs in &self.trajectory.inputs[window * WINDOW..][..WINDOW] {
            let truth = plant.truth(inputs);
            let shown = plant.noise_free_readings(&truth);
            for i in measured() {
                run.readings.extend(shown[i].iter().zip(self.noise).map(|(value, noise)| value / noise));
                phases[i].push(phase(&truth, i));
            }
            plant.step(inputs);
        }
        let end = plant.truth(&Inputs::default());
        run.jumps.resize(run.readings.len(), false);
        let width = self.rows() / WINDOW;
        for (lane, i) in measured().enumerate() {
            phases[i].push(phase(&end, i));
            for at in 0..WINDOW {
                let current = phases[i][at];
                let jumps = phases[i][at.saturating_sub(1)] != current || phases[i][at + 1] != current;
                run.jumps[from + at * width + lane * CHANNELS + FORCE] = jumps;
            }
        }
    }

    /// The changes of a window by changes of its initial state.
    fn window(&self, window: usize, start: &State) -> Window {
        let rows = self.rows();
        let baseline = &self.baseline.readings[window * rows..][..rows];
        let mut jumps = self.baseline.jumps[window * rows..][..rows].to_vec();
        let mut sensitivities = Vec::new();
        for axis in (0..2).filter(|axis| self.trajectory.measured[*axis]) {
            for number in 0..POINT_NUMBERS {
                let mut points = self.trajectory.points[window * WINDOW];
                points[axis] = points[axis].perturbed(number);
                let mut plant = self.plant(&self.trajectory.rig, start);
                plant
                    .go_on_in(&at_true_state(&plant, &points))
                    .expect("a perturbation leaves the rig in a state of its own");
                let mut perturbed = Run::default();
                self.read(&mut plant, window, &mut perturbed);
                sensitivities.extend(
                    perturbed.readings.iter().zip(baseline).map(|(reading, baseline)| reading - baseline),
                );
                jumps.iter_mut().zip(&perturbed.jumps).for_each(|(all, jump)| *all |= jump);
            }
        }
        let basis = basis(&sensitivities, &jumps);
        Window { sensitivities, jumps, basis }
    }

    fn plant(&self, rig: &RigParameters, state: &State) -> Plant {
        // A supply of another pressure has dropped by the same share.
        let ratio = rig.supply().pressure_pa / self.trajectory.rig.supply().pressure_pa;
        let state = State { supply_pressure_pa: ratio * state.supply_pressure_pa, ..*state };
        Plant::in_state(rig, &state).expect("the states of a record are some that the rig can be in")
    }
}

impl Window {
    /// Projects the subspace of the initial state out of a difference of readings; those at `jumps` are set to 0.
    fn project(&self, difference: &mut [f64], jumps: &[bool]) {
        let all: Vec<bool> = self.jumps.iter().zip(jumps).map(|(left, right)| *left || *right).collect();
        difference.iter_mut().zip(&all).filter(|(_, jumps)| **jumps).for_each(|(value, _)| *value = 0.0);
        let more;
        let basis = if all == self.jumps {
            &self.basis
        } else {
            more = basis(&self.sensitivities, &all);
            &more
        };
        for direction in basis {
            let share = dot(difference, direction);
            difference.iter_mut().zip(direction).for_each(|(value, part)| *value -= share * part);
        }
    }
}

/// An orthonormal basis of some columns, with the rows of `without` set to 0.
fn basis(columns: &[f64], without: &[bool]) -> Vec<Vec<f64>> {
    let rows = without.len();
    let mut kept = Vec::with_capacity(columns.len());
    for column in columns.chunks_exact(rows) {
        let column: Vec<f64> =
            column.iter().zip(without).map(|(value, without)| if *without { 0.0 } else { *value }).collect();
        // Columns are normalised, since their scale would decide the rank.
        let length = length(&column);
        if length > 0.0 {
            kept.extend(column.iter().map(|value| value / length));
        }
    }
    if kept.is_empty() {
        return Vec::new();
    }
    let parts = DMatrix::from_vec(rows, kept.len() / rows, kept).svd(true, false);
    let u = parts.u.expect("it was asked for");
    let least = RANK * parts.singular_values.max();
    let kept = (0..u.ncols()).filter(|column| parts.singular_values[*column] > least);
    kept.map(|column| u.column(column).iter().copied().collect()).collect()
}

/// Direction of motion of an axis, and whether the rods are in contact.
fn phase(truth: &Truth, axis: usize) -> (i8, bool) {
    (direction(truth.axes[axis].rod_velocity_m_per_s), truth.contact_force_n != 0.0)
}

fn direction(velocity_m_per_s: f64) -> i8 {
    if velocity_m_per_s.abs() < REST_M_PER_S { 0 } else { velocity_m_per_s.signum() as i8 }
}

/// A plant's state with the mechanical state and the pressures of a record.
fn at_true_state(plant: &Plant, points: &[Point; 2]) -> State {
    let mut state = *plant.state();
    let truth = plant.truth(&Inputs::default());
    let cylinder = plant.rig().cylinder();
    for ((axis_state, point), axis) in state.axes.iter_mut().zip(points).zip(&truth.axes) {
        let way_m = point.extension_m.clamp(0.0, cylinder.stroke_m) - axis_state.extension_m;
        // The volumes are those of this plant: an effect may have changed them.
        let volume_a = axis.stored_air_a_j / axis.pressure_a_pa + cylinder.piston_area_m2 * way_m;
        let volume_b = axis.stored_air_b_j / axis.pressure_b_pa - cylinder.annulus_area_m2 * way_m;
        axis_state.extension_m += way_m;
        axis_state.rod_velocity_m_per_s = point.rod_velocity_m_per_s;
        axis_state.stored_air_a_j = point.pressures_pa[0] * volume_a;
        axis_state.stored_air_b_j = point.pressures_pa[1] * volume_b;
    }
    state
}

/// Length of a signature: standard deviations of the matched filter.
pub(crate) fn length(signature: &[f64]) -> f64 {
    dot(signature, signature).sqrt()
}

/// Absolute cosine between two signatures, 0 to 1; 0 if one is zero.
pub(crate) fn abs_cosine(left: &[f64], right: &[f64]) -> f64 {
    let lengths = length(left) * length(right);
    if lengths > 0.0 { (dot(left, right) / lengths).abs().min(1.0) } else { 0.0 }
}

pub(crate) fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::{Setup, Truth};

    fn points(truth: &Truth) -> [Point; 2] {
        let point = |axis: usize, extension_m: f64| Point {
            extension_m,
            rod_velocity_m_per_s: truth.axes[axis].rod_velocity_m_per_s,
            pressures_pa: [truth.axes[axis].pressure_a_pa, truth.axes[axis].pressure_b_pa],
        };
        [point(0, truth.axes[0].position_m), point(1, 0.5 - truth.axes[1].position_m)]
    }

    /// Two seconds of strokes of the drive, without a controller.
    pub(crate) fn trajectory() -> TrueTrajectory {
        let rig = RigParameters::baseline();
        let mut plant = Plant::new(&rig, &Setup { carriage_position_m: 0.2, ..Setup::default() }).unwrap();
        let mut trajectory = TrueTrajectory {
            rig,
            measured: [true, false],
            start: *plant.state(),
            inputs: Vec::new(),
            settling: 1,
            points: Vec::new(),
        };
        for cycle in 0..2000 {
            let valve = 0.3 * (f64::from(cycle) * 0.012).sin() + if cycle % 500 < 100 { 0.3 } else { 0.0 };
            let inputs = Inputs { valve: [plant::quantise_valve(valve), 0.0], ..Inputs::default() };
            trajectory.inputs.push(inputs);
            trajectory.points.push(points(&plant.truth(&inputs)));
            plant.step(&inputs);
        }
        trajectory
    }

    #[test]
    fn the_baseline_against_itself_is_nothing() {
        assert_eq!(length(&Observer::new(trajectory()).signature(&RigParameters::baseline())), 0.0);
    }

    #[test]
    fn a_signature_is_proportional_to_its_amplitude_where_it_is_small() {
        let observer = Observer::new(trajectory());
        let rig = |newton: f64| {
            RigParameters::baseline().with("friction.sliding_force_n", &[26.0 + newton]).unwrap()
        };
        let [one, two] = [0.5, 1.0].map(|newton| observer.signature(&rig(newton)));
        let ratio = length(&two) / length(&one);
        // Stops shift with the friction: a tenth beside the straight line.
        assert!((ratio - 2.0).abs() < 0.2, "{ratio}");
        assert!(abs_cosine(&one, &two) > 0.95, "{}", abs_cosine(&one, &two));
        assert!(length(&one) > 3.6, "{}", length(&one));
    }

    #[test]
    fn different_laws_leave_different_signatures() {
        let observer = Observer::new(trajectory());
        let with =
            |path: &str, value| observer.signature(&RigParameters::baseline().with(path, &[value]).unwrap());
        let mass = with("mass.drive_kg", 5.2);
        let lag = with("valve.flow_lag_time_constant_ms", 8.5);
        assert!(abs_cosine(&mass, &lag) < 0.8, "{}", abs_cosine(&mass, &lag));
    }

    #[test]
    fn what_the_initial_state_explains_is_projected_out() {
        let observer = Observer::new(trajectory());
        let rows = observer.rows();
        for (window, basis) in observer.windows.iter().map(|window| &window.basis).enumerate() {
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
