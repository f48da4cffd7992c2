//! Responses of a window's readings to unknown inputs of each of its blocks, as products with other columns.
//!
//! ```text
//!   B_k = d readings / d input of (axis, input, block)          window k, whitened, start states projected out
//!   kept: B_k' B_k and B_k' c for each column c                 any input that is a function of state and command is B_k Phi_k
//! ```
//!
//! An unknown force acts as a hand force that the sensor does not read; an unknown flow is added to the stored air; an offset of
//! the force sensor is added to its reading. Source: discrepancy-notes.md, Second reading (Kennedy, O'Hagan 2001).

use super::whiten::SPIKE;
use super::{COARSE_SUBSTEPS, FORCE, WINDOW_PERIODS, Windows, dot, project, set_state};
use crate::sensor_inverse::SensorInverse;
use crate::unknown_inputs::{NORMAL_LITRES_PER_MINUTE, add_air, pushed};
use model_fit::parallel;
use nalgebra::DMatrix;
use plant::{Inputs, Plant, RigParameters};

/// Periods of a block; a window has [`BLOCKS_PER_WINDOW`].
pub(crate) const BLOCK_PERIODS: usize = 20;
pub(crate) const BLOCKS_PER_WINDOW: usize = WINDOW_PERIODS / BLOCK_PERIODS;
/// Steps of finite differences: 1 Nl/min and 1 N, the units of the columns.
const STEP: f64 = 1.0;

/// What is unknown in a balance of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnknownKind {
    FlowA,
    FlowB,
    Force,
    ForceSensor,
}

impl UnknownKind {
    pub(crate) const ALL: [UnknownKind; 4] =
        [UnknownKind::FlowA, UnknownKind::FlowB, UnknownKind::Force, UnknownKind::ForceSensor];

    /// Its place in [`UnknownKind::ALL`].
    pub(crate) fn place(self) -> usize {
        self as usize
    }

    /// Whether it is a flow into a chamber, in Nl/min; N otherwise.
    pub(crate) fn is_flow(self) -> bool {
        matches!(self, UnknownKind::FlowA | UnknownKind::FlowB)
    }

    /// As a part of [`crate::report::BalanceBar::balance`].
    pub(crate) fn name(self) -> &'static str {
        match self {
            UnknownKind::FlowA => "flow-a",
            UnknownKind::FlowB => "flow-b",
            UnknownKind::Force => "force",
            UnknownKind::ForceSensor => "force-sensor",
        }
    }
}

/// Products of a window: the inputs of an axis in the order of [`UnknownKind::ALL`], each with its blocks.
#[derive(Clone, Debug)]
pub(crate) struct InputProducts {
    /// B'B for each measured axis, and 0 for the other.
    pub(crate) gram: [DMatrix<f64>; 2],
    /// B'c: a row for each column.
    pub(crate) cross: [DMatrix<f64>; 2],
}

