//! Integration of a program over the samples of a record, with sensitivities.
//!
//! ```text
//!   x' = f(t, u, x, p)        S' = f_x S + f_p        S = dx/d(directions)
//!   adaptive: Dormand-Prince 5(4); a step is accepted when its error in x is at most tolerance * largest |x| so far
//!   fixed:    classical Runge-Kutta 4
//! ```
//! Every step ends at a sample at the latest, so that an input that jumps there jumps between two steps. The same operations that
//! step x step S (forward derivatives through the scheme), so that S is the derivative of what is computed; steps are chosen by
//! x alone. Memories are renewed after each step.
//!
//! The scheme is written out here: the kept libraries were tried and allocate in each step (ode_solvers 0.6 clones its state some
//! six times a step and stores it; diffsol 0.12 brings faer and 90 crates), and both would restart at each sample. ode_solvers is
//! the reference of the tests.
//!
//! Sources: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd edition, II.4, II.5, table 5.2 [HNW 1993];
//! Bock 1983, internal numerical differentiation.

use crate::compile::{Tapes, tapes};
use crate::failure::Failure;
use crate::file::{Model, Solver};
use crate::inputs::{Hold, Inputs};
use crate::tape::{Leaves, Registers, Tape};
use settings::SettingsError;

/// Stages of Dormand-Prince.
const STAGES: usize = 7;
/// Its coefficients [HNW 1993, table 5.2].
const A: [[f64; 6]; STAGES] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const C: [f64; STAGES] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// Difference of the two orders.
const E: [f64; STAGES] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Share of the step that the error would allow, and bounds of its change [HNW 1993, II.4].
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;
/// Most steps between two samples.
pub(crate) const MOST_STEPS: usize = 100_000;

/// A number that something is differentiated by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// A parameter of the model, by its index.
    Parameter(usize),
    /// The start of a state, by its index.
    Start(usize),
}

/// A model with some of its suspects, compiled.
#[derive(Clone, Debug)]
pub struct Program {
    tapes: Tapes,
    solver: Solver,
    holds: Vec<Hold>,
    names: Names,
}

/// What messages call the parts, with the places of their equations.
#[derive(Clone, Debug)]
struct Names {
    states: Vec<(String, String)>,
    outputs: Vec<(String, String)>,
}

impl Program {
    /// Compiles a model with these suspects, by their index.
    ///
    /// # Errors
    /// Suspects that depend on each other in a circle.
    pub fn new(model: &Model, suspects: &[usize]) -> Result<Self, SettingsError> {
        let tapes = tapes(model, suspects).map_err(|wrong| model.wrong(wrong.at, &wrong.why))?;
        let state = |index: &usize| {
            let state = &model.states[*index];
            (format!("the rate of {}", state.name), model.place_of(&state.derivative))
        };
        let names = Names {
            states: tapes.states.iter().map(state).collect(),
            outputs: model.outputs.iter().map(|one| (one.name.clone(), model.place_of(&one.value))).collect(),
        };
        let holds = model.inputs.iter().map(|input| input.hold).collect();
        Ok(Self { tapes, solver: model.solver, holds, names })
    }

    /// Operations of one evaluation of all rates.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.tapes.rates.operations()
    }

    /// States that it integrates, by their index in the model.
    #[must_use]
    pub fn states(&self) -> &[usize] {
        &self.tapes.states
    }

    fn leaves(&self) -> Leaves {
        self.tapes.rates.leaves
    }
}

/// A program with room for its states, stages and sensitivities.
#[derive(Clone, Debug)]
pub struct Simulator<'a> {
    program: &'a Program,
    directions: Vec<Direction>,
    rates: Registers,
    outputs: Registers,
    updates: Registers,
    /// Each state and its sensitivities, one after the other.
    x: Vec<f64>,
    tried: Vec<f64>,
    stages: [Vec<f64>; STAGES],
    largest: Vec<f64>,
    memory: Vec<f64>,
    step_s: f64,
    /// Steps of the record, refused ones too, and how many it may take.
    steps: usize,
    most_steps: usize,
}

