//! Expected discrimination between two explanations in an experiment.
//!
//! ```text
//! J_i  = M (readings of explanation i - readings of the baseline) / noise     in windows of 100 ms, driven as if i were true
//! M    = 1 - S S^+                       S: what the readings change with x, v, p_a, p_b at the start of the window
//! D_ij = min over a of |J_i - a J_j|^2 = |J_i|^2 (1 - cos_ij^2)               the alternative's amplitude a >= 0 is refitted
//! T_ij = D_ij / (1 + e^2 |J_i|^2)                                             e = 1/16: no model is better than that
//! ```
//!
//! D is the expected gain in chi2 of the true explanation over the alternative; the inner product excludes nuisance parameters
//! (`nuisance.rs`). For signatures of hundreds of standard deviations D is large for any two that differ, but model error is
//! a share e of the signature. T counts that share as noise: it equals D for a weak signature, and for a strong one T >= 25 means
//! a cosine below 0.95. The amplitude is refitted although the first record bounds it, so that T is conservative.
//!
//! Windows start at the true x, v, p_a, p_b of the run; spool, lagged flow and internal states of effects continue in each plant.
//! The first window is left out, since internal states fill in it. Force readings next to a stop, a break-away or a contact are
//! excluded: microseconds there are hundreds of newtons in a sample.
//!
//! Source: discrepancy-notes.md, 1 and pipeline 9; Hunter and Reiner 1965, Technometrics 7(3): designs for discriminating
//! between two rival models.

use super::closed_loop::ClosedLoopRun;
use super::nuisance::MarginalProduct;
use crate::gridded_record::{AxisState, CHANNELS};
use crate::windows::{FORCE, dot, project, state_at};
use plant::{Inputs, Plant, RigParameters, State, Truth};

/// Model error as a share of the signature: 25 = (1 - 0.95^2) / e^2.
const MODEL_ERROR: f64 = 1.0 / 16.0;
/// Periods of a window here, shorter than one of the fits ([`crate::windows::WINDOW_PERIODS`]).
const DESIGN_WINDOW_PERIODS: usize = 100;
/// Speed below which a piston is at rest, m/s: bristles creep.
const REST_M_PER_S: f64 = 1e-5;
/// Relative length below which an orthogonalised direction is rounding.
const RANK: f64 = 1e-6;

/// Simulates rigs in the windows of a run.
struct Observer<'a> {
    driven: &'a ClosedLoopRun,
    measured: Vec<usize>,
    noise: [f64; CHANNELS],
}

/// Whitened readings of all windows; force readings at events are marked.
struct ObservedRun {
    readings: Vec<f64>,
    jumps: Vec<bool>,
    starts: Vec<State>,
}

/// Divergence of an explanation from an alternative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Divergence {
    /// |J|^2 of the true one, squared standard deviations.
    pub(crate) square: f64,
    /// Cosine of the two signatures, 0 to 1.
    pub(crate) cosine: f64,
}

impl Divergence {
    /// T of so many repetitions, in squared standard deviations.
    pub(crate) fn in_repetitions(&self, times: usize) -> f64 {
        let square = self.square * times as f64;
        square * (1.0 - self.cosine * self.cosine) / (1.0 + MODEL_ERROR * MODEL_ERROR * square)
    }
}

/// Divergence of the first of `rigs`, which made the run, from each of the others. `perturbed` are baselines with one parameter
/// off by a prior standard deviation each.
pub(crate) fn divergences(
    driven: &ClosedLoopRun,
    baseline: &RigParameters,
    rigs: &[&RigParameters],
    perturbed: &[RigParameters],
    measured: [bool; 2],
) -> Vec<Divergence> {
    let all: Vec<&RigParameters> = rigs.iter().copied().chain(perturbed).collect();
    let signatures = signatures(driven, baseline, &all, measured);
    let (signatures, sensitivities) = signatures.split_at(rigs.len());
    let product = MarginalProduct::new(sensitivities);
    let Some((truth, alternatives)) = signatures.split_first() else { return Vec::new() };
    let square = product.of(truth, truth).max(0.0);
    let from = |other: &Vec<f64>| {
        let lengths = (square * product.of(other, other).max(0.0)).sqrt();
        let cosine = if lengths > 0.0 { (product.of(truth, other) / lengths).clamp(0.0, 1.0) } else { 0.0 };
        Divergence { square, cosine }
    };
    alternatives.iter().map(from).collect()
}

