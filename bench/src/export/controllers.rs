//! Which tables of controllers in a run's folder are of this run.
//!
//! The rig removes reports of an earlier run at its start, their tables remain ([`runlog::run_folder::results`]): a table whose
//! axis no report names is of an earlier run, or its controller was killed before it wrote one.

use crate::warn;
use runlog::Axis;
use runlog::controller_report::ControllerReport;
use runlog::process::Process;
use runlog::run_folder::{FileError, controller_csv, read_json};
use std::path::Path;

/// Whether the table of an axis, `controller-AXIS.csv`, is of this run; says so where there is one that is not.
///
/// # Errors
/// A report that is none.
pub(super) fn has_axis(folder: &Path, axis: Axis) -> Result<bool, FileError> {
    let is_named = folder.join(Process::ControllerOf(axis).report()).exists() || {
        let both = folder.join(Process::Controller.report());
        both.exists() && read_json::<ControllerReport>(&both)?.axes.contains_key(axis.name())
    };
    Ok(is_named || left_out(&folder.join(controller_csv(axis))))
}

/// Whether the cycles of a controller, `NAME-timing.csv`, are of this run; says so where there are some that are not.
pub(super) fn has_process(folder: &Path, controller: Process) -> bool {
    folder.join(controller.report()).exists() || left_out(&folder.join(controller.timing()))
}

/// Says that a table is left out, if it is there; false.
fn left_out(table: &Path) -> bool {
    if table.exists() {
        warn(&format!("{}: left out, as no report of a controller of this run names it", table.display()));
    }
    false
}
