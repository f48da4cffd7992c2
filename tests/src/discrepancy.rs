//! `discrepancy` as a program, on the shipped rig file.

use crate::binaries::{Program, workspace};
use crate::process::{Ended, PATIENCE};
use std::ffi::OsStr;
use std::path::PathBuf;

/// The shipped rig file.
pub fn rig() -> PathBuf {
    workspace().join("plant/rig.toml")
}

/// Runs the program to its end.
pub fn discrepancy(arguments: &[&dyn AsRef<OsStr>]) -> Ended {
    Program::Discrepancy.start(arguments).wait_within(2 * PATIENCE)
}
