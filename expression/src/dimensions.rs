//! The dimension of an expression, and the numbers of arguments in it.

use crate::compile::function;
use crate::grammar::{Binary, ExpressionError, Kind, Node, NodeId, Result};
use crate::units::{Dimension, Unit};

/// `None` is the dimension of 0, which is any.
pub type Measure = Option<Dimension>;

/// Finds dimensions; who implements it knows what names mean.
pub trait Dimensions {
    /// Where an expression stands, if names mean different things at different places.
    type Scope: Copy;

    /// A copy of the node with this index.
    fn at(&self, place: NodeId) -> Node;

    /// The dimension of a name.
    ///
    /// # Errors
    /// [`ExpressionError`] for a name that means nothing here.
    fn named(&mut self, name: &str, at: usize, scope: Self::Scope) -> Result<Measure>;

    /// Number of arguments of a function that is not one of [`function`], and what follows the known ones in a message.
    fn arguments(&self, name: &str) -> Option<usize>;

    /// A dimension in units that a reader of the file knows.
    fn in_units(&self, dimension: Dimension) -> String {
        familiar(dimension)
    }

    /// The functions beside those of [`function`], for a message.
    fn functions(&self) -> &'static str;

    /// The dimension of a call of such a function.
    ///
    /// # Errors
    /// [`ExpressionError`] for arguments that it does not take.
    fn called(&mut self, name: &str, measures: &[Measure], at: usize) -> Result<Measure>;

