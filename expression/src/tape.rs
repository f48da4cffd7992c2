//! Expressions compiled to a list of operations over registers, evaluated with or without derivatives.
//!
//! ```text
//!   registers:  time | inputs | states | parameters | memory | constants | one for each operation
//! ```
//! Equal operations share a register, so a definition that many equations use is computed once. Derivatives are carried forward
//! with the values, along as many directions as there are fitted numbers; operations that no fitted number reaches skip them.
//! Nothing is allocated while a tape is evaluated, and its length bounds its time.
//!
//! Elementary functions are those of `libm`, so that bits are equal on every machine; `+ - * /` and the square root are exact by
//! IEEE 754. At a kink (abs, min, max, if, table) the derivative is that of the branch that is taken; that of sign and of a
//! comparison is 0, and that of sqrt at 0 is set to 0.
//!
//! Source: Griewank, Walther, Evaluating Derivatives, SIAM 2008, chapter 3 (forward mode).

use crate::curve::Curve;
use crate::inputs::Inputs;
use std::collections::HashMap;

/// A register.
pub type Register = u32;

/// What an operation does with its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Code {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Negate,
    Abs,
    Sign,
    Min,
    Max,
    Sqrt,
    Exp,
    Log,
    Tanh,
    Sin,
    Cos,
    Atan,
    Floor,
    Less,
    LessOrEqual,
    Equal,
    NotEqual,
    And,
    Or,
    /// First operand not 0: the second, else the third.
    Select,
    /// The table of this number at the first operand.
    Table(u16),
    /// The input of this number, the first operand earlier.
    Delayed(u16),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Operation {
    code: Code,
    operands: [Register; 3],
}

/// Numbers of registers that hold what comes from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leaves {
    pub inputs: usize,
    pub states: usize,
    pub parameters: usize,
    pub memories: usize,
}

impl Leaves {
    pub fn input(self, index: usize) -> Register {
        (1 + index) as Register
    }

    pub fn state(self, index: usize) -> Register {
        (1 + self.inputs + index) as Register
    }

    pub fn parameter(self, index: usize) -> Register {
        (1 + self.inputs + self.states + index) as Register
    }

    pub fn memory(self, index: usize) -> Register {
        (1 + self.inputs + self.states + self.parameters + index) as Register
    }

    /// How many there are, the time included.
    #[must_use]
    pub fn count(self) -> usize {
        1 + self.inputs + self.states + self.parameters + self.memories
    }
}

/// Collects operations, each once.
pub struct Builder {
    leaves: Leaves,
    constants: Vec<f64>,
    operations: Vec<Operation>,
    known: HashMap<Operation, Register>,
}

/// Constants stand in this many registers behind the leaves; expressions are bounded, and so are their numbers.
const CONSTANTS: usize = 2 * crate::grammar::MOST_NODES;

impl Builder {
    pub fn new(leaves: Leaves) -> Self {
        Self { leaves, constants: Vec::new(), operations: Vec::new(), known: HashMap::new() }
    }

    pub fn leaves(&self) -> Leaves {
        self.leaves
    }

    pub fn constant(&mut self, value: f64) -> Register {
        let known = self.constants.iter().position(|other| other.to_bits() == value.to_bits());
        let index = known.unwrap_or_else(|| {
            self.constants.push(value);
            self.constants.len() - 1
        });
        (self.leaves.count() + index) as Register
    }

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

    /// The tape that computes these registers.
    pub fn tape(self, results: &[Register], curves: Vec<Curve>) -> Tape {
        let (leaves, constants) = (self.leaves.count(), self.constants.len());
        let moved = |register: Register| {
            let register = register as usize;
            (if register >= leaves + CONSTANTS { register - CONSTANTS + constants } else { register })
                as Register
        };
        let mut operations = self.operations;
        for operation in &mut operations {
            operation.operands = operation.operands.map(moved);
        }
        Tape {
            leaves: self.leaves,
            constants: self.constants,
            operations,
            results: results.iter().map(|result| moved(*result)).collect(),
            curves,
        }
    }
}

/// Operations in their order, and where their results stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Tape {
    pub leaves: Leaves,
    constants: Vec<f64>,
    operations: Vec<Operation>,
    results: Vec<Register>,
    curves: Vec<Curve>,
}

