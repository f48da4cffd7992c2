//! The dimension of an expression, and the numbers of arguments in it.

use crate::compile::function;
use crate::grammar::{Binary, Kind, Node, Place, Wrong};
use crate::units::Dimension;

/// `None` is the dimension of 0, which is any.
pub type Measure = Option<Dimension>;

/// Finds dimensions; who implements it knows what names mean.
pub trait Dimensions {
    /// Where an expression stands, if names mean different things at different places.
    type Scope: Copy;

    /// The node at a place.
    fn at(&self, place: Place) -> Node;

    /// The dimension of a name.
    ///
    /// # Errors
    /// [`Wrong`] for a name that means nothing here.
    fn named(&mut self, name: &str, at: usize, scope: Self::Scope) -> Result<Measure, Wrong>;

    /// Number of arguments of a function that is not one of [`function`], and what follows the known ones in a message.
    fn arguments(&self, name: &str) -> Option<usize>;

    /// The functions beside those of [`function`], for a message.
    fn functions(&self) -> &'static str;

    /// The dimension of a call of such a function.
    ///
    /// # Errors
    /// [`Wrong`] for arguments that it does not take.
    fn called(&mut self, name: &str, measures: &[Measure], at: usize) -> Result<Measure, Wrong>;

    /// Checks an expression against the dimension that it must have; it begins at byte `at`.
    ///
    /// # Errors
    /// [`Wrong`] with the byte of the file.
    fn expression(
        &mut self,
        place: Place,
        scope: Self::Scope,
        wanted: Dimension,
        (at, what): (usize, &str),
    ) -> Result<(), Wrong> {
        match self.node(place, scope)? {
            Some(found) if found != wanted => {
                Err(Wrong::new(at, format!("{what} is in {wanted}, and this is in {found}")))
            }
            _ => Ok(()),
        }
    }

    /// The dimension of a node.
    ///
    /// # Errors
    /// [`Wrong`] with the byte of the file.
    fn node(&mut self, place: Place, scope: Self::Scope) -> Result<Measure, Wrong> {
        let node = self.at(place);
        match &node.kind {
            Kind::Number(value, None) => Ok((*value != 0.0).then_some(Dimension::NONE)),
            Kind::Number(_, Some(unit)) => Ok(Some(unit.dimension)),
            Kind::Name(name) => self.named(name, node.at, scope),
            Kind::Negation(inner) => self.node(*inner, scope),
            Kind::Binary(operator, left, right) => {
                let [a, b] = [self.node(*left, scope)?, self.node(*right, scope)?];
                match operator {
                    Binary::Add | Binary::Subtract => same(a, b, node.at, "sum"),
                    Binary::Multiply => Ok(a.zip(b).map(|(a, b)| a.times(b))),
                    Binary::Divide => Ok(a.map(|a| a.over(b.unwrap_or_default()))),
                    Binary::Power => self.power(a, b, *right, node.at),
                    Binary::And | Binary::Or => Ok(Some(Dimension::NONE)),
                    _ => same(a, b, node.at, "comparison").map(|_| Some(Dimension::NONE)),
                }
            }
            Kind::Call(name, arguments) => self.call(name, arguments, node.at, scope),
        }
    }

    /// The dimension of a power.
    ///
    /// # Errors
    /// [`Wrong`] with the byte of the file.
    fn power(&self, base: Measure, exponent: Measure, place: Place, at: usize) -> Result<Measure, Wrong> {
        if exponent.is_some_and(|exponent| exponent != Dimension::NONE) {
            return Err(Wrong::new(at, "an exponent has no unit"));
        }
        let Some(base) = base.filter(|base| *base != Dimension::NONE) else { return Ok(base) };
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
                "a value in {base} has a power with a number as exponent alone: divide it by a scale first"
            )
        };
        power.map(Some).ok_or_else(|| Wrong::new(at, why()))
    }

    /// The dimension of a call.
    ///
    /// # Errors
    /// [`Wrong`] with the byte of the file.
    fn call(
        &mut self,
        name: &str,
        arguments: &[Place],
        at: usize,
        scope: Self::Scope,
    ) -> Result<Measure, Wrong> {
        let own = self.arguments(name);
        let least = match (own, function(name)) {
            (Some(count), _) => count,
            _ if name == "not" => 1,
            (_, Some((_, least))) => least,
            _ => {
                let more = self.functions();
                let known = format!(
                    "abs, sign, min, max, sqrt, exp, log, tanh, sin, cos, atan, floor, if, not{more}"
                );
                return Err(Wrong::new(at, format!("'{name}' is no function; known are {known}")));
            }
        };
        let takes_more = own.is_none() && matches!(name, "min" | "max");
        if arguments.len() < least || !takes_more && arguments.len() > least {
            let more = if takes_more { " or more" } else { "" };
            return Err(Wrong::new(
                at,
                format!("{name} has {} arguments; it takes {least}{more}", arguments.len()),
            ));
        }
        let measures =
            arguments.iter().map(|argument| self.node(*argument, scope)).collect::<Result<Vec<_>, _>>()?;
        if own.is_some() {
            return self.called(name, &measures, at);
        }
        match name {
            "abs" => Ok(measures[0]),
            "sign" | "not" => Ok(Some(Dimension::NONE)),
            "sqrt" => Ok(measures[0].and_then(|measure| measure.to_the(0.5))),
            "min" | "max" => {
                measures[1..].iter().try_fold(measures[0], |all, more| same(all, *more, at, name))
            }
            "if" => same(measures[1], measures[2], at, name),
            _ => takes(name, measures[0], Dimension::NONE, at).map(|()| Some(Dimension::NONE)),
        }
    }
}

/// Checks the dimension of a function's argument.
///
/// # Errors
/// [`Wrong`] where it is another.
pub fn takes(name: &str, measure: Measure, wanted: Dimension, at: usize) -> Result<(), Wrong> {
    match measure {
        Some(found) if found != wanted => {
            Err(Wrong::new(at, format!("{name} takes a value in {wanted}, and this is in {found}")))
        }
        _ => Ok(()),
    }
}

fn same(a: Measure, b: Measure, at: usize, what: &str) -> Result<Measure, Wrong> {
    match (a, b) {
        (Some(a), Some(b)) if a != b => {
            Err(Wrong::new(at, format!("{what} of a value in {a} and one in {b}")))
        }
        _ => Ok(a.or(b)),
    }
}
