//! One reader of records, for study and workflow alike.
//!
//! ```text
//!   measurement.csv ───────────────┐
//!   bus.log (candump -L) ──────────┼──► Record: time and channels in SI, absent values as None,
//!   foreign CSV + mapping (TOML) ──┘            set-up of the rig, file and line of each row, warnings
//! ```
//!
//! A record holds measurements only: a missing sample is `None`, never NaN and never interpolated. The check decides whether it
//! can be used; warnings of the reader are in [`Record::warnings`].
//!
//! Forms and keys: `discrepancy/docs/records.md`. Sources: rig-model.md, Measurement file; bus.md, Time and Frames.

#![warn(missing_docs)] // an interface of other crates

pub mod channel;
pub mod error;
pub mod mapping;

mod acting;
mod bus_log;
mod calendar;
mod columns;
mod cycles;
mod foreign;
mod measurement;
mod table;

pub use calendar::CalendarTime;
pub use channel::{Channel, Quantity, Signal};
pub use columns::{ColumnOptions, Columns, UnitRow, read_columns};
pub use error::ReadError;
pub use mapping::Mapping;
pub use table::cells;

use plant::Axis;
use std::path::{Path, PathBuf};

/// How a record is read; the default reads everything that rig and rehearsal write.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Treatment of unknown columns.
    pub unknown: UnlistedColumns,
    /// The mapping file of a foreign CSV.
    pub mapping: Option<PathBuf>,
    /// Who wrote the log, if it is one.
    pub logged_by: LoggedBy,
}

/// Treatment of columns and comments that rig-model.md does not list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UnlistedColumns {
    /// Left out, with a warning.
    #[default]
    Ignored,
    /// An error: the blind study takes nothing that could tell what is hidden.
    Refused,
}

/// Who wrote a log: whether a frame that is not in it did not reach the rig either.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LoggedBy {
    /// The rig, as `bus.log` of a run: what is not there did not come, and the last command went on acting.
    #[default]
    Rig,
    /// Another peer: where the counter of commands jumps, nobody knows which one acted.
    Listener,
}

/// Which kind of file a record comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `measurement.csv`.
    Measurement,
    /// `bus.log`.
    BusLog,
    /// A table that a mapping explains.
    Foreign,
}

/// How the rig was set up, from the record's comments or its mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigSetup {
    /// Whether the load's eye sat in the carriage.
    pub linked: bool,
    /// Weights on the carriage, kg.
    pub added_mass_kg: f64,
}

/// What a reader noticed and did not refuse.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Line in the file, from 1; `None` when it is about the file as a whole.
    pub line: Option<u64>,
    /// The warning and its consequence.
    pub text: String,
}

/// A record: rows of samples in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The file that was read.
    pub file: PathBuf,
    /// Which kind of file it is.
    pub form: Form,
    /// How the rig was set up.
    pub setup: RigSetup,
    /// The period in which samples were meant to be taken, s; `None` for a record that has none.
    pub nominal_period_s: Option<f64>,
    time_s: Vec<f64>,
    lines: Vec<u64>,
    columns: Vec<Option<Vec<Option<f64>>>>,
    /// What the reader noticed, in the order of the file.
    pub warnings: Vec<Warning>,
}

/// Reads a record: a foreign one with `options.mapping`, a log when the file's name ends with `.log`, else a `measurement.csv`.
///
/// # Errors
/// [`ReadError`] with file, line, column, value and what is allowed.
pub fn read(file: &Path, options: &ReadOptions) -> Result<Record, ReadError> {
    if let Some(path) = &options.mapping {
        return foreign::read(file, &Mapping::read(path)?);
    }
    if file.extension().is_some_and(|extension| extension == "log") {
        return bus_log::read(file, options.logged_by);
    }
    measurement::read(file, options.unknown)
}

/// Reads a foreign CSV with a mapping that is already there.
///
/// # Errors
/// [`ReadError`] with file, line, column, value and what is allowed.
pub fn read_mapped(file: &Path, mapping: &Mapping) -> Result<Record, ReadError> {
    foreign::read(file, mapping)
}

impl Record {
    fn new(file: &Path, form: Form, setup: RigSetup) -> Self {
        Self {
            file: file.into(),
            form,
            setup,
            nominal_period_s: None,
            time_s: Vec::new(),
            lines: Vec::new(),
            columns: vec![None; Channel::COUNT],
            warnings: Vec::new(),
        }
    }

    /// Gives the record a channel; rows pushed from now on have a place for it.
    fn add(&mut self, channel: Channel) {
        self.columns[channel.index()] = Some(Vec::new());
    }

    fn push_row(&mut self, line: u64, time_s: f64) {
        self.lines.push(line);
        self.time_s.push(time_s);
        self.columns.iter_mut().flatten().for_each(|column| column.push(None));
    }

    /// Puts a value into the last row.
    fn put(&mut self, channel: Channel, value: f64) {
        let last = self.columns[channel.index()].as_mut().and_then(|column| column.last_mut());
        *last.expect("the channel was added and a row pushed") = Some(value);
    }

    fn warn_cut(&mut self, line: Option<u64>) {
        if line.is_some() {
            self.warn(line, "the last line is cut, and left out: its writer was killed");
        }
    }

    fn warn(&mut self, line: impl Into<Option<u64>>, text: impl Into<String>) {
        self.warnings.push(Warning { line: line.into(), text: text.into() });
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Time of each row, s, as recorded: with holes, and unsorted where the file is.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Line of the file that a row comes from, from 1. In a log that of its sensors, or of the last frame before where none came.
    pub fn line(&self, row: usize) -> u64 {
        self.lines[row]
    }

    /// The values of a channel, one for each row, `None` where there is none; `None` when the record lacks the channel.
    pub fn channel(&self, channel: Channel) -> Option<&[Option<f64>]> {
        self.columns[channel.index()].as_deref()
    }

    /// The value of a channel in a row, in SI; `None` where either has none.
    pub fn value(&self, channel: Channel, row: usize) -> Option<f64> {
        self.channel(channel)?.get(row).copied().flatten()
    }

    /// The channels that it has, in the order of [`Channel::ALL`].
    pub fn channels(&self) -> impl Iterator<Item = Channel> {
        Channel::ALL.into_iter().filter(|channel| self.channel(*channel).is_some())
    }

    /// Whether the record has any channel of the axis.
    pub fn has_axis(&self, axis: Axis) -> bool {
        self.channels().any(|channel| matches!(channel, Channel::Of(channel_axis, _) if channel_axis == axis))
    }
}
