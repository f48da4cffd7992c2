//! A record in windows of 100 ms, each simulated from where the record says that the pistons were.
//!
//! ```text
//!   e_k = M_k (y_k - f_k(start_k; rig)) / sigma          window k: readings y, simulation f, noise sigma
//!   M_k = 1 - Q_k Q_k'                                   Q_k: what a change of x, v, p_a, p_b at the window's start explains
//! ```
//!
//! Spool, lagged flows and whatever effects remember go on from window to window; mechanics and pressures start anew from the
//! record's points, whose errors M_k takes out to first order. A direction of the start that is worth less than one standard
//! deviation over the whole window is left in: at rest the speed is none.
//!
//! Where a piston stops, breaks away or turns, the force jumps, and microseconds decide on which side of a sample: a reading of
//! the force that differs from those around it more than noise can is put back to their median, in residuals and sensitivities
//! alike [rig-model.md, Accuracy].
//!
//! Source: discrepancy-notes.md, 1 (windows of 100 to 200 ms judge best), 6.

use crate::course::{CHANNELS, Course, PERIOD_S, Point};
use crate::seats::Seats;
use nalgebra::{DMatrix, DVector};
use plant::{Inputs, Plant, RigParameters, Setup, State};
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Periods of a window.
pub const WINDOW: usize = 100;
/// Place of the force among the readings.
const FORCE: usize = 1;
/// How far a start may move at a time where the rods are linked.
const FARTHEST: [f64; 4] = [1e-4, 0.02, 2e3, 2e3];
/// How often the starts of a linked record are moved.
const LINKED_PASSES: usize = 3;
/// The same of others, where it is asked for.
const SETTLING: usize = 2;
/// Steps of a period where only a difference is wanted.
const COARSE_SUBSTEPS: u32 = 5;
/// Readings to each side that a reading of the force is compared with.
const SPIKE_REACH: usize = 4;
/// Standard deviations by which it may differ from their median.
const SPIKE: f64 = 6.0;
/// Changes of a start by which sensitivities are taken: x, v, p_a, p_b. Small, so that the course stays what it is.
const NUDGES: [f64; 4] = [2e-6, 2e-4, 50.0, 50.0];
/// How far the points may be from the truth, generously: m, m/s, Pa, Pa.
const DOUBT: [f64; 4] = [2e-3, 0.2, 2e4, 2e4];

/// The windows of a course under a rig, with what their starts explain.
#[derive(Debug)]
pub struct Windows<'a> {
    course: &'a Course,
    rig: RigParameters,
    /// First period of each window.
    starts: Vec<usize>,
    /// Where each window begins, those that are not judged included.
    points: Vec<[Point; 2]>,
    /// Axis and channel of each lane.
    lanes: Vec<(usize, usize)>,
    /// Readings over their noise, window by window, period by period, lane by lane; 0 where there is none.
    readings: Vec<f64>,
    valid: Vec<bool>,
    /// What an error of the sampling instant would change in each reading, in standard deviations.
    drifts: Vec<f64>,
    /// Orthonormal, per window.
    bases: Vec<Vec<Vec<f64>>>,
}

