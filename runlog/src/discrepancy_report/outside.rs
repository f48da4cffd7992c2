//! A disagreement outside the catalogue, and what of it an extended rig file has.

use super::null_is_nan;
use serde::{Deserialize, Serialize};

/// A disagreement that no effect of the catalogue explains.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct UncataloguedTerm {
    /// As in [`super::BalanceBar::balance`].
    pub balance: String,
    /// Variables that it depends on, strongest first.
    #[serde(default)]
    pub variables: Vec<Dependence>,
    /// The missing term over its first variable.
    #[serde(skip_deserializing)]
    pub curve: Option<Curve>,
    /// The same over its first two, where their joint R2 is much larger.
    #[serde(skip_deserializing)]
    pub surface: Option<Surface>,
    /// A short formula, if one fits.
    pub formula: Option<String>,
    /// Whether the extended rig file has it, as the tables.
    #[serde(default)]
    pub added: bool,
    /// Why it has not, in words.
    pub why_not: Option<String>,
    /// The terms that were added, each a table; empty when none.
    #[serde(default)]
    pub tables: Vec<TableTerm>,
    /// Share of the disagreement of the training records, beside parameters alone, that goes with the tables; null when none.
    pub share_explained: Option<f64>,
}

/// A term that the extended rig file has as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableTerm {
    /// `drive.force`, `drive.flow-a` and so on.
    pub balance: String,
    /// x, v, |v|, sign(v), u, p_a, p_b, p_a-p_b or x sign(v).
    pub variable: String,
    /// Unit of `at`; empty for a plain number.
    pub variable_unit: String,
    /// Unit of the term, N or Nl/min.
    pub unit: String,
    /// Points of the table, growing.
    pub at: Vec<f64>,
    /// The term there; a straight line between points, constant beyond them.
    pub value: Vec<f64>,
}

/// Statistical dependence of a disagreement on a variable.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Dependence {
    /// x, v, |v|, sign(v), p_a, p_b, p_a-p_b, u, du/dt, F, t, dp/dt, one of the history (`change of u (2 ms)`, `last movement
    /// of x`, …), or constant for a term that is always there.
    pub variable: String,
    /// Share of the variance explained on folds it was not fitted on.
    #[serde(deserialize_with = "null_is_nan")]
    pub r2: f64,
    /// Permutation p value over 200 circular shifts: (1 + shifts that reach R2) / 201. The entry `constant` is no permutation p
    /// value, since a shift leaves the mean unchanged: a z test of the mean decides on it, and it always has 1/201 here.
    #[serde(deserialize_with = "null_is_nan")]
    pub p_value: f64,
}

/// A smooth curve with a band.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// As in [`Dependence::variable`].
    pub variable: String,
    /// Unit of `at`.
    pub variable_unit: String,
    /// Unit of the term.
    pub unit: String,
    /// Values of the variable.
    pub at: Vec<f64>,
    /// The term at each place of `at`, in `unit`.
    pub value: Vec<f64>,
    /// Two standard errors of `value`.
    pub band: Vec<f64>,
}

/// A surface over two variables with a band; null where too few points are.
#[derive(Clone, Debug, Serialize)]
pub struct Surface {
    /// As in [`Dependence::variable`].
    pub variables: [String; 2],
    /// Their units.
    pub variable_units: [String; 2],
    /// Unit of the term.
    pub unit: String,
    /// Values of the first variable, and of the second.
    pub at: [Vec<f64>; 2],
    /// The term there: a row for each value of the second variable.
    pub value: Vec<Vec<Option<f64>>>,
    /// Two standard errors of `value`.
    pub band: Vec<Vec<Option<f64>>>,
}
