//! Operations: what each does with its operands, and its derivatives by them.
//!
//! Elementary functions are those of `libm`, so that bits are equal on every machine; `+ - * /` and the square root are exact by
//! IEEE 754. At a kink (abs, min, max, if, table) the derivative is that of the branch that is taken; that of sign and of a
//! comparison is 0, and that of sqrt at 0 is set to 0.

use crate::curve::Curve;
use crate::inputs::Inputs;
use crate::past::History;

/// What an operation does with its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Code {
    /// `a + b`.
    Add,
    /// `a - b`.
    Subtract,
    /// `a * b`.
    Multiply,
    /// `a / b`; 0/0 is NaN.
    Divide,
    /// `a ^ b`; NaN for a negative base with an exponent that is no integer.
    Power,
    /// `-a`.
    Negate,
    /// Absolute value.
    Abs,
    /// -1, 0 or 1; NaN for an infinite operand.
    Sign,
    /// The smaller operand; NaN where either is.
    Min,
    /// The larger operand; NaN where either is.
    Max,
    /// Square root; NaN below 0.
    Sqrt,
    /// `e^a`.
    Exp,
    /// Natural logarithm; minus infinity at 0, NaN below.
    Log,
    /// Hyperbolic tangent.
    Tanh,
    /// Sine of an angle in radians.
    Sin,
    /// Cosine of an angle in radians.
    Cos,
    /// Arc tangent in radians, -pi/2 to pi/2.
    Atan,
    /// Largest integer up to the operand.
    Floor,
    /// `a < b`: 1 or 0; 0 where either is NaN.
    Less,
    /// `a <= b`: 1 or 0; 0 where either is NaN.
    LessOrEqual,
    /// `a == b`: 1 or 0; 0 where either is NaN.
    Equal,
    /// `a != b`: 1 or 0; 1 where either is NaN.
    NotEqual,
    /// 1 where both operands differ from 0, else 0; NaN differs from 0.
    And,
    /// 1 where either operand differs from 0, else 0; NaN differs from 0.
    Or,
    /// First operand not 0: the second, else the third.
    Select,
    /// The table of this number at the first operand.
    Table(u16),
    /// The input of this number, the first operand earlier.
    DelayedInput(u16),
    /// The state, memory or direction in this register, the first operand earlier.
    DelayedLeaf(u32),
}

/// What operations read in addition to their operands.
pub(crate) struct EvaluationContext<'a> {
    pub(crate) time_s: f64,
    pub(crate) inputs: &'a Inputs<'a>,
    pub(crate) history: &'a History,
    pub(crate) curves: &'a [Curve],
}

impl Code {
    /// How many operands it reads.
    pub(crate) fn operands(self) -> usize {
        match self {
            Code::Add
            | Code::Subtract
            | Code::Multiply
            | Code::Divide
            | Code::Power
            | Code::Min
            | Code::Max => 2,
            code if code.is_condition() => 2,
            Code::Select => 3,
            _ => 1,
        }
    }

    /// Whether its derivatives are 0 everywhere.
    pub(crate) fn is_flat(self) -> bool {
        matches!(self, Code::Sign | Code::Floor) || self.is_condition()
    }

    /// Whether it compares, or joins two conditions: its value is 0 or 1.
    fn is_condition(self) -> bool {
        matches!(self, Code::Less | Code::LessOrEqual | Code::Equal | Code::NotEqual | Code::And | Code::Or)
    }

