//! Expressions compiled to a list of operations over registers, evaluated with or without derivatives.
//!
//! ```text
//!   registers:  time | inputs | states | parameters | memory | constants | one for each operation
//! ```
//! Equal operations share a register, so a definition that many equations use is computed once. Derivatives are carried forward
//! with the values, along as many directions as there are fitted numbers; operations that no fitted number reaches skip them.
//! Nothing is allocated while a tape is evaluated, and its length bounds its time.
//!
//! Operations that depend on parameters and constants alone stand first: they are computed once for a record. Derivatives are
//! kept in groups of [`LANES`], which a processor multiplies together.
//!
//! Source: Griewank, Walther, Evaluating Derivatives, SIAM 2008, chapter 3 (forward mode).

use crate::curve::Curve;
use crate::inputs::Inputs;
pub use crate::operation::Code;
use crate::operation::EvaluationContext;
use crate::past::{History, NONE};
use std::collections::HashMap;

/// Place of an intermediate result.
pub type Register = u32;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Operation {
    code: Code,
    operands: [Register; 3],
}

/// Counts of the registers that are set from outside: the leaves. They follow register 0, the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeafLayout {
    /// Inputs: registers from 1.
    pub inputs: usize,
    /// States, behind the inputs.
    pub states: usize,
    /// Parameters, behind the states; they are constant over a record.
    pub parameters: usize,
    /// Memories, behind the parameters; a model adds the directions of its frictions.
    pub memories: usize,
}

impl LeafLayout {
    /// Register of an input, by its index among the inputs; no function here checks its index.
    pub fn input(self, index: usize) -> Register {
        (1 + index) as Register
    }

    /// Register of a state, by its index among the states.
    pub fn state(self, index: usize) -> Register {
        (1 + self.inputs + index) as Register
    }

    /// Register of a parameter, by its index among the parameters.
    pub fn parameter(self, index: usize) -> Register {
        (1 + self.inputs + self.states + index) as Register
    }

    /// Register of a memory, by its index among the memories.
    pub fn memory(self, index: usize) -> Register {
        (1 + self.inputs + self.states + self.parameters + index) as Register
    }

    /// How many there are, the time included.
    #[must_use]
    pub(crate) fn count(self) -> usize {
        1 + self.inputs + self.states + self.parameters + self.memories
    }
}

/// Collects operations, each once.
pub struct Builder {
    /// Counts of the leaves, fixed before the first operation.
    pub leaves: LeafLayout,
    constants: Vec<f64>,
    operations: Vec<Operation>,
    known: HashMap<Operation, Register>,
}

/// Constants stand in this many registers behind the leaves; expressions are bounded, and so are their numbers.
const CONSTANTS: usize = 2 * crate::grammar::MOST_NODES;

impl Builder {
    /// A builder without constants and operations.
    pub fn new(leaves: LeafLayout) -> Self {
        Self { leaves, constants: Vec::new(), operations: Vec::new(), known: HashMap::new() }
    }

    /// Register of a constant; constants with the same bits share one.
    pub fn constant(&mut self, value: f64) -> Register {
        let known = self.constants.iter().position(|other| other.to_bits() == value.to_bits());
        let index = known.unwrap_or_else(|| {
            self.constants.push(value);
            self.constants.len() - 1
        });
        (self.leaves.count() + index) as Register
    }

    /// Register of an operation, at most three operands; equal operations share one.
    pub fn push(&mut self, code: Code, operands: &[Register]) -> Register {
        let mut all = [0; 3];
        all[..operands.len()].copy_from_slice(operands);
        let operation = Operation { code, operands: all };
        let next = (self.leaves.count() + CONSTANTS + self.operations.len()) as Register;
        *self.known.entry(operation).or_insert_with(|| {
            self.operations.push(operation);
            next
        })
    }

