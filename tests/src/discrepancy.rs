//! `discrepancy` as a program, on the shipped rig file.

use crate::binaries::{Build, Program, executable, workspace};
use crate::process::{Ended, PATIENCE, Running};
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;

/// The shipped rig file.
#[must_use]
pub fn rig() -> PathBuf {
    workspace().join("plant/rig.toml")
}

/// Runs the program to its end.
///
/// # Panics
/// When it does not end in time.
#[must_use]
pub fn discrepancy(arguments: &[&dyn AsRef<OsStr>]) -> Ended {
    let mut command = Command::new(executable(Program::Discrepancy, Build::Shipped));
    command.args(arguments.iter().map(|argument| argument.as_ref()));
    Running::start("discrepancy", &mut command).wait_within(2 * PATIENCE)
}
