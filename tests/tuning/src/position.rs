//! Figures of a position program on moves, and how far it is from oscillating: unlinked, no chains around it.
//!
//! ```text
//!   moves ──► program ──► 1 cycle (+ extra delay) ──► plant, K_V times the loop's factor ──► sensors with noise ──┐
//!                ▲                                                                                                │
//!                └────────────────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! The delay margin counts cycles that each command is late.
//!
//! *No oscillation* means: in the last half second of each rest of [`EXCITATION`] the position, as a mean over 10 ms, moves
//! by less than [`STILL_M`], and during moves nothing quicker than a third of a second is larger than [`RIPPLE_M`]. A hop
//! of stick and slip, 1 to 2 mm every few seconds, is no oscillation; it shows in the figure `rest_peak_to_peak_m`, which
//! is judged apart.

use crate::{Trial, TrialError, largest_factor, means, peak_to_peak};
use algorithms::guard::AlgorithmFault;
use axis_control::program::{ActiveAlgorithm, Demand, Program};
use axis_control::set_point::{ForceSetPoint, SetPoint, SmoothTransition};
use plant::{Inputs, Plant, RigParameters, Setup, quantise_valve};
use protocol::frames::Sensors;
use std::collections::VecDeque;

/// Largest movement at rest that is no oscillation, m.
pub const STILL_M: f64 = 2e-3;
/// Largest ripple during a move that is no oscillation, m.
pub const RIPPLE_M: f64 = 2e-3;

/// A move along a Bestehorn sinoid and the rest behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    pub to_m: f64,
    /// How long it takes, s; 0 is a step.
    pub duration_s: f64,
    /// How long it rests, s; 0.5 s at least.
    pub rest_s: f64,
}

const fn to(to_m: f64, duration_s: f64, rest_s: f64) -> Move {
    Move { to_m, duration_s, rest_s }
}

const START_M: f64 = 0.1;
/// The paper's positioning, Fig. 8, twice: the first repetition has the chamber pressures of the start, the others do not.
pub const POINT_TO_POINT: &[Move] =
    &[to(0.4, 3.0, 1.0), to(0.1, 3.0, 1.0), to(0.4, 3.0, 1.0), to(0.1, 3.0, 1.0)];
/// Weights with which the positioning keeps its bounds, kg.
pub const WEIGHTS_KG: [f64; 3] = [0.0, 2.5, 5.0];
/// A step and back: Fig. 7.
pub const STEP: &[Move] = &[to(0.3, 0.0, 2.0), to(0.1, 0.0, 2.0)];
/// What wakes up an oscillation: both ends, the soft middle, a step.
pub const EXCITATION: &[Move] = &[to(0.4, 3.0, 3.0), to(0.1, 3.0, 3.0), to(0.25, 0.0, 4.0)];

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Largest |error| while the set-point moves, m.
    pub dynamic_m: f64,
    /// Largest mean |error| over the last 0.2 s of a rest, m.
    pub static_m: f64,
    /// Largest peak to peak of the position's mean over 10 ms in the last 0.5 s of a rest, m.
    pub rest_peak_to_peak_m: f64,
    /// Largest error during moves beside its mean over 0.3 s, m.
    pub ripple_m: f64,
    pub overshoot_m: f64,
    /// Longest time from a step until the error stays within 2 mm, s.
    pub settling_s: f64,
}

/// Tries `program`, which has seen nothing yet, on `moves`.
///
/// # Errors
/// [`TrialError`] when the conditions are none of the rig's, or the algorithm's result is no number.
pub fn attempt(program: Program, moves: &[Move], trial: &Trial) -> Result<Figures, TrialError> {
    attempt_late(program, moves, trial, 0)
}

/// The positioning with each of [`WEIGHTS_KG`]: the worst of all.
pub fn positioning(program: impl Fn() -> Program) -> Result<Figures, TrialError> {
    let mut worst = Figures::default();
    for added_mass_kg in WEIGHTS_KG {
        let figures = attempt(program(), POINT_TO_POINT, &Trial { added_mass_kg, ..Trial::default() })?;
        worst.dynamic_m = worst.dynamic_m.max(figures.dynamic_m);
        worst.static_m = worst.static_m.max(figures.static_m);
        worst.rest_peak_to_peak_m = worst.rest_peak_to_peak_m.max(figures.rest_peak_to_peak_m);
    }
    Ok(worst)
}

/// The same with each command so many cycles late.
fn attempt_late(
    mut program: Program,
    moves: &[Move],
    trial: &Trial,
    late_cycles: usize,
) -> Result<Figures, TrialError> {
    let rig = trial.rig(&RigParameters::baseline())?;
    let setup = Setup { carriage_position_m: START_M, linked: false, added_mass_kg: trial.added_mass_kg };
    let mut drive = SimulatedDrive {
        plant: Plant::new(&rig, &setup)?,
        sensors: plant::Sensors::new(&rig, trial.seed),
        commands: VecDeque::from(vec![0.0; 1 + late_cycles]),
        cycle: 0,
    };
    let mut figures = Figures::default();
    drive.follow(&mut program, SmoothTransition::new(START_M, START_M, 0.0), 0.5)?;
    let mut from_m = START_M;
    for part in moves {
        let way = SmoothTransition::new(from_m, part.to_m, part.duration_s);
        let moving = drive.follow(&mut program, way, part.duration_s)?;
        let resting =
            drive.follow(&mut program, SmoothTransition::new(part.to_m, part.to_m, 0.0), part.rest_s)?;
        figures.take_move(&moving);
        figures.take_rest(&resting);
        if part.duration_s == 0.0 {
            figures.take_step(&resting, (part.to_m - from_m).signum());
        }
        from_m = part.to_m;
    }
    Ok(figures)
}

