//! How far two explanations of one record lie apart in another experiment.
//!
//! ```text
//! J_i  = M (readings of explanation i - readings of the baseline) / noise     in windows of 100 ms, driven as if i were true
//! M    = 1 - S S^+                       S: what the readings change with x, v, p_a, p_b at the start of the window
//! D_ij = min over a of |J_i - a J_j|^2 = |J_i|^2 (1 - cos_ij^2)               the rival's amplitude a >= 0 is refitted
//! T_ij = D_ij / (1 + e^2 |J_i|^2)                                             e = 1/16: no model is better than that
//! ```
//!
//! D is the expected gain in chi2 of the true explanation over its rival; lengths and cosines leave out what numbers of the
//! baseline explain (`nuisance.rs`). Where signatures are hundreds of standard deviations long, D is large for any two that
//! are not equal; but forms that differ from the catalogue's and numbers that are a little off leave a share of the signature
//! itself. T counts that share e as noise: it is D while a signature is weak, and of strong ones T >= 25 means a cosine below
//! 0.95, which is what the workflow calls different. The amplitude is refitted although the first record bounds it: T is
//! rather too small than too large.
//!
//! Windows begin at the true x, v, p_a, p_b of the run; what else moves (spool, lagged flow, memories of effects) goes on
//! from the window before, of each plant its own. The first window is left out: memories fill in it. Readings of the force
//! next to a stop, a break-away or a contact count for nothing: a difference of microseconds there is one of hundreds of
//! newtons in a sample.
//!
//! Source: discrepancy-notes.md, 1 and pipeline 9; Hunter and Reiner 1965, Technometrics 7(3): designs for discriminating
//! between two rival models.

use super::closed_loop::ClosedLoopRun;
use super::nuisance::Product;
use crate::gridded_record::{CHANNELS, Point};
use crate::windows::{FORCE, dot, project, state_at};
use plant::{Inputs, Plant, RigParameters, State, Truth};

/// Share of a signature that forms and numbers leave unexplained: 25 = (1 - 0.95^2) / e^2.
const MODEL_ERROR: f64 = 1.0 / 16.0;
/// Periods of a window.
const WINDOW: usize = 100;
/// Slower than this a piston is at rest, m/s: bristles creep.
const REST_M_PER_S: f64 = 1e-5;
/// Share of its length below which what is left of a direction is rounding.
const RANK: f64 = 1e-6;

/// What rigs read in the windows of a run.
struct Observer<'a> {
    driven: &'a ClosedLoopRun,
    measured: Vec<usize>,
    noise: [f64; CHANNELS],
}

/// Whitened readings of all windows; those of the force at events are marked.
struct Run {
    readings: Vec<f64>,
    jumps: Vec<bool>,
    starts: Vec<State>,
}

/// How one explanation differs from a rival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Divergence {
    /// |J|^2 of the true one, squared standard deviations.
    pub square: f64,
    /// Cosine of the two signatures, 0 to 1.
    pub cosine: f64,
}

impl Divergence {
    /// T of so many repetitions, in squared standard deviations.
    #[must_use]
    pub fn in_repetitions(&self, times: u32) -> f64 {
        let square = self.square * f64::from(times);
        square * (1.0 - self.cosine * self.cosine) / (1.0 + MODEL_ERROR * MODEL_ERROR * square)
    }
}

/// Divergence of the first of `rigs`, which the run was driven by, from each of the others. `numbers` are baselines whose numbers
/// are off by a prior standard deviation each.
#[must_use]
pub fn divergences(
    driven: &ClosedLoopRun,
    baseline: &RigParameters,
    rigs: &[&RigParameters],
    numbers: &[RigParameters],
    measured: [bool; 2],
) -> Vec<Divergence> {
    let all: Vec<&RigParameters> = rigs.iter().copied().chain(numbers).collect();
    let signatures = signatures(driven, baseline, &all, measured);
    let (signatures, numbers) = signatures.split_at(rigs.len());
    let product = Product::new(numbers);
    let Some((truth, rivals)) = signatures.split_first() else { return Vec::new() };
    let square = product.of(truth, truth).max(0.0);
    let from = |rival: &Vec<f64>| {
        let lengths = (square * product.of(rival, rival).max(0.0)).sqrt();
        let cosine = if lengths > 0.0 { (product.of(truth, rival) / lengths).clamp(0.0, 1.0) } else { 0.0 };
        Divergence { square, cosine }
    };
    rivals.iter().map(from).collect()
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
    let runs: Vec<Run> = rigs.iter().map(|rig| observer.run(rig)).collect();
    let mut left: Vec<Vec<f64>> = runs
        .iter()
        .map(|run| run.readings.iter().zip(&base.readings).map(|(value, base)| value - base).collect())
        .collect();
    let rows = observer.rows();
    for signature in &mut left {
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
        for signature in &mut left {
            let part = &mut signature[span.clone()];
            part.iter_mut().zip(&out).filter(|(_, out)| **out).for_each(|(value, _)| *value = 0.0);
            project(part, &basis);
        }
    }
    left
}

impl<'a> Observer<'a> {
    fn new(driven: &'a ClosedLoopRun, rig: &RigParameters, measured: [bool; 2]) -> Self {
        let sensors = rig.sensors();
        let with_rounding = |noise: f64, step: f64| (noise * noise + step * step / 12.0).sqrt();
        let pressure = with_rounding(sensors.pressure_noise_pa, sensors.pressure_step_pa());
        let noise = [
            with_rounding(sensors.position_noise_m, sensors.position_step_m()),
            with_rounding(sensors.force_noise_n, sensors.force_step_n()),
            pressure,
            pressure,
        ];
        Observer { driven, measured: (0..2).filter(|axis| measured[*axis]).collect(), noise }
    }

