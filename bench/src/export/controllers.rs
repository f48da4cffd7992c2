//! Which tables of controllers in a run's folder belong to this run.
//!
//! At its start the rig removes the reports of an earlier run, but their tables remain ([`runlog::run_folder::results`]): a
//! table of an axis without a report belongs to an earlier run, or its controller was killed.

use crate::warn;
use runlog::Axis;
use runlog::controller_report::ControllerReport;
use runlog::process::Process;
use runlog::run_folder::{FileError, controller_csv, read_json};
use std::path::Path;

/// Whether the table of an axis, `controller-AXIS.csv`, belongs to this run; warns of one that does not.
///
/// # Errors
/// A report that cannot be read.
pub(super) fn has_axis(folder: &Path, axis: Axis) -> Result<bool, FileError> {
    let is_named = folder.join(Process::ControllerOf(axis).report()).exists() || {
        let both = folder.join(Process::Controller.report());
        both.exists() && read_json::<ControllerReport>(&both)?.axes.contains_key(axis.name())
    };
    Ok(is_named || left_out(&folder.join(controller_csv(axis))))
}

/// Whether `NAME-timing.csv` of a controller belongs to this run; warns of one that does not.
pub(super) fn has_process(folder: &Path, controller: Process) -> bool {
    folder.join(controller.report()).exists() || left_out(&folder.join(controller.timing()))
}

/// Warns that a table is left out, if it exists; returns false.
fn left_out(table: &Path) -> bool {
    if table.exists() {
        warn(&format!("{}: left out, as no report of a controller of this run names it", table.display()));
    }
    false
}
