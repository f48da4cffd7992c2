//! Why a call is refused, in words for the importer's log.

use plant::{ParameterError, SetupError};

/// Why a call is refused; nothing has changed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The call belongs into another mode.
    #[error("{call} belongs after {after}")]
    Mode { call: &'static str, after: &'static str },
    /// No variable of this type has this reference.
    #[error("value reference {0} is no {1} of this FMU; see its modelDescription.xml")]
    Reference(u32, &'static str),
    /// The variable cannot be set, or not now.
    #[error("{0} cannot be set {1}")]
    NotSettable(String, &'static str),
    /// The value is out of range, or none.
    #[error("{name} = {value}: allowed are {least} to {most}{}", spaced(unit))]
    OutOfRange { name: String, value: f64, least: f64, most: f64, unit: &'static str },
    /// Parameters that do not fit together.
    #[error("{0}")]
    Parameters(#[from] ParameterError),
    /// A rig that cannot be set up so.
    #[error("{0}")]
    Setup(#[from] SetupError),
    /// Time that is not where the plant stands, or a step that is no whole number of milliseconds.
    #[error("{0}")]
    Time(String),
    /// The plant's state is no longer finite: latched until a reset.
    #[error(
        "the plant's state is no longer finite, at {at_s} s; reset the FMU, and look at the inputs before"
    )]
    NotFinite { at_s: f64 },
}

/// A unit behind a number.
fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}
