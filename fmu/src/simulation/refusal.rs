//! Why a call is refused, as a message for the importer's log.

use plant::{ParameterError, SetupError};

/// Why a call is refused; it has had no effect then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum Refusal {
    /// The call belongs to another mode.
    #[error("{call} belongs after {after}")]
    Mode { call: &'static str, after: &'static str },
    /// No variable of this type has this reference.
    #[error("value reference {0} is no {1} of this FMU; see its modelDescription.xml")]
    Reference(u32, &'static str),
    /// The variable cannot be set, or not in this mode.
    #[error("{0} cannot be set {1}")]
    NotSettable(String, &'static str),
    /// The value is out of range, or not finite.
    #[error("{name} = {value}: allowed are {least} to {most}{}", spaced(unit))]
    OutOfRange { name: String, value: f64, least: f64, most: f64, unit: &'static str },
    #[error("{0}")]
    Parameters(#[from] ParameterError),
    /// A set-up that the rig does not allow.
    #[error("{0}")]
    Setup(#[from] SetupError),
    /// A communication point other than the plant's time, or a step that is no whole number of milliseconds.
    #[error("{0}")]
    Time(String),
    /// The plant's state is not finite: latched until a reset.
    #[error(
        "the plant's state is no longer finite, at {at_s} s; reset the FMU, and look at the inputs before"
    )]
    NotFinite { at_s: f64 },
}

/// A unit after a number.
fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}
