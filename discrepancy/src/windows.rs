//! Truncated simulation error: a record in windows of 400 ms, each simulated from a start state estimated from the record.
//!
//! ```text
//!   e_k = M_k (y_k - f_k(start_k; rig)) / sigma          window k: readings y, simulation f, noise sigma
//!   M_k = 1 - Q_k Q_k'                                   Q_k: what a change of x, v, p_a, p_b at the window's start explains
//! ```
//!
//! Spool, lagged flows and the internal states of effects continue from window to window. Mechanical states and pressures restart
//! from the record's smoothed states, whose errors M_k projects out to first order. A direction is projected out if one prior
//! standard deviation of the start state changes the whitened window by a norm above 1; at rest the speed is zero.
//!
//! The force jumps where a piston stops, breaks away or reverses, and microseconds decide on which side of a sample. A force
//! residual, or difference of two simulations, that deviates from its neighbours' median by more than noise is replaced by it
//! [rig-model.md, Accuracy].
//!
//! Source: discrepancy-notes.md, 1 (the share of right names is the same from 100 ms to 2 s; longer windows show smaller slow
//! effects, such as leaks), 6.

mod input_responses;
mod reference_run;
mod starts;
mod whiten;

use crate::gridded_record::{AxisState, CHANNELS, GriddedRecord};
use crate::sensor_inverse::SensorInverse;
pub(crate) use input_responses::{BLOCK_PERIODS, BLOCKS_PER_WINDOW, InputProducts, UnknownKind};
use plant::effects::sheet::Part;
use plant::{Batch, Inputs, Plant, RigParameters};
pub use reference_run::{ReferenceRun, VariableRanges};
use starts::START_PASSES;
pub(crate) use starts::{first_state, set_state, state_at};
use whiten::{SPIKE, jitter_sensitivity_of};

/// Periods of a window.
pub(crate) const WINDOW_PERIODS: usize = 400;
/// Index of the force among the channels.
pub(crate) const FORCE: usize = 1;
/// Integration substeps of a period in the search and in its finite differences.
const COARSE_SUBSTEPS: u32 = 5;
/// The same to estimate the error of integration: twice those of a plant.
const FINE_SUBSTEPS: u32 = 20;

/// The windows of a record, with the subspaces that their start states span.
#[derive(Clone, Debug)]
pub struct Windows<'a> {
    pub(crate) record: &'a GriddedRecord,
    pub(crate) rig: RigParameters,
    /// First period of each window.
    pub(crate) starts: Vec<usize>,
    /// Start state of each window, unjudged ones included.
    points: Vec<[AxisState; 2]>,
    /// Axis and channel of each output.
    pub(crate) outputs: Vec<(usize, usize)>,
    /// Readings over their noise by window, period and output; 0 where there is none.
    readings: Vec<f64>,
    valid: Vec<bool>,
    /// Change of each reading by one standard deviation of the sampling instant, over its noise.
    jitter_sensitivity: Vec<f64>,
    /// Orthonormal basis of the start sensitivities of each window.
    bases: Vec<Vec<Vec<f64>>>,
}

impl<'a> Windows<'a> {
    /// The windows of a record, with start sensitivities under a baseline rig.
    pub fn new(record: &'a GriddedRecord, rig: &RigParameters) -> Self {
        Self::with_recorded_starts(record, rig).estimate_starts(0)
    }

    /// The same with estimated start states.
    ///
    /// The projection is of first order only, and internal states of effects continue from window to window. Where the points are
    /// far off, as behind a lagging sensor, both need a better start state.
    pub(crate) fn with_estimated_starts(record: &'a GriddedRecord, rig: &RigParameters) -> Self {
        Self::with_recorded_starts(record, rig).estimate_starts(START_PASSES)
    }

