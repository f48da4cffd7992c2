//! Constants: parts of expressions that numbers alone stand in, and what of them is no finite number.
//!
//! `1/0`, `sqrt(-1)` and `1e308*1e308` are refused where they stand, and so is a division by a part that is 0, whatever is above
//! it. What depends on a name can be 0 at some samples alone, or be guarded by a condition: that is seen when it is computed.

use crate::compile::{code_of, function};
use crate::grammar::{Binary, ExpressionError, Kind, Nodes, Result};
use crate::inputs::Inputs;
use crate::operation::{Code, EvaluationContext};
use crate::past::NONE;

/// Of each node its value if it is a constant.
///
/// # Errors
/// [`ExpressionError`] at the operator or function whose value is no finite number.
pub fn constants(nodes: &Nodes) -> Result<Vec<Option<f64>>> {
    let mut values: Vec<Option<f64>> = Vec::new();
    // Operands precede their node.
    for node in nodes.all() {
        let of = |place: &u32| values[*place as usize];
        let value = match &node.kind {
            Kind::Number(value, _) => Some(*value),
            Kind::Name(name) => (name == "pi").then_some(std::f64::consts::PI),
            Kind::Negation(inner) => of(inner).map(|value| -value),
            Kind::Binary(Binary::Divide, _, below) if of(below) == Some(0.0) => {
                return Err(ExpressionError::new(node.at, "this divides by 0"));
            }
            Kind::Binary(operator, left, right) => {
                of(left).zip(of(right)).map(|(a, b)| computed(code_of(*operator), [a, b, 0.0]))
            }
            Kind::Call(name, arguments) => {
                let arguments: Option<Vec<f64>> = arguments.iter().map(of).collect();
                arguments.and_then(|arguments| call(name, &arguments))
            }
        };
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            let found = if value.is_nan() { "not a number".into() } else { value.to_string() };
            return Err(ExpressionError::new(node.at, format!("this is no finite number: {found}")));
        }
        values.push(value);
    }
    Ok(values)
}

/// The value of a function; `None` where it is none of all files, or has another number of arguments.
fn call(name: &str, arguments: &[f64]) -> Option<f64> {
    let (code, least) = function(name)?;
    if arguments.len() < least {
        return None;
    }
    if matches!(code, Code::Min | Code::Max) {
        return arguments.iter().copied().reduce(|a, b| computed(code, [a, b, 0.0]));
    }
    let of = |index: usize| arguments.get(index).copied().unwrap_or(0.0);
    Some(computed(code, [of(0), of(1), of(2)]))
}

fn computed(code: Code, operands: [f64; 3]) -> f64 {
    code.value(
        operands,
        &EvaluationContext { time_s: 0.0, inputs: &Inputs::none(), history: &NONE, curves: &[] },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last(text: &str) -> Result<Option<f64>> {
        let mut nodes = Nodes::default();
        nodes.parse(text, 0).expect("an expression");
        constants(&nodes).map(|values| values[values.len() - 1])
    }

    #[test]
    fn numbers_alone_are_computed() {
        for (text, value) in [
            ("-2^2 + 10[mm]*100", Some(-3.0)),
            ("max(1, 5, pi) - if(2 > 1, 5, 1/3)", Some(0.0)),
            ("x + 0/2", None),
            ("min(1)", None),
            ("f(1)", None),
        ] {
            assert_eq!(last(text), Ok(value), "{text}");
        }
    }

    #[test]
    fn a_constant_that_is_no_finite_number_is_refused_at_its_operator() {
        for (text, at) in [
            ("1/0", 1),
            ("x + 0/0", 5),
            ("x/(2 - 2)", 1),
            ("2*sqrt(-1)", 2),
            ("x*log(0)", 2),
            ("1e308*1e308", 5),
            ("(-8)^(1/3)", 4),
            ("0^-1", 1),
            ("exp(1000)*x", 0),
        ] {
            assert_eq!(last(text).map_err(|wrong| wrong.at), Err(at), "{text}");
        }
    }
}
