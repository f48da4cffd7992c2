//! Expressions: a text becomes a tree, or is refused at the byte where it goes wrong.
//!
//! ```text
//!   or        or        lowest
//!   and       and
//!   compare   < <= > >= == !=
//!   sum       + -
//!   product   * /
//!   negation  -
//!   power     ^         right to left, above negation: -x^2 is -(x^2)
//!   atom      1.5e3   10[mm]   name   function(a, b)   (…)
//! ```
//! A truth is a number: 0 is false, any other true, and a comparison gives 1 or 0. A number has no dimension unless a unit in
//! square brackets follows it.

mod chains;

use crate::units::Unit;
use chains::{Operand, Operator};

/// Most nodes of all expressions of a file.
pub const MOST_NODES: usize = 10_000;
/// Deepest nesting of an expression.
pub const DEEPEST: usize = 64;

/// Index of a node in the list of all nodes of a file.
pub type NodeId = u32;

/// What a node computes.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A number in SI with its unit, if it has one.
    Number(f64, Option<Unit>),
    /// A symbol, `t` or `pi`, as it is written.
    Name(String),
    /// The operand times -1.
    Negation(NodeId),
    /// Left and right operand; `>` and `>=` are kept as `<` and `<=` with their operands exchanged.
    Binary(Binary, NodeId, NodeId),
    /// A function or a table, with its arguments in order; their number is not checked here.
    Call(String, Vec<NodeId>),
}

impl Kind {
    fn operands(&self) -> Vec<NodeId> {
        match self {
            Kind::Number(..) | Kind::Name(_) => Vec::new(),
            Kind::Negation(inner) => vec![*inner],
            Kind::Binary(_, left, right) => vec![*left, *right],
            Kind::Call(_, arguments) => arguments.clone(),
        }
    }
}

/// Operators between two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// `a + b`.
    Add,
    /// `a - b`.
    Subtract,
    /// `a * b`.
    Multiply,
    /// `a / b`.
    Divide,
    /// `a ^ b`.
    Power,
    /// `a < b`, a number: 1 or 0, as of all conditions.
    Less,
    /// `a <= b`.
    LessOrEqual,
    /// `a == b`.
    Equal,
    /// `a != b`.
    NotEqual,
    /// Whether both operands differ from 0.
    And,
    /// Whether either operand differs from 0.
    Or,
}

/// A node and the byte of the file at which it stands.
#[derive(Clone, Debug)]
pub struct Node {
    /// What it computes, with the indices of its operands.
    pub kind: Kind,
    /// Byte of the file, from 0: of an operator its own, else that of the first character.
    pub at: usize,
    pub(crate) depth: usize,
}

/// All nodes of a file.
#[derive(Clone, Debug, Default)]
pub struct Nodes(Vec<Node>);

/// An error in an expression: at which byte of the file, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// Byte of the file, from 0.
    pub at: usize,
    /// Message without the place.
    pub why: String,
    /// Two units do not match; which one is expected depends on the whole expression.
    pub(crate) is_unit_mismatch: bool,
}

/// Result of reading or compiling an expression.
pub(crate) type Result<T, E = ExpressionError> = core::result::Result<T, E>;

impl ExpressionError {
    /// An error other than a unit mismatch.
    pub fn new(at: usize, why: impl Into<String>) -> Self {
        Self { at, why: why.into(), is_unit_mismatch: false }
    }

    pub(crate) fn unit_mismatch(at: usize, why: impl Into<String>) -> Self {
        Self { is_unit_mismatch: true, ..Self::new(at, why) }
    }
}

impl Nodes {
    /// The node of an index.
    ///
    /// # Panics
    /// For an index beyond the last node.
    pub fn get(&self, place: NodeId) -> &Node {
        &self.0[place as usize]
    }

    /// All of them, what a node is made of before it.
    pub fn all(&self) -> &[Node] {
        &self.0
    }

    /// A node and all that it is made of, from left to right.
    pub fn tree(&self, root: NodeId) -> impl Iterator<Item = &Node> {
        let mut left = vec![root];
        std::iter::from_fn(move || {
            let node = self.get(left.pop()?);
            left.extend(node.kind.operands().into_iter().rev());
            Some(node)
        })
    }

