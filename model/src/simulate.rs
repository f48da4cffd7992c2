//! Integration of a program over the samples of a record, with sensitivities.
//!
//! ```text
//!   x' = f(t, u, x, p)        S' = f_x S + f_p        S = dx/d(directions)
//!   adaptive: Dormand-Prince 5(4); a step is accepted when its error in x is at most tolerance * largest |x| so far
//!   fixed:    classical Runge-Kutta 4
//! ```
//! Every step ends at a sample at the latest, so that an input that jumps there jumps between two steps. The same operations that
//! step x step S (forward derivatives through the scheme), so that S is the derivative of what is computed; steps are chosen by
//! x alone. Memories are renewed at each sample and after each step; what their change within a step does to x is added by
//! Simpson's rule, and is part of the adaptive method's error (`memories`). A step ends where dry friction stops or breaks away
//! (`frictions`). What else jumps is found by step control: steps become shorter, until one of a millionth of the samples'
//! distance goes over the jump. Earlier values of what is integrated are kept as long as delays reach back (`delays`).
//!
//! The scheme is written out here: the kept libraries were tried and allocate in each step (ode_solvers 0.6 clones its state some
//! six times a step and stores it; diffsol 0.12 brings faer and 90 crates), and both would restart at each sample. ode_solvers is
//! the reference of the tests.
//!
//! Sources: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd edition, II.4, II.5, table 5.2 [HNW 1993];
//! Bock 1983, internal numerical differentiation.

mod delays;
mod frictions;
mod memories;
mod steps;

use crate::compile::{Tapes, direction_of, tapes};
use crate::failure::Failure;
use crate::file::{Model, Solver};
use crate::inputs::{Hold, Inputs};
use crate::tape::{LeafLayout, Register, Registers, Tape};
use delays::DelayedQuantity;
use expression::past::History;
use settings::SettingsError;

/// Stages of Dormand-Prince.
const STAGES: usize = 7;
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
    names: PartNames,
    /// Of each friction the place of its speed among the states, and the register of its direction.
    held: Vec<(usize, Register)>,
    /// Of each state whether derivatives take it as given.
    is_given: Vec<bool>,
}