impl<'a> Windows<'a> {
    /// The windows of a course, their starts' sensitivities under a baseline rig.
    #[must_use]
    pub fn new(course: &'a Course, rig: &RigParameters) -> Self {
        let measured = (0..2).filter(|axis| course.measured[*axis]);
        let lanes: Vec<_> = measured.flat_map(|axis| (0..CHANNELS).map(move |at| (axis, at))).collect();
        // The first window fills lags and memories, and is not judged [rig-model.md: a record is judged after 0.1 s].
        let starts: Vec<usize> = (1..course.len() / WINDOW)
            .map(|window| window * WINDOW)
            .filter(|start| !course.gaps[*start..start + WINDOW].contains(&true))
            .collect();
        let mut readings = Vec::with_capacity(starts.len() * WINDOW * lanes.len());
        let mut valid = Vec::with_capacity(readings.capacity());
        for start in &starts {
            for samples in &course.samples[*start..start + WINDOW] {
                for (axis, at) in &lanes {
                    let sample = samples[*axis][*at];
                    valid.push(sample.is_some());
                    readings.push(sample.map_or(0.0, |value| value / course.noise[*axis][*at]));
                }
            }
        }
        let points = (0..course.len() / WINDOW).map(|window| course.points[window * WINDOW]).collect();
        let mut drifts = Vec::with_capacity(readings.len());
        for at in starts.iter().flat_map(|start| *start..start + WINDOW) {
            drifts.extend(lanes.iter().map(|(axis, channel)| drift(course, at, *axis, *channel)));
        }
        let mut windows = Windows {
            course,
            rig: rig.clone(),
            starts,
            points,
            lanes,
            readings,
            valid,
            drifts,
            bases: Vec::new(),
        };
        windows.bases = windows.sensitivities().into_iter().map(orthonormal).collect();
        // A micrometre of the eye in its gap is two newtons: where the rods are linked, the record's points are too coarse.
        for _ in 0..if course.linked { LINKED_PASSES } else { 0 } {
            windows.settle();
        }
        windows
    }

    /// Moves each window's start to where its readings say that it was, and takes its sensitivities anew.
    fn settle(&mut self) {
        let rows = self.rows();
        let all = self.sensitivities();
        let simulated = self.simulate(&self.rig);
        let mut left: Vec<f64> =
            self.readings.iter().zip(&simulated).map(|(reading, own)| reading - own).collect();
        for (value, _) in left.iter_mut().zip(&self.valid).filter(|(_, valid)| !**valid) {
            *value = 0.0;
        }
        let measured: Vec<usize> = (0..2).filter(|axis| self.course.measured[*axis]).collect();
        for (at, columns) in all.iter().enumerate() {
            let own = &mut left[at * rows..][..rows];
            self.flatten_spikes(own);
            self.whiten(at, own);
            let count = columns.len();
            // What is known of a start beforehand, in units of its doubt.
            let mut matrix = DMatrix::<f64>::identity(count, count);
            for row in 0..count {
                for column in 0..count {
                    matrix[(row, column)] += dot(&columns[row], &columns[column]);
                }
            }
            let right = DVector::from_iterator(count, columns.iter().map(|column| dot(column, own)));
            let Some(moved) = matrix.cholesky().map(|factor| factor.solve(&right)) else { continue };
            for (place, axis) in measured.iter().enumerate() {
                let part = |number: usize| {
                    let most = if self.course.linked { FARTHEST[number] } else { DOUBT[number] };
                    (moved[place * NUDGES.len() + number] * DOUBT[number]).clamp(-most, most)
                };
                let point = &mut self.points[self.starts[at] / WINDOW][*axis];
                point.extension_m += part(0);
                // What rests, rests: a speed of its own would only let it slide and stick again.
                if point.rod_velocity_m_per_s != 0.0 {
                    point.rod_velocity_m_per_s += part(1);
                }
                point.pressures_pa[0] += part(2);
                point.pressures_pa[1] += part(3);
            }
        }
        self.bases = self.sensitivities().into_iter().map(orthonormal).collect();
    }

    /// The baseline rig.
    #[must_use]
    pub fn rig(&self) -> &RigParameters {
        &self.rig
    }

    /// The course.
    #[must_use]
    pub fn course(&self) -> &Course {
        self.course
    }

    /// How many windows there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// First period of each window.
    #[must_use]
    pub fn starts(&self) -> &[usize] {
        &self.starts
    }

    /// Axis and channel of each lane.
    #[must_use]
    pub fn lanes(&self) -> &[(usize, usize)] {
        &self.lanes
    }

    /// Numbers in a window.
    #[must_use]
    pub fn rows(&self) -> usize {
        WINDOW * self.lanes.len()
    }

