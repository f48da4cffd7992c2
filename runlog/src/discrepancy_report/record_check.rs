//! Whether records can be used, and with what.

use serde::Serialize;
use std::collections::BTreeMap;

/// Whether the workflow can use a record, and what is odd about it.
#[derive(Clone, Debug, Serialize)]
pub struct RecordCheck {
    /// The record as it was given.
    pub file: String,
    /// Whether the workflow can use it.
    pub usable: bool,
    /// Number of samples.
    pub rows: usize,
    /// Last time minus first, s.
    pub length_s: f64,
    /// What is odd about it.
    pub findings: Vec<Finding>,
    /// Noise and quantum of each channel, estimated from the record.
    pub channels: BTreeMap<String, ChannelCheck>,
}

/// What is odd about a record.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Finding {
    /// gap, repeated-time, jumping-time, clipped, stuck, wrong-unit, swapped-pressures, force-sign, lost-samples, …
    pub kind: String,
    /// Column, if it is about one.
    pub column: Option<String>,
    /// First line of the file that it is about.
    pub line: Option<u64>,
    /// Whether it makes the record unusable; otherwise it is tolerated, or the samples are left out.
    pub fatal: bool,
    /// What, where, and what to do.
    pub text: String,
}

/// Noise, resolution and lost samples of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelCheck {
    /// Standard deviation of its noise, in SI; null when unknown.
    pub noise: Option<f64>,
    /// Smallest step between its values, in SI; null when it has none.
    pub quantum: Option<f64>,
    /// Share of samples that cannot be used.
    pub unusable: f64,
}
