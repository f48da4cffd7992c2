//! Start states of windows: their sensitivities, and their estimation.

use super::whiten::gaussian;
use super::{COARSE_SUBSTEPS, WINDOW_PERIODS, Windows, dot, project};
use crate::gridded_record::{AxisState, GriddedRecord};
use nalgebra::{DMatrix, DVector};
use plant::{Batch, Inputs, Plant, RigParameters, Setup, State};
use rand_pcg::Pcg64;
use std::borrow::Cow;

/// Largest move of a start state in one step where the rods are linked.
const MOST_STEP: [f64; 4] = [1e-4, 0.02, 2e3, 2e3];
/// Backtracking factor.
const SHORTER: f64 = 0.3;
/// Speeds of a piston that seems at rest, m/s: too slow to measure, but sliding pistons need no break-away force.
const SLIDES_M_PER_S: [f64; 2] = [1e-4, -1e-4];
/// Fall of a window's squares at which another speed is taken.
const MIN_CHI2_DROP: f64 = 10.0;
/// Gauss-Newton passes after each search on linked records.
const LINKED_PASSES: usize = 3;
/// Grids of relative shifts of the two pistons: first over the noise of two sensors, then finer.
const SHIFTS_M: [[f64; 3]; 2] = [[30e-6, 70e-6, 120e-6], [5e-6, 12e-6, 25e-6]];
/// Gauss-Newton passes on other records.
pub(super) const START_PASSES: usize = 2;
/// Largest change of a force reading by a perturbation, in standard deviations; more is a jump.
const JUMP: f64 = 0.5;
/// Prior standard deviations of the start state: m, m/s, Pa, Pa.
const PRIOR_STD: [f64; 4] = [2e-3, 0.2, 2e4, 2e4];

/// Lower bound of a chamber's absolute pressure, Pa.
const LEAST_PA: f64 = 1e4;

/// By window and number of the start state.
type Sensitivities<'s> = Cow<'s, [Vec<Vec<f64>>]>;

