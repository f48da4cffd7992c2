//! Memories: renewed at each sample and after each step, and what their change within a step does to the states.
//!
//! ```text
//!   m is held over a step in the rates; within it, it goes m0 -> m1 -> m2 -> m3 -> m4 in four equal parts
//!   x += h/6 (4 d2 + d4)      d2 = f(x2, m2) - f(x2, m0), d4 = f(x4, m4) - f(x4, m0)      Simpson's rule
//!   x += h/3 (f(x + that, m4) - f(x, m4))                     what that moves in turn, which grows with the square of time
//!   errors: of x    h |2 d2 - d4| / 3                         the rule's distance from the trapezoidal one; and the second term
//!           of m4   its distance from that in two parts       a play that turns back between two looks
//! ```
//! A memory that jumps (a relay) has an error in proportion to the step, so that step control finds the instant of the jump.

use super::steps::cubic;
use super::{STAGES, Simulator, put};
use crate::failure::Failure;
use crate::inputs::Inputs;
use expression::past::NONE;

/// Stages of a step that are no longer needed when its memories are looked at: rates in its middle with the memories of its head
/// and with those there, and rates at its end with those there.
const MIDDLE_BEFORE: usize = 1;
const MIDDLE: usize = 2;
const END: usize = 3;
/// The same as END with the states that this moves.
const MOVED: usize = 4;

