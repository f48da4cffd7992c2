//! What a run adds up to: the tables of its folder, its figures, whether they keep the bounds of its experiment, its pictures.
//!
//! | file | holds |
//! |---|---|
//! | [`series`] | a quantity over time: smoothing, slopes, stretches |
//! | [`tables_read`] | a CSV table as columns of numbers and of states |
//! | [`reports`] | the controllers' reports, and so which tables are of the run |
//! | [`record`] | all tables of a run: its moves, rests and steps |
//! | [`experiment`] | what all of these take of the experiment file |
//! | [`families`] | the figures, one file for each family |
//! | [`join`](mod@join) | joins what emulator and controllers left in a run's folder into one summary |
//! | [`thresholds`] | `[passed]` of the experiment file held against the summary |
//! | [`top`] | the figures at the top of a summary, in one list |
//! | [`table`] | the summary as a short table |
//! | [`drawing`] | panels on one time axis, as SVG |
//! | [`picture`] | the pictures of a run: the whole, and around its step or its emergency stop |
//! | [`sum_up`](mod@sum_up) | all of this for one folder: joined, judged, drawn, and a text |
//! | [`median`](mod@median) | a median with its interval |

#![warn(missing_docs)] // an interface of other crates

pub mod drawing;
pub mod experiment;
mod families;
pub mod join;
pub mod median;
pub mod picture;
pub mod record;
mod reports;
pub mod series;
pub mod sum_up;
pub mod table;
pub mod tables_read;
pub mod thresholds;
pub mod top;

pub use families::{Definition, Family, Figures, definition, definitions, list, of};
pub use families::{emergency_stop, position};

use runlog::run_folder::FileError;
use std::path::PathBuf;

/// What keeps a run's folder from being summed up.
#[derive(Debug, thiserror::Error)]
pub enum SummaryError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder without a summary.
    #[error(
        "{0} has no summary.json: the emulator was killed or is still running; the rows that it recorded are readable"
    )]
    NoSummary(PathBuf),
    /// A bound of the experiment that makes no sense.
    #[error("[passed] {key} = {value}: {problem}")]
    Threshold {
        /// Figure or number that it bounds.
        key: String,
        /// The bound as it was written.
        value: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
}