    /// Result for these operands.
    #[inline]
    pub(crate) fn value(self, [a, b, c]: [f64; 3], context: &EvaluationContext<'_>) -> f64 {
        let truth = |is_true: bool| f64::from(u8::from(is_true));
        match self {
            Code::Add => a + b,
            Code::Subtract => a - b,
            Code::Multiply => a * b,
            Code::Divide => a / b,
            Code::Power if b == 2.0 => a * a,
            Code::Power => libm::pow(a, b),
            Code::Negate => -a,
            Code::Abs => a.abs(),
            Code::Sign => sign(a),
            Code::Min | Code::Max if a.is_nan() || b.is_nan() => f64::NAN,
            Code::Min => {
                if a <= b {
                    a
                } else {
                    b
                }
            }
            Code::Max => {
                if a >= b {
                    a
                } else {
                    b
                }
            }
            Code::Sqrt => a.sqrt(),
            Code::Exp => libm::exp(a),
            Code::Log => libm::log(a),
            Code::Tanh => libm::tanh(a),
            Code::Sin => libm::sin(a),
            Code::Cos => libm::cos(a),
            Code::Atan => libm::atan(a),
            Code::Floor => libm::floor(a),
            Code::Less => truth(a < b),
            Code::LessOrEqual => truth(a <= b),
            Code::Equal => truth(a == b),
            Code::NotEqual => truth(a != b),
            Code::And => truth(a != 0.0 && b != 0.0),
            Code::Or => truth(a != 0.0 || b != 0.0),
            Code::Select if a.is_nan() => f64::NAN,
            Code::Select => {
                if a != 0.0 {
                    b
                } else {
                    c
                }
            }
            Code::Table(number) => context.curves[usize::from(number)].at(a).0,
            Code::DelayedInput(input) => context.inputs.between(usize::from(input), context.time_s - a).0,
            Code::DelayedLeaf(leaf) => context.history.value(leaf, context.time_s - a)[0],
        }
    }

    /// Its derivatives by the operands, where it has this value; those by an operand that is not `wanted` may be 0.
    #[inline]
    pub(crate) fn partials(
        self,
        [a, b, _]: [f64; 3],
        value: f64,
        wanted: [bool; 3],
        context: &EvaluationContext<'_>,
    ) -> [f64; 3] {
        match self {
            Code::Add => [1.0, 1.0, 0.0],
            Code::Subtract => [1.0, -1.0, 0.0],
            Code::Multiply => [b, a, 0.0],
            Code::Divide => [1.0 / b, -value / b, 0.0],
            Code::Power => power(a, b, value, wanted),
            Code::Negate => [-1.0, 0.0, 0.0],
            Code::Abs => [sign(a), 0.0, 0.0],
            Code::Min | Code::Max | Code::Select if value.is_nan() => [0.0; 3],
            Code::Min if a <= b => [1.0, 0.0, 0.0],
            Code::Max if a >= b => [1.0, 0.0, 0.0],
            Code::Min | Code::Max => [0.0, 1.0, 0.0],
            Code::Sqrt => [if value > 0.0 { 0.5 / value } else { 0.0 }, 0.0, 0.0],
            Code::Exp => [value, 0.0, 0.0],
            Code::Log => [1.0 / a, 0.0, 0.0],
            Code::Tanh => [1.0 - value * value, 0.0, 0.0],
            Code::Sin => [libm::cos(a), 0.0, 0.0],
            Code::Cos => [-libm::sin(a), 0.0, 0.0],
            Code::Atan => [1.0 / (1.0 + a * a), 0.0, 0.0],
            Code::Select if a != 0.0 => [0.0, 1.0, 0.0],
            Code::Select => [0.0, 0.0, 1.0],
            Code::Table(number) => [context.curves[usize::from(number)].at(a).1, 0.0, 0.0],
            Code::DelayedInput(input) => {
                [-context.inputs.between(usize::from(input), context.time_s - a).1, 0.0, 0.0]
            }
            Code::DelayedLeaf(leaf) => [-context.history.value(leaf, context.time_s - a)[1], 0.0, 0.0],
            Code::Sign
            | Code::Floor
            | Code::Less
            | Code::LessOrEqual
            | Code::Equal
            | Code::NotEqual
            | Code::And
            | Code::Or => [0.0; 3],
        }
    }
}

/// -1, 0 or 1; that of NaN is NaN.
fn sign(a: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / a.abs() * if a.is_infinite() { f64::NAN } else { 1.0 } }
}

/// Derivatives of a power. A logarithm and a second power cost more than all else: the one is computed only where it is
/// wanted, the other follows from the value.
fn power(a: f64, b: f64, value: f64, [by_base, by_exponent, _]: [bool; 3]) -> [f64; 3] {
    let base = match (by_base, b == 2.0) {
        (false, _) => 0.0,
        (true, true) => 2.0 * a,
        (true, false) if a != 0.0 => b * (value / a),
        (true, false) if b < 1.0 => 0.0,
        (true, false) => b * libm::pow(a, b - 1.0),
    };
    let exponent = if by_exponent && a > 0.0 { value * libm::log(a) } else { 0.0 };
    [base, exponent, 0.0]
}