/// Values and derivatives of the registers of a tape.
#[derive(Clone, Debug)]
pub struct Registers {
    values: Vec<f64>,
    /// Register by register, along each direction.
    slopes: Vec<f64>,
    directions: usize,
    active: Vec<bool>,
}

impl Registers {
    /// Those of `tape`; `is_active` tells of a leaf whether it has derivatives.
    pub fn new(tape: &Tape, directions: usize, is_active: impl Fn(Register) -> bool) -> Self {
        let leaves = tape.leaves.count();
        let count = leaves + tape.constants.len() + tape.operations.len();
        let mut values = vec![0.0; count];
        values[leaves..leaves + tape.constants.len()].copy_from_slice(&tape.constants);
        let mut active: Vec<bool> =
            (0..leaves as Register).map(|leaf| directions > 0 && is_active(leaf)).collect();
        active.resize(count, false);
        for (place, operation) in tape.operations.iter().enumerate() {
            let is_flat = matches!(
                operation.code,
                Code::Sign
                    | Code::Floor
                    | Code::Less
                    | Code::LessOrEqual
                    | Code::Equal
                    | Code::NotEqual
                    | Code::And
                    | Code::Or
            );
            let reached = operation.operands.iter().any(|operand| active[*operand as usize]);
            active[leaves + tape.constants.len() + place] = reached && !is_flat;
        }
        Self { values, slopes: vec![0.0; count * directions], directions, active }
    }

    #[inline]
    pub fn set(&mut self, register: Register, value: f64) {
        self.values[register as usize] = value;
    }

    #[inline]
    pub fn slope_mut(&mut self, register: Register) -> &mut [f64] {
        let start = register as usize * self.directions;
        &mut self.slopes[start..start + self.directions]
    }

    #[inline]
    pub fn value(&self, register: Register) -> f64 {
        self.values[register as usize]
    }

    #[inline]
    pub fn slope(&self, register: Register) -> &[f64] {
        let start = register as usize * self.directions;
        &self.slopes[start..start + self.directions]
    }
}