    /// Degrees of freedom of each window.
    #[must_use]
    pub fn freedom(&self) -> Vec<f64> {
        let rows = self.rows();
        let valid = self.valid.chunks_exact(rows).map(|valid| valid.iter().filter(|valid| **valid).count());
        valid.zip(&self.bases).map(|(valid, basis)| valid.saturating_sub(basis.len()).max(1) as f64).collect()
    }

    /// The residual of a model that lacks nothing: noise as the course has it, its memory and the sampling instants' errors
    /// included, treated as a residual is.
    #[must_use]
    pub fn noise(&self, random: &mut Pcg64) -> Vec<f64> {
        let width = self.lanes.len();
        let memories: Vec<f64> =
            self.lanes.iter().map(|(axis, channel)| self.course.memory[*axis][*channel]).collect();
        let mut noise = Vec::with_capacity(self.readings.len());
        for drifts in self.drifts.chunks_exact(self.rows().max(1)) {
            let mut own = vec![0.0; width];
            for (period, drifts) in drifts.chunks_exact(width).enumerate() {
                for (own, memory) in own.iter_mut().zip(&memories) {
                    let kept = if period == 0 { 0.0 } else { *memory };
                    *own = kept * *own + (1.0 - kept * kept).sqrt() * gaussian(random);
                }
                let instant = gaussian(random);
                noise.extend(own.iter().zip(drifts).map(|(own, drift)| own + drift * instant));
            }
        }
        self.reduce(&mut noise);
        noise
    }

    /// The same windows with starts where the readings are met best, as linked ones have them anyway.
    ///
    /// What starts explain is taken out of a residual to first order only, and what effects remember goes on from window to
    /// window: where the points are far off, as those of a sensor that lags, both need the start itself.
    #[must_use]
    pub fn settled(mut self) -> Self {
        for _ in 0..if self.course.linked { 0 } else { SETTLING } {
            let (points, squares) = (self.points.clone(), self.squares());
            self.settle();
            // A start from which readings are met worse, as around a break-away, stays where it was.
            let worse: Vec<bool> = self.squares().iter().zip(&squares).map(|(new, old)| new > old).collect();
            for (start, _) in self.starts.iter().zip(&worse).filter(|(_, worse)| **worse) {
                self.points[start / WINDOW] = points[start / WINDOW];
            }
        }
        self.bases = self.sensitivities().into_iter().map(orthonormal).collect();
        self
    }

    /// Squares of what each window leaves under the baseline rig.
    fn squares(&self) -> Vec<f64> {
        let left = self.residual(&self.simulate(&self.rig));
        left.chunks_exact(self.rows().max(1)).map(|own| dot(own, own)).collect()
    }

    /// Readings over their noise that this rig would have given, without noise and rounding.
    #[must_use]
    pub fn simulate(&self, rig: &RigParameters) -> Vec<f64> {
        self.run(self.plant(rig))
    }

    /// The same in longer steps: half the time, good enough for what one simulation differs from another by.
    #[must_use]
    pub fn simulate_coarsely(&self, rig: &RigParameters) -> Vec<f64> {
        self.run(self.plant(rig).with_substeps(COARSE_SUBSTEPS))
    }

    fn plant(&self, rig: &RigParameters) -> Plant {
        Plant::in_state(rig, &first_state(self.course, rig)).expect("a start state is one of the rig's")
    }

    fn run(&self, mut plant: Plant) -> Vec<f64> {
        let mut simulated = Vec::with_capacity(self.readings.len());
        let seats = Seats::of(plant.rig());
        let mut next = 0;
        // Windows that are not judged are simulated as well: memories go on.
        for start in (0..self.course.len() / WINDOW).map(|window| window * WINDOW) {
            let points = seats.points(self.course, start, &self.points[start / WINDOW]);
            seat(&mut plant, self.course, &points);
            let judged = self.starts.get(next) == Some(&start);
            next += usize::from(judged);
            for inputs in &self.course.inputs[start..start + WINDOW] {
                if judged {
                    self.read(&plant, inputs, &mut simulated);
                }
                plant.step(inputs);
            }
        }
        simulated
    }

