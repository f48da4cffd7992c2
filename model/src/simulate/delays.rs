//! Delays of what is integrated: which earlier values are kept, and steps that read what they are computing.
//!
//! ```text
//!   x' = f(t, x(t), x(t - d))        x(s) = x(0) for s < 0        d of numbers alone, fitted or not
//!   dx(t - d)/dp = S(t - d) - x'(t - d) dd/dp
//! ```
//! Accepted steps stay in a ring as long as the longest delay reaches back ([`expression::past`]): states by the continuous
//! extension of their method, memories by their values at quarters of a step, straight where they stand still over it, directions
//! of friction as they are. Steps end where the start of the record, and a
//! sample at which an input jumps, come back by a delay, since a derivative jumps there.
//!
//! A step that is longer than a delay reads itself. It is computed from the tangent at its head first, and then from its own
//! continuous extension until that stays as it is.
//!
//! Sources: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd edition, II.6 (continuous extensions; that of
//! Dormand-Prince as in their program dopri5), II.17 (delays, discontinuities); Shampine, Thompson 2001, Applied Numerical
//! Mathematics 37 (steps longer than a delay).

use super::steps::SHORTEST;
use super::{Program, STAGES, Simulator};
use crate::file::Solver;
use crate::inputs::{Hold, Inputs};
use crate::tape::Register;
use expression::past::TERMS;

/// Weights of the stages in the last coefficient of the continuous extension of Dormand-Prince.
const D: [f64; STAGES] = [
    -12_715_105_075.0 / 11_282_082_432.0,
    0.0,
    87_487_479_700.0 / 32_700_410_799.0,
    -10_690_763_975.0 / 1_880_347_072.0,
    701_980_252_875.0 / 199_316_789_632.0,
    -1_453_857_185.0 / 822_651_844.0,
    69_997_945.0 / 29_380_423.0,
];
/// Most passes of a step that reads itself, and the change over the sizes of states at which they end: of the fixed method, and
/// of the adaptive one as a share of its tolerance.
const MOST_PASSES: usize = 20;
const CONVERGED: f64 = 1e-10;
const CONVERGED_SHARE: f64 = 0.01;
/// How often the start of the record comes back by the same delay: each time the jump is in one derivative more.
const RETURNS: u32 = 4;
/// Steps for which the ring has room: of the adaptive method for a sample, and at most before it has to grow.
const STEPS_OF_A_SAMPLE: f64 = 4.0;
const MOST_ROOM: f64 = 4096.0;

/// A quantity of which earlier values are kept, by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DelayedQuantity {
    State(usize),
    Memory(usize),
    Direction(usize),
}

impl Program {
    /// How many delays rates, memories and frictions read.
    pub(super) fn delays(&self) -> usize {
        let all = [&self.tapes.rates, &self.tapes.updates, &self.tapes.guards];
        all.iter().map(|tape| tape.delayed_leaves().count()).sum()
    }

    /// The leaves of which tapes read earlier values.
    pub(super) fn delayed_quantities(&self) -> Vec<(Register, DelayedQuantity)> {
        let (tapes, leaves) = (&self.tapes, self.leaves());
        let all = [&tapes.rates, &tapes.outputs, &tapes.updates, &tapes.guards];
        let mut read: Vec<Register> =
            all.iter().flat_map(|tape| tape.delayed_leaves().map(|(leaf, _)| leaf)).collect();
        read.sort_unstable();
        read.dedup();
        let states = tapes.states.iter().enumerate();
        let states = states.map(|(place, state)| (leaves.state(*state), DelayedQuantity::State(place)));
        let memories = tapes.memories.iter().enumerate();
        let memories =
            memories.map(|(place, memory)| (leaves.memory(*memory), DelayedQuantity::Memory(place)));
        let directions = self.held.iter().enumerate();
        let directions =
            directions.map(|(friction, (_, leaf))| (*leaf, DelayedQuantity::Direction(friction)));
        let known = states.chain(memories).chain(directions);
        known.filter(|(leaf, _)| read.binary_search(leaf).is_ok()).collect()
    }
}

