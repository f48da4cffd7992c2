//! A run's folder summed up: what `bench summary` and the end of `airbench run` do.

use crate::{SummaryError, join, picture, table};
use std::path::Path;

/// A run's summary as it is printed, and its verdict.
#[derive(Debug)]
pub struct PrintedSummary {
    /// The short table, and the names of the files.
    pub text: String,
    /// Whether the run ended well and kept all its bounds.
    pub passed: bool,
}

/// Joins what emulator and controllers left in `folder`, judges it and draws its pictures there.
///
/// # Errors
///
/// A folder without a summary, files that cannot be read or written, a bound that makes no sense.
pub fn sum_up(folder: &Path) -> Result<PrintedSummary, SummaryError> {
    let joined = join::join(folder)?;
    let pictures = picture::draw(folder, &joined.record)?;
    let others = if joined.is_rehearsal() { "" } else { "bus.log, " };
    let text = format!(
        "{}\n  files in {}: {}, summary.json, measurement.csv, truth.csv, {others}…",
        table::table(&joined),
        folder.display(),
        pictures.join(", ")
    );
    Ok(PrintedSummary { text, passed: joined.passed() })
}