    /// What is left of the readings beside a simulation: without single jumps of the force and what the starts explain.
    #[must_use]
    pub fn residual(&self, simulated: &[f64]) -> Vec<f64> {
        let mut left: Vec<f64> =
            self.readings.iter().zip(simulated).map(|(reading, own)| reading - own).collect();
        self.reduce(&mut left);
        left
    }

    /// What one simulation differs from another by, treated as a residual is.
    #[must_use]
    pub fn difference(&self, simulated: &[f64], from: &[f64]) -> Vec<f64> {
        let mut differs: Vec<f64> = simulated.iter().zip(from).map(|(own, from)| own - from).collect();
        self.reduce(&mut differs);
        differs
    }

    fn reduce(&self, values: &mut [f64]) {
        for (value, _) in values.iter_mut().zip(&self.valid).filter(|(_, valid)| !**valid) {
            *value = 0.0;
        }
        let rows = self.rows();
        for (at, (window, basis)) in values.chunks_exact_mut(rows).zip(&self.bases).enumerate() {
            self.flatten_spikes(window);
            self.whiten(at, window);
            project(window, basis);
        }
    }

    /// Takes account of errors of the sampling instant, which all readings of an instant share, and of noise that lasts longer
    /// than a period: with d the drift of an instant's readings, (1 + d d')^(-1/2) and then e_n - r e_(n-1) over sqrt(1 - r^2).
    fn whiten(&self, at: usize, window: &mut [f64]) {
        let width = self.lanes.len();
        let drifts = &self.drifts[at * self.rows()..][..self.rows()];
        for (own, drift) in window.chunks_exact_mut(width).zip(drifts.chunks_exact(width)) {
            let square = dot(drift, drift);
            if square > 1e-6 {
                let share = dot(own, drift) * (1.0 - 1.0 / (1.0 + square).sqrt()) / square;
                own.iter_mut().zip(drift).for_each(|(own, drift)| *own -= share * drift);
            }
        }
        for (lane, (axis, channel)) in self.lanes.iter().enumerate() {
            let memory = self.course.memory[*axis][*channel];
            if memory == 0.0 {
                continue;
            }
            for period in (1..WINDOW).rev() {
                let (place, before) = (period * width + lane, (period - 1) * width + lane);
                if !(self.valid[at * self.rows() + place] && self.valid[at * self.rows() + before]) {
                    continue;
                }
                // Where the instants are off, the noise of neighbours has less in common.
                let own = memory / (1.0 + drifts[place] * drifts[place]);
                window[place] = (window[place] - own * window[before]) / (1.0 - own * own).sqrt();
            }
        }
    }

    fn flatten_spikes(&self, window: &mut [f64]) {
        let width = self.lanes.len();
        let forces: Vec<usize> =
            self.lanes.iter().enumerate().filter(|(_, (_, at))| *at == FORCE).map(|(lane, _)| lane).collect();
        for lane in forces {
            let own: Vec<f64> = window.iter().skip(lane).step_by(width).copied().collect();
            for at in 0..own.len() {
                let mut near = [0.0; 2 * SPIKE_REACH + 1];
                let from = at.saturating_sub(SPIKE_REACH);
                let to = (at + SPIKE_REACH + 1).min(own.len());
                let near = &mut near[..to - from];
                near.copy_from_slice(&own[from..to]);
                near.sort_unstable_by(f64::total_cmp);
                let median = near[near.len() / 2];
                if (own[at] - median).abs() > SPIKE {
                    window[at * width + lane] = median;
                }
            }
        }
    }

    fn read(&self, plant: &Plant, inputs: &Inputs, into: &mut Vec<f64>) {
        let shown = plant.shown(&plant.truth(inputs));
        into.extend(self.lanes.iter().map(|(axis, at)| shown[*axis][*at] / self.course.noise[*axis][*at]));
    }

