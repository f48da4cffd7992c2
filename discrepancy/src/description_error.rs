//! Why a file that a person writes to describe records or a model is refused: the mapping of a foreign record, the model of one
//! balance.

use std::path::{Path, PathBuf};

/// A mapping or model file that is refused.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    #[error("cannot read the {what} {}: {reason}", file.display())]
    Open { what: &'static str, file: PathBuf, reason: String },
    #[error("{}: {reason}", file.display())]
    Syntax { file: PathBuf, reason: String },
    #[error("{}: {key} = {value}; allowed is {allowed}", file.display())]
    Value { file: PathBuf, key: String, value: String, allowed: String },
}

impl DescriptionError {
    pub(crate) fn read(what: &'static str, file: &Path) -> Result<String, Self> {
        std::fs::read_to_string(file).map_err(|error| Self::Open {
            what,
            file: file.into(),
            reason: error.to_string(),
        })
    }
}
