//! A record that the plant makes, on its grid.

use crate::record::{STROKES_RAD_PER_S, measurement};
use discrepancy::gridded_record::GriddedRecord;
use discrepancy::workflow::{Task, open};
use plant::RigParameters;

/// Strokes of a rig, read beside the rig file that is thought to be its.
pub(crate) fn gridded(hidden: &RigParameters, rig: &RigParameters) -> GriddedRecord {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("train.csv");
    std::fs::write(&path, measurement(hidden, 11, STROKES_RAD_PER_S)).expect("the folder is ours");
    open(&path, &Task::default().options, rig).expect("readable").gridded.expect("a good record")
}
