//! Errors of reading a record, with file, line, column, value and what is allowed.

use crate::description_error::DescriptionError;
use std::path::PathBuf;

/// Why a record cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file is missing or not readable.
    #[error("cannot read {}: {reason}", file.display())]
    Open {
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A head, but no rows; or not even a head.
    #[error("{} has no rows: a record needs a head with column names, and one row for each sample", file.display())]
    Empty { file: PathBuf },
    /// A column that the record cannot do without.
    #[error("{}:{line}: column {column} is missing; the file has {found}", file.display())]
    MissingColumn {
        file: PathBuf,
        /// Line of the head, from 1.
        line: u64,
        column: String,
        /// The columns that are there.
        found: String,
    },
    /// The same column twice.
    #[error("{}:{line}: column {column} stands twice: delete or rename one", file.display())]
    RepeatedColumn {
        file: PathBuf,
        /// Line of the head, from 1.
        line: u64,
        column: String,
    },
    /// A column or comment that a blind record must not have.
    #[error("{}:{line}: '{text}' is refused in a blind record; allowed are {allowed}", file.display())]
    NotBlind {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The column's name or the comment.
        text: String,
        /// What may stand there.
        allowed: String,
    },
    /// A row with more or fewer cells than the head.
    #[error("{}:{line}: {cells} cells, but the head has {expected}", file.display())]
    Width {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Cells in the row.
        cells: usize,
        /// Columns in the head.
        expected: usize,
    },
    /// A cell that is not what its column holds.
    #[error("{}:{line}: {column} = '{value}'; allowed is {allowed}", file.display())]
    Cell {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Column, or key of the comment line.
        column: String,
        /// What stands there.
        value: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A line that a log of a bus does not have.
    #[error("{}:{line}: '{text}' is no line of candump -L, such as (1700000000.123456) can0 120#0011AABB", file.display())]
    LogLine {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        text: String,
    },
    /// A log without a frame of sensors.
    #[error("{}: no frame of sensors (0x120, 0x121) in {frames} frames: was the rig on this bus?", file.display())]
    NoSensors {
        file: PathBuf,
        /// Frames that are there.
        frames: usize,
    },
    /// A log that lacks seconds in its midst.
    #[error(
        "{}:{line}: {seconds:.0} s without a frame of sensors before this line, {at_most_s} s at most: split the log there",
        file.display()
    )]
    LongHole {
        file: PathBuf,
        /// Line of the first frame after it, from 1.
        line: u64,
        /// How long, s.
        seconds: f64,
        /// What is read as one record, s.
        at_most_s: u64,
    },
    /// A log over two runs of the rig.
    #[error("{}:{line}: the rig starts anew (cycle {cycle} after {before}): split the log there", file.display())]
    Restarted {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The cycle that the tick says.
        cycle: u64,
        /// The cycle before it.
        before: u64,
    },
    /// Two different frames of sensors for one cycle.
    #[error("{}:{line}: other sensors of cycle {cycle} than before: two rigs on one bus? Record each alone", file.display())]
    TwoRigs {
        file: PathBuf,
        /// Line, from 1.
        line: u64,
        cycle: u64,
    },
    /// The mapping of a foreign file.
    #[error(transparent)]
    Mapping(#[from] DescriptionError),
}