    /// The operations as a tape, with the registers of its results in order and the curves of [`Code::Table`].
    pub fn tape(self, results: &[Register], curves: Vec<Curve>) -> Tape {
        let (leaves, constants) = (self.leaves.count(), self.constants.len());
        let is_fixed = self.fixed();
        let fixed = is_fixed.iter().filter(|fixed| **fixed).count();
        let mut ahead = [0, fixed];
        let places: Vec<usize> = is_fixed
            .iter()
            .map(|fixed| {
                let place = &mut ahead[usize::from(!fixed)];
                *place += 1;
                *place - 1
            })
            .collect();
        let moved = |register: Register| {
            let operation = (register as usize).checked_sub(leaves + CONSTANTS);
            operation.map_or(register, |operation| (leaves + constants + places[operation]) as Register)
        };
        let mut operations = self.operations.clone();
        for (operation, place) in self.operations.into_iter().zip(&places) {
            operations[*place] = Operation { operands: operation.operands.map(moved), ..operation };
        }
        Tape {
            leaves: self.leaves,
            constants: self.constants,
            operations,
            fixed,
            results: results.iter().map(|result| moved(*result)).collect(),
            curves,
        }
    }

    /// The degree of a register as a polynomial of a leaf, 0 or 1; `None` where it is more or no polynomial.
    #[must_use]
    pub fn degree(&self, register: Register, leaf: Register) -> Option<u8> {
        let first = self.leaves.count() + CONSTANTS;
        let mut degrees: Vec<Option<u8>> = Vec::with_capacity(self.operations.len());
        let of = |degrees: &[Option<u8>], register: Register| match (register as usize).checked_sub(first) {
            Some(before) => degrees[before],
            None => Some(u8::from(register == leaf)),
        };
        for operation in &self.operations {
            let operands = operation.operands.map(|operand| of(&degrees, operand));
            let degree = match (operation.code, operands) {
                (Code::Add | Code::Subtract, [Some(a), Some(b), _]) => Some(a.max(b)),
                (Code::Negate, [a, ..]) => a,
                (Code::Multiply, [Some(a), Some(b), _]) if a + b < 2 => Some(a + b),
                (Code::Divide, [a, Some(0), _]) => a,
                (Code::Select, [Some(0), Some(b), Some(c)]) => Some(b.max(c)),
                (code, operands) => {
                    operands[..code.operands()].iter().all(|one| *one == Some(0)).then_some(0)
                }
            };
            degrees.push(degree);
        }
        of(&degrees, register)
    }

    /// Whether a register depends on parameters and constants alone.
    #[must_use]
    pub fn is_constant(&self, register: Register) -> bool {
        match (register as usize).checked_sub(self.leaves.count() + CONSTANTS) {
            Some(operation) => self.fixed()[operation],
            None => {
                let parameters = self.leaves.parameter(0)..self.leaves.memory(0);
                parameters.contains(&register) || register as usize >= self.leaves.count()
            }
        }
    }

    /// Of each operation whether it depends on parameters and constants alone.
    fn fixed(&self) -> Vec<bool> {
        let first = self.leaves.count() + CONSTANTS;
        let parameters = self.leaves.parameter(0)..self.leaves.memory(0);
        let mut fixed: Vec<bool> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let is_fixed = |operand: &Register| match (*operand as usize).checked_sub(first) {
                Some(before) => fixed[before],
                None => parameters.contains(operand) || *operand as usize >= self.leaves.count(),
            };
            let reads_time = matches!(operation.code, Code::DelayedInput(_) | Code::DelayedLeaf(_));
            let count = operation.code.operands();
            fixed.push(!reads_time && operation.operands[..count].iter().all(is_fixed));
        }
        fixed
    }
}

/// Operations in their order, and where their results stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Tape {
    /// Counts of the leaves, as the builder had them.
    pub leaves: LeafLayout,
    constants: Vec<f64>,
    operations: Vec<Operation>,
    /// The first so many depend on parameters and constants alone.
    fixed: usize,
    results: Vec<Register>,
    curves: Vec<Curve>,
}

/// Derivatives that are computed together.
const LANES: usize = 4;

/// Which operands of an operation have derivatives.
type ActiveOperands = [bool; 3];

