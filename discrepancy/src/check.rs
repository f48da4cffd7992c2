//! Whether a record can be used: gaps, jumping time, clipping, stuck channels, units that cannot be, noise and quantum of each
//! channel.
//!
//! ```text
//!   record ──► time ──► grid ──► range, units ──► stuck ──► noise, quantum ──► signs
//!                │                  │               │                            │
//!                └── findings with line, column and what to do; samples that are left out ──► Checked
//! ```
//!
//! A finding is fatal when the record as a whole would mislead: a channel in another unit, two channels swapped, a sign that is
//! wrong, time that goes backwards. Local defects are left out and reported. Effects of the catalogue are no findings: the
//! workflow names a sensor that is off by a few per cent, and the check does not refuse it.
//!
//! Kinds and their limits: `discrepancy/docs/checks.md`.

mod grid;
mod noise;
mod notes;
mod range;
mod signs;
mod stuck;
mod time;
mod units;

use crate::report::{ChannelCheck, Finding, RecordCheck};
use grid::Grid;
use model_fit::quantum;
use notes::Notes;
use plant::{Axis, RigParameters};
use records::{Channel, Record, Signal};

/// Kind of the finding that an axis stood at the end of its stroke all the time.
pub(crate) const PARKED: &str = "parked";

/// A record's check with what follows for each of its samples.
#[derive(Clone, Debug)]
pub struct Checked {
    /// Findings, and noise, quantum and share of unusable samples of each channel.
    pub report: RecordCheck,
    /// For each channel (by [`Channel::index`]) and row whether the sample can be used; empty for a channel without bad ones.
    pub(crate) unusable: Vec<Vec<bool>>,
}

impl Checked {
    /// Whether no finding leaves the sample out; true also where the record has none.
    pub fn is_usable(&self, channel: Channel, row: usize) -> bool {
        !self.unusable[channel.index()].get(row).copied().unwrap_or(false)
    }

    /// Fatal findings, one line each.
    pub(crate) fn why_not(&self) -> String {
        let fatal = self.report.findings.iter().filter(|finding| finding.fatal);
        fatal.map(|finding| finding.text.as_str()).collect::<Vec<_>>().join("\n")
    }

    /// A record that can be read and still cannot be simulated.
    pub(crate) fn refuse(&mut self, column: Option<&str>, text: String) {
        self.report.usable = false;
        let (kind, column) = ("not-simulated".into(), column.map(str::to_owned));
        self.report.findings.push(Finding { kind, column, fatal: true, text, ..Finding::default() });
    }

    /// Standard deviation of a channel's noise, rounding included; `None` when unknown.
    pub fn noise(&self, channel: Channel) -> Option<f64> {
        self.report.channels.get(&channel.column()).and_then(|check| check.noise)
    }

    /// Whether the axis was parked at the end of its stroke, its position sensor at the limit.
    pub fn is_parked(&self, axis: Axis) -> bool {
        let column = Channel::Of(axis, Signal::Position).column();
        self.report
            .findings
            .iter()
            .any(|finding| finding.kind == PARKED && finding.column.as_ref() == Some(&column))
    }
}

/// Checks a record against the sensors and limits of a rig file; never fails: [`RecordCheck::usable`] says whether it is fit.
pub fn check(record: &Record, rig: &RigParameters) -> Checked {
    let mut notes = Notes::new(record);
    for warning in &record.warnings {
        let (kind, line, text) = ("reader".into(), warning.line, warning.text.clone());
        notes.findings.push(Finding { kind, line, text, ..Finding::default() });
    }
    time::check(&mut notes);
    let grid = Grid::of(record, &notes);
    units::check(&mut notes, rig);
    range::check(&mut notes, rig, &grid);
    stuck::check(&mut notes, rig, &grid);
    let channels =
        record.channels().map(|channel| (channel.column(), channel_check(channel, &notes, &grid))).collect();
    // Signs are tested only where units are right.
    if !notes.is_fatal() {
        signs::check(&mut notes, rig, &grid);
    }
    let time_s = record.time_s();
    let report = RecordCheck {
        file: record.file.display().to_string(),
        usable: !notes.is_fatal(),
        rows: record.len(),
        length_s: time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0),
        findings: notes.findings,
        channels,
    };
    Checked { report, unusable: notes.unusable }
}

/// Noise, quantum and share of bad samples of a channel.
fn channel_check(channel: Channel, notes: &Notes, grid: &Grid) -> ChannelCheck {
    let values = grid.series(notes, channel);
    let present: Vec<f64> = values.iter().flatten().copied().collect();
    // A command has steps and no noise.
    let noise = if matches!(channel, Channel::Of(_, Signal::Valve)) { None } else { noise::of(&values) };
    ChannelCheck { noise, quantum: quantum::of(&present), unusable: notes.share_unusable(channel) }
}
