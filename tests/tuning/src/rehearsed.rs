//! A whole experiment in rehearsal under the conditions of a trial: real chains, both programs, both axes.
//!
//! ```text
//!   rest │ motion, force step in it │ rest: three windows of 0.5 s at its end │ done
//!                 ╰── ripple ──╯          ╰──── lasting oscillation ────╯
//! ```
//!
//! A linked rig *oscillates* when its run is not done (a chain waited in vain for standstill, or a fault stopped it), or when in
//! each of the last three half seconds of the experiment the drive's position moves by more than [`STILL_M`] or the load's force
//! by more than [`STILL_N`], or when in motion, from 1 s to 0.5 s before the drive's set-point comes to rest, the force has a
//! ripple of more than [`RIPPLE_N`]: at rest a dead zone may hide what the loop does. In the last half second of the motion the
//! rod may stick and hop, which is no oscillation. Each is asked of [`SEEDS`] kinds of noise: one that hunts does not do so each
//! time.

use super::{Trial, TrialError, in_parallel, means, peak_to_peak};
use axis_control::setup::{Inputs, Mode};
use plant::{Axis, Scene};
use protocol::frames::MainChainState;
use rehearsal::{Rehearsal, RehearsalParts, RehearsalRow};

/// Largest movement at rest that is no oscillation, m.
pub const STILL_M: f64 = 2e-4;
/// Largest change of the force at rest that is no oscillation, N.
pub const STILL_N: f64 = 10.0;
/// Largest ripple of the force in motion that is no oscillation, N.
pub const RIPPLE_N: f64 = 10.0;
/// Kinds of the sensors' noise that a margin is asked of.
pub const SEEDS: u64 = 3;
/// Longest run, cycles: several times the experiments'.
const LONGEST: u64 = 120_000;
/// Cycles of a window, of the means that take the noise of position and force away, and of that which a ripple is measured from.
const WINDOW: usize = 500;
const SMOOTH_M: usize = 10;
const SMOOTH_N: usize = 5;
const SLOW: usize = 100;

pub struct Run {
    pub rows: Vec<RehearsalRow>,
    pub done: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationFigures {
    pub done: bool,
    /// Least peak to peak of the drive's position among the last three half seconds, m.
    pub position_m: f64,
    /// The same of the load's force, N.
    pub force_n: f64,
    /// Largest force beside its mean over 0.1 s, in the last but one half second of the motion, N.
    pub ripple_n: f64,
}

impl OscillationFigures {
    pub fn is_still(&self) -> bool {
        self.done && self.position_m < STILL_M && self.force_n < STILL_N && self.ripple_n < RIPPLE_N
    }
}

/// Rehearses what was read under the conditions of `trial`; the controllers keep the numbers of the nominal rig.
///
/// # Errors
/// [`TrialError`] when the conditions are none of the rig's, or experiment and programs do not go together.
pub fn rehearse(inputs: &Inputs, scene: &Scene, trial: &Trial) -> Result<Run, TrialError> {
    let rig = trial.rig(&inputs.rig)?;
    let scene = Scene { added_mass_kg: trial.added_mass_kg, ..scene.clone() };
    let mode = Mode { partner_needed: true, real_time: false, forever: false };
    let controllers =
        Axis::ALL.into_iter().map(|axis| inputs.controller(axis, mode)).collect::<Result<_, _>>()?;
    let parts = RehearsalParts { rig: &rig, scene: &scene, seed: trial.seed, controllers };
    let mut rehearsal = Rehearsal::new(parts)?;
    let mut rows = Vec::new();
    while rehearsal.cycles() < LONGEST && !rehearsal.ended() {
        rows.push(rehearsal.step(|_, _| {}));
    }
    Ok(Run { rows, done: rehearsal.node().done() })
}

/// Largest of [`FACTORS`](super::FACTORS) up to which the rig does not oscillate; 0 if it does as it is.
pub fn gain_margin(inputs: &Inputs, scene: &Scene, trial: &Trial) -> Result<f64, TrialError> {
    super::largest_factor(trial, |trial| is_still(inputs, scene, trial))
}

/// The least margin of all corners, by [`in_parallel`].
pub fn worst_gain_margin(inputs: &Inputs, scene: &Scene) -> Result<f64, TrialError> {
    super::largest_factor(&Trial::default(), |Trial { loop_factor, .. }| {
        let corners =
            Trial::corners().into_iter().map(|corner| Trial { loop_factor: *loop_factor, ..corner });
        let still = in_parallel(&corners.collect::<Vec<_>>(), |trial| is_still(inputs, scene, trial))?;
        Ok(still.into_iter().all(|still| still))
    })
}

/// Whether nothing oscillates with any kind of noise.
fn is_still(inputs: &Inputs, scene: &Scene, trial: &Trial) -> Result<bool, TrialError> {
    for seed in trial.seed..trial.seed + SEEDS {
        if !rehearse(inputs, scene, &Trial { seed, ..*trial })?.oscillation().is_still() {
            return Ok(false);
        }
    }
    Ok(true)
}

impl Run {
    pub fn oscillation(&self) -> OscillationFigures {
        let drive = |row: &RehearsalRow| row.axes[Axis::Drive.index()];
        let in_experiment =
            |row: &&RehearsalRow| drive(row).is_some_and(|drive| drive.main == MainChainState::Experiment);
        let rows: Vec<_> = self.rows.iter().filter(in_experiment).collect();
        let column = |of: fn(&RehearsalRow) -> f64| rows.iter().map(|row| of(row)).collect::<Vec<_>>();
        let position = column(|row| row.cycle.readings[Axis::Drive.index()].position.value);
        let force = column(|row| row.cycle.readings[Axis::Load.index()].force.value);
        let least = |values: &[f64], smooth| {
            let windows = values.rchunks(WINDOW).take(3);
            windows.map(|window| peak_to_peak(&means(window, smooth))).fold(f64::INFINITY, f64::min)
        };
        let moves = |row: &&&RehearsalRow| {
            drive(row).and_then(|drive| drive.set_position).is_some_and(|point| point.moving)
        };
        let rest_from = rows.len() - rows.iter().rev().take_while(|row| !moves(row)).count();
        let motion = &force[rest_from.saturating_sub(2 * WINDOW)..rest_from.saturating_sub(WINDOW)];
        let (quick, slow) = (means(motion, SMOOTH_N), means(motion, SLOW));
        let ripple =
            quick.iter().skip((SLOW - SMOOTH_N) / 2).zip(&slow).map(|(quick, slow)| (quick - slow).abs());
        OscillationFigures {
            done: self.done,
            position_m: least(&position, SMOOTH_M),
            force_n: least(&force, SMOOTH_N),
            ripple_n: ripple.fold(0.0, f64::max),
        }
    }
}