impl<'a> Simulator<'a> {
    /// Room for a program, with derivatives along these directions.
    #[must_use]
    pub fn new(program: &'a Program, directions: &[Direction]) -> Self {
        let leaves = program.leaves();
        let is_active = |leaf| {
            let is_state = (leaves.state(0)..leaves.parameter(0)).contains(&leaf);
            let is_memory = leaf >= leaves.memory(0);
            let is_parameter = directions.iter().any(
                |direction| matches!(direction, Direction::Parameter(index) if leaf == leaves.parameter(*index)),
            );
            is_state || is_memory || is_parameter
        };
        let registers = |tape: &Tape| {
            let mut registers = Registers::new(tape, directions.len(), is_active);
            for (place, direction) in directions.iter().enumerate() {
                if let Direction::Parameter(index) = direction {
                    registers.slope_mut(leaves.parameter(*index))[place] = 1.0;
                }
            }
            registers
        };
        let width = 1 + directions.len();
        let room = vec![0.0; program.tapes.states.len() * width];
        Self {
            program,
            directions: directions.to_vec(),
            rates: registers(&program.tapes.rates),
            outputs: registers(&program.tapes.outputs),
            updates: registers(&program.tapes.updates),
            x: room.clone(),
            tried: room.clone(),
            stages: core::array::from_fn(|_| room.clone()),
            largest: vec![0.0; program.tapes.states.len()],
            memory: vec![0.0; program.tapes.memories.len() * width],
            step_s: 0.0,
            steps: 0,
            most_steps: usize::MAX,
        }
    }

    /// The same with at most so many steps over all samples: a fit gives up values at which the equations become stiff.
    #[must_use]
    pub fn within(self, most_steps: usize) -> Self {
        Self { most_steps, ..self }
    }

