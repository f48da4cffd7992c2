//! Everything around the plant and its controller that is neither: here, what a run's folder adds up to.
//!
//! | file | holds |
//! |---|---|
//! | [`join`] | joins what emulator and controllers left in a run's folder into one summary |
//! | [`thresholds`] | `[passed]` of the experiment file held against the summary |
//! | [`table`] | the summary as a short table |
//! | [`tables_read`] | `measurement.csv` and `controller.csv` as columns |
//! | [`picture`] | set-point, position, error, valve and pressures over time, as SVG |
//! | [`cli`] | the command line |

pub mod cli;
pub mod join;
pub mod picture;
pub mod table;
pub mod tables_read;
pub mod thresholds;

use std::path::{Path, PathBuf};

/// What keeps a run's folder from being summed up.
#[derive(Debug, thiserror::Error)]
pub enum SummaryError {
    /// A file is missing or cannot be read.
    #[error("cannot read {file}: {reason}")]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system or the parser said.
        reason: String,
    },
    /// A file cannot be written.
    #[error("cannot write {file}: {reason}")]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// The emulator left no summary: it was killed, or is still running.
    #[error(
        "{0} has no summary.json: the emulator was killed or is still running; the rows that it recorded are readable"
    )]
    NoSummary(PathBuf),
    /// `[passed]` names something that is no figure, or a bound that is no number.
    #[error("[passed] {key} = {value}: {problem}")]
    Threshold {
        /// Key in the experiment file.
        key: String,
        /// Its value.
        value: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
}

impl SummaryError {
    fn read(file: &Path, reason: impl ToString) -> Self {
        Self::Read { file: file.into(), reason: reason.to_string() }
    }

    fn write(file: &Path, reason: impl ToString) -> Self {
        Self::Write { file: file.into(), reason: reason.to_string() }
    }
}