    /// Puts the measured axes of a plant where the record says that they were; one number of it nudged.
    fn seat(&self, plant: &mut Plant, start: usize, nudged: Option<(usize, usize)>) {
        let mut points = self.points[start / WINDOW];
        if let Some((axis, number)) = nudged {
            let point = &mut points[axis];
            match number {
                0 => point.extension_m += NUDGES[0],
                1 => point.rod_velocity_m_per_s += NUDGES[1],
                2 => point.pressures_pa[0] += NUDGES[2],
                _ => point.pressures_pa[1] += NUDGES[3],
            }
        }
        seat(plant, self.course, &points);
    }

    /// What a change of each number of a window's start changes, by as much as it is doubted.
    fn sensitivities(&self) -> Vec<Vec<Vec<f64>>> {
        let mut plant = self.plant(&self.rig);
        let rows = self.rows();
        let mut all: Vec<Vec<Vec<f64>>> = Vec::with_capacity(self.starts.len());
        for start in (0..self.course.len() / WINDOW).map(|window| window * WINDOW) {
            let place = self.starts.get(all.len()).is_some_and(|own| *own == start);
            let before = plant.clone();
            self.seat(&mut plant, start, None);
            let mut straight = Vec::with_capacity(rows);
            for inputs in &self.course.inputs[start..start + WINDOW] {
                self.read(&plant, inputs, &mut straight);
                plant.step(inputs);
            }
            if !place {
                continue;
            }
            let valid = &self.valid[all.len() * rows..][..rows];
            let mut columns: Vec<Vec<f64>> = Vec::new();
            for axis in (0..2).filter(|axis| self.course.measured[*axis]) {
                for (number, nudge) in NUDGES.iter().enumerate() {
                    let mut nudged = before.clone();
                    self.seat(&mut nudged, start, Some((axis, number)));
                    let mut own = Vec::with_capacity(rows);
                    for inputs in &self.course.inputs[start..start + WINDOW] {
                        self.read(&nudged, inputs, &mut own);
                        nudged.step(inputs);
                    }
                    let scale = DOUBT[number] / nudge;
                    for ((own, straight), valid) in own.iter_mut().zip(&straight).zip(valid) {
                        *own = if *valid { (*own - straight) * scale } else { 0.0 };
                    }
                    self.flatten_jumps(&mut own, scale);
                    self.whiten(all.len(), &mut own);
                    columns.push(own);
                }
            }
            all.push(columns);
        }
        all
    }

    /// A sensitivity is scaled up from a small change: a jump that moves by a sample is no part of it.
    fn flatten_jumps(&self, own: &mut [f64], scale: f64) {
        own.iter_mut().for_each(|own| *own /= scale);
        let width = self.lanes.len();
        for lane in 0..width {
            if self.lanes[lane].1 != FORCE {
                continue;
            }
            let force: Vec<f64> = own.iter().skip(lane).step_by(width).copied().collect();
            for at in 0..force.len() {
                let from = at.saturating_sub(SPIKE_REACH);
                let to = (at + SPIKE_REACH + 1).min(force.len());
                let mut near = force[from..to].to_vec();
                near.sort_unstable_by(f64::total_cmp);
                let median = near[near.len() / 2];
                if (force[at] - median).abs() > 0.5 {
                    own[at * width + lane] = median;
                }
            }
        }
        own.iter_mut().for_each(|own| *own *= scale);
    }
}

/// Rate of a reading times the error of the sampling instant, over its noise; nobody knows that of the force.
fn drift(course: &Course, at: usize, axis: usize, channel: usize) -> f64 {
    if course.jitter_s == 0.0 || channel == FORCE {
        return 0.0;
    }
    let (before, after) = (at.saturating_sub(1), (at + 1).min(course.len() - 1));
    let [before, own, after] = [before, at, after].map(|at| course.points[at][axis]);
    let rate = match channel {
        0 if axis == 0 => own.rod_velocity_m_per_s,
        0 => -own.rod_velocity_m_per_s,
        channel => {
            let [before, after] = [before, after].map(|point| point.pressures_pa[channel - 2]);
            (after - before) / (2.0 * PERIOD_S)
        }
    };
    rate * course.jitter_s / course.noise[axis][channel]
}