    /// Steps that the last record took.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    fn width(&self) -> usize {
        1 + self.directions.len()
    }

    /// Simulates over all samples. `parameters` and `starts` are those of the model, in SI; `memories` their starts. `sink` gets
    /// row, output, value and derivatives.
    ///
    /// # Errors
    /// [`Failure`] with the time at which it goes wrong.
    pub fn run(
        &mut self,
        inputs: &Inputs<'_>,
        [parameters, starts, memories]: [&[f64]; 3],
        mut sink: impl FnMut(usize, usize, f64, &[f64]),
    ) -> Result<(), Failure> {
        let leaves = self.program.leaves();
        for (index, value) in parameters.iter().enumerate() {
            let register = leaves.parameter(index);
            self.rates.set(register, *value);
            self.outputs.set(register, *value);
            self.updates.set(register, *value);
        }
        let tapes = &self.program.tapes;
        tapes.rates.prepare(&mut self.rates);
        tapes.outputs.prepare(&mut self.outputs);
        tapes.updates.prepare(&mut self.updates);
        self.begin(starts, memories);
        for row in 0..inputs.time_s.len() {
            if row > 0 {
                self.advance(inputs, row - 1)?;
            }
            self.read(inputs, row, &mut sink)?;
        }
        Ok(())
    }

    fn begin(&mut self, starts: &[f64], memories: &[f64]) {
        let width = self.width();
        self.x.fill(0.0);
        self.memory.fill(0.0);
        self.step_s = 0.0;
        self.steps = 0;
        for (place, state) in self.program.tapes.states.iter().enumerate() {
            self.x[place * width] = starts[*state];
            for (index, direction) in self.directions.iter().enumerate() {
                if *direction == Direction::Start(*state) {
                    self.x[place * width + 1 + index] = 1.0;
                }
            }
            self.largest[place] = starts[*state].abs();
        }
        for (place, memory) in self.program.tapes.memories.iter().enumerate() {
            self.memory[place * width] = memories[*memory];
        }
        self.put_memories();
    }

    fn put_memories(&mut self) {
        let (leaves, width) = (self.program.leaves(), self.width());
        for (place, memory) in self.program.tapes.memories.iter().enumerate() {
            let value = &self.memory[place * width..(place + 1) * width];
            for registers in [&mut self.rates, &mut self.outputs, &mut self.updates] {
                registers.set(leaves.memory(*memory), value[0]);
                registers.slope_mut(leaves.memory(*memory)).copy_from_slice(&value[1..]);
            }
        }
    }

    /// Reads the outputs at a sample.
    fn read(
        &mut self,
        inputs: &Inputs<'_>,
        row: usize,
        sink: &mut impl FnMut(usize, usize, f64, &[f64]),
    ) -> Result<(), Failure> {
        let program = self.program;
        put(program, &mut self.outputs, inputs, (row, inputs.time_s[row]), &self.x);
        program.tapes.outputs.evaluate(&mut self.outputs, inputs);
        for (output, (name, place)) in program.names.outputs.iter().enumerate() {
            let register = program.tapes.outputs.result(output);
            let value = self.outputs.value(register);
            if !value.is_finite() {
                return Err(failure(row == 0, name, place, inputs.time_s[row]));
            }
            sink(row, output, value, self.outputs.slope(register));
        }
        Ok(())
    }

    /// From a sample to the next one.
    fn advance(&mut self, inputs: &Inputs<'_>, row: usize) -> Result<(), Failure> {
        let (from_s, to_s) = (inputs.time_s[row], inputs.time_s[row + 1]);
        if self.steps >= self.most_steps {
            return Err(Failure::Steps { time_s: from_s });
        }
        if self.x.is_empty() && self.memory.is_empty() {
            self.steps += 1;
            return Ok(());
        }
        match self.program.solver {
            Solver::Fixed { step_s } => {
                // A step that is longer by a rounding error is no step more.
                let steps = ((to_s - from_s) / step_s - 1e-9).ceil().max(1.0);
                if steps > MOST_STEPS as f64 {
                    return Err(Failure::Steps { time_s: from_s });
                }
                let length_s = (to_s - from_s) / steps;
                self.steps += steps as usize;
                for step in 0..steps as usize {
                    self.first_stage(inputs, row, from_s + length_s * step as f64)?;
                    self.classical(inputs, row, from_s + length_s * step as f64, length_s);
                    self.taken(inputs, row, from_s + length_s * (step + 1) as f64)?;
                }
                Ok(())
            }
            Solver::Adaptive { relative_tolerance } => self.adapt(inputs, row, relative_tolerance),
        }
    }

    /// The rates at the head of a step, which are finite at the start of a record or its equation is wrong.
    fn first_stage(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64) -> Result<(), Failure> {
        self.stage(inputs, row, time_s, 0, false);
        let width = self.width();
        let lost = (0..self.largest.len()).find(|place| !self.stages[0][place * width].is_finite());
        match lost {
            Some(place) => {
                let (name, where_it_is) = &self.program.names.states[place];
                Err(failure(time_s == inputs.time_s[0], name, where_it_is, time_s))
            }
            None => Ok(()),
        }
    }

    fn classical(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64, step_s: f64) {
        for (stage, share) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
            for ((tried, x), rate) in self.tried.iter_mut().zip(&self.x).zip(&self.stages[stage - 1]) {
                *tried = x + step_s * share * rate;
            }
            self.stage(inputs, row, time_s + share * step_s, stage, true);
        }
        let [first, second, third, fourth, ..] = &self.stages;
        for (index, x) in self.x.iter_mut().enumerate() {
            *x += step_s / 6.0 * (first[index] + 2.0 * (second[index] + third[index]) + fourth[index]);
        }
    }

    fn adapt(&mut self, inputs: &Inputs<'_>, row: usize, tolerance: f64) -> Result<(), Failure> {
        let (from_s, to_s) = (inputs.time_s[row], inputs.time_s[row + 1]);
        let mut time_s = from_s;
        self.first_stage(inputs, row, time_s)?;
        for _ in 0..MOST_STEPS.min(self.most_steps - self.steps) {
            self.steps += 1;
            let left_s = to_s - time_s;
            let wished_s = if self.step_s > 0.0 { self.step_s } else { left_s };
            // The last step ends on the sample, and no sliver is left behind it.
            let is_last = wished_s >= 0.999 * left_s;
            let step_s = if is_last { left_s } else { wished_s.min(0.5 * left_s).max(left_s * 1e-6) };
            for stage in 1..STAGES {
                self.tried.fill(0.0);
                for (weight, before) in A[stage][..stage.min(6)].iter().zip(&self.stages) {
                    for (sum, rate) in self.tried.iter_mut().zip(before) {
                        *sum += weight * rate;
                    }
                }
                for (tried, x) in self.tried.iter_mut().zip(&self.x) {
                    *tried = x + step_s * *tried;
                }
                self.stage(inputs, row, time_s + C[stage] * step_s, stage, true);
            }
            let error = self.error(step_s) / tolerance;
            let factor = if error > 0.0 { SAFETY * libm::pow(error, -0.2) } else { GROW };
            let factor = if factor.is_nan() { SHRINK } else { factor.clamp(SHRINK, GROW) };
            if error <= 1.0 {
                self.step_s = if is_last { self.step_s.max(step_s * factor) } else { step_s * factor };
                time_s = if is_last { to_s } else { time_s + step_s };
                core::mem::swap(&mut self.x, &mut self.tried);
                self.taken(inputs, row, time_s)?;
                if is_last {
                    return Ok(());
                }
                if self.memory.is_empty() {
                    self.stages.swap(0, STAGES - 1);
                } else {
                    self.stage(inputs, row, time_s, 0, false);
                }
            } else {
                if step_s <= left_s * 1e-6 {
                    return Err(if error.is_finite() {
                        Failure::Steps { time_s: from_s }
                    } else {
                        self.lost(time_s)
                    });
                }
                self.step_s = step_s * factor.min(1.0);
            }
        }
        Err(Failure::Steps { time_s: from_s })
    }

    /// Largest error of a step over the size of its state.
    fn error(&self, step_s: f64) -> f64 {
        let width = self.width();
        let mut worst: f64 = 0.0;
        for (place, largest) in self.largest.iter().enumerate() {
            let at = place * width;
            let error: f64 = E.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[at]).sum();
            // A state that has not moved yet is as large as its first step.
            let size =
                largest.max((step_s * self.stages[0][at]).abs()).max((self.tried[at] - self.x[at]).abs());
            let relative = (step_s * error).abs() / size.max(f64::MIN_POSITIVE);
            worst = if relative.is_nan() { f64::INFINITY } else { worst.max(relative) };
            if worst.is_infinite() {
                return worst;
            }
        }
        worst
    }

    /// Rates at a stage, from `tried` or `x`.
    fn stage(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64, stage: usize, tried: bool) {
        let program = self.program;
        let x = if tried { &self.tried } else { &self.x };
        put(program, &mut self.rates, inputs, (row, time_s), x);
        program.tapes.rates.evaluate(&mut self.rates, inputs);
        let width = self.width();
        for place in 0..program.tapes.states.len() {
            let register = program.tapes.rates.result(place);
            let rate = &mut self.stages[stage][place * width..(place + 1) * width];
            rate[0] = self.rates.value(register);
            rate[1..].copy_from_slice(self.rates.slope(register));
        }
    }

    /// What follows a step: memories, sizes, and whether all is finite.
    fn taken(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64) -> Result<(), Failure> {
        let (program, width) = (self.program, self.width());
        for place in 0..self.largest.len() {
            let value = self.x[place * width];
            if !value.is_finite() {
                return Err(self.lost(time_s));
            }
            self.largest[place] = self.largest[place].max(value.abs());
        }
        if self.memory.is_empty() {
            return Ok(());
        }
        put(program, &mut self.updates, inputs, (row, time_s), &self.x);
        program.tapes.updates.evaluate(&mut self.updates, inputs);
        for place in 0..program.tapes.memories.len() {
            let register = program.tapes.updates.result(place);
            let kept = &mut self.memory[place * width..(place + 1) * width];
            kept[0] = self.updates.value(register);
            kept[1..].copy_from_slice(self.updates.slope(register));
        }
        self.put_memories();
        Ok(())
    }

    /// The first state that is not finite, or whose rate is not.
    fn lost(&self, time_s: f64) -> Failure {
        let width = self.width();
        let is_lost = |place: &usize| {
            !self.x[place * width].is_finite()
                || self.stages.iter().any(|stage| !stage[place * width].is_finite())
        };
        let place = (0..self.largest.len()).find(is_lost).unwrap_or(0);
        let (name, where_it_is) = &self.program.names.states[place];
        failure(false, name, where_it_is, time_s)
    }
}