impl Windows<'_> {
    /// Estimates the start states in `passes` passes (linked records always), then their sensitivities.
    pub(super) fn estimate_starts(mut self, passes: usize) -> Self {
        self.estimate_starts_by(passes, |windows| Cow::Owned(windows.sensitivities()));
        self.bases = self.sensitivities().into_iter().map(orthonormal).collect();
        self
    }

    /// Estimates the start states with these sensitivities in each pass.
    fn estimate_starts_by<'s>(&mut self, passes: usize, sensitivities: impl Fn(&Self) -> Sensitivities<'s>) {
        self.choose_rates();
        if self.record.linked {
            // A micrometre of the eye in its gap is two newtons, so the smoothed states are too coarse. A grid search finds the
            // side of the gap, then Gauss-Newton starts there.
            for shifts_m in SHIFTS_M {
                self.shift_linked(&shifts_m);
                self.improve_starts(LINKED_PASSES, &sensitivities);
            }
        } else {
            self.improve_starts(passes, &sensitivities);
        }
    }

    /// Replaces the speed of a start state by an indistinguishable one where the readings fit better.
    fn choose_rates(&mut self) {
        let mut squares: Option<Vec<f64>> = None;
        for slide_m_per_s in SLIDES_M_PER_S {
            let points = self.points.clone();
            for start in &self.starts {
                for point in &mut self.points[start / WINDOW_PERIODS] {
                    let rests = point.rod_velocity_m_per_s == 0.0;
                    let other = point.alternative_velocity_m_per_s.or(rests.then_some(slide_m_per_s));
                    point.rod_velocity_m_per_s = other.unwrap_or(point.rod_velocity_m_per_s);
                }
            }
            if self.points == points {
                return;
            }
            let tried = std::mem::replace(&mut self.points, points);
            let squares = squares.get_or_insert_with(|| self.squares_of(&self.simulate_coarsely(&self.rig)));
            let points = std::mem::replace(&mut self.points, tried);
            let all_new = self.squares_of(&self.simulate_coarsely(&self.rig));
            for ((start, old), new) in self.starts.iter().zip(squares).zip(all_new) {
                if new < *old - MIN_CHI2_DROP {
                    *old = new;
                } else {
                    self.points[start / WINDOW_PERIODS] = points[start / WINDOW_PERIODS];
                }
            }
        }
    }

    /// Gauss-Newton on the start state of each window. Steps that raise the squares, as around a break-away, are undone and
    /// shortened.
    fn improve_starts<'s>(&mut self, passes: usize, sensitivities: &impl Fn(&Self) -> Sensitivities<'s>) {
        if passes == 0 {
            return;
        }
        let rows = self.rows();
        let mut residual = self.raw_residual(&self.simulate(&self.rig));
        let mut shares = vec![1.0; self.starts.len()];
        for _ in 0..passes {
            let points = self.points.clone();
            self.move_starts(&sensitivities(self), &residual, &shares);
            let new = self.raw_residual(&self.simulate(&self.rig));
            let windows = residual.chunks_exact_mut(rows).zip(new.chunks_exact(rows));
            for ((residual, new), (start, share)) in windows.zip(self.starts.iter().zip(&mut shares)) {
                if dot(new, new) > dot(residual, residual) {
                    self.points[start / WINDOW_PERIODS] = points[start / WINDOW_PERIODS];
                    *share *= SHORTER;
                } else {
                    residual.copy_from_slice(new);
                    *share = 1.0;
                }
            }
        }
    }

    /// Moves the start states by a fraction of the step, one for each window.
    fn move_starts(&mut self, sensitivities: &[Vec<Vec<f64>>], residual: &[f64], shares: &[f64]) {
        let rows = self.rows();
        let measured: Vec<usize> = (0..2).filter(|axis| self.record.measured[*axis]).collect();
        for (at, columns) in sensitivities.iter().enumerate() {
            let residual = &residual[at * rows..][..rows];
            let count = columns.len();
            // Prior precision, in units of the prior standard deviation.
            let mut matrix = DMatrix::<f64>::identity(count, count);
            for row in 0..count {
                for column in 0..count {
                    matrix[(row, column)] += dot(&columns[row], &columns[column]);
                }
            }
            let right = DVector::from_iterator(count, columns.iter().map(|column| dot(column, residual)));
            let Some(moved) = matrix.cholesky().map(|factor| factor.solve(&right)) else { continue };
            for (place, axis) in measured.iter().enumerate() {
                let part = |number: usize| {
                    let most = if self.record.linked { MOST_STEP[number] } else { PRIOR_STD[number] };
                    shares[at]
                        * (moved[place * AxisState::PERTURBATIONS.len() + number] * PRIOR_STD[number])
                            .clamp(-most, most)
                };
                let point = &mut self.points[self.starts[at] / WINDOW_PERIODS][*axis];
                point.extension_m += part(0);
                // A piston at rest stays at rest: a speed would only let it slide and stick again.
                if point.rod_velocity_m_per_s != 0.0 {
                    point.rod_velocity_m_per_s += part(1);
                }
                point.pressures_pa[0] += part(2);
                point.pressures_pa[1] += part(3);
            }
        }
    }

    /// Grid search over relative shifts of the pistons in each window. On the wrong side of the gap no Gauss-Newton step is short
    /// enough.
    fn shift_linked(&mut self, shifts_m: &[f64]) {
        let points = self.points.clone();
        let mut squares = self.raw_squares();
        let mut best = vec![0.0; self.starts.len()];
        for shift_m in shifts_m.iter().flat_map(|size_m| [-size_m, *size_m]) {
            for (moved, from) in self.points.iter_mut().zip(&points) {
                for axis in 0..2 {
                    moved[axis].extension_m = from[axis].extension_m + 0.5 * shift_m;
                }
            }
            for ((best, least), new) in best.iter_mut().zip(&mut squares).zip(self.raw_squares()) {
                if new < *least {
                    (*best, *least) = (shift_m, new);
                }
            }
        }
        self.points = points;
        for (start, shift_m) in self.starts.iter().zip(best) {
            for point in &mut self.points[start / WINDOW_PERIODS] {
                point.extension_m += 0.5 * shift_m;
            }
        }
    }

    /// Squared residuals of each window at the present start states.
    fn raw_squares(&self) -> Vec<f64> {
        self.squares_of(&self.simulate(&self.rig))
    }

    fn squares_of(&self, simulated: &[f64]) -> Vec<f64> {
        self.raw_residual(simulated).chunks_exact(self.rows()).map(|window| dot(window, window)).collect()
    }

    /// A synthetic record of this rig in the same windows: `simulated` plus drawn noise. Its start states are estimated anew from
    /// the record's smoothed states, by Gauss-Newton with these `sensitivities` of the windows.
    pub(crate) fn redrawn(
        &self,
        simulated: &[f64],
        sensitivities: &[Vec<Vec<f64>>],
        random: &mut Pcg64,
    ) -> Self {
        let noise = self.raw_noise(random);
        let readings = simulated.iter().zip(&noise).map(|(value, noise)| value + noise).collect();
        let points = (0..self.points.len())
            .map(|window| self.record.smoothed_states[window * WINDOW_PERIODS])
            .collect();
        let mut windows = Windows { points, readings, ..self.clone() };
        windows.estimate_starts_by(START_PASSES, |_| Cow::Borrowed(sensitivities));
        windows
    }

    /// The same windows in another record of the same run, which differs by noise alone: its start states are estimated with
    /// these `sensitivities`, of the windows of this record. `None` where a window is left out of one of the two.
    pub(crate) fn replicated<'r>(
        &self,
        record: &'r GriddedRecord,
        sensitivities: &[Vec<Vec<f64>>],
    ) -> Option<Windows<'r>> {
        let mut windows = Windows::with_recorded_starts(record, &self.rig);
        if windows.starts != self.starts {
            return None;
        }
        windows.estimate_starts_by(0, |_| Cow::Borrowed(sensitivities));
        windows.bases.clone_from(&self.bases);
        Some(windows)
    }

    /// The same without estimates: `simulated` plus drawn noise of `variance_factor` times the power, with start states that are
    /// off by drawn errors of the smoothed states.
    pub(crate) fn drawn(&self, simulated: &[f64], variance_factor: f64, random: &mut Pcg64) -> Self {
        let size = variance_factor.sqrt();
        let noise = self.raw_noise(random);
        let readings = simulated.iter().zip(&noise).map(|(value, noise)| value + size * noise).collect();
        let mut points = self.points.clone();
        for points in &mut points {
            for axis in (0..2).filter(|axis| self.record.measured[*axis]) {
                let point = &mut points[axis];
                let rests = point.rod_velocity_m_per_s == 0.0;
                let [way_m, rate_m_per_s, a_pa, b_pa] =
                    self.record.state_errors(axis, rests).map(|error| size * error * gaussian(random));
                point.extension_m += way_m;
                point.rod_velocity_m_per_s += rate_m_per_s;
                point.pressures_pa[0] += a_pa;
                point.pressures_pa[1] += b_pa;
            }
        }
        Windows { points, readings, ..self.clone() }
    }

    /// Perturbation of each simulation: its axes, and the index in the start state. Axes that do not act on each other
    /// are perturbed together.
    fn perturbations(&self) -> Vec<(Vec<usize>, usize)> {
        let measured: Vec<usize> = (0..2).filter(|axis| self.record.measured[*axis]).collect();
        let numbers = 0..AxisState::PERTURBATIONS.len();
        if self.axes_are_independent() {
            return numbers.map(|number| (measured.clone(), number)).collect();
        }
        measured.iter().flat_map(|axis| numbers.clone().map(|number| (vec![*axis], number))).collect()
    }

    /// Sensitivities of the readings to each number of the start state, per prior standard deviation, axis by axis.
    pub(crate) fn sensitivities(&self) -> Vec<Vec<Vec<f64>>> {
        let mut plant = self.plant(&self.rig).with_substeps(COARSE_SUBSTEPS);
        let rows = self.rows();
        let perturbations = self.perturbations();
        let mut all: Vec<Vec<Vec<f64>>> = Vec::with_capacity(self.starts.len());
        for start in (0..self.record.len() / WINDOW_PERIODS).map(|window| window * WINDOW_PERIODS) {
            let judged = self.starts.get(all.len()) == Some(&start);
            let points = self.points[start / WINDOW_PERIODS];
            set_state(&mut plant, self.record, start, &points);
            let mut plants = vec![plant];
            for (axes, number) in perturbations.iter().filter(|_| judged) {
                let mut points = points;
                axes.iter().for_each(|axis| points[*axis] = points[*axis].perturbed(*number));
                let mut perturbed = plants[0].clone();
                set_state(&mut perturbed, self.record, start, &points);
                plants.push(perturbed);
            }
            let mut read = vec![Vec::with_capacity(rows); plants.len()];
            let mut batch = Batch::new(plants);
            for inputs in &self.record.inputs[start..start + WINDOW_PERIODS] {
                self.read_each(&batch, inputs, &mut read);
                batch.step_alike(inputs);
            }
            plant = batch.into_plants().swap_remove(0);
            if !judged {
                continue;
            }
            let straight = read.remove(0);
            let mut columns: Vec<((usize, usize), Vec<f64>)> = Vec::new();
            for ((axes, number), read) in perturbations.iter().zip(&read) {
                for axis in axes {
                    let column = self.start_sensitivity(all.len(), *axis, *number, [read, &straight]);
                    columns.push(((*axis, *number), column));
                }
            }
            columns.sort_by_key(|(of, _)| *of);
            all.push(columns.into_iter().map(|(_, column)| column).collect());
        }
        all
    }

    /// Sensitivity of a window to a number of an axis' start state, of its readings with that number perturbed and without.
    fn start_sensitivity(
        &self,
        window: usize,
        axis: usize,
        number: usize,
        [perturbed, straight]: [&Vec<f64>; 2],
    ) -> Vec<f64> {
        let valid = &self.valid[window * self.rows()..][..self.rows()];
        let alone = self.axes_are_independent();
        let shows = self.outputs.iter().map(|(of, _)| !alone || *of == axis).cycle();
        let mut column: Vec<f64> = perturbed
            .iter()
            .zip(straight)
            .zip(valid.iter().zip(shows))
            .map(
                |((perturbed, straight), (valid, shows))| {
                    if *valid && shows { perturbed - straight } else { 0.0 }
                },
            )
            .collect();
        // Removes jumps that moved by a sample before the difference is scaled up.
        self.flatten(&mut column, JUMP);
        let scale = PRIOR_STD[number] / AxisState::PERTURBATIONS[number];
        column.iter_mut().for_each(|value| *value *= scale);
        self.whiten(window, &mut column);
        column
    }
}

