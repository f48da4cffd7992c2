//! `[rows]`: which rows of a record count, and how the model is compared on them.
//!
//! ```text
//!   measured, model ──► zero-phase Chebyshev I, every n-th row ──► rows that meet the condition ──► residual
//! ```
//! Measured and modelled go through the same filter, so that numbers do not change, and a residual is what is left behind it.

use crate::file::{Expression, Model};
use crate::names::{Symbol, resolve};
use expression::grammar::{Kind, Place, Wrong};

/// Rows that count.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Rows at which it is not 0 count, an expression of inputs.
    pub condition: Option<Expression>,
    /// Every how many samples there is a row; more than 1 goes through the filter.
    pub every: usize,
    /// Order of the filter.
    pub order: usize,
    /// Its ripple, dB.
    pub ripple_decibel: f64,
    /// Its edge over the Nyquist frequency of the rows.
    pub edge: f64,
    /// Rows this close to an end of a record are fitted and judge nothing, s.
    pub ends_s: f64,
    /// What folds go over beside the time, expressions of inputs.
    pub folds: Vec<Expression>,
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            condition: None,
            every: 1,
            order: 4,
            ripple_decibel: 0.5,
            edge: 0.8,
            ends_s: 0.0,
            folds: Vec::new(),
        }
    }
}

/// Whether an expression can be computed before the model is.
pub(crate) fn reads_inputs_alone(model: &Model, place: Place) -> Result<(), Wrong> {
    let node = model.nodes.get(place);
    match &node.kind {
        Kind::Number(..) => Ok(()),
        Kind::Name(name) => match resolve(model, name, None, node.at)? {
            Symbol::Time | Symbol::Pi | Symbol::Input(_) => Ok(()),
            Symbol::Parameter(index) if model.parameters[index].is_one_constant() => Ok(()),
            _ => Err(Wrong::new(
                node.at,
                format!("'{name}': rows and folds read inputs and fixed numbers alone"),
            )),
        },
        Kind::Negation(inner) => reads_inputs_alone(model, *inner),
        Kind::Binary(_, left, right) => {
            reads_inputs_alone(model, *left)?;
            reads_inputs_alone(model, *right)
        }
        Kind::Call(_, arguments) => {
            arguments.iter().try_for_each(|argument| reads_inputs_alone(model, *argument))
        }
    }
}

/// Refuses an expression that reads more than numbers: what a memory is before the first sample.
pub(crate) fn reads_numbers_alone(model: &Model, place: Place, suspect: Option<usize>) -> Result<(), Wrong> {
    let node = model.nodes.get(place);
    match &node.kind {
        Kind::Number(..) => Ok(()),
        Kind::Name(name) => match resolve(model, name, suspect, node.at)? {
            Symbol::Pi | Symbol::Parameter(_) => Ok(()),
            _ => Err(Wrong::new(node.at, format!("'{name}': the start of a memory reads parameters alone"))),
        },
        Kind::Negation(inner) => reads_numbers_alone(model, *inner, suspect),
        Kind::Binary(_, left, right) => {
            reads_numbers_alone(model, *left, suspect)?;
            reads_numbers_alone(model, *right, suspect)
        }
        Kind::Call(_, arguments) => {
            arguments.iter().try_for_each(|argument| reads_numbers_alone(model, *argument, suspect))
        }
    }
}
