//! The two experiments of the page: a valve step and a slow stroke, of the baseline and of a rig with one effect.
//!
//! ```text
//! step         valve commands from a script, the same with and without the effect: nothing hides the difference
//! slow stroke  a proportional controller follows a ramp by what the position sensor shows, as a rig is run
//! ```
//!
//! Effects of the linkage and the force sensor's gain are run linked: a force controller on the load presses and pulls in turns.

use plant::effects::sheet::{Excitation, Sheet};
use plant::{Inputs, Plant, RigParameters, Setup};

/// Position, force, pressure a and pressure b of the drive as its sensors show them without noise.
pub(crate) type Row = [f64; 4];

/// What an experiment showed.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    pub(crate) rows: Vec<Row>,
    pub(crate) inputs: Vec<Inputs>,
}

/// How a rig is run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Experiment {
    pub(crate) kind: Kind,
    linked: bool,
    start_m: f64,
}

/// Which of the two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// From rest to `STEP` and back to 0.
    Step,
    /// There and back by a controller.
    SlowStroke,
}

/// Valve opening of the step.
const STEP: f64 = 0.6;
/// Rest before the step, ms: what grows with the time at rest has grown.
const REST_MS: usize = 1000;
/// Length of the step, ms.
const STEP_MS: usize = 250;
/// What is shown before and after the step, ms.
const BEFORE_MS: usize = 50;
const AFTER_MS: usize = 400;

/// Slow stroke: speed, m/s, and rests at its ends, ms.
const SPEED_M_PER_S: f64 = 0.06;
const HOLD_MS: usize = 800;
/// Way of the slow stroke, m.
const WAY_M: f64 = 0.3;
/// Of the controller: opening per metre.
const PROPORTIONAL_PER_M: f64 = 8.0;
/// Of the load's force controller: opening per newton, and what it presses and pulls with in turns of so many ms.
const PROPORTIONAL_PER_N: f64 = 1e-3;
const PRESSING_N: f64 = 150.0;
const TURN_MS: usize = 1100;

impl Experiment {
    /// The experiment that excites an effect.
    pub(crate) fn of(sheet: &Sheet, kind: Kind) -> Self {
        let start_m = match (sheet.excited_by, kind) {
            (Excitation::NearEnd, Kind::Step) => 0.01,
            // The step ends in the cushion.
            (Excitation::IntoEnd, Kind::Step) => 0.43,
            (Excitation::IntoEnd, Kind::SlowStroke) => 0.199,
            _ => 0.1,
        };
        Experiment { kind, linked: sheet.excited_by == Excitation::LinkedRods, start_m }
    }

    /// In words, for the page.
    pub(crate) fn conditions(&self) -> String {
        let linked = if self.linked { ", linked" } else { "" };
        format!("from {} mm{linked}", self.start_m * 1e3)
    }

    /// Milliseconds of the whole and of what is not shown at its beginning.
    pub(crate) fn lengths_ms(&self) -> [usize; 2] {
        match self.kind {
            Kind::Step => [REST_MS + STEP_MS + AFTER_MS, REST_MS - BEFORE_MS],
            Kind::SlowStroke => [3 * HOLD_MS + 2 * Self::ramp_ms(), 0],
        }
    }

    fn ramp_ms() -> usize {
        (WAY_M / SPEED_M_PER_S * 1e3) as usize
    }

    fn set_point_m(&self, k: usize) -> f64 {
        let ramp = Self::ramp_ms();
        let gone = |since: usize| (k.saturating_sub(since).min(ramp)) as f64 * 1e-3 * SPEED_M_PER_S;
        self.start_m + gone(HOLD_MS) - gone(2 * HOLD_MS + ramp)
    }

    /// Runs a rig; `commands` are those of another run, where the experiment gives the same to both.
    pub(crate) fn run(&self, rig: &RigParameters, commands: Option<&[Inputs]>) -> Record {
        let setup = Setup { carriage_position_m: self.start_m, linked: self.linked, ..Setup::default() };
        let mut plant = Plant::new(rig, &setup).expect("a good setup");
        let [length, hidden] = self.lengths_ms();
        let mut record = Record { rows: Vec::new(), inputs: Vec::new() };
        for k in 0..length {
            let shown = plant.noise_free_readings(&plant.truth(&Inputs::default()));
            let inputs = match (commands, self.kind) {
                (Some(commands), Kind::Step) => commands[k],
                _ => self.commands(k, &shown),
            };
            record.rows.push(shown[0]);
            record.inputs.push(inputs);
            plant.step(&inputs);
        }
        record.rows.drain(..hidden);
        record
    }

    fn commands(&self, k: usize, shown: &[Row; 2]) -> Inputs {
        let drive = match self.kind {
            Kind::Step if (REST_MS..REST_MS + STEP_MS).contains(&k) => STEP,
            Kind::Step => 0.0,
            Kind::SlowStroke => PROPORTIONAL_PER_M * (self.set_point_m(k) - shown[0][0]),
        };
        let wanted_n = if (k / TURN_MS).is_multiple_of(2) { PRESSING_N } else { -PRESSING_N };
        let load = match self.kind {
            _ if self.linked => PROPORTIONAL_PER_N * (wanted_n - shown[1][1]),
            // Both axes draw from the supply.
            Kind::Step => drive,
            Kind::SlowStroke => 0.0,
        };
        Inputs { valve: [drive, load].map(plant::quantise_valve), ..Inputs::default() }
    }
}

/// Samples that a difference must last to count as one: the instant of breaking away, a few samples sooner or later, does not.
const LASTING_MS: usize = 10;

/// The largest size of a mean over `LASTING_MS`.
pub(crate) fn lasting_peak(curve: &[f64]) -> f64 {
    let mean = |part: &[f64]| part.iter().sum::<f64>() / LASTING_MS as f64;
    curve.windows(LASTING_MS).map(|part| mean(part).abs()).fold(0.0, f64::max)
}

/// Differences in units of noise, in the order pressure a, pressure b, position, force.
pub(crate) fn differences(baseline: &Record, effect: &Record, noise: [f64; 4]) -> [Vec<f64>; 4] {
    [2, 3, 0, 1].map(|channel: usize| {
        let pairs = baseline.rows.iter().zip(&effect.rows);
        pairs.map(|(before, after)| (after[channel] - before[channel]) / noise[channel]).collect()
    })
}