/// Values and derivatives of the registers of a tape.
#[derive(Clone, Debug)]
pub struct Registers {
    values: Vec<f64>,
    /// Register by register, along each direction, and zeros up to whole groups.
    slopes: Vec<[f64; LANES]>,
    directions: usize,
    /// Groups of a register.
    width: usize,
    /// Of each operation; `None` where no operand has derivatives.
    active_operands: Vec<Option<ActiveOperands>>,
}

impl Registers {
    /// Those of `tape`; `is_active` is whether a leaf has derivatives.
    pub fn new(tape: &Tape, directions: usize, is_active: impl Fn(Register) -> bool) -> Self {
        let (leaves, count) = (tape.leaves.count(), tape.registers());
        let mut values = vec![0.0; count];
        tape.begin(&mut values);
        let mut active: Vec<bool> =
            (0..leaves as Register).map(|leaf| directions > 0 && is_active(leaf)).collect();
        active.resize(leaves + tape.constants.len(), false);
        let mut active_operands = Vec::with_capacity(tape.operations.len());
        for operation in &tape.operations {
            let count = operation.code.operands();
            let mut operands = operation.operands.map(|operand| active[operand as usize]);
            operands[count..].fill(false);
            let is_past = directions > 0 && matches!(operation.code, Code::DelayedLeaf(_));
            let is_active = is_past || !operation.code.is_flat() && operands.contains(&true);
            active.push(is_active);
            active_operands.push(is_active.then_some(operands));
        }
        let width = directions.div_ceil(LANES);
        Self { values, slopes: vec![[0.0; LANES]; count * width], directions, width, active_operands }
    }

    /// Sets the value of a leaf; its derivatives stay.
    #[inline]
    pub fn set(&mut self, register: Register, value: f64) {
        self.values[register as usize] = value;
    }

    /// Derivatives of a register, one for each direction.
    #[inline]
    pub fn slope_mut(&mut self, register: Register) -> &mut [f64] {
        let start = register as usize * self.width;
        &mut self.slopes[start..start + self.width].as_flattened_mut()[..self.directions]
    }

    /// Value of a register, in SI.
    #[inline]
    pub fn value(&self, register: Register) -> f64 {
        self.values[register as usize]
    }

    /// Derivatives of a register, one for each direction.
    #[inline]
    pub fn slope(&self, register: Register) -> &[f64] {
        let start = register as usize * self.width;
        &self.slopes[start..start + self.width].as_flattened()[..self.directions]
    }
}