impl Windows<'_> {
    /// The products of each judged window; `columns` are over all judged windows, as an engine's residuals are. `None` where an
    /// input brings the rig into a state that it cannot be in.
    pub(crate) fn input_products(
        &self,
        rig: &RigParameters,
        columns: &[&[f64]],
        axis_by_axis: bool,
    ) -> Option<Vec<InputProducts>> {
        let rows = self.rows();
        let plants = self.plants_at_windows(rig);
        let products = parallel::map_range(0..plants.len(), |at| {
            let plant = &plants[at];
            let mut products = InputProducts {
                gram: [DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)],
                cross: [DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)],
            };
            for axis in (0..2).filter(|axis| self.record.measured[*axis]) {
                let mut responses = self.responses(at, plant, axis)?;
                if axis_by_axis {
                    responses.iter_mut().for_each(|response| *response = super::axis_by_axis(response));
                }
                let count = responses.len();
                let mut gram = DMatrix::zeros(count, count);
                for left in 0..count {
                    for right in 0..=left {
                        let product = dot(&responses[left], &responses[right]);
                        gram[(left, right)] = product;
                        gram[(right, left)] = product;
                    }
                }
                products.gram[axis] = gram;
                products.cross[axis] = DMatrix::from_fn(columns.len(), count, |column, response| {
                    dot(&columns[column][at * rows..][..rows], &responses[response])
                });
            }
            Some(products)
        });
        products.into_iter().collect()
    }

    /// The plant at the start of each judged window, with what continues from window to window.
    fn plants_at_windows(&self, rig: &RigParameters) -> Vec<Plant> {
        let mut plant = self.plant(rig).with_substeps(COARSE_SUBSTEPS);
        let inverse = SensorInverse::of(rig);
        let mut plants = Vec::with_capacity(self.starts.len());
        for start in (0..self.record.len() / WINDOW_PERIODS).map(|window| window * WINDOW_PERIODS) {
            let points = inverse.points(self.record, start, &self.points[start / WINDOW_PERIODS]);
            set_state(&mut plant, self.record, start, &points);
            if self.starts.get(plants.len()) == Some(&start) {
                plants.push(plant.clone());
            }
            self.record.inputs[start..start + WINDOW_PERIODS].iter().for_each(|inputs| plant.step(inputs));
        }
        plants
    }

    /// The responses of window `at` to each input and block of an axis.
    fn responses(&self, at: usize, plant: &Plant, axis: usize) -> Option<Vec<Vec<f64>>> {
        let inputs = &self.record.inputs[self.starts[at]..][..WINDOW_PERIODS];
        let width = self.outputs.len();
        // The straight run, and the plant at the start of each block.
        let mut straight = Vec::with_capacity(self.rows());
        let mut plants = Vec::with_capacity(BLOCKS_PER_WINDOW);
        let mut plant = plant.clone();
        for (period, inputs) in inputs.iter().enumerate() {
            if period % BLOCK_PERIODS == 0 {
                plants.push(plant.clone());
            }
            self.read(&plant, inputs, &mut straight);
            plant.step(inputs);
        }
        let force_output = self.outputs.iter().position(|output| *output == (axis, FORCE));
        let mut all = Vec::with_capacity(UnknownKind::ALL.len() * BLOCKS_PER_WINDOW);
        for kind in UnknownKind::ALL {
            for (block, plant) in plants.iter().enumerate() {
                let from = block * BLOCK_PERIODS * width;
                let mut response = vec![0.0; self.rows()];
                if kind == UnknownKind::ForceSensor {
                    if let Some(output) = force_output {
                        let reading = STEP / self.record.noise[axis][FORCE];
                        (0..BLOCK_PERIODS)
                            .for_each(|period| response[from + period * width + output] = reading);
                    }
                } else {
                    let changed = self.run_block(plant, &inputs[block * BLOCK_PERIODS..], axis, kind)?;
                    for ((value, changed), straight) in
                        response[from..].iter_mut().zip(changed).zip(&straight[from..])
                    {
                        *value = (changed - straight) / STEP;
                    }
                }
                self.process(at, &mut response);
                all.push(response);
            }
        }
        Some(all)
    }

    /// Readings from a block on, with a unit of an input during the block.
    fn run_block(
        &self,
        plant: &Plant,
        inputs: &[Inputs],
        axis: usize,
        kind: UnknownKind,
    ) -> Option<Vec<f64>> {
        let mut plant = plant.clone();
        let mut readings = Vec::with_capacity(inputs.len() * self.outputs.len());
        let (mut forces_n, mut flows_m3_per_s) = ([0.0; 2], [[0.0; 2]; 2]);
        match kind {
            UnknownKind::Force => forces_n[axis] = STEP,
            UnknownKind::FlowA => flows_m3_per_s[axis][0] = STEP / NORMAL_LITRES_PER_MINUTE,
            UnknownKind::FlowB => flows_m3_per_s[axis][1] = STEP / NORMAL_LITRES_PER_MINUTE,
            UnknownKind::ForceSensor => {}
        }
        for (period, inputs) in inputs.iter().enumerate() {
            let acts = period < BLOCK_PERIODS;
            let inputs = if acts { pushed(*inputs, forces_n) } else { *inputs };
            let from = readings.len();
            self.read(&plant, &inputs, &mut readings);
            if acts {
                for (reading, (of, channel)) in readings[from..].iter_mut().zip(&self.outputs) {
                    if *channel == FORCE {
                        *reading += forces_n[*of] / self.record.noise[*of][FORCE];
                    }
                }
            }
            plant.step(&inputs);
            if acts && kind.is_flow() {
                add_air(&mut plant, &flows_m3_per_s).ok()?;
            }
        }
        Some(readings)
    }

    /// Processes one window's column as residuals are.
    fn process(&self, at: usize, column: &mut [f64]) {
        let valid = &self.valid[at * self.rows()..][..self.rows()];
        column.iter_mut().zip(valid).filter(|(_, valid)| !**valid).for_each(|(value, _)| *value = 0.0);
        self.flatten(column, SPIKE);
        self.whiten(at, column);
        project(column, &self.bases[at]);
    }
}
