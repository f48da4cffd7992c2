//! Derivatives against differences, kinks, NaN, and equal operations.

use super::*;
use proptest::prelude::*;

/// One operation of two parameters, its value and its derivatives.
fn computed(code: Code, a: f64, b: f64) -> (f64, [f64; 2]) {
    let leaves = LeafLayout { parameters: 3, ..LeafLayout::default() };
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
    tape.prepare(&mut registers);
    tape.evaluate(&mut registers, &Inputs::none(), &NONE);
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
    let leaves = LeafLayout { parameters: 2, ..LeafLayout::default() };
    let mut builder = Builder::new(leaves);
    let operands = [leaves.parameter(0), leaves.parameter(1)];
    let first = builder.push(Code::Multiply, &operands);
    let half = builder.constant(0.5);
    assert_eq!(builder.constant(0.5), half);
    assert_eq!(builder.push(Code::Multiply, &operands), first);
    let sum = builder.push(Code::Add, &[first, half]);
    assert_eq!(builder.tape(&[sum], vec![]).operations(), 2);
}
