//! Everything around the plant and its controller that is neither: what runs' folders add up to, latency reports, soaks, and
//! references to measure beside.
//!
//! | file | holds |
//! |---|---|
//! | [`series`] | a quantity over time: smoothing, slopes, stretches |
//! | [`tables_read`] | a CSV table as columns of numbers and of states |
//! | [`reports`] | what the controllers tell of themselves, and so which tables are of the run |
//! | [`record`] | all tables of a run: its moves, rests and steps |
//! | [`figures`] | what a run adds up to in named numbers, one file for each family |
//! | [`join`] | joins what emulator and controllers left in a run's folder into one summary |
//! | [`thresholds`] | `[passed]` of the experiment file held against the summary |
//! | [`table`] | the summary as a short table |
//! | [`drawing`] | panels on one time axis, as SVG |
//! | [`picture`] | the pictures of a run: all of it, and around its step or its emergency stop |
//! | [`runs`] | several runs: whether they are of one experiment, their figures |
//! | [`median`] | a median with its interval |
//! | [`grid`] | a table of words in Markdown and HTML |
//! | [`page_style`] | what all pages share: stylesheet, frame, text made safe |
//! | [`compare`] | runs side by side: figures with their change, curves over each other |
//! | [`spread`] | how much the figures of repetitions spread |
//! | [`probe`] | gaps that a spinning thread sees: did the machine stand still, or did another thread run |
//! | [`ping_pong`] | round trips of 16 bytes between two processes, as a reference |
//! | [`latency_table`] | the table of ratios that `scripts/latency` ends with |
//! | [`report`] | the latency report |
//! | [`conformance`] | whether a foreign controller keeps the contract of the bus |
//! | [`gateway`] | a door to a bus for clients of the socketcand protocol |
//! | [`watch`] | a run shown while it goes on |
//! | [`soak`] | emulator and controllers over hours, every frame accounted for |
//! | [`recorded_log`] | a log of the bus, checked to its last line |
//! | [`export`] | a log as CSV, MDF4, ASC, BLF |
//! | [`replay`] | a log put back on a bus, by absolute time |
//! | [`export_fmu`] | the plant as an FMU |
//! | [`cli`] | the command line |

pub mod cli;
pub mod compare;
pub mod conformance;
pub mod drawing;
pub mod export;
pub mod export_fmu;
pub mod figures;
pub mod gateway;
pub mod grid;
pub mod join;
mod junit;
pub mod latency_table;
pub mod median;
pub mod page_style;
pub mod picture;
pub mod ping_pong;
pub mod probe;
pub mod record;
pub mod recorded_log;
pub mod replay;
pub mod report;
pub mod reports;
pub mod runs;
pub mod series;
pub mod soak;
pub mod spread;
pub mod table;
pub mod tables_read;
pub mod thresholds;
pub mod watch;

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
    /// A file that cannot be read.
    pub fn read(file: &Path, reason: impl ToString) -> Self {
        Self::Read { file: file.into(), reason: reason.to_string() }
    }

    /// A file that cannot be written.
    pub fn write(file: &Path, reason: impl ToString) -> Self {
        Self::Write { file: file.into(), reason: reason.to_string() }
    }
}
