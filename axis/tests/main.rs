//! The integration tests of `axis-control`, one executable.

mod axis_properties;
mod axis_way_back;
mod skipped_cycles;

use axis_control::axis::AxisController;
use axis_control::setup::{FileArguments, Inputs, Mode};
use clap::Parser;
use plant::Axis;
use std::path::{Path, PathBuf};

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    files: FileArguments,
}

/// A file of the repository, from its root.
pub(crate) fn shipped(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The controller of `axis` in simulated time for an experiment with the shipped rig and programs, and with further arguments.
pub(crate) fn controller(
    axis: Axis,
    experiment: &Path,
    partner_needed: bool,
    further: &[String],
) -> AxisController {
    let files = [("--rig", shipped("plant/rig.toml")), ("--experiment", experiment.into())];
    let files = files.map(|(key, path)| [key.to_owned(), path.display().to_string()]);
    let line = std::iter::once("axis").chain(files.as_flattened().iter().chain(further).map(String::as_str));
    let mode = Mode { partner_needed, real_time: false, forever: false };
    Inputs::read(&Line::parse_from(line).files).unwrap().controller(axis, mode).unwrap()
}
