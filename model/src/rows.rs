//! `[rows]`: which rows of a record count, and how the model is compared on them.
//!
//! ```text
//!   measured, model ──► zero-phase Chebyshev I, every n-th row ──► rows that meet the condition ──► residual
//! ```
//! Measured and modelled go through the same filter, so that numbers do not change; residuals are those of the filtered signals.

use crate::file::{Expression, Model};
use crate::names::{Symbol, resolve};
use expression::grammar::{ExpressionError, Kind, NodeId};

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

/// Refuses an expression that cannot be computed before the model is.
pub(crate) fn reads_inputs_alone(model: &Model, root: NodeId) -> Result<(), ExpressionError> {
    let is_known = |symbol| match symbol {
        Symbol::Time | Symbol::Pi | Symbol::Input(_) => true,
        Symbol::Parameter(index) => {
            model.parameters[index].is_fixed && model.parameters[index].of_records_si.is_empty()
        }
        _ => false,
    };
    reads_alone((model, root, None), is_known, "rows and folds read inputs and fixed numbers alone")
}

/// Refuses an expression that reads more than numbers: what a memory is before the first sample.
pub(crate) fn reads_numbers_alone(
    model: &Model,
    root: NodeId,
    suspect: Option<usize>,
) -> Result<(), ExpressionError> {
    let is_number = |symbol| matches!(symbol, Symbol::Pi | Symbol::Parameter(_));
    reads_alone((model, root, suspect), is_number, "the start of a memory reads parameters alone")
}

fn reads_alone(
    (model, root, suspect): (&Model, NodeId, Option<usize>),
    is_allowed: impl Fn(Symbol) -> bool,
    why: &str,
) -> Result<(), ExpressionError> {
    for node in model.nodes.tree(root) {
        if let Kind::Name(name) = &node.kind
            && !is_allowed(resolve(model, name, suspect, node.at)?)
        {
            return Err(ExpressionError::new(node.at, format!("'{name}': {why}")));
        }
    }
    Ok(())
}