    fn windows(&self) -> usize {
        self.driven.inputs.len() / WINDOW
    }

    /// Where the axes are at the start of a window, at rest where they creep: there friction holds a piston up to the break-away
    /// force, whichever way, as the workflow takes it. One that came to rest sliding would give way to one sign of a nudge alone.
    fn points(&self, window: usize) -> [Point; 2] {
        self.driven.points[window * WINDOW].map(|point| {
            let creeps = point.rod_velocity_m_per_s.abs() < REST_M_PER_S;
            if creeps { Point { rod_velocity_m_per_s: 0.0, ..point } } else { point }
        })
    }

    /// Readings of a period.
    fn width(&self) -> usize {
        CHANNELS * self.measured.len()
    }

    /// Readings of a window.
    fn rows(&self) -> usize {
        WINDOW * self.width()
    }

    fn run(&self, rig: &RigParameters) -> Run {
        let mut plant = plant_in(rig, &self.driven.start);
        let mut run = Run { readings: Vec::new(), jumps: Vec::new(), starts: Vec::new() };
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
        let mut phases = Vec::with_capacity(WINDOW + 1);
        for inputs in &self.driven.inputs[window * WINDOW..][..WINDOW] {
            let truth = plant.truth(inputs);
            let shown = plant.shown(&truth);
            for axis in &self.measured {
                readings.extend(shown[*axis].iter().zip(self.noise).map(|(value, noise)| value / noise));
            }
            phases.push([phase(&truth, 0), phase(&truth, 1)]);
            plant.step(inputs);
        }
        let end = plant.truth(&Inputs::default());
        phases.push([phase(&end, 0), phase(&end, 1)]);
        jumps.resize(readings.len(), false);
        for (lane, axis) in self.measured.iter().enumerate() {
            for at in 0..WINDOW {
                let now = phases[at][*axis];
                let jump = phases[at.saturating_sub(1)][*axis] != now || phases[at + 1][*axis] != now;
                jumps[from + at * self.width() + lane * CHANNELS + FORCE] = jump;
            }
        }
    }

    /// Columns of S of a window; marks in `out` the events of the nudged plants.
    fn sensitivities(
        &self,
        rig: &RigParameters,
        base: &Run,
        window: usize,
        out: &mut [bool],
    ) -> Vec<Vec<f64>> {
        let baseline = &base.readings[window * self.rows()..][..self.rows()];
        // Axes that are not linked know nothing of each other: one run nudges both, and each has its own readings.
        let together: Vec<Vec<usize>> = if self.driven.linked {
            self.measured.iter().map(|axis| vec![*axis]).collect()
        } else {
            vec![self.measured.clone()]
        };
        let mut columns = Vec::new();
        for axes in together {
            for number in 0..Point::NUDGES.len() {
                let mut points = self.points(window);
                for axis in &axes {
                    points[*axis] = points[*axis].nudged(number);
                }
                let mut plant = plant_in(rig, &base.starts[window]);
                plant
                    .go_on_in(&state_at(&plant, &points, [true; 2]))
                    .expect("a nudge leaves the rig in a state of its own");
                let (mut nudged, mut jumps) = (Vec::with_capacity(self.rows()), Vec::new());
                self.read(&mut plant, window, &mut nudged, &mut jumps);
                out.iter_mut().zip(&jumps).for_each(|(all, jump)| *all |= jump);
                let change: Vec<f64> =
                    nudged.iter().zip(baseline).map(|(value, base)| value - base).collect();
                if self.driven.linked {
                    columns.push(change);
                } else {
                    columns.extend((0..self.measured.len()).map(|lane| self.lane(&change, lane)));
                }
            }
        }
        columns
    }

    /// The readings of one measured axis, 0 for the other.
    fn lane(&self, readings: &[f64], lane: usize) -> Vec<f64> {
        let of = |at: usize| (at % self.width()) / CHANNELS;
        readings.iter().enumerate().map(|(at, value)| if of(at) == lane { *value } else { 0.0 }).collect()
    }
}

fn plant_in(rig: &RigParameters, state: &State) -> Plant {
    Plant::in_state(rig, &of_rig(rig, state)).expect("a state of a run is one that the rig can be in")
}

/// The state with what this rig's supply gives at most: another rig's run may have had more.
fn of_rig(rig: &RigParameters, state: &State) -> State {
    State { supply_pressure_pa: state.supply_pressure_pa.min(rig.supply().pressure_pa), ..*state }
}

/// Which way an axis goes, and whether the rods touch.
fn phase(truth: &Truth, axis: usize) -> (i8, bool) {
    let velocity = truth.axes[axis].rod_velocity_m_per_s;
    let way = if velocity.abs() < REST_M_PER_S { 0 } else { velocity.signum() as i8 };
    (way, truth.contact_force_n != 0.0)
}

/// An orthonormal basis of columns without the rows that count for nothing, by Gram and Schmidt, each direction twice.
fn basis(columns: Vec<Vec<f64>>, out: &[bool]) -> Vec<Vec<f64>> {
    let mut kept: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns {
        column.iter_mut().zip(out).filter(|(_, out)| **out).for_each(|(value, _)| *value = 0.0);
        let before = dot(&column, &column).sqrt();
        project(&mut column, &kept);
        project(&mut column, &kept);
        let left = dot(&column, &column).sqrt();
        if left > RANK * before {
            column.iter_mut().for_each(|value| *value /= left);
            kept.push(column);
        }
    }
    kept
}