    fn push(&mut self, kind: Kind, at: usize) -> Result<NodeId> {
        let depth = 1 + kind.operands().iter().map(|place| self.get(*place).depth).max().unwrap_or(0);
        if depth > DEEPEST {
            return Err(ExpressionError::new(at, too_deep()));
        }
        if self.0.len() >= MOST_NODES {
            return Err(ExpressionError::new(
                at,
                format!("more than {MOST_NODES} numbers, names and operators in this file"),
            ));
        }
        self.0.push(Node { kind, at, depth });
        Ok(self.0.len() as NodeId - 1)
    }

    /// Reads an expression that begins at byte `at` of its file.
    pub fn parse(&mut self, text: &str, at: usize) -> Result<NodeId> {
        Parser { text, offset: at, at: 0, nested: 0, nodes: self, bindings: None }.whole()
    }

    /// Reads an expression of another file, all of it at byte `at` of the one that uses it, with its names bound.
    ///
    /// # Errors
    /// [`ExpressionError`] at byte `at`.
    pub fn parse_bound(&mut self, text: &str, at: usize, bindings: &Bindings<'_>) -> Result<NodeId> {
        Parser { text, offset: at, at: 0, nested: 0, nodes: self, bindings: Some(bindings) }.whole()
    }

    /// The product of two expressions.
    ///
    /// # Errors
    /// [`ExpressionError`] at byte `at` where it is nested too deep.
    pub fn product(&mut self, left: NodeId, right: NodeId, at: usize) -> Result<NodeId> {
        self.push(Kind::Binary(Binary::Multiply, left, right), at)
    }

    /// Appends an operand that is called by a name.
    ///
    /// # Errors
    /// [`ExpressionError`] at byte `at` where there are too many.
    pub fn name(&mut self, name: &str, at: usize) -> Result<NodeId> {
        self.push(Kind::Name(name.into()), at)
    }
}

/// What a name in the expression of another file is bound to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Binding {
    /// An expression that was read before.
    Expression(NodeId),
    /// Another name.
    Name(String),
}

/// Bindings of names; a name without one stays as it is.
pub(crate) type Bindings<'a> = dyn Fn(&str) -> Option<Binding> + 'a;

struct Parser<'a> {
    text: &'a str,
    offset: usize,
    at: usize,
    nested: usize,
    nodes: &'a mut Nodes,
    bindings: Option<&'a Bindings<'a>>,
}

/// Operators by their level, longest first.
const LEVELS: [&[(&str, Operator)]; 5] = [
    &[("or", Operator::Plain(Binary::Or))],
    &[("and", Operator::Plain(Binary::And))],
    &[
        ("<=", Operator::Plain(Binary::LessOrEqual)),
        (">=", Operator::Swapped(Binary::LessOrEqual)),
        ("==", Operator::Plain(Binary::Equal)),
        ("!=", Operator::Plain(Binary::NotEqual)),
        ("<", Operator::Plain(Binary::Less)),
        (">", Operator::Swapped(Binary::Less)),
    ],
    &[("+", Operator::Plain(Binary::Add)), ("-", Operator::Plain(Binary::Subtract))],
    &[("*", Operator::Plain(Binary::Multiply)), ("/", Operator::Plain(Binary::Divide))],
];

fn too_deep() -> String {
    format!(
        "nested deeper than {DEEPEST} brackets, signs, calls and operators: \
         in a model file name a part of it under [define]"
    )
}

