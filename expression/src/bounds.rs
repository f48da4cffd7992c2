//! Bounds of an expression over the ranges of its names: what is proven finite, and where the proof fails.
//!
//! ```text
//!   [a, b] + [c, d] = [a + c, b + d]        [a, b] / [c, d]: refused where 0 is in [c, d]
//! ```
//! Interval arithmetic node by node: a name that stands twice counts as two, so that bounds may be wider than the values are. A
//! branch of `if` is bounded whatever its condition: `1/x` is guarded by `1/max(x, 0.1)`, not by a condition. A value beyond
//! [`MOST`] counts as not finite, far enough below the largest number for rounding not to matter.
//!
//! Source: Moore, Kearfott, Cloud, Introduction to Interval Analysis, SIAM 2009, chapter 2.

use crate::curve::Table;
use crate::grammar::{Binary, ExpressionError, Kind, NodeId, Nodes, Result};

/// Largest bound that counts as finite.
pub(crate) const MOST: f64 = 1e100;

/// Smallest and largest value.
pub(crate) type Range = [f64; 2];

/// Bounds of a node; `of` gives the range of a name, and a table comes before a function. Names and numbers of arguments were
/// checked.
///
/// # Errors
/// [`ExpressionError`] at the node that is not proven finite.
pub(crate) fn bounds(
    nodes: &Nodes,
    place: NodeId,
    of: &dyn Fn(&str) -> Range,
    tables: &[Table],
) -> Result<Range> {
    let node = nodes.get(place);
    let bounds = |place: NodeId| bounds(nodes, place, of, tables);
    let range = match &node.kind {
        Kind::Number(value, _) => [*value; 2],
        Kind::Name(name) => of(name),
        Kind::Negation(inner) => {
            let [least, most] = bounds(*inner)?;
            [-most, -least]
        }
        Kind::Binary(Binary::Power, base, exponent) => {
            let inner = bounds(*base)?;
            let powers = bounds(*exponent)?;
            power(inner, powers).map_err(|why| ExpressionError::new(node.at, why))?
        }
        Kind::Binary(operator, left, right) => {
            let [a, b] = [bounds(*left)?, bounds(*right)?];
            binary(*operator, a, b).map_err(|why| ExpressionError::new(node.at, why))?
        }
        Kind::Call(name, arguments) => {
            let ranges = arguments.iter().map(|argument| bounds(*argument)).collect::<Result<Vec<_>, _>>()?;
            match tables.iter().find(|table| table.name == *name) {
                Some(table) => table.curve.bounds(ranges[0]),
                None => call(name, &ranges).map_err(|why| ExpressionError::new(node.at, why))?,
            }
        }
    };
    // Written so that a NaN is refused.
    if range.iter().all(|end| end.abs() <= MOST) {
        return Ok(range);
    }
    let [least, most] = range;
    let why =
        format!("this may be {least:e} to {most:e}, which counts as not finite: bound it by min and max");
    Err(ExpressionError::new(node.at, why))
}

fn binary(operator: Binary, [a, b]: Range, [c, d]: Range) -> Result<Range, String> {
    Ok(match operator {
        Binary::Add => [a + c, b + d],
        Binary::Subtract => [a - d, b - c],
        Binary::Multiply => hull(&[a * c, a * d, b * c, b * d]),
        Binary::Divide if c <= 0.0 && d >= 0.0 => {
            return Err(format!(
                "this divides by a value that may be 0 ({c} to {d}): bound it by max or min"
            ));
        }
        Binary::Divide => hull(&[a / c, a / d, b / c, b / d]),
        // Truths.
        _ => [0.0, 1.0],
    })
}

fn power([a, b]: Range, [c, d]: Range) -> Result<Range, String> {
    if c == d && c.fract() == 0.0 {
        if c < 0.0 && a <= 0.0 && b >= 0.0 {
            return Err(format!("this is a negative power of a value that may be 0 ({a} to {b})"));
        }
        let ends = [libm::pow(a, c), libm::pow(b, c)];
        let is_even = c % 2.0 == 0.0;
        return Ok(if is_even && a < 0.0 && b > 0.0 {
            hull(&[ends[0], ends[1], if c == 0.0 { 1.0 } else { 0.0 }])
        } else {
            hull(&ends)
        });
    }
    if a < 0.0 {
        return Err(format!("this is a power of a value that may be negative ({a} to {b}): bound it by max"));
    }
    if a == 0.0 && c < 0.0 {
        return Err("this may be a negative power of 0: bound the base by max".to_owned());
    }
    // Monotone in the base and in the exponent: its ends are at the corners.
    let corners = hull(&[libm::pow(a, c), libm::pow(a, d), libm::pow(b, c), libm::pow(b, d)]);
    Ok(if a == 0.0 { [corners[0].min(0.0), corners[1]] } else { corners })
}