/// Largest of [`FACTORS`](super::FACTORS) up to which nothing oscillates; 0 if something does as it is.
pub fn gain_margin(program: impl Fn() -> Program, trial: &Trial) -> Result<f64, TrialError> {
    largest_factor(trial, |trial| Ok(attempt(program(), EXCITATION, trial)?.is_still()))
}

/// How many cycles a command may be late without oscillation, up to 20; `None` if something oscillates as it is.
pub fn delay_margin(program: impl Fn() -> Program, trial: &Trial) -> Result<Option<usize>, TrialError> {
    for late_cycles in 0..=20 {
        if !attempt_late(program(), EXCITATION, trial, late_cycles)?.is_still() {
            return Ok(late_cycles.checked_sub(1));
        }
    }
    Ok(Some(20))
}

struct SimulatedDrive {
    plant: Plant,
    sensors: plant::Sensors,
    commands: VecDeque<f64>,
    cycle: u64,
}

impl SimulatedDrive {
    /// Follows `way` for `duration_s`; errors of each cycle, m.
    fn follow(
        &mut self,
        program: &mut Program,
        way: SmoothTransition,
        duration_s: f64,
    ) -> Result<Vec<f64>, AlgorithmFault> {
        let cycles = (duration_s * 1e3).round() as usize;
        (0..cycles).map(|cycle| self.cycle(program, way.at(cycle as f64 * 1e-3).into())).collect()
    }

    /// One cycle; the command that answers it acts from the next one on.
    fn cycle(&mut self, program: &mut Program, position: SetPoint) -> Result<f64, AlgorithmFault> {
        let acting = self.commands.pop_front().unwrap_or(0.0);
        let inputs = Inputs { valve: [acting, 0.0], ..Inputs::default() };
        let [drive, _] = self.sensors.sample(&self.plant, &inputs);
        let sensors = Sensors {
            position_m: drive.position.value,
            force_n: drive.force.value,
            pressure_a_pa: drive.pressure_a.value,
            pressure_b_pa: drive.pressure_b.value,
            ..Sensors::default()
        };
        program.observe(self.cycle, &sensors, self.plant.supply_pressure_pa());
        let demand = Demand { position, force: ForceSetPoint::at_rest(0.0) };
        let output = program.control(self.cycle, &demand, ActiveAlgorithm::User)?;
        self.commands.push_back(quantise_valve(output.opening));
        self.plant.step(&inputs);
        self.cycle += 1;
        Ok(position.position_m - sensors.position_m)
    }
}

/// Cycles of a mean that takes the noise away, of the end of a rest for its movement, and of that for its error.
const SMOOTH: usize = 10;
const STILL: usize = 500;
const STATIC: usize = 200;
/// Cycles of the mean that a ripple is measured from.
const SLOW: usize = 300;
/// Within this a step has settled, m.
const SETTLED_M: f64 = 2e-3;

impl Figures {
    pub fn is_still(&self) -> bool {
        self.rest_peak_to_peak_m < STILL_M && self.ripple_m < RIPPLE_M
    }

    fn take_move(&mut self, errors_m: &[f64]) {
        self.dynamic_m = errors_m.iter().fold(self.dynamic_m, |most, error| most.max(error.abs()));
        let (quick, slow) = (means(errors_m, SMOOTH), means(errors_m, SLOW));
        let middle = (SLOW - SMOOTH) / 2;
        let ripple = quick.iter().skip(middle).zip(&slow).map(|(quick, slow)| (quick - slow).abs());
        // The break-away in the first second is no ripple.
        self.ripple_m = ripple.skip(1000).fold(self.ripple_m, f64::max);
    }

    fn take_rest(&mut self, errors_m: &[f64]) {
        let end = |cycles: usize| &errors_m[errors_m.len().saturating_sub(cycles)..];
        let mean_m = end(STATIC).iter().map(|error| error.abs()).sum::<f64>() / STATIC as f64;
        self.static_m = self.static_m.max(mean_m);
        let smooth = means(end(STILL), SMOOTH);
        self.rest_peak_to_peak_m = self.rest_peak_to_peak_m.max(peak_to_peak(&smooth));
    }

    fn take_step(&mut self, errors_m: &[f64], direction: f64) {
        let smooth = means(errors_m, SMOOTH);
        self.overshoot_m = smooth.iter().fold(self.overshoot_m, |most, error| most.max(-direction * error));
        let settled =
            smooth.iter().rposition(|error| error.abs() > SETTLED_M).map_or(0, |place| place + SMOOTH);
        self.settling_s = self.settling_s.max(settled as f64 * 1e-3);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axis_control::program::file::Source;
    use plant::Axis;
    use std::path::Path;

    fn shipped(name: &str) -> Program {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../controller/programs/{name}.toml"));
        Source::read(&path).unwrap().program(Axis::Drive, &RigParameters::baseline(), false).unwrap()
    }

    #[test]
    fn a_loop_that_oscillates_is_noticed() {
        let loud = || {
            let mut program = shipped("position-p");
            program.set(program.place("algorithm.gain_per_s").unwrap(), 80.0).unwrap();
            program
        };
        let trial = Trial { added_mass_kg: 20.0, ..Trial::default() };
        assert_eq!(gain_margin(loud, &trial).unwrap(), 0.0);
        assert_eq!(delay_margin(loud, &trial).unwrap(), None);
    }
}
