//! What a run adds up to: the tables of its folder, its figures, and whether they keep the bounds of its experiment.
//!
//! | file | holds |
//! |---|---|
//! | [`series`] | a quantity over time: smoothing, slopes, stretches |
//! | [`tables_read`] | a CSV table as columns of numbers and of states |
//! | [`reports`] | the controllers' reports, and so which tables are of the run |
//! | [`record`] | all tables of a run: its moves, rests and steps |
//! | [`families`] | the figures, one file for each family |
//! | [`join`](mod@join) | joins what emulator and controllers left in a run's folder into one summary |
//! | [`thresholds`] | `[passed]` of the experiment file held against the summary |
//! | [`table`] | the summary as a short table |
//! | [`median`](mod@median) | a median with its interval |

pub mod families;
pub mod join;
pub mod median;
pub mod record;
pub mod reports;
pub mod series;
pub mod table;
pub mod tables_read;
pub mod thresholds;

pub use families::{Definition, FAMILIES, Family, Figures, definition, definitions, list, of};
pub use families::{emergency_stop, position};

use std::path::{Path, PathBuf};

/// What keeps a run's folder from being summed up.
#[derive(Debug, thiserror::Error)]
pub enum SummaryError {
    #[error("cannot read {file}: {reason}")]
    Read { file: PathBuf, reason: String },
    #[error("cannot write {file}: {reason}")]
    Write { file: PathBuf, reason: String },
    #[error(
        "{0} has no summary.json: the emulator was killed or is still running; the rows that it recorded are readable"
    )]
    NoSummary(PathBuf),
    #[error("[passed] {key} = {value}: {problem}")]
    Threshold {
        /// Key in the experiment file.
        key: String,
        value: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
}

impl SummaryError {
    /// A file that cannot be read.
    pub fn read(file: &Path, reason: impl ToString) -> Self {
        Self::Read { file: file.into(), reason: reason.to_string() }
    }

    /// A file that cannot be written.
    pub fn write(file: &Path, reason: impl ToString) -> Self {
        Self::Write { file: file.into(), reason: reason.to_string() }
    }
}