fn failure(is_start: bool, what: &str, place: &str, time_s: f64) -> Failure {
    if is_start {
        Failure::Start { place: place.into(), what: what.into() }
    } else {
        Failure::NotFinite { what: what.into(), time_s }
    }
}

/// Sets time, inputs and states between two samples.
fn put(
    program: &Program,
    registers: &mut Registers,
    inputs: &Inputs<'_>,
    (row, time_s): (usize, f64),
    x: &[f64],
) {
    let leaves = program.leaves();
    registers.set(0, time_s);
    for (index, hold) in program.holds.iter().enumerate() {
        let samples = &inputs.samples_si[index];
        let value = match hold {
            Hold::Linear if row + 1 < inputs.time_s.len() => {
                let (from_s, to_s) = (inputs.time_s[row], inputs.time_s[row + 1]);
                samples[row] + (samples[row + 1] - samples[row]) * ((time_s - from_s) / (to_s - from_s))
            }
            _ => samples[row],
        };
        registers.set(leaves.input(index), value);
    }
    let width = x.len() / program.tapes.states.len().max(1);
    for (place, state) in program.tapes.states.iter().enumerate() {
        let register = leaves.state(*state);
        registers.set(register, x[place * width]);
        registers.slope_mut(register).copy_from_slice(&x[place * width + 1..(place + 1) * width]);
    }
}