/// Initial state of a simulation of a record: that of a run with the record's set-up.
pub(crate) fn first_state(record: &GriddedRecord, rig: &RigParameters) -> State {
    let stroke_m = rig.cylinder().stroke_m;
    let drive_m = if record.measured[0] { record.smoothed_states[0][0].extension_m } else { 0.1 };
    let setup = Setup {
        carriage_position_m: drive_m.clamp(0.0, stroke_m),
        linked: record.linked,
        added_mass_kg: record.added_mass_kg,
    };
    let plant = Plant::new(rig, &setup).expect("the set-up was checked");
    let mut state = *plant.state();
    for (axis, inputs) in state.axes.iter_mut().zip(record.inputs[0].valve) {
        axis.spool = inputs;
    }
    state
}

/// A plant's state with these points on the measured axes, otherwise unchanged.
pub(crate) fn state_at(plant: &Plant, points: &[AxisState; 2], measured: [bool; 2]) -> State {
    let mut state = *plant.state();
    let truth = plant.truth(&Inputs::default());
    let cylinder = plant.rig().cylinder();
    for i in (0..2).filter(|i| measured[*i]) {
        let (axis_state, point, axis) = (&mut state.axes[i], &points[i], &truth.axes[i]);
        let way_m = point.extension_m.clamp(0.0, cylinder.stroke_m) - axis_state.extension_m;
        // Volumes come from the plant, since an effect may change them.
        let volume_a_m3 = axis.stored_air_a_j / axis.pressure_a_pa + cylinder.piston_area_m2 * way_m;
        let volume_b_m3 = axis.stored_air_b_j / axis.pressure_b_pa - cylinder.annulus_area_m2 * way_m;
        // Rounding may leave the stroke.
        axis_state.extension_m = (axis_state.extension_m + way_m).clamp(0.0, cylinder.stroke_m);
        axis_state.rod_velocity_m_per_s = point.rod_velocity_m_per_s;
        axis_state.stored_air_a_j = point.pressures_pa[0].max(LEAST_PA) * volume_a_m3;
        axis_state.stored_air_b_j = point.pressures_pa[1].max(LEAST_PA) * volume_b_m3;
    }
    state
}

/// Sets the measured axes of a plant to these points, and its time to that of a period of the record.
pub(crate) fn set_state(plant: &mut Plant, record: &GriddedRecord, period: usize, points: &[AxisState; 2]) {
    let state = state_at(plant, points, record.measured);
    plant.go_on_in(&state).expect("the points of a record are states of the rig");
    plant.set_time(record.since_start(period) as u64);
}

/// Orthonormal basis of some columns, without directions whose norm is 1 or less: they do not show in the whitened window.
pub(super) fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut column in columns {
        // Twice, against rounding.
        project(&mut column, &basis);
        project(&mut column, &basis);
        let length = dot(&column, &column).sqrt();
        if length > 1.0 {
            column.iter_mut().for_each(|value| *value /= length);
            basis.push(column);
        }
    }
    basis
}