impl Simulator<'_> {
    /// Starts of memories that are expressions of parameters, with their derivatives.
    pub(super) fn begin_memories(&mut self, inputs: &Inputs<'_>) -> Result<(), Failure> {
        let program = self.program;
        let width = self.width();
        let (Some(tape), Some(registers)) = (&program.tapes.starts, &mut self.memory_starts) else {
            return Ok(());
        };
        tape.prepare(registers);
        tape.evaluate(registers, inputs, &NONE);
        for (place, memory) in self.memory.chunks_mut(width).enumerate() {
            let start = tape.result(place);
            memory[0] = registers.value(start);
            memory[1..].copy_from_slice(registers.slope(start));
            if !memory[0].is_finite() {
                let time_s = inputs.time_s.first().copied().unwrap_or(0.0);
                return Err(Failure::NotFinite { what: "the start of a memory".into(), time_s });
            }
            self.largest_memory[place] = memory[0].abs();
        }
        self.put_memories();
        Ok(())
    }

    pub(super) fn put_memories(&mut self) {
        let (leaves, width) = (self.program.leaves(), self.width());
        for (place, memory) in self.program.tapes.memories.iter().enumerate() {
            let value = &self.memory[place * width..(place + 1) * width];
            for registers in [&mut self.rates, &mut self.outputs, &mut self.updates, &mut self.guards] {
                registers.set(leaves.memory(*memory), value[0]);
                registers.slope_mut(leaves.memory(*memory)).copy_from_slice(&value[1..]);
            }
            self.plain_guards.set(leaves.memory(*memory), value[0]);
        }
    }

    /// Renews the memories at an instant with these states, which are those of `x`, `tried` or `middle`.
    fn renew_at(&mut self, inputs: &Inputs<'_>, instant: (usize, f64), place: StepPoint) {
        let (program, width) = (self.program, self.width());
        let x = match place {
            StepPoint::Start => &self.x,
            StepPoint::Middle => &self.middle,
            StepPoint::End => &self.tried,
        };
        put(program, &mut self.updates, inputs, instant, x);
        program.tapes.updates.evaluate(&mut self.updates, inputs, &self.history);
        for place in 0..program.tapes.memories.len() {
            let register = program.tapes.updates.result(place);
            let kept = &mut self.memory[place * width..(place + 1) * width];
            kept[0] = self.updates.value(register);
            kept[1..].copy_from_slice(self.updates.slope(register));
        }
        self.put_memories();
    }

    pub(super) fn renew(&mut self, inputs: &Inputs<'_>, instant: (usize, f64)) {
        if !self.memory.is_empty() {
            self.renew_at(inputs, instant, StepPoint::Start);
            let width = self.width();
            for (largest, kept) in self.largest_memory.iter_mut().zip(self.memory.chunks_exact(width)) {
                *largest = largest.max(kept[0].abs());
            }
        }
    }

    /// Adds to the step that was tried what its memories change within it; they are those of its end then. Returns the error
    /// over the size of its state.
    pub(super) fn remember(&mut self, inputs: &Inputs<'_>, (row, time_s): (usize, f64), step_s: f64) -> f64 {
        // Without states there is nothing to add to, and inputs go straight from sample to sample.
        if self.memory.is_empty() || self.x.is_empty() {
            return 0.0;
        }
        self.memory_before.copy_from_slice(&self.memory);
        let end = (row, time_s + step_s);
        self.between(step_s, 0.5);
        let middle = (row, time_s + 0.5 * step_s);
        self.stage_at(inputs, middle, MIDDLE_BEFORE, StepPoint::Middle);
        self.renew_at(inputs, middle, StepPoint::Middle);
        self.renew_at(inputs, end, StepPoint::End);
        self.memory_in_two.copy_from_slice(&self.memory);
        self.forget();
        for (part, share) in [0.25, 0.5, 0.75].into_iter().enumerate() {
            self.between(step_s, share);
            let instant = (row, time_s + share * step_s);
            self.renew_at(inputs, instant, StepPoint::Middle);
            self.memory_within[part].copy_from_slice(&self.memory);
            if share == 0.5 {
                self.stage_at(inputs, instant, MIDDLE, StepPoint::Middle);
            }
        }
        self.renew_at(inputs, end, StepPoint::End);
        self.stage_at(inputs, end, END, StepPoint::End);
        let width = self.width();
        let mut worst = self.error_of_memories();
        for (place, largest) in self.largest_memory.iter().enumerate() {
            let [before, in_two, now] =
                [&self.memory_before, &self.memory_in_two, &self.memory].map(|memory| memory[place * width]);
            let size = largest.max(before.abs()).max(now.abs()).max(f64::MIN_POSITIVE);
            worst = worst.max((now - in_two).abs() / size);
        }
        for index in 0..self.tried.len() {
            let in_middle = self.stages[MIDDLE][index] - self.stages[MIDDLE_BEFORE][index];
            let at_end = self.stages[END][index] - self.stages[STAGES - 1][index];
            if index % width == 0 {
                let error = step_s * (2.0 * in_middle - at_end) / 3.0;
                worst = worst.max(error.abs() / self.error_scale(index / width, step_s));
            }
            self.tried[index] += step_s / 6.0 * (4.0 * in_middle + at_end);
        }
        self.stage_at(inputs, end, MOVED, StepPoint::End);
        for index in 0..self.tried.len() {
            let moved = step_s / 3.0 * (self.stages[MOVED][index] - self.stages[END][index]);
            if index % width == 0 {
                worst = worst.max(moved.abs() / self.error_scale(index / width, step_s));
            }
            self.tried[index] += moved;
        }
        worst
    }

    /// States within the step that was tried, with their sensitivities, by the cubic of its ends and their rates.
    fn between(&mut self, step_s: f64, share: f64) {
        for (index, middle) in self.middle.iter_mut().enumerate() {
            let (from, to) = (self.x[index], self.tried[index]);
            let [head, end] = [0, STAGES - 1].map(|stage| step_s * self.stages[stage][index]);
            *middle = cubic([from, to], [head, end], share);
        }
    }

    /// Memories as they were at the head of a step that is refused.
    pub(super) fn forget(&mut self) {
        if !self.memory.is_empty() && !self.x.is_empty() {
            self.memory.copy_from_slice(&self.memory_before);
            self.put_memories();
        }
    }
}

/// Where in a step rates and memories are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StepPoint {
    /// With the states `x`.
    Start,
    /// With the states `middle`.
    Middle,
    /// With the states `tried`.
    End,
}
