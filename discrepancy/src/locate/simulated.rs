//! Simulates a window with perturbed start state and unknown inputs.
//!
//! Windows start at the record's smoothed states; spool, lagged flows and internal states of effects continue. When linked, the
//! measured contact force is an input of both axes, since positions do not determine it at 2 N per micrometre. It acts as a hand
//! force, so that the force sensors read it as on the rig [rig-model.md, Masses and linkage]. The axes are then independent, and
//! one run perturbs both.
//!
//! An unknown force acts as a hand force, without its reading by the sensor. An unknown flow is added to the stored air at the
//! end of each period.

use super::SHORT_WINDOW_PERIODS;
use crate::gridded_record::{CHANNELS, GriddedRecord};
use crate::unknown_inputs::{add_air, pushed};
use crate::windows::state_at;
use plant::{Inputs, PERIOD_S, Plant, RigParameters, Setup};

/// Noise-free readings of a window.
pub(super) type Readings = [[[f64; CHANNELS]; SHORT_WINDOW_PERIODS]; 2];

/// A perturbation of a window, along the extension of each axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Perturbation {
    /// Extension, m; rod velocity, m/s; pressures a and b, Pa.
    pub(super) start: [[f64; 4]; 2],
    /// Force through the whole window, N.
    pub(super) force_n: [f64; 2],
    /// Force that grows from its negative to itself, N.
    pub(super) ramp_n: [f64; 2],
    /// Normal flow into a and b, m^3/s.
    pub(super) flows_m3_per_s: [[f64; 2]; 2],
}

/// A plant that follows a record.
pub(super) struct RecordFollower<'a> {
    record: &'a GriddedRecord,
    /// F_c over the record, N, in +x on the carriage; all 0 when not linked.
    pub(super) contact_n: Vec<f64>,
    plant: Plant,
}

impl<'a> RecordFollower<'a> {
    /// A plant at the beginning of a record; `None` when the rig cannot be in such a state.
    pub(super) fn new(rig: &RigParameters, record: &'a GriddedRecord) -> Option<Self> {
        let setup = Setup { added_mass_kg: record.added_mass_kg, ..Setup::default() };
        let mut plant = Plant::new(rig, &setup).ok()?;
        let mut state = *plant.state();
        for (axis, axis_state) in state.axes.iter_mut().enumerate() {
            axis_state.spool = record.inputs[0].valve[axis];
        }
        plant.go_on_in(&state).ok()?;
        Some(RecordFollower { record, contact_n: contact_forces(rig, record), plant })
    }

    /// Readings of the window at a period with a perturbation; `None` for a state that the rig cannot have.
    pub(super) fn run(&self, from: usize, perturbation: &Perturbation) -> Option<Readings> {
        let mut plant = self.plant.clone();
        let points = [0, 1].map(|axis| {
            let mut point = self.record.smoothed_states[from][axis];
            let [x, v, a, b] = perturbation.start[axis];
            point.extension_m += x;
            point.rod_velocity_m_per_s += v;
            point.pressures_pa[0] += a;
            point.pressures_pa[1] += b;
            point
        });
        plant.go_on_in(&state_at(&plant, &points, self.record.measured)).ok()?;
        let flows = perturbation.flows_m3_per_s.iter().flatten().any(|flow| *flow != 0.0);
        let mut read = [[[0.0; CHANNELS]; 2]; SHORT_WINDOW_PERIODS];
        for (at, readings) in read.iter_mut().enumerate() {
            let share = (at as f64 + 0.5) / SHORT_WINDOW_PERIODS as f64 * 2.0 - 1.0;
            let forces = [0, 1].map(|axis| perturbation.force_n[axis] + perturbation.ramp_n[axis] * share);
            let inputs = self.inputs(from + at, forces);
            // The sensor reads the contact force of the instant; the mean of both ends acts over the period.
            let contact_n = self.contact_n[from + at];
            *readings = plant.noise_free_readings(&plant.truth(&touched(inputs, contact_n, forces)));
            readings.iter_mut().zip(forces).for_each(|(reading, force_n)| reading[1] += force_n);
            plant.step(&inputs);
            if flows {
                add_air(&mut plant, &perturbation.flows_m3_per_s).ok()?;
            }
        }
        Some([0, 1].map(|axis| read.map(|readings| readings[axis])))
    }

    /// Advances to the next window from the state of the record.
    pub(super) fn advance(&mut self, from: usize, periods: usize) {
        if !self.record.excluded_periods[from] {
            let start = state_at(&self.plant, &self.record.smoothed_states[from], self.record.measured);
            // Impossible points come from a broken record; the plant then continues from its state.
            let _ = self.plant.go_on_in(&start);
        }
        for at in from..from + periods {
            let inputs = self.inputs(at, [0.0; 2]);
            self.plant.step(&inputs);
        }
    }

    /// Inputs of a period: commands, contact force, and unknown forces along the extensions, N.
    fn inputs(&self, at: usize, forces_n: [f64; 2]) -> Inputs {
        let contact_n = 0.5 * (self.contact_n[at] + self.contact_n[(at + 1).min(self.contact_n.len() - 1)]);
        touched(self.record.inputs[at], contact_n, forces_n)
    }
}

/// Inputs with a contact force and unknown forces along the extensions, N.
fn touched(inputs: Inputs, contact_n: f64, forces_n: [f64; 2]) -> Inputs {
    let contact = Inputs { hand_force_carriage_n: contact_n, hand_force_load_n: -contact_n, ..inputs };
    pushed(contact, forces_n)
}

/// Contact force from the sensors: -F of the load, or that of the drive minus the inertia of the carriage.
fn contact_forces(rig: &RigParameters, record: &GriddedRecord) -> Vec<f64> {
    if !record.linked {
        return vec![0.0; record.len()];
    }
    let axis = usize::from(record.measured[1]);
    let behind_kg = rig.mass().carriage_kg + record.added_mass_kg;
    let mut last_n = 0.0;
    (0..record.len())
        .map(|at| {
            let inertia_n = if axis == 0 { behind_kg * acceleration(record, at) } else { 0.0 };
            last_n = record.samples[at][axis][1].map_or(last_n, |force_n| inertia_n - force_n);
            last_n
        })
        .collect()
}

/// Acceleration of the drive from the speeds 5 ms before and after, m/s^2.
fn acceleration(record: &GriddedRecord, at: usize) -> f64 {
    let (from, to) = (at.saturating_sub(5), (at + 5).min(record.len() - 1));
    let speed = |at: usize| record.smoothed_states[at][0].rod_velocity_m_per_s;
    (speed(to) - speed(from)) / ((to - from) as f64 * PERIOD_S)
}
