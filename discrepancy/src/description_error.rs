//! Why a file that a person writes to describe records or a model is refused: the mapping of a foreign record, the model of one
//! balance.

use std::path::PathBuf;

/// A mapping or model file that is refused.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// The file is missing or not readable.
    #[error("cannot read the {what} {}: {reason}", file.display())]
    Open {
        /// What the file describes: `mapping` or `model`.
        what: &'static str,
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// Not TOML, a key that is unknown or missing, a value of another kind.
    #[error("{}: {reason}", file.display())]
    Syntax {
        file: PathBuf,
        /// What the parser said, with line and column.
        reason: String,
    },
    /// A value that makes no sense.
    #[error("{}: {key} = {value}; allowed is {allowed}", file.display())]
    Value {
        file: PathBuf,
        /// The key with its table.
        key: String,
        value: String,
        /// What may stand there.
        allowed: String,
    },
}