impl Tape {
    /// Number of operations.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.operations.len()
    }

    /// Register of a result, by its index among the results given to [`Builder::tape`].
    #[inline]
    pub fn result(&self, index: usize) -> Register {
        self.results[index]
    }

    /// Computes what depends on parameters alone, after these were set and before [`Tape::evaluate`].
    pub fn prepare(&self, registers: &mut Registers) {
        self.compute_some(registers, 0..self.fixed, (&Inputs::none(), &NONE));
    }

    /// Computes all other registers from the leaves that were set.
    pub fn evaluate(&self, registers: &mut Registers, inputs: &Inputs<'_>, history: &History) {
        self.compute_some(registers, self.fixed..self.operations.len(), (inputs, history));
    }

    /// The leaves of which it reads earlier values, each with the register of by how much they are earlier, which
    /// [`Tape::prepare`] computes.
    pub fn delayed_leaves(&self) -> impl Iterator<Item = (Register, Register)> + '_ {
        self.operations.iter().filter_map(|operation| match operation.code {
            Code::DelayedLeaf(leaf) => Some((leaf, operation.operands[0])),
            _ => None,
        })
    }

    #[inline]
    fn compute_some(
        &self,
        registers: &mut Registers,
        which: core::ops::Range<usize>,
        (inputs, history): (&Inputs<'_>, &History),
    ) {
        let first = self.leaves.count() + self.constants.len() + which.start;
        let context =
            EvaluationContext { time_s: registers.values[0], inputs, history, curves: &self.curves };
        let Registers { values, slopes, width, active_operands, .. } = registers;
        let width = *width;
        let both = self.operations[which.clone()].iter().zip(&active_operands[which]);
        for (result, (operation, active_operands)) in (first..).zip(both) {
            let operands = operation.operands.map(|operand| operand as usize);
            let [a, b, c] = operands.map(|operand| values[operand]);
            // Most are one of these, and choose once between all.
            let (value, partial) = match operation.code {
                Code::Add => (a + b, [1.0, 1.0, 0.0]),
                Code::Subtract => (a - b, [1.0, -1.0, 0.0]),
                Code::Multiply => (a * b, [b, a, 0.0]),
                code => {
                    let value = code.value([a, b, c], &context);
                    let partial =
                        active_operands.map(|wanted| code.partials([a, b, c], value, wanted, &context));
                    (value, partial.unwrap_or_default())
                }
            };
            values[result] = value;
            let Some(active_operands) = active_operands else { continue };
            carry((slopes, width), result, operands, *active_operands, partial);
            if let Code::DelayedLeaf(leaf) = operation.code {
                let slopes =
                    &mut slopes[result * width..][..width].as_flattened_mut()[..registers.directions];
                history.add_slopes(leaf, context.time_s - a, slopes);
            }
        }
    }

    #[must_use]
    pub(crate) fn registers(&self) -> usize {
        self.leaves.count() + self.constants.len() + self.operations.len()
    }

    /// Puts the constants into their registers.
    ///
    /// # Panics
    /// Where `registers` are fewer than [`Tape::registers`].
    pub(crate) fn begin(&self, registers: &mut [f64]) {
        let leaves = self.leaves.count();
        registers[leaves..leaves + self.constants.len()].copy_from_slice(&self.constants);
    }

    /// The first result, from leaves and constants, without derivatives; it reads no input over time.
    ///
    /// # Panics
    /// Where `registers` are fewer than [`Tape::registers`].
    #[must_use]
    pub(crate) fn compute(&self, registers: &mut [f64]) -> f64 {
        let first = self.leaves.count() + self.constants.len();
        let context = EvaluationContext {
            time_s: registers[0],
            inputs: &Inputs::none(),
            history: &NONE,
            curves: &self.curves,
        };
        for (place, operation) in self.operations.iter().enumerate() {
            let operands = operation.operands.map(|operand| registers[operand as usize]);
            registers[first + place] = operation.code.value(operands, &context);
        }
        registers[self.results[0] as usize]
    }
}

/// Chain rule. An operand that was not taken has the factor 0, and its own derivative may be infinite: it is left out.
#[inline]
fn carry(
    (slopes, width): (&mut [[f64; LANES]], usize),
    result: usize,
    operands: [usize; 3],
    active_operands: ActiveOperands,
    partial: [f64; 3],
) {
    let (below, at) = slopes.split_at_mut(result * width);
    let target = &mut at[..width];
    let of = |operand: usize| &below[operand * width..][..width];
    // A third operand is a choice's, which derives by one of its two values.
    let [one, other, third] = [0, 1, 2].map(|place| active_operands[place] && partial[place] != 0.0);
    let [by_one, by_other, by_third] = partial;
    match (one, other) {
        (true, true) => {
            for ((sum, slope), other) in target.iter_mut().zip(of(operands[0])).zip(of(operands[1])) {
                *sum = core::array::from_fn(|lane| by_one * slope[lane] + by_other * other[lane]);
            }
        }
        (true, false) => scale(target, of(operands[0]), by_one),
        (false, true) => scale(target, of(operands[1]), by_other),
        (false, false) if third => scale(target, of(operands[2]), by_third),
        (false, false) => target.fill([0.0; LANES]),
    }
}

#[inline]
fn scale(target: &mut [[f64; LANES]], source: &[[f64; LANES]], factor: f64) {
    for (sum, slope) in target.iter_mut().zip(source) {
        *sum = slope.map(|slope| factor * slope);
    }
}

#[cfg(test)]
mod tests;