    /// Checks an expression against the dimension that it must have; it begins at byte `at`.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn expression(
        &mut self,
        place: NodeId,
        scope: Self::Scope,
        wanted: Dimension,
        (at, what): (usize, &str),
    ) -> Result<()> {
        let found = self.node(place, scope).map_err(|wrong| match wrong.is_unit_mismatch {
            true if wanted != Dimension::NONE => ExpressionError {
                why: format!("{}; {what} is in {}", wrong.why, self.in_units(wanted)),
                ..wrong
            },
            _ => wrong,
        })?;
        match found {
            Some(found) if found != wanted => {
                let [wanted, found] = [wanted, found].map(|one| self.in_units(one));
                Err(ExpressionError::new(at, format!("{what} is in {wanted}, and this is in {found}")))
            }
            _ => Ok(()),
        }
    }

    /// The dimension of a node.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn node(&mut self, place: NodeId, scope: Self::Scope) -> Result<Measure> {
        let node = self.at(place);
        match &node.kind {
            Kind::Number(value, None) => Ok((*value != 0.0).then_some(Dimension::NONE)),
            Kind::Number(_, Some(unit)) => Ok(Some(unit.dimension)),
            Kind::Name(name) => self.named(name, node.at, scope),
            Kind::Negation(inner) => self.node(*inner, scope),
            Kind::Binary(operator, left, right) => {
                let [a, b] = [self.node(*left, scope)?, self.node(*right, scope)?];
                match operator {
                    Binary::Add | Binary::Subtract => self.same([(a, *left), (b, *right)], node.at, "sum"),
                    // 0 alone has any dimension; as a factor it is a number like others.
                    Binary::Multiply | Binary::Divide if a.or(b).is_none() => Ok(None),
                    Binary::Multiply => Ok(Some(a.unwrap_or_default().times(b.unwrap_or_default()))),
                    Binary::Divide => Ok(Some(a.unwrap_or_default().over(b.unwrap_or_default()))),
                    Binary::Power => self.power(a, b, *right, node.at),
                    Binary::And | Binary::Or => {
                        let name = if *operator == Binary::And { "and" } else { "or" };
                        [a, b].into_iter().try_for_each(|one| self.truth(name, one, node.at))?;
                        Ok(Some(Dimension::NONE))
                    }
                    _ => self
                        .same([(a, *left), (b, *right)], node.at, "comparison")
                        .map(|_| Some(Dimension::NONE)),
                }
            }
            Kind::Call(name, arguments) => self.call(name, arguments, node.at, scope),
        }
    }

    /// The dimension of a power.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn power(&self, base: Measure, exponent: Measure, place: NodeId, at: usize) -> Result<Measure> {
        if exponent.is_some_and(|exponent| exponent != Dimension::NONE) {
            return Err(ExpressionError::new(at, "an exponent has no unit"));
        }
        let Some(base) = base.filter(|base| *base != Dimension::NONE) else {
            return Ok(Some(Dimension::NONE));
        };
        let number = match self.at(place).kind {
            Kind::Number(value, None) => Some(value),
            Kind::Negation(inner) => match self.at(inner).kind {
                Kind::Number(value, None) => Some(-value),
                _ => None,
            },
            _ => None,
        };
        let power = number.and_then(|number| base.to_the(number));
        let why = || {
            format!(
                "a value in {} has a power with a number as exponent alone: divide it by a scale first",
                self.in_units(base)
            )
        };
        power.map(Some).ok_or_else(|| ExpressionError::new(at, why()))
    }

    /// The dimension of a call.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file.
    fn call(&mut self, name: &str, arguments: &[NodeId], at: usize, scope: Self::Scope) -> Result<Measure> {
        let of_file = self.arguments(name);
        let least = match (of_file, function(name)) {
            (Some(count), _) => count,
            _ if name == "not" => 1,
            (_, Some((_, least))) => least,
            _ => {
                let more = self.functions();
                let known = format!(
                    "abs, sign, min, max, sqrt, exp, log, tanh, sin, cos, atan, floor, if, not{more}"
                );
                return Err(ExpressionError::new(at, format!("'{name}' is no function; known are {known}")));
            }
        };
        let takes_more = of_file.is_none() && matches!(name, "min" | "max");
        if arguments.len() < least || !takes_more && arguments.len() > least {
            let more = if takes_more { " or more" } else { "" };
            return Err(ExpressionError::new(
                at,
                format!("{name} has {} arguments; it takes {least}{more}", arguments.len()),
            ));
        }
        let measures =
            arguments.iter().map(|argument| self.node(*argument, scope)).collect::<Result<Vec<_>, _>>()?;
        if of_file.is_some() {
            return self.called(name, &measures, at);
        }
        match name {
            "abs" => Ok(measures[0]),
            "sign" => Ok(Some(Dimension::NONE)),
            "not" => self.truth(name, measures[0], at).map(|()| Some(Dimension::NONE)),
            "sqrt" => {
                let Some(squared) = measures[0] else { return Ok(None) };
                let why = || {
                    format!(
                        "sqrt of a value in {}: powers of units are twelfths: divide it by a scale first",
                        self.in_units(squared)
                    )
                };
                squared.to_the(0.5).map(Some).ok_or_else(|| ExpressionError::new(at, why()))
            }
            "min" | "max" => {
                let mut all = measures.iter().zip(arguments).map(|(measure, place)| (*measure, *place));
                let first = all.next().expect("the number of arguments was checked");
                let first =
                    all.try_fold(first, |all, more| Ok((self.same([all, more], at, name)?, all.1)))?;
                Ok(first.0)
            }
            "if" => {
                self.truth(name, measures[0], at)?;
                let of = |index: usize| (measures[index], arguments[index]);
                self.same([of(1), of(2)], at, name)
            }
            _ => self.takes(name, measures[0], Dimension::NONE, at).map(|()| Some(Dimension::NONE)),
        }
    }

    /// Checks the dimension of a function's argument.
    ///
    /// # Errors
    /// [`ExpressionError`] where it is another.
    fn takes(&self, name: &str, measure: Measure, wanted: Dimension, at: usize) -> Result<()> {
        match measure {
            Some(found) if found != wanted => {
                let [wanted, found] = [wanted, found].map(|one| self.in_units(one));
                Err(ExpressionError::unit_mismatch(
                    at,
                    format!("{name} takes a value in {wanted}, and this is in {found}"),
                ))
            }
            _ => Ok(()),
        }
    }

    /// Checks what is taken as true or false.
    ///
    /// # Errors
    /// [`ExpressionError`] where it has a unit.
    fn truth(&self, name: &str, measure: Measure, at: usize) -> Result<()> {
        match measure {
            Some(found) if found != Dimension::NONE => {
                let found = self.in_units(found);
                Err(ExpressionError::new(
                    at,
                    format!("{name} takes a condition, and this is in {found}: compare it"),
                ))
            }
            _ => Ok(()),
        }
    }

    /// Checks that two operands have one dimension, which one of them may leave open.
    ///
    /// # Errors
    /// [`ExpressionError`] where they have not.
    fn same(&self, operands: [(Measure, NodeId); 2], at: usize, what: &str) -> Result<Measure> {
        let [(a, left), (b, right)] = operands;
        match (a, b) {
            (Some(a), Some(b)) if a != b => {
                let [a, b] = [a, b].map(|one| self.in_units(one));
                let [left, right] = [left, right].map(|place| self.written(place));
                Err(ExpressionError::unit_mismatch(at, format!("{what} of {left} in {a} and {right} in {b}")))
            }
            _ => Ok(a.or(b)),
        }
    }

    /// A node as a message names it: what is short as it is written, else a value.
    fn written(&self, place: NodeId) -> String {
        match &self.at(place).kind {
            Kind::Number(value, None) => format!("the number {value}"),
            Kind::Name(name) if is_of_file(name) => format!("'{name}'"),
            Kind::Call(name, _) if is_of_file(name) => format!("'{name}(…)'"),
            Kind::Binary(Binary::Multiply, left, _) => match &self.at(*left).kind {
                Kind::Name(name) if is_of_file(name) => format!("'{name}*…'"),
                _ => "a value".into(),
            },
            _ => "a value".into(),
        }
    }
}

/// Units of mechanics and circuits by which a dimension is known better than by those of SI.
const FAMILIAR: [&str; 18] = [
    "N", "m/s", "m/s^2", "N/m", "N s/m", "N s", "N m", "Pa", "Pa/s", "m^3/s", "kg/s", "J", "W", "V", "V/s",
    "ohm", "1/s", "W/K",
];

/// A dimension in a familiar unit, else in base units.
#[must_use]
pub fn familiar(dimension: Dimension) -> String {
    let is_it = |unit: &&&str| Unit::parse(unit).is_ok_and(|unit| unit.dimension == dimension);
    FAMILIAR.iter().find(is_it).map_or_else(|| dimension.to_string(), |unit| (*unit).to_owned())
}

/// Whether a name is one that the reader wrote.
fn is_of_file(name: &str) -> bool {
    name.starts_with(|first: char| first.is_alphabetic() || first == '_')
}