/// M J of each rig.
fn signatures(
    driven: &ClosedLoopRun,
    baseline: &RigParameters,
    rigs: &[&RigParameters],
    measured: [bool; 2],
) -> Vec<Vec<f64>> {
    let observer = Observer::new(driven, baseline, measured);
    let base = observer.run(baseline);
    let runs: Vec<ObservedRun> = rigs.iter().map(|rig| observer.run(rig)).collect();
    let mut signatures: Vec<Vec<f64>> = runs
        .iter()
        .map(|run| run.readings.iter().zip(&base.readings).map(|(value, base)| value - base).collect())
        .collect();
    let rows = observer.rows();
    for signature in &mut signatures {
        let first = rows.min(signature.len());
        signature[..first].fill(0.0);
    }
    for window in 1..observer.windows() {
        let span = window * rows..(window + 1) * rows;
        let mut out = base.jumps[span.clone()].to_vec();
        for run in &runs {
            out.iter_mut().zip(&run.jumps[span.clone()]).for_each(|(all, jump)| *all |= jump);
        }
        let columns = observer.sensitivities(baseline, &base, window, &mut out);
        let basis = basis(columns, &out);
        for signature in &mut signatures {
            let part = &mut signature[span.clone()];
            part.iter_mut().zip(&out).filter(|(_, out)| **out).for_each(|(value, _)| *value = 0.0);
            project(part, &basis);
        }
    }
    signatures
}

/// Specified noise of each channel, its rounding included.
pub(crate) fn noise_with_rounding(rig: &RigParameters) -> [f64; CHANNELS] {
    let sensors = rig.sensors();
    let with_rounding = |noise: f64, step: f64| (noise * noise + step * step / 12.0).sqrt();
    let pressure = with_rounding(sensors.pressure_noise_pa, sensors.pressure_step_pa());
    [
        with_rounding(sensors.position_noise_m, sensors.position_step_m()),
        with_rounding(sensors.force_noise_n, sensors.force_step_n()),
        pressure,
        pressure,
    ]
}

impl<'a> Observer<'a> {
    fn new(driven: &'a ClosedLoopRun, rig: &RigParameters, measured: [bool; 2]) -> Self {
        let noise = noise_with_rounding(rig);
        Observer { driven, measured: (0..2).filter(|axis| measured[*axis]).collect(), noise }
    }

    fn windows(&self) -> usize {
        self.driven.inputs.len() / DESIGN_WINDOW_PERIODS
    }

    /// Start states of a window, with creep set to rest, as in the workflow: friction then holds the piston in both directions. A
    /// piston still sliding would respond to one sign of a perturbation only.
    fn points(&self, window: usize) -> [AxisState; 2] {
        self.driven.points[window * DESIGN_WINDOW_PERIODS].map(|point| {
            let creeps = point.rod_velocity_m_per_s.abs() < REST_M_PER_S;
            if creeps { AxisState { rod_velocity_m_per_s: 0.0, ..point } } else { point }
        })
    }

    /// Readings of a period.
    fn width(&self) -> usize {
        CHANNELS * self.measured.len()
    }

    /// Readings of a window.
    fn rows(&self) -> usize {
        DESIGN_WINDOW_PERIODS * self.width()
    }

    fn run(&self, rig: &RigParameters) -> ObservedRun {
        let mut plant = plant_in(rig, &self.driven.start);
        let mut run = ObservedRun { readings: Vec::new(), jumps: Vec::new(), starts: Vec::new() };
        for window in 0..self.windows() {
            let start = state_at(&plant, &self.points(window), [true; 2]);
            plant.go_on_in(&start).expect("a state of a run is one that the rig can be in");
            run.starts.push(start);
            self.read(&mut plant, window, &mut run.readings, &mut run.jumps);
        }
        run
    }

