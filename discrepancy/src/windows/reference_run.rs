//! A simulation kept with its states, so that a neighbouring rig is simulated only in the windows where the two differ.
//!
//! ```text
//!   rig ──► reference_run: readings, the state that each window begins in, how far each variable reaches in it
//!   rig with one point of a table moved ──► windows that reach the point anew, each from its state; the others are known
//! ```
//!
//! A point of a table acts between its neighbours only, so that half of the windows or more do not depend on it. The state of a
//! rig without effects holds all of its past.

use super::{COARSE_SUBSTEPS, WINDOW_PERIODS, Windows};
use crate::sensor_inverse::SensorInverse;
use plant::effects::tabulated::Variable;
use plant::{Axis, Plant, RigParameters, State};

/// Readings of a rig in the windows of a record, with start states and ranges of the variables.
#[derive(Clone, Debug, Default)]
pub struct ReferenceRun {
    /// Readings over their noise, as [`Windows::simulate_coarsely`] gives them.
    pub simulated: Vec<f64>,
    /// Start state of each judged window; empty for rigs with effects, whose internal states are no part of it.
    states: Vec<State>,
    ranges_of_windows: Vec<VariableRanges>,
}

/// Smallest and largest value of each table variable in a window.
#[derive(Clone, Copy, Debug)]
pub struct VariableRanges([[[f64; 2]; Variable::ALL.len()]; 2]);

impl VariableRanges {
    const EMPTY: VariableRanges =
        VariableRanges([[[f64::INFINITY, f64::NEG_INFINITY]; Variable::ALL.len()]; 2]);

    fn add(&mut self, plant: &Plant) {
        let truth = plant.truth(&plant::Inputs::default());
        for axis in Axis::ALL {
            let (state, truth) = (plant.state().axis(axis), &truth.axes[axis.index()]);
            for (variable, [least, most]) in Variable::ALL.iter().zip(&mut self.0[axis.index()]) {
                let value = variable.value(state, truth);
                (*least, *most) = (least.min(value), most.max(value));
            }
        }
    }

    /// Whether a variable of an axis lies between two values anywhere in the window.
    pub fn overlaps(&self, axis: Axis, variable: Variable, between: [f64; 2]) -> bool {
        let place = Variable::ALL.iter().position(|known| *known == variable).expect("all of them");
        let [least, most] = self.0[axis.index()][place];
        least < between[1] && most > between[0]
    }
}

impl Windows<'_> {
    /// Simulates a rig with longer steps and keeps its states.
    pub fn reference_run(&self, rig: &RigParameters) -> ReferenceRun {
        let mut plant = self.plant(rig).with_substeps(COARSE_SUBSTEPS);
        let inverse = SensorInverse::of(rig);
        // A declared term may count the time.
        let remembers = !(rig.effects().is_empty() && rig.terms().is_empty());
        let mut reference_run =
            ReferenceRun { simulated: Vec::with_capacity(self.readings.len()), ..ReferenceRun::default() };
        for start in (0..self.record.len() / WINDOW_PERIODS).map(|window| window * WINDOW_PERIODS) {
            let points = inverse.points(self.record, start, &self.points[start / WINDOW_PERIODS]);
            super::set_state(&mut plant, self.record, start, &points);
            let judged = self.starts.get(reference_run.ranges_of_windows.len()) == Some(&start);
            let state = *plant.state();
            let mut ranges = VariableRanges::EMPTY;
            for inputs in &self.record.inputs[start..start + WINDOW_PERIODS] {
                if judged {
                    self.read(&plant, inputs, &mut reference_run.simulated);
                    ranges.add(&plant);
                }
                plant.step(inputs);
            }
            if judged {
                ranges.add(&plant);
                reference_run.ranges_of_windows.push(ranges);
                if !remembers {
                    reference_run.states.push(state);
                }
            }
        }
        reference_run
    }

    /// Readings of a neighbour of the reference rig. They differ only in the windows where `differs` is true, and start states do
    /// not depend on the difference.
    pub fn simulate_where(
        &self,
        rig: &RigParameters,
        reference_run: &ReferenceRun,
        differs: impl Fn(&VariableRanges) -> bool,
    ) -> Vec<f64> {
        if reference_run.states.is_empty() {
            return self.simulate_coarsely(rig);
        }
        let mut plant = self.plant(rig).with_substeps(COARSE_SUBSTEPS);
        let mut simulated = Vec::with_capacity(reference_run.simulated.len());
        let known = reference_run.simulated.chunks_exact(self.rows());
        for ((start, known), (state, ranges)) in self
            .starts
            .iter()
            .zip(known)
            .zip(reference_run.states.iter().zip(&reference_run.ranges_of_windows))
        {
            if !differs(ranges) {
                simulated.extend_from_slice(known);
                continue;
            }
            plant.go_on_in(state).expect("a state of a rig is one of its neighbour's");
            for inputs in &self.record.inputs[*start..start + WINDOW_PERIODS] {
                self.read(&plant, inputs, &mut simulated);
                plant.step(inputs);
            }
        }
        simulated
    }
}
