//! Chains of operators of one level: sums, products, conditions.
//!
//! ```text
//!   a - b + c    ──► (a - b) + c                          up to 32 operands, from left to right
//!   a - b + … z  ──► (a - b + …) + (… z), and so on       longer: as deep as its logarithm
//! ```

use super::{Binary, Kind, NodeId, Nodes, Result};

#[derive(Clone, Copy)]
pub(super) enum Operator {
    Plain(Binary),
    /// The same with its operands exchanged.
    Swapped(Binary),
}

/// An operand behind its operator, which stands at a byte of the file.
#[derive(Clone, Copy)]
pub(super) struct Operand {
    pub(super) operator: Operator,
    pub(super) at: usize,
    pub(super) place: NodeId,
}

/// Chains of as many operators are halved; shorter ones are computed from left to right.
const LONGEST: usize = 32;

impl Operator {
    fn between(self, left: NodeId, right: NodeId) -> Kind {
        match self {
            Operator::Plain(binary) => Kind::Binary(binary, left, right),
            Operator::Swapped(binary) => Kind::Binary(binary, right, left),
        }
    }

    /// What becomes of the operators of a bracket behind this one; `None` where brackets change the value.
    fn turn(self) -> Option<fn(Self) -> Self> {
        let Operator::Plain(binary) = self else { return None };
        Some(match binary {
            Binary::Or | Binary::And | Binary::Add | Binary::Multiply => |operator| operator,
            Binary::Subtract | Binary::Divide => |operator| match operator {
                Operator::Plain(Binary::Add) => Operator::Plain(Binary::Subtract),
                Operator::Plain(Binary::Subtract) => Operator::Plain(Binary::Add),
                Operator::Plain(Binary::Multiply) => Operator::Plain(Binary::Divide),
                Operator::Plain(Binary::Divide) => Operator::Plain(Binary::Multiply),
                other => other,
            },
            _ => return None,
        })
    }
}

impl Nodes {
    /// Operands between operators of one level, from left to right; a long chain is halved, so that a flat sum of a thousand
    /// terms is ten deep.
    pub(super) fn chain(&mut self, first: NodeId, rest: &[Operand]) -> Result<NodeId> {
        if rest.len() >= LONGEST && rest.iter().all(|operand| operand.operator.turn().is_some()) {
            return self.halved(first, rest);
        }
        rest.iter().try_fold(first, |left, operand| {
            self.push(operand.operator.between(left, operand.place), operand.at)
        })
    }

    fn halved(&mut self, first: NodeId, rest: &[Operand]) -> Result<NodeId> {
        let middle = rest.len() / 2;
        let Some(Operand { operator, at, place }) = rest.get(middle).copied() else { return Ok(first) };
        let left = self.halved(first, &rest[..middle])?;
        // a - (b + c) is a - b - c: behind a minus or a division the operators turn.
        let mut right = rest[middle + 1..].to_vec();
        if let Some(turn) = operator.turn() {
            right.iter_mut().for_each(|operand| operand.operator = turn(operand.operator));
        }
        let right = self.halved(place, &right)?;
        self.push(operator.between(left, right), at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::constants;

    /// Signs and divisors of the halves turn: the sum and the product are those from left to right, of whole numbers exactly.
    #[test]
    fn a_long_chain_has_the_value_of_one_from_left_to_right_and_is_not_deep() {
        let numbers: Vec<f64> = (0..1000_u32).map(|index| f64::from(index * 37 % 101)).collect();
        let (mut text, mut sum) = (String::from("7"), 7.0);
        for (index, number) in numbers.iter().enumerate() {
            let is_minus = index * 7 % 5 < 2;
            text += &format!(" {} {number}", if is_minus { '-' } else { '+' });
            sum += if is_minus { -number } else { *number };
        }
        let (mut product_text, mut product) = (String::from("3"), 3.0);
        for index in 0..200 {
            let (sign, factor) =
                [("*", 2.0), ("/", 0.25), ("/", 4.0), ("*", 0.5), ("/", 2.0), ("*", 2.0)][index % 6];
            product_text += &format!("{sign}{factor}");
            product = if sign == "*" { product * factor } else { product / factor };
        }
        for (text, value) in [(text, sum), (product_text, product)] {
            let mut nodes = Nodes::default();
            let root = nodes.parse(&text, 0).expect("it is not deep");
            assert!(nodes.get(root).depth < 16, "{}", nodes.get(root).depth);
            assert_eq!(constants(&nodes).unwrap()[root as usize], Some(value));
        }
        let truths = vec!["1"; 100].join(" and ") + " and 0 or " + &vec!["0"; 100].join(" or ");
        let mut nodes = Nodes::default();
        let root = nodes.parse(&truths, 0).expect("it is not deep");
        assert_eq!(constants(&nodes).unwrap()[root as usize], Some(0.0));
    }
}