impl Tape {
    /// Operations in an evaluation.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.operations.len()
    }

    #[inline]
    pub fn result(&self, index: usize) -> Register {
        self.results[index]
    }

    /// Computes all registers from the leaves that were set.
    pub fn evaluate(&self, registers: &mut Registers, inputs: &Inputs<'_>) {
        let first = self.leaves.count() + self.constants.len();
        for (place, operation) in self.operations.iter().enumerate() {
            let result = first + place;
            let [a, b, c] = operation.operands.map(|operand| registers.values[operand as usize]);
            let (value, partial) = self.apply(operation.code, [a, b, c], registers.values[0], inputs);
            registers.values[result] = value;
            if registers.active[result] {
                carry(registers, result, operation, partial);
            }
        }
    }

    /// How many registers it has.
    #[must_use]
    pub fn registers(&self) -> usize {
        self.leaves.count() + self.constants.len() + self.operations.len()
    }

    /// Puts the constants into their registers.
    ///
    /// # Panics
    /// Where `registers` are fewer than [`Tape::registers`].
    pub fn begin(&self, registers: &mut [f64]) {
        let leaves = self.leaves.count();
        registers[leaves..leaves + self.constants.len()].copy_from_slice(&self.constants);
    }

    /// The first result, from leaves and constants, without derivatives; it reads no input over time.
    ///
    /// # Panics
    /// Where `registers` are fewer than [`Tape::registers`].
    #[must_use]
    pub fn compute(&self, registers: &mut [f64]) -> f64 {
        let first = self.leaves.count() + self.constants.len();
        for (place, operation) in self.operations.iter().enumerate() {
            let operands = operation.operands.map(|operand| registers[operand as usize]);
            registers[first + place] = self.apply(operation.code, operands, registers[0], &Inputs::none()).0;
        }
        registers[self.results[0] as usize]
    }

    /// Value, and derivatives by the operands.
    fn apply(&self, code: Code, [a, b, c]: [f64; 3], time_s: f64, inputs: &Inputs<'_>) -> (f64, [f64; 3]) {
        let truth = |is_true: bool| (f64::from(u8::from(is_true)), [0.0; 3]);
        match code {
            Code::Add => (a + b, [1.0, 1.0, 0.0]),
            Code::Subtract => (a - b, [1.0, -1.0, 0.0]),
            Code::Multiply => (a * b, [b, a, 0.0]),
            Code::Divide => {
                let quotient = a / b;
                (quotient, [1.0 / b, -quotient / b, 0.0])
            }
            Code::Power => power(a, b),
            Code::Negate => (-a, [-1.0, 0.0, 0.0]),
            Code::Abs => (a.abs(), [sign(a), 0.0, 0.0]),
            Code::Sign => (sign(a), [0.0; 3]),
            Code::Min if a.is_nan() || b.is_nan() => (f64::NAN, [0.0; 3]),
            Code::Max if a.is_nan() || b.is_nan() => (f64::NAN, [0.0; 3]),
            Code::Min => {
                if a <= b {
                    (a, [1.0, 0.0, 0.0])
                } else {
                    (b, [0.0, 1.0, 0.0])
                }
            }
            Code::Max => {
                if a >= b {
                    (a, [1.0, 0.0, 0.0])
                } else {
                    (b, [0.0, 1.0, 0.0])
                }
            }
            Code::Sqrt => {
                let root = a.sqrt();
                (root, [if root > 0.0 { 0.5 / root } else { 0.0 }, 0.0, 0.0])
            }
            Code::Exp => {
                let value = libm::exp(a);
                (value, [value, 0.0, 0.0])
            }
            Code::Log => (libm::log(a), [1.0 / a, 0.0, 0.0]),
            Code::Tanh => {
                let value = libm::tanh(a);
                (value, [1.0 - value * value, 0.0, 0.0])
            }
            Code::Sin => (libm::sin(a), [libm::cos(a), 0.0, 0.0]),
            Code::Cos => (libm::cos(a), [-libm::sin(a), 0.0, 0.0]),
            Code::Atan => (libm::atan(a), [1.0 / (1.0 + a * a), 0.0, 0.0]),
            Code::Floor => (libm::floor(a), [0.0; 3]),
            Code::Less => truth(a < b),
            Code::LessOrEqual => truth(a <= b),
            Code::Equal => truth(a == b),
            Code::NotEqual => truth(a != b),
            Code::And => truth(a != 0.0 && b != 0.0),
            Code::Or => truth(a != 0.0 || b != 0.0),
            Code::Select if a.is_nan() => (f64::NAN, [0.0; 3]),
            Code::Select => {
                if a != 0.0 {
                    (b, [0.0, 1.0, 0.0])
                } else {
                    (c, [0.0, 0.0, 1.0])
                }
            }
            Code::Table(number) => {
                let (value, slope) = self.curves[usize::from(number)].at(a);
                (value, [slope, 0.0, 0.0])
            }
            Code::Delayed(input) => {
                let (value, rate) = inputs.between(usize::from(input), time_s - a);
                (value, [-rate, 0.0, 0.0])
            }
        }
    }
}

/// Chain rule. An operand that was not taken has the factor 0, and its own derivative may be infinite: it is left out.
fn carry(registers: &mut Registers, result: usize, operation: &Operation, partial: [f64; 3]) {
    let count = registers.directions;
    let (below, at) = registers.slopes.split_at_mut(result * count);
    let target = &mut at[..count];
    target.fill(0.0);
    for (operand, factor) in operation.operands.iter().zip(partial) {
        let operand = *operand as usize;
        if factor != 0.0 && registers.active[operand] {
            let source = &below[operand * count..(operand + 1) * count];
            for (sum, slope) in target.iter_mut().zip(source) {
                *sum += factor * slope;
            }
        }
    }
}

/// -1, 0 or 1; that of NaN is NaN.
fn sign(a: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / a.abs() * if a.is_infinite() { f64::NAN } else { 1.0 } }
}

