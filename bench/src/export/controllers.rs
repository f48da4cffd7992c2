//! Which tables of controllers in a run's folder are of this run.
//!
//! The rig removes reports of an earlier run at its start, their tables remain ([`runlog::run_folder::RESULTS`]): a table whose
//! axis no report names is of an earlier run, or its controller was killed before it wrote one.

use crate::warn;
use runlog::controller_report::ControllerReport;
use runlog::run_folder::{FileError, read_json};
use std::path::Path;

/// The report of a process with both axes.
const BOTH: &str = "controller.json";

/// Whether the table of an axis, `controller-AXIS.csv`, is of this run; says so where there is one that is not.
///
/// # Errors
/// A report that is none.
pub(super) fn has_axis(folder: &Path, axis: &str) -> Result<bool, FileError> {
    let is_named = folder.join(format!("controller-{axis}.json")).exists() || {
        let both = folder.join(BOTH);
        both.exists() && read_json::<ControllerReport>(&both)?.axes.contains_key(axis)
    };
    Ok(is_named || left_out(&folder.join(format!("controller-{axis}.csv"))))
}

/// Whether the cycles of a process, `NAME-timing.csv`, are of this run; says so where there are some that are not.
pub(super) fn has_process(folder: &Path, name: &str) -> bool {
    folder.join(format!("{name}.json")).exists() || left_out(&folder.join(format!("{name}-timing.csv")))
}

/// Says that a table is left out, if it is there; false.
fn left_out(table: &Path) -> bool {
    if table.exists() {
        warn(&format!("{}: left out, as no report of a controller of this run names it", table.display()));
    }
    false
}