/// Names of the parts in messages, with the places of their equations.
#[derive(Clone, Debug)]
struct PartNames {
    states: Vec<(String, String)>,
    outputs: Vec<(String, String)>,
    frictions: Vec<(String, String)>,
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
        let friction = |index: &usize| {
            let friction = &model.frictions[*index];
            (friction.name.clone(), model.place_of(&friction.sliding))
        };
        let names = PartNames {
            states: tapes.states.iter().map(state).collect(),
            outputs: model.outputs.iter().map(|one| (one.name.clone(), model.place_of(&one.value))).collect(),
            frictions: tapes.frictions.iter().map(friction).collect(),
        };
        let held = tapes.frictions.iter().map(|index| {
            let velocity = model.frictions[*index].velocity;
            let place = tapes.states.iter().position(|state| *state == velocity);
            let place = place.expect("it holds a state of the model or of its own suspect");
            (place, direction_of(tapes.rates.leaves, model, *index))
        });
        let held = held.collect();
        let holds = model.inputs.iter().map(|input| input.hold).collect();
        let is_given = vec![false; tapes.states.len()];
        Ok(Self { tapes, solver: model.solver, holds, names, held, is_given })
    }

    /// The same where derivatives take the states of the model itself as given, and follow those of suspects alone: of a term
    /// they are then those of its law, not of what the law does to the states that it reads.
    #[must_use]
    pub fn along_states(mut self, model: &Model) -> Self {
        self.is_given =
            self.tapes.states.iter().map(|state| model.states[*state].suspect.is_none()).collect();
        self
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

    fn leaves(&self) -> LeafLayout {
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
    memory_starts: Option<Registers>,
    guards: Registers,
    /// The same without derivatives, for the search of the instant at which friction stops or breaks away.
    plain_guards: Registers,
    /// Of each friction 1 or -1 where it slides, 0 where it holds.
    direction: Vec<f64>,
    /// Of each fitted number by how much an event comes earlier, s for a unit of it.
    earlier_s: Vec<f64>,
    /// States within a step.
    within: Vec<f64>,
    /// Each state and its sensitivities, one after the other.
    x: Vec<f64>,
    tried: Vec<f64>,
    stages: [Vec<f64>; STAGES],
    largest: Vec<f64>,
    memory: Vec<f64>,
    /// Memories at the head of a step, those of its end in two parts, and states with their sensitivities within it.
    memory_before: Vec<f64>,
    memory_in_two: Vec<f64>,
    largest_memory: Vec<f64>,
    middle: Vec<f64>,
    /// Leaves of which earlier values are kept, and these values.
    delayed: Vec<(Register, DelayedQuantity)>,
    history: History,
    memory_at_head: Vec<f64>,
    memory_within: [Vec<f64>; 3],
    /// Delays that rates and memories read; the least of them, and the longest of all.
    delays_s: Vec<f64>,
    least_delay_s: f64,
    longest_delay_s: f64,
    step_s: f64,
    /// Steps of the record, refused ones too, and how many it may take.
    pub steps: usize,
    most_steps: usize,
}

impl<'a> Simulator<'a> {
    /// Room for a program, with derivatives along these directions.
    #[must_use]
    pub fn new(program: &'a Program, directions: &[Direction]) -> Self {
        let leaves = program.leaves();
        let is_active = |leaf| {
            let is_state = (leaves.state(0)..leaves.parameter(0)).contains(&leaf);
            let is_memory = leaf >= leaves.memory(0) && program.held.iter().all(|(_, held)| leaf != *held);
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
        let memory = vec![0.0; program.tapes.memories.len() * width];
        let delayed = program.delayed_quantities();
        Self {
            program,
            directions: directions.to_vec(),
            rates: registers(&program.tapes.rates),
            outputs: registers(&program.tapes.outputs),
            updates: registers(&program.tapes.updates),
            memory_starts: program.tapes.starts.as_ref().map(registers),
            guards: registers(&program.tapes.guards),
            plain_guards: Registers::new(&program.tapes.guards, 0, |_| false),
            direction: vec![0.0; program.held.len()],
            earlier_s: vec![0.0; directions.len()],
            within: vec![0.0; program.tapes.states.len()],
            x: room.clone(),
            tried: room.clone(),
            stages: core::array::from_fn(|_| room.clone()),
            largest: vec![0.0; program.tapes.states.len()],
            memory_before: memory.clone(),
            memory_in_two: memory.clone(),
            memory_at_head: memory.clone(),
            memory_within: core::array::from_fn(|_| memory.clone()),
            memory,
            largest_memory: vec![0.0; program.tapes.memories.len()],
            middle: room.clone(),
            history: History::of(delayed.iter().map(|(leaf, _)| *leaf).collect(), directions.len()),
            delayed,
            delays_s: Vec::with_capacity(program.delays()),
            least_delay_s: 0.0,
            longest_delay_s: 0.0,
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
            for registers in self.all_registers() {
                registers.set(register, *value);
            }
            if let Some(registers) = &mut self.memory_starts {
                registers.set(register, *value);
            }
        }
        let tapes = &self.program.tapes;
        tapes.rates.prepare(&mut self.rates);
        tapes.outputs.prepare(&mut self.outputs);
        tapes.updates.prepare(&mut self.updates);
        tapes.guards.prepare(&mut self.guards);
        tapes.guards.prepare(&mut self.plain_guards);
        self.begin(starts, memories);
        self.begin_memories(inputs)?;
        self.begin_delays(inputs);
        self.settle(inputs)?;
        self.keep_directions();
        for row in 0..inputs.time_s.len() {
            if row > 0 {
                self.advance(inputs, row - 1)?;
            }
            self.read(inputs, row, &mut sink)?;
        }
        Ok(())
    }

    fn all_registers(&mut self) -> [&mut Registers; 5] {
        [&mut self.rates, &mut self.outputs, &mut self.updates, &mut self.guards, &mut self.plain_guards]
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
            self.largest_memory[place] = memories[*memory].abs();
        }
        self.put_memories();
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
        program.tapes.outputs.evaluate(&mut self.outputs, inputs, &self.history);
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
        let slope = registers.slope_mut(register);
        match program.is_given[place] {
            true => slope.fill(0.0),
            false => slope.copy_from_slice(&x[place * width + 1..(place + 1) * width]),
        }
    }
}