fn power(a: f64, b: f64) -> (f64, [f64; 3]) {
    if b == 2.0 {
        return (a * a, [2.0 * a, if a > 0.0 { a * a * libm::log(a) } else { 0.0 }, 0.0]);
    }
    let value = libm::pow(a, b);
    let by_base = if a == 0.0 && b < 1.0 { 0.0 } else { b * libm::pow(a, b - 1.0) };
    let by_exponent = if a > 0.0 { value * libm::log(a) } else { 0.0 };
    (value, [by_base, by_exponent, 0.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// One operation of two parameters, its value and its derivatives.
    fn computed(code: Code, a: f64, b: f64) -> (f64, [f64; 2]) {
        let leaves = Leaves { parameters: 3, ..Leaves::default() };
        let mut builder = Builder::new(leaves);
        let operands = [0, 1, 2].map(|index| leaves.parameter(index));
        let result = builder.push(code, &operands);
        let curve = Curve::new(vec![0.0, 1.0, 3.0], vec![1.0, 2.0, -2.0]);
        let tape = builder.tape(&[result], vec![curve]);
        let mut registers = Registers::new(&tape, 2, |leaf| leaf != leaves.parameter(2));
        for (index, value) in [a, b, 0.5].into_iter().enumerate() {
            registers.set(leaves.parameter(index), value);
        }
        registers.slope_mut(leaves.parameter(0))[0] = 1.0;
        registers.slope_mut(leaves.parameter(1))[1] = 1.0;
        tape.evaluate(&mut registers, &Inputs::none());
        let slope = registers.slope(tape.result(0));
        (registers.value(tape.result(0)), [slope[0], slope[1]])
    }

    const SMOOTH: [Code; 15] = [
        Code::Add,
        Code::Subtract,
        Code::Multiply,
        Code::Divide,
        Code::Power,
        Code::Negate,
        Code::Abs,
        Code::Sqrt,
        Code::Exp,
        Code::Log,
        Code::Tanh,
        Code::Sin,
        Code::Cos,
        Code::Atan,
        Code::Table(0),
    ];

    proptest! {
        /// Central differences with steps of 1e-6: their error is some 1e-9 of the values, which are below 1e3.
        #[test]
        fn derivatives_are_those_of_differences(a in 0.1..2.9f64, b in 0.2..3.0f64, which in 0..SMOOTH.len()) {
            let code = SMOOTH[which];
            prop_assume!((a - 1.0).abs() > 1e-3);
            let step = 1e-6;
            let slopes = computed(code, a, b).1;
            let by_a = (computed(code, a + step, b).0 - computed(code, a - step, b).0) / (2.0 * step);
            let by_b = (computed(code, a, b + step).0 - computed(code, a, b - step).0) / (2.0 * step);
            prop_assert!((slopes[0] - by_a).abs() < 1e-5 * (1.0 + by_a.abs()), "{code:?} by a");
            prop_assert!((slopes[1] - by_b).abs() < 1e-5 * (1.0 + by_b.abs()), "{code:?} by b");
        }
    }

    #[test]
    fn what_is_not_taken_leaves_no_infinite_derivative() {
        assert_eq!(computed(Code::Max, -1.0, 0.0), (0.0, [0.0, 1.0]));
        assert_eq!(computed(Code::Sqrt, 0.0, 0.0), (0.0, [0.0, 0.0]));
        assert_eq!(computed(Code::Power, 0.0, 0.5).1[0], 0.0);
        assert_eq!(computed(Code::Select, 0.0, f64::INFINITY), (0.5, [0.0, 0.0]));
    }

    #[test]
    fn a_value_that_is_no_number_stays_visible() {
        for code in [Code::Min, Code::Max, Code::Abs, Code::Sign, Code::Table(0), Code::Select, Code::Power] {
            assert!(computed(code, f64::NAN, 1.0).0.is_nan(), "{code:?}");
        }
        assert!(computed(Code::Divide, 0.0, 0.0).0.is_nan());
        assert!(computed(Code::Sqrt, -1.0, 0.0).0.is_nan());
    }

    #[test]
    fn equal_operations_share_a_register() {
        let leaves = Leaves { parameters: 2, ..Leaves::default() };
        let mut builder = Builder::new(leaves);
        let operands = [leaves.parameter(0), leaves.parameter(1)];
        let first = builder.push(Code::Multiply, &operands);
        let half = builder.constant(0.5);
        assert_eq!(builder.constant(0.5), half);
        assert_eq!(builder.push(Code::Multiply, &operands), first);
        let sum = builder.push(Code::Add, &[first, half]);
        assert_eq!(builder.tape(&[sum], vec![]).operations(), 2);
    }
}
