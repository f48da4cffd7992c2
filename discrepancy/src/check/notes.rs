//! Findings of a check, and samples that are left out.

use crate::report::Finding;
use plant::Axis;
use records::{Channel, Record, Signal};

#[derive(Debug)]
pub(super) struct Notes<'a> {
    pub(super) record: &'a Record,
    pub(super) findings: Vec<Finding>,
    pub(super) unusable: Vec<Vec<bool>>,
}

impl<'a> Notes<'a> {
    pub(super) fn new(record: &'a Record) -> Self {
        Notes { record, findings: Vec::new(), unusable: vec![Vec::new(); Channel::COUNT] }
    }

    /// Adds a finding of a channel from its first row on; its text is prefixed by file, line and column.
    pub(super) fn add(&mut self, kind: &str, channel: Channel, row: Option<usize>, fatal: bool, text: &str) {
        self.push(kind, channel.column(), row, fatal, &format!("{channel}: {text}"));
    }

    pub(super) fn add_time(&mut self, kind: &str, row: Option<usize>, fatal: bool, text: &str) {
        self.push(kind, "time_s".into(), row, fatal, text);
    }

    fn push(&mut self, kind: &str, column: String, row: Option<usize>, fatal: bool, text: &str) {
        let line = row.map(|row| self.record.line(row));
        let file = self.record.file.display();
        let place = line.map_or_else(|| format!("{file}"), |line| format!("{file}:{line}"));
        let (kind, column, text) = (kind.into(), Some(column), format!("{place}: {text}"));
        self.findings.push(Finding { kind, column, line, fatal, text });
    }

    pub(super) fn leave_out(&mut self, channel: Channel, row: usize) {
        let mask = &mut self.unusable[channel.index()];
        if mask.is_empty() {
            mask.resize(self.record.len(), false);
        }
        mask[row] = true;
    }

    /// A sample, if it is there and not left out.
    pub(super) fn value(&self, channel: Channel, row: usize) -> Option<f64> {
        self.record.value(channel, row).filter(|_| !self.is_left_out(channel, row))
    }

    pub(super) fn is_left_out(&self, channel: Channel, row: usize) -> bool {
        self.unusable[channel.index()].get(row).copied().unwrap_or(false)
    }

    /// Share of a channel's samples that cannot be used, absent ones included.
    pub(super) fn share_unusable(&self, channel: Channel) -> f64 {
        let rows = self.record.len();
        let bad = (0..rows).filter(|row| self.value(channel, *row).is_none()).count();
        bad as f64 / rows.max(1) as f64
    }

    /// Channels of which nothing fatal was found yet: in a wrong unit everything would seem clipped.
    pub(super) fn open_channels(&self) -> Vec<Channel> {
        let fatal = |column: &str| {
            self.findings.iter().any(|finding| finding.fatal && finding.column.as_deref() == Some(column))
        };
        self.record.channels().filter(|channel| !fatal(&channel.column())).collect()
    }

    pub(super) fn is_fatal(&self) -> bool {
        self.findings.iter().any(|finding| finding.fatal)
    }

    /// Whether the axis is one of the rig's, with a valve: foreign stages and single chambers are not held against the rig's
    /// numbers.
    pub(super) fn is_of_rig(&self, axis: Axis) -> bool {
        self.record.channel(Channel::Of(axis, Signal::Valve)).is_some()
    }
}
