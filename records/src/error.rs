//! Errors of reading a record, with file, line, column, value and what is allowed.

use crate::description_error::DescriptionError;
use std::path::PathBuf;

/// Why a record cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error("cannot read {}: {reason}", file.display())]
    Open { file: PathBuf, reason: String },
    #[error("{} has no rows: a record needs a head with column names, and one row for each sample", file.display())]
    Empty { file: PathBuf },
    #[error("{}:{line}: column {column} is missing; the file has {found}", file.display())]
    MissingColumn { file: PathBuf, line: u64, column: String, found: String },
    #[error("{}:{line}: column {column} stands twice: delete or rename one", file.display())]
    RepeatedColumn { file: PathBuf, line: u64, column: String },
    #[error("{}:{line}: '{text}' is refused in a blind record; allowed are {allowed}", file.display())]
    NotBlind { file: PathBuf, line: u64, text: String, allowed: String },
    #[error("{}:{line}: {cells} cells, but the head has {expected}", file.display())]
    Width { file: PathBuf, line: u64, cells: usize, expected: usize },
    #[error("{}:{line}: {column} = '{value}'; allowed is {allowed}", file.display())]
    Cell { file: PathBuf, line: u64, column: String, value: String, allowed: &'static str },
    #[error("{}:{line}: '{text}' is no line of candump -L, such as (1700000000.123456) can0 120#0011AABB", file.display())]
    LogLine { file: PathBuf, line: u64, text: String },
    #[error("{}: no frame of sensors (0x120, 0x121) in {frames} frames: was the rig on this bus?", file.display())]
    NoSensors { file: PathBuf, frames: usize },
    #[error(
        "{}:{line}: {seconds:.0} s without a frame of sensors before this line, {at_most_s} s at most: split the log there",
        file.display()
    )]
    LongHole { file: PathBuf, line: u64, seconds: f64, at_most_s: u64 },
    #[error("{}:{line}: the rig starts anew (cycle {cycle} after {before}): split the log there", file.display())]
    Restarted { file: PathBuf, line: u64, cycle: u64, before: u64 },
    #[error("{}:{line}: other sensors of cycle {cycle} than before: two rigs on one bus? Record each alone", file.display())]
    TwoRigs { file: PathBuf, line: u64, cycle: u64 },
    #[error(transparent)]
    Mapping(#[from] DescriptionError),
}
