//! Errors of reading a record, with file, line, column, value and what is allowed.

use settings::SettingsError;
use std::path::{Path, PathBuf};

/// Why a record cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum ReadError {
    #[error("cannot read {}: {reason}", file.display())]
    Open { file: PathBuf, reason: String },
    #[error("{} has no rows: a record needs a head with column names, and one row for each sample", file.display())]
    Empty { file: PathBuf },
    #[error("{}:{line}: {message}", file.display())]
    Line { file: PathBuf, line: u64, message: String },
    #[error("{}: no frame of sensors (0x120, 0x121) in {frames} frames: was the rig on this bus?", file.display())]
    NoSensors { file: PathBuf, frames: usize },
    #[error(transparent)]
    Mapping(#[from] SettingsError),
}

impl ReadError {
    pub(super) fn at(file: &Path, line: u64, message: String) -> Self {
        ReadError::Line { file: file.into(), line, message }
    }
}