impl Parser<'_> {
    fn whole(mut self) -> Result<NodeId> {
        let place = self.level(0)?;
        self.skip_blanks();
        if self.at < self.text.len() {
            return Err(self.wrong("an operator is missing here, or a bracket was not opened"));
        }
        Ok(place)
    }

    /// Byte of the file that is read.
    fn place(&self) -> usize {
        self.offset + if self.bindings.is_some() { 0 } else { self.at }
    }

    fn wrong(&self, why: &str) -> ExpressionError {
        ExpressionError::new(self.place(), why)
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_blanks(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    fn take(&mut self, wanted: &str) -> bool {
        self.skip_blanks();
        let is_there = self.rest().starts_with(wanted);
        // A word ends where no letter follows.
        let goes_on = wanted.starts_with(char::is_alphabetic)
            && self.rest().get(wanted.len()..).is_some_and(|rest| rest.starts_with(is_name_character));
        if is_there && !goes_on {
            self.at += wanted.len();
        }
        is_there && !goes_on
    }

    /// Brackets and signs within each other are bounded before the stack is; `at` is the place of the outer one.
    fn deeper<T>(&mut self, at: usize, inner: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.nested += 1;
        if self.nested > DEEPEST {
            return Err(ExpressionError::new(at, too_deep()));
        }
        let value = inner(self)?;
        self.nested -= 1;
        Ok(value)
    }

    fn level(&mut self, level: usize) -> Result<NodeId> {
        let Some(operators) = LEVELS.get(level) else { return self.negation() };
        let first = self.level(level + 1)?;
        let mut rest = Vec::new();
        loop {
            self.skip_blanks();
            let at = self.place();
            let Some((_, operator)) = operators.iter().find(|(sign, _)| self.take(sign)) else { break };
            rest.push(Operand { operator: *operator, at, place: self.level(level + 1)? });
        }
        self.nodes.chain(first, &rest)
    }

    fn negation(&mut self) -> Result<NodeId> {
        self.skip_blanks();
        let at = self.place();
        if self.take("-") {
            let inner = self.deeper(at, Self::negation)?;
            return self.nodes.push(Kind::Negation(inner), at);
        }
        if self.take("+") {
            return self.deeper(at, Self::negation);
        }
        let base = self.atom()?;
        self.skip_blanks();
        let at = self.place();
        if self.take("^") {
            let exponent = self.deeper(at, Self::negation)?;
            return self.nodes.push(Kind::Binary(Binary::Power, base, exponent), at);
        }
        Ok(base)
    }

    fn atom(&mut self) -> Result<NodeId> {
        self.skip_blanks();
        let at = self.place();
        if self.take("(") {
            let inner = self.deeper(at, |parser| parser.level(0))?;
            return if self.take(")") {
                Ok(inner)
            } else {
                Err(self.wrong("a bracket is not closed: ) is missing"))
            };
        }
        let rest = self.rest();
        let Some(first) = rest.chars().next() else {
            return Err(self.wrong("the expression ends where a value should stand"));
        };
        if first.is_ascii_digit() || first == '.' {
            return self.number(at);
        }
        if !is_name_character(first) {
            return Err(self.wrong(&format!("'{first}' where a number, a name or a bracket should stand")));
        }
        let name: String = rest.chars().take_while(|character| is_name_character(*character)).collect();
        self.at += name.len();
        if !self.take("(") {
            return match self.bindings.and_then(|bindings| bindings(&name)) {
                Some(Binding::Expression(place)) => Ok(place),
                Some(Binding::Name(other)) => self.nodes.push(Kind::Name(other), at),
                None => self.nodes.push(Kind::Name(name), at),
            };
        }
        let mut arguments = Vec::new();
        if !self.take(")") {
            loop {
                arguments.push(self.deeper(at, |parser| parser.level(0))?);
                if self.take(")") {
                    break;
                }
                if !self.take(",") {
                    return Err(self.wrong("a comma or ) is missing between the arguments"));
                }
            }
        }
        self.nodes.push(Kind::Call(name, arguments), at)
    }

    fn number(&mut self, at: usize) -> Result<NodeId> {
        let length = number_length(self.rest());
        let text = &self.rest()[..length];
        let Some(value) = text.parse::<f64>().ok().filter(|value| value.is_finite()) else {
            return Err(self.wrong(&format!("'{text}' is no finite number")));
        };
        self.at += length;
        if !self.take("[") {
            return self.nodes.push(Kind::Number(value, None), at);
        }
        let Some(end) = self.rest().find(']') else { return Err(self.wrong("] is missing after a unit")) };
        let unit = Unit::parse(&self.rest()[..end])
            .map_err(|error| ExpressionError::new(self.place() + error.at, error.why))?;
        self.at += end + 1;
        self.nodes.push(Kind::Number(value * unit.factor, Some(unit)), at)
    }
}

/// Letters and digits of any script, and `_`.
pub fn is_name_character(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// A text with its names exchanged, where another stands for them; numbers and units stay.
#[must_use]
pub fn renamed(text: &str, other: &dyn Fn(&str) -> Option<String>) -> String {
    let mut written = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if first.is_ascii_digit() || first == '.' {
            number_length(rest).max(1)
        } else if first == '[' {
            rest.find(']').map_or(rest.len(), |end| end + 1)
        } else if is_name_character(first) {
            rest.find(|character| !is_name_character(character)).unwrap_or(rest.len())
        } else {
            first.len_utf8()
        };
        let part = &rest[..length];
        written += &other(part).unwrap_or_else(|| part.to_owned());
        rest = &rest[length..];
    }
    written
}

/// Bytes of the number at the head of a text.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

#[cfg(test)]
mod tests;