    fn with_recorded_starts(record: &'a GriddedRecord, rig: &RigParameters) -> Self {
        let measured = (0..2).filter(|axis| record.measured[*axis]);
        let outputs: Vec<_> = measured.flat_map(|axis| (0..CHANNELS).map(move |at| (axis, at))).collect();
        // The first window fills lags and internal states and is not judged [rig-model.md: a record is judged after 0.1 s].
        let starts: Vec<usize> = (1..record.len() / WINDOW_PERIODS)
            .map(|window| window * WINDOW_PERIODS)
            .filter(|start| !record.excluded_periods[*start..start + WINDOW_PERIODS].contains(&true))
            .collect();
        let mut readings = Vec::with_capacity(starts.len() * WINDOW_PERIODS * outputs.len());
        let mut valid = Vec::with_capacity(readings.capacity());
        for start in &starts {
            for samples in &record.samples[*start..start + WINDOW_PERIODS] {
                for (axis, at) in &outputs {
                    let sample = samples[*axis][*at];
                    valid.push(sample.is_some());
                    readings.push(sample.map_or(0.0, |value| value / record.noise[*axis][*at]));
                }
            }
        }
        let points = (0..record.len() / WINDOW_PERIODS)
            .map(|window| record.smoothed_states[window * WINDOW_PERIODS])
            .collect();
        let mut jitter_sensitivity = Vec::with_capacity(readings.len());
        for at in starts.iter().flat_map(|start| *start..start + WINDOW_PERIODS) {
            jitter_sensitivity.extend(
                outputs.iter().map(|(axis, channel)| jitter_sensitivity_of(record, at, *axis, *channel)),
            );
        }
        let (rig, bases) = (rig.clone(), Vec::new());
        Windows { record, rig, starts, points, outputs, readings, valid, jitter_sensitivity, bases }
    }

    /// Number of windows.
    pub fn count(&self) -> usize {
        self.starts.len()
    }

    /// Length of the residual vector of a window.
    pub(crate) fn rows(&self) -> usize {
        WINDOW_PERIODS * self.outputs.len()
    }

    /// Whether the residuals of the axes have nothing to do with each other: both are measured, and their rods are not linked.
    pub(crate) fn axes_are_apart(&self) -> bool {
        self.record.measured == [true, true] && !self.record.linked
    }

    /// Whether a start state of one axis moves no reading of the other: the same, with nothing that feeds both.
    fn axes_are_independent(&self) -> bool {
        let joins = |part: Part| matches!(part, Part::Linkage | Part::Supply);
        self.axes_are_apart() && !self.rig.effects().iter().any(|effect| joins(effect.place.part))
    }

    /// Degrees of freedom of each window, or of each axis in it.
    pub(crate) fn dof(&self, axis_by_axis: bool) -> Vec<f64> {
        let width = if axis_by_axis { CHANNELS } else { self.outputs.len() };
        let groups = self.outputs.len() / width;
        let of_group = |at: usize, group: usize| {
            let in_group = |row: &usize| row / width % groups == group;
            let valid = &self.valid[at * self.rows()..][..self.rows()];
            let readings = (0..valid.len()).filter(in_group).filter(|row| valid[*row]).count();
            let most = |direction: &&Vec<f64>| {
                (0..direction.len()).filter(in_group).map(|row| direction[row].powi(2)).sum::<f64>() > 0.5
            };
            readings.saturating_sub(self.bases[at].iter().filter(most).count()).max(1) as f64
        };
        (0..self.count())
            .flat_map(|at| (0..groups).map(move |group| (at, group)))
            .map(|(at, group)| of_group(at, group))
            .collect()
    }

    /// Noise-free readings of a rig over their noise.
    pub(crate) fn simulate(&self, rig: &RigParameters) -> Vec<f64> {
        self.run(vec![self.plant(rig)]).remove(0)
    }

    /// The same with half the step, to estimate the error of integration.
    pub(crate) fn simulate_finely(&self, rig: &RigParameters) -> Vec<f64> {
        self.run(vec![self.plant(rig).with_substeps(FINE_SUBSTEPS)]).remove(0)
    }

    /// Readings with the longer steps of the search: half the cost.
    pub fn simulate_coarsely(&self, rig: &RigParameters) -> Vec<f64> {
        self.simulate_side_by_side(std::slice::from_ref(rig)).remove(0)
    }

    /// The same for several rigs, each with the bits of a run on its own. Rigs without effects cost a third in a batch.
    pub fn simulate_side_by_side(&self, rigs: &[RigParameters]) -> Vec<Vec<f64>> {
        self.run(rigs.iter().map(|rig| self.plant(rig).with_substeps(COARSE_SUBSTEPS)).collect())
    }

