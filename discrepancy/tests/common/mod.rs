//! Records that the plant makes for the tests, with whatever is hidden in it.

mod record;

use discrepancy::check::check;
use discrepancy::course::Course;
use discrepancy::records::{ReadOptions, read};
use plant::RigParameters;
use record::{STROKES_RAD_PER_S, measurement};

/// A record of the drive on the simulation's grid.
pub(crate) fn course(hidden: &RigParameters, seed: u64) -> Course {
    let text = measurement(hidden, seed, STROKES_RAD_PER_S);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("measurement.csv");
    std::fs::write(&file, text).expect("the folder is ours");
    let record = read(&file, &ReadOptions::default()).expect("a record");
    let rig = RigParameters::baseline();
    Course::of(&record, &check(&record, &rig), &rig).expect("both are whole")
}
