//! Compares a scheme with the reference over windows of 100 ms that start alike, in units of the sensors' noise.
//!
//! The error of a window is the rms of the difference of what a sensor would show without noise [rig-model.md,
//! Accuracy]. Samples of the force within 5 ms of a corner (sticking, breaking away, contact) are left out, as that
//! page excepts them; so they are from the maxima.

#![allow(dead_code)] // each user needs a part of it

use plant::{Inputs, Plant, RigParameters, State};

use crate::reference::{Method, Reference, SensorReadings};
use crate::scenario::{Scenario, WINDOW_MS};

/// Noise of the sensors, rms: m, Pa, N [rig-model.md, Sensors].
const NOISE: [f64; 3] = [20e-6, 400.0, 0.5];

/// What is compared with the reference.
#[derive(Clone, Copy)]
pub(crate) enum Scheme {
    /// The plant with so many substeps in a period.
    Plant(u32),
    /// The plain explicit rule of the reference with so many steps in a period.
    Explicit(Method, u32),
}

/// What the reference shows at each millisecond of a window, and where corners lie.
pub(crate) struct Window {
    seen: Vec<SensorReadings>,
    near_corner: Vec<bool>,
}

/// Errors over all windows of all motions.
#[derive(Default)]
pub(crate) struct Errors {
    /// Position, pressure, force: rms of each window and axis over the noise.
    pub(crate) rms: [Vec<f64>; 3],
    /// Largest single differences apart from corners: m, Pa, N.
    pub(crate) max: [f64; 3],
}

impl Errors {
    /// The worst window of position, pressure, force.
    pub(crate) fn worst(&self) -> [f64; 3] {
        [0, 1, 2].map(|i: usize| self.rms[i].iter().copied().fold(0.0, f64::max))
    }

    /// The median window of position, pressure, force.
    pub(crate) fn median(&self) -> [f64; 3] {
        [0, 1, 2].map(|i: usize| {
            let mut sorted = self.rms[i].clone();
            sorted.sort_by(f64::total_cmp);
            sorted[sorted.len() / 2]
        })
    }
}

/// The windows of a motion as the reference sees them, with so many steps in a millisecond.
pub(crate) fn reference_windows(scenario: &Scenario, steps: u32) -> Vec<Window> {
    let window = |start: usize| {
        let mut rig = Reference::from_state(&scenario.states[start]);
        let mut window = Window { seen: Vec::new(), near_corner: vec![false; WINDOW_MS] };
        for k in 0..WINDOW_MS {
            let before = rig.corners;
            rig.advance(&scenario.inputs[start + k], steps, Method::RungeKutta4);
            window.seen.push(rig.readings(&Inputs::default()));
            if rig.corners != before {
                (k.saturating_sub(5)..(k + 6).min(WINDOW_MS))
                    .for_each(|near| window.near_corner[near] = true);
            }
        }
        window
    };
    (0..scenario.inputs.len()).step_by(WINDOW_MS).map(window).collect()
}

/// Runs a scheme through the windows of a motion and adds its errors.
pub(crate) fn compare(
    rig: &RigParameters,
    scheme: Scheme,
    scenario: &Scenario,
    windows: &[Window],
    errors: &mut Errors,
) {
    for (i, window) in windows.iter().enumerate() {
        let start = i * WINDOW_MS;
        let inputs = &scenario.inputs[start..start + WINDOW_MS];
        let seen = run(rig, scheme, &scenario.states[start], inputs);
        for axis in 0..2 {
            let mut squares = [0.0; 4];
            let mut force_samples = 0;
            for (k, (got, want)) in seen.iter().zip(&window.seen).enumerate() {
                let error = [
                    got.x[axis] - want.x[axis],
                    got.p_a[axis] - want.p_a[axis],
                    got.p_b[axis] - want.p_b[axis],
                    got.force[axis] - want.force[axis],
                ];
                let counted = if window.near_corner[k] { 3 } else { 4 };
                (0..counted).for_each(|j| squares[j] += error[j] * error[j]);
                if !window.near_corner[k] {
                    force_samples += 1;
                    let size = error.map(f64::abs);
                    let largest = [size[0], size[1].max(size[2]), size[3]];
                    (0..3).for_each(|j| errors.max[j] = errors.max[j].max(largest[j]));
                }
            }
            let rms = |j: usize, samples: usize| (squares[j] / samples.max(1) as f64).sqrt();
            let whole = [rms(0, WINDOW_MS), rms(1, WINDOW_MS).max(rms(2, WINDOW_MS)), rms(3, force_samples)];
            (0..3).for_each(|j| errors.rms[j].push(whole[j] / NOISE[j]));
        }
    }
}

fn run(rig: &RigParameters, scheme: Scheme, state: &State, inputs: &[Inputs]) -> Vec<SensorReadings> {
    match scheme {
        Scheme::Plant(substeps) => {
            let mut plant = Plant::in_state(rig, state).expect("a recorded state").with_substeps(substeps);
            let see = |inputs: &Inputs| {
                plant.step(inputs);
                let truth = plant.truth(&Inputs::default());
                SensorReadings {
                    x: truth.axes.map(|axis| axis.position_m),
                    force: truth.axes.map(|axis| axis.sensor_force_n),
                    p_a: truth.axes.map(|axis| axis.pressure_a_pa),
                    p_b: truth.axes.map(|axis| axis.pressure_b_pa),
                }
            };
            inputs.iter().map(see).collect()
        }
        Scheme::Explicit(method, steps) => {
            let mut reference = Reference::from_state(state);
            let see = |inputs: &Inputs| {
                reference.advance(inputs, steps, method);
                reference.readings(&Inputs::default())
            };
            inputs.iter().map(see).collect()
        }
    }
}