/// The state in which a simulation of a course begins: as a run starts, with the record's set-up.
#[must_use]
pub fn first_state(course: &Course, rig: &RigParameters) -> State {
    let stroke_m = rig.cylinder().stroke_m;
    let drive_m = if course.measured[0] { course.points[0][0].extension_m } else { 0.1 };
    let setup = Setup {
        carriage_position_m: drive_m.clamp(0.0, stroke_m),
        linked: course.linked,
        added_mass_kg: course.added_mass_kg,
    };
    let plant = Plant::new(rig, &setup).expect("the set-up was checked");
    let mut state = *plant.state();
    for (axis, inputs) in state.axes.iter_mut().zip(course.inputs[0].valve) {
        axis.spool = inputs;
    }
    state
}

/// Puts the measured axes of a plant at these points; volumes are the plant's own, since an effect may have changed them.
pub fn seat(plant: &mut Plant, course: &Course, points: &[Point; 2]) {
    let mut state = *plant.state();
    let truth = plant.truth(&Inputs::default());
    let cylinder = *plant.rig().cylinder();
    for i in (0..2).filter(|i| course.measured[*i]) {
        let (own, point, axis) = (&mut state.axes[i], &points[i], &truth.axes[i]);
        let way_m = point.extension_m.clamp(0.0, cylinder.stroke_m) - own.extension_m;
        let volume_a_m3 = axis.stored_air_a_j / axis.pressure_a_pa + cylinder.piston_area_m2 * way_m;
        let volume_b_m3 = axis.stored_air_b_j / axis.pressure_b_pa - cylinder.annulus_area_m2 * way_m;
        own.extension_m += way_m;
        own.rod_velocity_m_per_s = point.rod_velocity_m_per_s;
        own.stored_air_a_j = point.pressures_pa[0].max(1e4) * volume_a_m3;
        own.stored_air_b_j = point.pressures_pa[1].max(1e4) * volume_b_m3;
    }
    // Rounding may have left the stroke by a bit.
    for own in &mut state.axes {
        own.extension_m = own.extension_m.clamp(0.0, cylinder.stroke_m);
    }
    plant.go_on_in(&state).expect("the points of a record are states of the rig");
}

/// An orthonormal basis of some columns, those left out that are worth less than one standard deviation.
fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut own in columns {
        // Twice, as rounding asks for.
        project(&mut own, &basis);
        project(&mut own, &basis);
        let length = dot(&own, &own).sqrt();
        if length > 1.0 {
            own.iter_mut().for_each(|own| *own /= length);
            basis.push(own);
        }
    }
    basis
}

/// Takes out what an orthonormal basis explains.
pub fn project(values: &mut [f64], basis: &[Vec<f64>]) {
    for direction in basis {
        let share = dot(values, direction);
        values.iter_mut().zip(direction).for_each(|(own, part)| *own -= share * part);
    }
}

/// A number of mean 0 and variance 1 [Box, Muller 1958, Ann. Math. Stat. 29(2), eq. 1].
fn gaussian(random: &mut Pcg64) -> f64 {
    const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
    let never_zero = ((random.next_u64() >> 11) + 1) as f64 * STEP;
    let turn = (random.next_u64() >> 11) as f64 * STEP;
    (-2.0 * never_zero.ln()).sqrt() * (TAU * turn).cos()
}

/// Sum of products, in four lanes that are added in one order.
#[must_use]
pub fn dot(left: &[f64], right: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (left_chunks, right_chunks) = (left.chunks_exact(4), right.chunks_exact(4));
    let rest: f64 = left_chunks.remainder().iter().zip(right_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (left, right) in left_chunks.zip(right_chunks) {
        for (sum, (a, b)) in sums.iter_mut().zip(left.iter().zip(right)) {
            *sum += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
