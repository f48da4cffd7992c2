//! From a tree to registers: what every expression has in common. Names, and functions of its own, are the caller's.

use crate::grammar::{Binary, ExpressionError, Kind, Node, NodeId, Result};
use crate::tape::{Builder, Code, Register};

/// Names that mean something in every expression.
pub const RESERVED: [&str; 19] = [
    "t", "pi", "and", "or", "not", "if", "abs", "sign", "min", "max", "sqrt", "exp", "log", "tanh", "sin",
    "cos", "atan", "floor", "delay",
];

/// A function and the least number of its arguments; `min` and `max` take more.
#[must_use]
pub(crate) fn function(name: &str) -> Option<(Code, usize)> {
    Some(match name {
        "abs" => (Code::Abs, 1),
        "sign" => (Code::Sign, 1),
        "sqrt" => (Code::Sqrt, 1),
        "exp" => (Code::Exp, 1),
        "log" => (Code::Log, 1),
        "tanh" => (Code::Tanh, 1),
        "sin" => (Code::Sin, 1),
        "cos" => (Code::Cos, 1),
        "atan" => (Code::Atan, 1),
        "floor" => (Code::Floor, 1),
        "min" => (Code::Min, 2),
        "max" => (Code::Max, 2),
        "if" => (Code::Select, 3),
        _ => return None,
    })
}

/// Compiles trees; who implements it knows what names mean.
pub trait Compile {
    /// Where an expression stands, if names mean different things at different places.
    type Scope: Copy;

    /// A copy of the node with this index.
    fn at(&self, place: NodeId) -> Node;

    /// Where operations are collected.
    fn builder(&mut self) -> &mut Builder;

    /// The register of a name.
    ///
    /// # Errors
    /// [`ExpressionError`] for a name that means nothing here.
    fn named(&mut self, name: &str, at: usize, scope: Self::Scope) -> Result<Register>;

    /// The register of a function that is not one of [`function`]; `None` where there is none of this name.
    ///
    /// # Errors
    /// [`ExpressionError`] for arguments that it does not take.
    fn called(
        &mut self,
        name: &str,
        arguments: &[NodeId],
        at: usize,
        scope: Self::Scope,
    ) -> Result<Option<Register>>;

    /// The register of a node; dimensions and numbers of arguments were checked.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn node(&mut self, place: NodeId, scope: Self::Scope) -> Result<Register> {
        let node = self.at(place);
        Ok(match node.kind {
            Kind::Number(value, _) => self.builder().constant(value),
            Kind::Name(name) => self.named(&name, node.at, scope)?,
            Kind::Negation(inner) => {
                let inner = self.node(inner, scope)?;
                self.builder().push(Code::Negate, &[inner])
            }
            Kind::Binary(Binary::Power, base, exponent)
                if matches!(self.at(exponent).kind, Kind::Number(2.0, None)) =>
            {
                let base = self.node(base, scope)?;
                self.builder().push(Code::Multiply, &[base, base])
            }
            Kind::Binary(operator, left, right) => {
                let operands = [self.node(left, scope)?, self.node(right, scope)?];
                self.builder().push(code_of(operator), &operands)
            }
            Kind::Call(name, arguments) => self.call(&name, &arguments, node.at, scope)?,
        })
    }

    /// The register of a call.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn call(&mut self, name: &str, arguments: &[NodeId], at: usize, scope: Self::Scope) -> Result<Register> {
        if let Some(register) = self.called(name, arguments, at, scope)? {
            return Ok(register);
        }
        let operands =
            arguments.iter().map(|argument| self.node(*argument, scope)).collect::<Result<Vec<_>, _>>()?;
        if name == "not" {
            let zero = self.builder().constant(0.0);
            return Ok(self.builder().push(Code::Equal, &[operands[0], zero]));
        }
        let (code, _) =
            function(name).ok_or_else(|| ExpressionError::new(at, format!("'{name}' is no function")))?;
        if matches!(code, Code::Min | Code::Max) {
            let [first, rest @ ..] = operands.as_slice() else {
                unreachable!("the number of arguments was checked")
            };
            return Ok(rest.iter().fold(*first, |left, right| self.builder().push(code, &[left, *right])));
        }
        Ok(self.builder().push(code, &operands))
    }
}

pub(crate) fn code_of(operator: Binary) -> Code {
    match operator {
        Binary::Add => Code::Add,
        Binary::Subtract => Code::Subtract,
        Binary::Multiply => Code::Multiply,
        Binary::Divide => Code::Divide,
        Binary::Power => Code::Power,
        Binary::Less => Code::Less,
        Binary::LessOrEqual => Code::LessOrEqual,
        Binary::Equal => Code::Equal,
        Binary::NotEqual => Code::NotEqual,
        Binary::And => Code::And,
        Binary::Or => Code::Or,
    }
}
