//! `discrepancy` as a program, on the shipped rig file.

use crate::binaries::{Program, workspace};
use crate::process::{CompletedProcess, PATIENCE};
use std::ffi::OsStr;
use std::path::PathBuf;

pub fn rig() -> PathBuf {
    workspace().join("plant/rig.toml")
}

pub fn discrepancy(arguments: &[&dyn AsRef<OsStr>]) -> CompletedProcess {
    Program::Discrepancy.start(arguments).wait_within(2 * PATIENCE)
}