impl Simulator<'_> {
    /// The delays of a record, whose parameters are set, and room for what they reach back to.
    pub(super) fn begin_delays(&mut self, inputs: &Inputs<'_>) {
        if self.history.is_empty() {
            return;
        }
        let tapes = &self.program.tapes;
        self.delays_s.clear();
        let both =
            [(&tapes.rates, &self.rates), (&tapes.updates, &self.updates), (&tapes.guards, &self.guards)];
        for (tape, registers) in both {
            self.delays_s.extend(tape.delayed_leaves().map(|(_, by)| registers.value(by)));
        }
        self.least_delay_s = self.delays_s.iter().copied().fold(f64::INFINITY, f64::min);
        let outputs = tapes.outputs.delayed_leaves().map(|(_, by)| self.outputs.value(by));
        self.longest_delay_s = self.delays_s.iter().copied().chain(outputs).fold(0.0, f64::max);
        self.delays_s.sort_unstable_by(f64::total_cmp);
        self.delays_s.dedup();
        let time_s = inputs.time_s;
        let (mut first, mut samples, mut widest_s) = (0, 1, 0.0_f64);
        for (last, at_s) in time_s.iter().enumerate() {
            while at_s - time_s[first] > self.longest_delay_s {
                first += 1;
            }
            samples = samples.max(last - first + 1);
            widest_s = widest_s.max(at_s - time_s[last.saturating_sub(1)]);
        }
        let of_a_sample = match self.program.solver {
            Solver::Fixed { step_s } => (widest_s / step_s).ceil(),
            Solver::Adaptive { .. } => STEPS_OF_A_SAMPLE,
        };
        let room = (of_a_sample + self.delays_s.len() as f64) * (samples as f64 + 2.0);
        self.history.begin(room.min(MOST_ROOM) as usize);
        for (place, (_, quantity)) in self.delayed.iter().enumerate() {
            let width = 1 + self.directions.len();
            let start = self.history.start_mut(place);
            start.fill(0.0);
            match *quantity {
                DelayedQuantity::State(state) if self.program.is_given[state] => {
                    start[0] = self.x[state * width]
                }
                DelayedQuantity::State(state) => {
                    start.copy_from_slice(&self.x[state * width..(state + 1) * width])
                }
                DelayedQuantity::Memory(at) => {
                    start.copy_from_slice(&self.memory[at * width..(at + 1) * width])
                }
                DelayedQuantity::Direction(friction) => start[0] = self.direction[friction],
            }
        }
    }

    /// Directions of friction before the first sample, which are those at it.
    pub(super) fn keep_directions(&mut self) {
        for (place, (_, quantity)) in self.delayed.iter().enumerate() {
            if let DelayedQuantity::Direction(friction) = quantity {
                self.history.start_mut(place)[0] = self.direction[*friction];
            }
        }
    }

    /// The next instant before `to_s` at which a derivative jumps because of what was a delay earlier.
    pub(super) fn next_return(&self, inputs: &Inputs<'_>, row: usize, [from_s, to_s]: [f64; 2]) -> f64 {
        let mut next_s = to_s;
        let sliver_s = SHORTEST * (inputs.time_s[row + 1] - inputs.time_s[row]);
        let mut consider = |at_s: f64| {
            if at_s > from_s + sliver_s && at_s < to_s - sliver_s {
                next_s = next_s.min(at_s);
            }
        };
        for delay_s in &self.delays_s {
            (1..=RETURNS).for_each(|times| consider(inputs.time_s[0] + f64::from(times) * delay_s));
            if self.program.holds.contains(&Hold::Zero) {
                let next = inputs.time_s.partition_point(|time_s| time_s + delay_s <= from_s + sliver_s);
                inputs.time_s.get(next).into_iter().for_each(|time_s| consider(time_s + delay_s));
            }
        }
        next_s
    }

    fn scheme(&mut self, inputs: &Inputs<'_>, instant: (usize, f64), step_s: f64) {
        match self.program.solver {
            Solver::Fixed { .. } => self.classical(inputs, instant, step_s),
            Solver::Adaptive { .. } => self.dormand_prince(inputs, instant, step_s),
        }
    }

    /// Tries a step from the rates at its head. False if the fixed-point iteration over delays shorter than the step does not
    /// converge.
    pub(super) fn attempt(&mut self, inputs: &Inputs<'_>, (row, time_s): (usize, f64), step_s: f64) -> bool {
        if self.history.is_empty() {
            self.scheme(inputs, (row, time_s), step_s);
            return true;
        }
        self.memory_at_head.copy_from_slice(&self.memory);
        if step_s <= self.least_delay_s {
            self.history.close();
            self.scheme(inputs, (row, time_s), step_s);
            self.write_step(time_s, step_s, false);
            return true;
        }
        let enough = match self.program.solver {
            Solver::Fixed { .. } => CONVERGED,
            Solver::Adaptive { relative_tolerance } => CONVERGED_SHARE * relative_tolerance,
        };
        self.write_step(time_s, step_s, true);
        if self.least_delay_s <= 0.0 {
            // The derivative by a delay of 0 is the rate at the head itself.
            self.stage(inputs, row, time_s, 0, false);
        }
        for pass in 0..MOST_PASSES {
            self.middle.copy_from_slice(&self.tried);
            self.scheme(inputs, (row, time_s), step_s);
            self.write_step(time_s, step_s, false);
            let width = self.width();
            let moved = (0..self.largest.len()).map(|place| {
                let change = (self.tried[place * width] - self.middle[place * width]).abs();
                change / self.error_scale(place, step_s)
            });
            if pass > 0 && moved.fold(0.0, f64::max) <= enough {
                return true;
            }
        }
        false
    }

    /// Writes the step that was tried behind those that were accepted; as the tangent at its head, where nothing was tried yet.
    fn write_step(&mut self, time_s: f64, step_s: f64, is_tangent: bool) {
        self.history.open([time_s, time_s + step_s], time_s - self.longest_delay_s);
        let width = self.width();
        let is_adaptive = matches!(self.program.solver, Solver::Adaptive { .. });
        for (place, (_, quantity)) in self.delayed.iter().enumerate() {
            let rows = self.history.open_rows_mut(place);
            match *quantity {
                DelayedQuantity::State(state) => {
                    let columns = if self.program.is_given[state] { 1 } else { width };
                    rows.fill(0.0);
                    for column in 0..columns {
                        let at = state * width + column;
                        let [from, head] = [self.x[at], step_s * self.stages[0][at]];
                        let mut terms = [from, head, 0.0, 0.0, 0.0];
                        if !is_tangent {
                            terms = extension(
                                [from, self.tried[at]],
                                [head, step_s * self.stages[STAGES - 1][at]],
                            );
                            if is_adaptive {
                                let stages = D.iter().zip(&self.stages);
                                terms[4] =
                                    step_s * stages.map(|(weight, stage)| weight * stage[at]).sum::<f64>();
                            }
                        }
                        (0..TERMS).for_each(|term| rows[term * width + column] = terms[term]);
                    }
                }
                DelayedQuantity::Memory(at) => {
                    rows.fill(0.0);
                    rows[..width].copy_from_slice(&self.memory_at_head[at * width..(at + 1) * width]);
                }
                DelayedQuantity::Direction(friction) => {
                    rows.fill(0.0);
                    rows[0] = self.direction[friction];
                }
            }
        }
    }

    /// Keeps the step that was tried, which is accepted, before its end becomes the head of the next one.
    pub(super) fn keep(&mut self, step_s: f64) {
        if self.history.is_empty() {
            return;
        }
        if !self.memory.is_empty() {
            // What memories changed within the step was added to its end; stages between are overwritten.
            let width = self.width();
            for (place, (_, quantity)) in self.delayed.iter().enumerate() {
                let DelayedQuantity::State(state) = *quantity else { continue };
                let columns = if self.program.is_given[state] { 1 } else { width };
                let rows = self.history.open_rows_mut(place);
                for column in 0..columns {
                    let at = state * width + column;
                    let [head, end] = [0, STAGES - 1].map(|stage| step_s * self.stages[stage][at]);
                    let terms = extension([self.x[at], self.tried[at]], [head, end]);
                    (0..TERMS - 1).for_each(|term| rows[term * width + column] = terms[term]);
                }
            }
        }
        if self.is_remembered() {
            let width = self.width();
            for (place, (_, quantity)) in self.delayed.iter().enumerate() {
                let DelayedQuantity::Memory(at) = *quantity else { continue };
                let rows = self.history.open_rows_mut(place);
                for column in 0..width {
                    let at = at * width + column;
                    let within = &self.memory_within;
                    let [second, third, fourth] = [0, 1, 2].map(|part| within[part][at]);
                    let terms = quartic([self.memory_at_head[at], second, third, fourth, self.memory[at]]);
                    (0..TERMS).for_each(|term| rows[term * width + column] = terms[term]);
                }
            }
        }
        self.history.accept();
    }

    /// Memories are followed within a step.
    fn is_remembered(&self) -> bool {
        !self.x.is_empty() && matches!(self.program.solver, Solver::Adaptive { .. })
    }

    /// How far the earlier values of memories may be off, over their sizes: where one turns within the step.
    pub(super) fn error_of_memories(&self) -> f64 {
        let errors = self.delayed.iter().filter_map(|(_, quantity)| match *quantity {
            DelayedQuantity::Memory(place) => {
                let size = self.largest_memory[place].max(f64::MIN_POSITIVE);
                let at = place * self.width();
                let [second, third, fourth] = [0, 1, 2].map(|part| self.memory_within[part][at]);
                let terms = quartic([self.memory_at_head[at], second, third, fourth, self.memory[at]]);
                Some(terms[TERMS - 1].abs() / 16.0 / size)
            }
            _ => None,
        });
        errors.fold(0.0, f64::max)
    }

    /// Memories at the end of the last step, where they stood still over it.
    pub(super) fn keep_memories(&mut self) {
        if self.is_remembered() {
            return;
        }
        let width = self.width();
        for (place, (_, quantity)) in self.delayed.iter().enumerate() {
            let DelayedQuantity::Memory(at) = *quantity else { continue };
            let Some(rows) = self.history.last_rows_mut(place) else { continue };
            let (from, rows) = rows.split_at_mut(width);
            let now = &self.memory[at * width..(at + 1) * width];
            rows.iter_mut().zip(now).zip(from).for_each(|((change, now), from)| *change = now - *from);
        }
    }
}

/// A step by its values at quarters of it: the polynomial of degree 4 that has them.
fn quartic([first, second, third, fourth, last]: [f64; TERMS]) -> [f64; TERMS] {
    let chord = last - first;
    let over = |value: f64, share: f64| (value - first - share * chord) / (share * (1.0 - share));
    let [early, middle, late] = [over(second, 0.25), over(third, 0.5), over(fourth, 0.75)];
    let (rise, bent) = (2.0 * (late - early), 8.0 * (2.0 * middle - early - late));
    [first, chord, middle - 0.5 * rise - 0.25 * bent, rise, bent]
}

/// A step by its ends and their rates times its length: the cubic that has them.
fn extension([from, to]: [f64; 2], [head, end]: [f64; 2]) -> [f64; TERMS] {
    let chord = to - from;
    let bent = head - chord;
    [from, chord, bent, chord - end - bent, 0.0]
}