fn call(name: &str, ranges: &[Range]) -> Result<Range, String> {
    let [a, b] = ranges[0];
    Ok(match name {
        "abs" if a <= 0.0 && b >= 0.0 => [0.0, b.max(-a)],
        "abs" => hull(&[a.abs(), b.abs()]),
        "sign" => [-1.0, 1.0],
        "sqrt" if a < 0.0 => {
            return Err(format!("sqrt of a value that may be negative ({a} to {b}): bound it by max"));
        }
        "sqrt" => [a.sqrt(), b.sqrt()],
        "exp" => [libm::exp(a), libm::exp(b)],
        "log" if a <= 0.0 => {
            return Err(format!("log of a value that may not be above 0 ({a} to {b}): bound it by max"));
        }
        "log" => [libm::log(a), libm::log(b)],
        "tanh" => [libm::tanh(a), libm::tanh(b)],
        "sin" | "cos" => [-1.0, 1.0],
        "atan" => [libm::atan(a), libm::atan(b)],
        "floor" => [libm::floor(a), libm::floor(b)],
        "min" => ranges[1..].iter().fold([a, b], |all, more| [all[0].min(more[0]), all[1].min(more[1])]),
        "max" => ranges[1..].iter().fold([a, b], |all, more| [all[0].max(more[0]), all[1].max(more[1])]),
        "if" => hull(&[ranges[1][0], ranges[1][1], ranges[2][0], ranges[2][1]]),
        // Truths.
        _ => [0.0, 1.0],
    })
}

/// The range of some values; NaN where one is.
fn hull(values: &[f64]) -> Range {
    if values.iter().any(|value| value.is_nan()) {
        return [f64::NAN; 2];
    }
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
        [least.min(*value), most.max(*value)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::{Formula, SymbolTable, Variable};
    use crate::units::Dimension;
    use proptest::prelude::*;

    fn range(text: &str, of: Range) -> Result<Range> {
        let mut nodes = Nodes::default();
        let root = nodes.parse(text, 0).expect("an expression");
        bounds(&nodes, root, &|_| of, &[])
    }

    #[test]
    fn ends_are_those_of_the_book() {
        for (text, of, ends) in [
            ("2*x - 1", [-1.0, 3.0], [-3.0, 5.0]),
            ("x^2", [-1.0, 3.0], [0.0, 9.0]),
            ("x^3", [-2.0, 1.0], [-8.0, 1.0]),
            ("x^-2", [1.0, 2.0], [0.25, 1.0]),
            ("x^0.5", [0.0, 4.0], [0.0, 2.0]),
            ("1/x", [-4.0, -2.0], [-0.5, -0.25]),
            ("-abs(x)", [-3.0, 2.0], [-3.0, 0.0]),
            ("max(x, 1, -5)", [-3.0, 2.0], [1.0, 2.0]),
            ("if(x > 0, x, 7)", [-3.0, 2.0], [-3.0, 7.0]),
            ("x >= 2 and not(x)", [-3.0, 2.0], [0.0, 1.0]),
            ("sqrt(x) + sign(x)", [0.0, 4.0], [-1.0, 3.0]),
        ] {
            assert_eq!(range(text, of), Ok(ends), "{text}");
        }
    }

    #[test]
    fn what_is_not_proven_finite_is_refused_at_its_operator() {
        for (text, of, at) in [
            ("1/x", [-1.0, 1.0], 1),
            ("3 + 2/(x - x)", [1.0, 2.0], 5),
            ("sqrt(x)", [-1.0, 1.0], 0),
            ("log(x)", [0.0, 1.0], 0),
            ("exp(x)", [0.0, 1e3], 0),
            ("x^-1", [-1.0, 1.0], 1),
            ("x^0.5", [-1.0, 1.0], 1),
            ("x^-0.5", [0.0, 1.0], 1),
            ("1e60*x*x", [-1e30, 1e30], 6),
            ("if(x > 0.5, 1/x, 2)", [-1.0, 1.0], 13),
        ] {
            assert_eq!(range(text, of).map_err(|wrong| wrong.at), Err(at), "{text}");
        }
    }

    proptest! {
        /// Rounding may pass an end by its last place.
        #[test]
        fn a_value_lies_within_its_bounds(x in -2.0..2.0f64, y in 0.1..3.0f64, which in 0..8usize) {
            let text = [
                "x*y - x", "x/y", "abs(x)^y", "tanh(x*y)*y", "min(x, y, 1)", "if(x < y, x^3, -y)",
                "sqrt(y)*exp(-y)", "atan(x)*log(y)",
            ][which];
            let one = |name, range| Variable { name, dimension: Dimension::NONE, range };
            let over = [one("x", [-2.0, 2.0]), one("y", [0.1, 3.0])];
            let known = SymbolTable { variables: &over, parameters: &[], tables: &[] };
            let formula = Formula::compile((text, 0), known, (Dimension::NONE, "it")).unwrap();
            let ([least, most], value) = (formula.bounds, formula.value(&[x, y]));
            prop_assert!(least - 1e-9 <= value && value <= most + 1e-9, "{text}: {value} in {least} to {most}");
        }
    }
}
