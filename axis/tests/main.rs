//! The integration tests of `axis-control`, one executable.

mod axis_properties;
mod axis_way_back;
mod skipped_cycles;

use axis_control::setup::FileArguments;
use clap::Parser;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    files: FileArguments,
}

/// The files that a command line names.
pub(crate) fn files(arguments: &[impl AsRef<str>]) -> FileArguments {
    Line::parse_from(["axis"].into_iter().chain(arguments.iter().map(AsRef::as_ref))).files
}