    fn plant(&self, rig: &RigParameters) -> Plant {
        Plant::in_state(rig, &first_state(self.record, rig)).expect("a start state is one of the rig's")
    }

    fn run(&self, plants: Vec<Plant>) -> Vec<Vec<f64>> {
        let mut simulated = vec![Vec::with_capacity(self.readings.len()); plants.len()];
        let inverse: Vec<SensorInverse> = plants.iter().map(|plant| SensorInverse::of(plant.rig())).collect();
        let mut batch = Batch::new(plants);
        let mut next = 0;
        // Unjudged windows are simulated as well, since internal states continue.
        for start in (0..self.record.len() / WINDOW_PERIODS).map(|window| window * WINDOW_PERIODS) {
            for (at, inverse) in inverse.iter().enumerate() {
                let points = inverse.points(self.record, start, &self.points[start / WINDOW_PERIODS]);
                set_state(batch.plant_mut(at), self.record, start, &points);
            }
            let judged = self.starts.get(next) == Some(&start);
            next += usize::from(judged);
            for inputs in &self.record.inputs[start..start + WINDOW_PERIODS] {
                if judged {
                    self.read_each(&batch, inputs, &mut simulated);
                }
                batch.step_alike(inputs);
            }
        }
        simulated
    }

    /// Whitened residual of a simulation, force spikes removed and start states projected out.
    pub(crate) fn residual(&self, simulated: &[f64]) -> Vec<f64> {
        let mut residual = self.raw_residual(simulated);
        self.project_windows(&mut residual);
        residual
    }

    /// The same without the projection.
    fn raw_residual(&self, simulated: &[f64]) -> Vec<f64> {
        let mut residual: Vec<f64> =
            self.readings.iter().zip(simulated).map(|(reading, simulated)| reading - simulated).collect();
        self.clean(&mut residual);
        residual
    }

    /// Difference of two simulations, processed like a residual.
    pub(crate) fn difference(&self, simulated: &[f64], from: &[f64]) -> Vec<f64> {
        let mut differs: Vec<f64> = simulated.iter().zip(from).map(|(value, from)| value - from).collect();
        self.reduce(&mut differs);
        differs
    }

    fn reduce(&self, values: &mut [f64]) {
        self.clean(values);
        self.project_windows(values);
    }

    fn project_windows(&self, values: &mut [f64]) {
        let windows = values.chunks_exact_mut(self.rows());
        windows.zip(&self.bases).for_each(|(window, basis)| project(window, basis));
    }

    /// Zeroes missing readings, removes force spikes and whitens.
    fn clean(&self, values: &mut [f64]) {
        for (value, _) in values.iter_mut().zip(&self.valid).filter(|(_, valid)| !**valid) {
            *value = 0.0;
        }
        for (at, window) in values.chunks_exact_mut(self.rows()).enumerate() {
            self.flatten(window, SPIKE);
            self.whiten(at, window);
        }
    }

    fn read_each(&self, batch: &Batch, inputs: &Inputs, into: &mut [Vec<f64>]) {
        batch.plants().iter().zip(into).for_each(|(plant, into)| self.read(plant, inputs, into));
    }

    fn read(&self, plant: &Plant, inputs: &Inputs, into: &mut Vec<f64>) {
        let shown = plant.noise_free_readings(&plant.truth(inputs));
        into.extend(self.outputs.iter().map(|(axis, at)| shown[*axis][*at] / self.record.noise[*axis][*at]));
    }
}

/// A window's values axis by axis, in place of period by period.
pub(crate) fn axis_by_axis(window: &[f64]) -> Vec<f64> {
    let of_axis = |axis: usize| {
        window.chunks_exact(2 * CHANNELS).flat_map(move |period| &period[axis * CHANNELS..][..CHANNELS])
    };
    (0..2).flat_map(of_axis).copied().collect()
}

/// Projects values on the complement of an orthonormal basis.
pub(crate) fn project(values: &mut [f64], basis: &[Vec<f64>]) {
    for direction in basis {
        let share = dot(values, direction);
        values.iter_mut().zip(direction).for_each(|(value, part)| *value -= share * part);
    }
}

/// Sum of products, in four outputs that are added in one order.
pub(crate) fn dot(left: &[f64], right: &[f64]) -> f64 {
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
