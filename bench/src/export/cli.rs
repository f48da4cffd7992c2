//! The export's command line.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What a log becomes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Decoded signals, a column each, in SI; a row for each time stamp.
    Csv,
    /// Decoded signals with their units, a group for each frame; read by asammdf and others.
    Mdf4,
    /// Everything of a run, tables and bus, as JSON with schemas; read by Foxglove and PlotJuggler.
    Mcap,
    /// Cycles with their stages, frames and faults on one time axis, as Chrome's JSON; read by Perfetto.
    Trace,
    /// Frames as Vector's text log; written by python-can.
    Asc,
    /// Frames as Vector's binary log; written by python-can.
    Blf,
}

/// What is exported, into what.
#[derive(Args, Debug)]
pub(crate) struct ExportArguments {
    /// A run's folder, or a log of 'candump -L'.
    #[arg(value_name = "RUN|LOG")]
    pub source: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    pub to: Format,
    /// The file to write.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// With csv: a row every so many milliseconds instead, holding what was seen last of each signal.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub every_ms: Option<u32>,
    /// Take what was seen at this interface alone.
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// With asc and blf: the python that has python-can 4 [default: what AIRBENCH_PYTHON says, else python3].
    #[arg(long, value_name = "PROGRAM")]
    pub python: Option<PathBuf>,
}