    /// Steps through a window and appends its readings.
    fn read(&self, plant: &mut Plant, window: usize, readings: &mut Vec<f64>, jumps: &mut Vec<bool>) {
        let from = jumps.len();
        let mut phases = Vec::with_capacity(DESIGN_WINDOW_PERIODS + 1);
        for inputs in &self.driven.inputs[window * DESIGN_WINDOW_PERIODS..][..DESIGN_WINDOW_PERIODS] {
            let truth = plant.truth(inputs);
            let shown = plant.noise_free_readings(&truth);
            for axis in &self.measured {
                readings.extend(shown[*axis].iter().zip(self.noise).map(|(value, noise)| value / noise));
            }
            phases.push([phase(&truth, 0), phase(&truth, 1)]);
            plant.step(inputs);
        }
        let end = plant.truth(&Inputs::default());
        phases.push([phase(&end, 0), phase(&end, 1)]);
        jumps.resize(readings.len(), false);
        for (output, axis) in self.measured.iter().enumerate() {
            for at in 0..DESIGN_WINDOW_PERIODS {
                let now = phases[at][*axis];
                let jump = phases[at.saturating_sub(1)][*axis] != now || phases[at + 1][*axis] != now;
                jumps[from + at * self.width() + output * CHANNELS + FORCE] = jump;
            }
        }
    }

    /// Columns of S of a window; marks in `out` the events of the perturbed plants.
    fn sensitivities(
        &self,
        rig: &RigParameters,
        base: &ObservedRun,
        window: usize,
        out: &mut [bool],
    ) -> Vec<Vec<f64>> {
        let baseline = &base.readings[window * self.rows()..][..self.rows()];
        // Unlinked axes are independent: one run perturbs both.
        let together: Vec<Vec<usize>> = if self.driven.linked {
            self.measured.iter().map(|axis| vec![*axis]).collect()
        } else {
            vec![self.measured.clone()]
        };
        let mut columns = Vec::new();
        for axes in together {
            for number in 0..AxisState::PERTURBATIONS.len() {
                let mut points = self.points(window);
                for axis in &axes {
                    points[*axis] = points[*axis].perturbed(number);
                }
                let mut plant = plant_in(rig, &base.starts[window]);
                plant
                    .go_on_in(&state_at(&plant, &points, [true; 2]))
                    .expect("a perturbation leaves the rig in a state of its own");
                let (mut perturbed, mut jumps) = (Vec::with_capacity(self.rows()), Vec::new());
                self.read(&mut plant, window, &mut perturbed, &mut jumps);
                out.iter_mut().zip(&jumps).for_each(|(all, jump)| *all |= jump);
                let change: Vec<f64> =
                    perturbed.iter().zip(baseline).map(|(value, base)| value - base).collect();
                if self.driven.linked {
                    columns.push(change);
                } else {
                    columns.extend((0..self.measured.len()).map(|output| self.output(&change, output)));
                }
            }
        }
        columns
    }

    /// The readings of one measured axis, 0 for the other.
    fn output(&self, readings: &[f64], output: usize) -> Vec<f64> {
        let of = |at: usize| (at % self.width()) / CHANNELS;
        readings.iter().enumerate().map(|(at, value)| if of(at) == output { *value } else { 0.0 }).collect()
    }
}

fn plant_in(rig: &RigParameters, state: &State) -> Plant {
    Plant::in_state(rig, &of_rig(rig, state)).expect("a state of a run is one that the rig can be in")
}

/// The state with the supply pressure limited to this rig's.
fn of_rig(rig: &RigParameters, state: &State) -> State {
    State { supply_pressure_pa: state.supply_pressure_pa.min(rig.supply().pressure_pa), ..*state }
}

/// Direction of an axis, and whether the rods touch.
fn phase(truth: &Truth, axis: usize) -> (i8, bool) {
    let velocity = truth.axes[axis].rod_velocity_m_per_s;
    let way = if velocity.abs() < REST_M_PER_S { 0 } else { velocity.signum() as i8 };
    (way, truth.contact_force_n != 0.0)
}

/// Orthonormal basis of columns without excluded rows, by Gram-Schmidt with reorthogonalisation.
fn basis(columns: Vec<Vec<f64>>, out: &[bool]) -> Vec<Vec<f64>> {
    let mut kept: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns {
        column.iter_mut().zip(out).filter(|(_, out)| **out).for_each(|(value, _)| *value = 0.0);
        let before = dot(&column, &column).sqrt();
        project(&mut column, &kept);
        project(&mut column, &kept);
        let norm = dot(&column, &column).sqrt();
        if norm > RANK * before {
            column.iter_mut().for_each(|value| *value /= norm);
            kept.push(column);
        }
    }
    kept
}
