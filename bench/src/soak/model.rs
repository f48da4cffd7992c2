//! `soak.json`: all results of a soak, rewritten after each segment; the other result files are derived from it.

use super::account::Row;
use super::memory::Memory;
use super::merged::StoredDistribution;
use super::plan::SegmentSpec;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Version of `soak.json`; goes up when a key changes its meaning or goes.
pub(crate) const SOAK_SCHEMA_VERSION: u32 = 1;

/// A soak, over all its starts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Soak {
    pub schema_version: u32,
    /// Whether its results so far may be trusted.
    pub trusted: bool,
    /// The verdict in one line, with its reasons.
    pub verdict: String,
    /// First start, s since 1970.
    pub started_unix_s: f64,
    /// Time of this write, s since 1970.
    pub updated_unix_s: f64,
    /// Planned length, s.
    pub planned_s: f64,
    /// Time soaked in all starts, s.
    pub elapsed_s: f64,
    /// Why the last start ended; null while it runs, or when it was killed.
    pub ended_because: Option<String>,
    pub settings: Settings,
    /// Why the requested load generator is missing; null otherwise.
    pub load_missing_because: Option<String>,
    /// The machine, from the emulator's first `run.json`.
    pub machine: Value,
    /// Sums over all segments.
    pub totals: Totals,
    /// Distributions of all segments together, by tag.
    pub distributions: BTreeMap<String, StoredDistribution>,
    pub folder_bytes: u64,
    /// Resident memory of the soak process after the last segment.
    pub own_rss_kib: u64,
    pub segments: Vec<Segment>,
}

/// Settings that must not change between starts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    pub bus: String,
    pub experiments: Vec<String>,
    /// Length of a segment including start and end, s.
    pub segment_s: f64,
    /// Command line of the load generator; null for none.
    pub load: Option<String>,
    /// Probability of loss in the segments with loss; null without any.
    pub loss: Option<f64>,
    pub emulator_options: String,
    pub controller_options: String,
    pub rig: String,
    /// Whether bounds on position errors are judged.
    pub positions_judged: bool,
}

impl Settings {
    /// Names of the differing settings.
    pub(crate) fn differences(&self, other: &Self) -> Vec<String> {
        let tables = [self, other].map(|settings| serde_json::to_value(settings).unwrap_or_default());
        let keys = tables[0].as_object().into_iter().flatten().map(|(key, _)| key);
        keys.filter(|key| tables[0][*key] != tables[1][*key])
            .map(|key| format!("{key} was {}, is {}", tables[0][key], tables[1][key]))
            .collect()
    }
}

/// Sums over all segments that finished.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Totals {
    /// Segments that were accounted for.
    pub segments: usize,
    /// Segments with a failed check.
    pub failed: usize,
    /// Segments without results, because the soak was killed.
    pub unfinished: usize,
    /// Cycles of the rig.
    pub cycles: u64,
    /// Cycles computed late and not sent.
    pub skipped: u64,
    /// Commands that arrived too old or expired.
    pub stale_commands: u64,
    /// Frames sent, one for each sender.
    pub frames_sent: u64,
    /// Frames that should have been received, one for each receiver.
    pub frames_due: u64,
    /// Frames received, one for each receiver.
    pub frames_received: u64,
    /// Frames lost by injection, one for each receiver.
    pub lost_on_wire: u64,
    /// Frames lost at receivers' queues.
    pub lost_at_queue: u64,
    /// Frames that passed while a receiver was absent.
    pub not_there: u64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Segment {
    pub spec: SegmentSpec,
    /// Its folder below the soak's.
    pub folder: String,
    /// Start, s since 1970.
    pub started_unix_s: f64,
    /// Length including start and end, s.
    pub length_s: f64,
    /// Planned run time of the rig, s.
    pub rig_s: f64,
    /// False when the soak was killed during the segment.
    pub finished: bool,
    pub ended: String,
    /// Command line of the load generator that ran beside it.
    pub load: Option<String>,
    pub checks: Vec<Check>,
    pub figures: Figures,
    /// Each identifier at each receiver.
    pub account: Vec<Row>,
    pub memory: BTreeMap<String, Memory>,
    /// Bytes of its folder at its end.
    pub file_bytes: u64,
    /// Bytes per second of run time of the rig.
    pub file_bytes_per_s: u64,
    /// Whether its large files were removed.
    pub rotated: bool,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Check {
    pub name: String,
    pub result: CheckResult,
    /// Findings, in a line or more.
    pub detail: String,
}

impl Check {
    pub(crate) fn new(name: &str, result: CheckResult, detail: &str) -> Self {
        Self { name: name.into(), result, detail: detail.into() }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum CheckResult {
    Passed,
    Failed,
    /// Nothing to judge.
    Skipped,
}

/// Figures of a segment's run; null where no report has them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Figures {
    /// Cycles of the rig.
    pub cycles: Option<u64>,
    /// Cycles computed late and not sent.
    pub skipped: Option<u64>,
    /// Wake-ups that missed at least one cycle.
    pub overruns: Option<u64>,
    /// Commands that arrived too old or expired.
    pub stale_commands: Option<u64>,
    /// Frames sent, one for each sender.
    pub frames_sent: u64,
    /// Largest error while the set-point moved, m.
    pub position_error_dynamic_m: Option<f64>,
    /// Largest mean error at rest, m.
    pub position_error_static_m: Option<f64>,
    /// Repetitions of the experiment that were completed.
    pub repetitions: Option<u64>,
}

impl Segment {
    /// A segment that was interrupted by the death of the soak.
    pub(crate) fn cut_off(number: u32, experiment: &str, folder: &str) -> Self {
        Self {
            spec: SegmentSpec { number, experiment: experiment.into(), ..SegmentSpec::default() },
            folder: folder.into(),
            ended: "the soak was killed while it ran; its rows stay in its folder".into(),
            ..Self::default()
        }
    }

    /// Whether a check failed.
    pub(crate) fn failed(&self) -> bool {
        self.checks.iter().any(|check| check.result == CheckResult::Failed)
    }

    pub(crate) fn broken(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| check.result == CheckResult::Failed)
    }
}

impl Totals {
    pub(crate) fn of(segments: &[Segment]) -> Self {
        let mut totals = Self::default();
        for segment in segments {
            if !segment.finished {
                totals.unfinished += 1;
                continue;
            }
            totals.segments += 1;
            totals.failed += usize::from(segment.failed());
            let figures = &segment.figures;
            totals.cycles += figures.cycles.unwrap_or(0);
            totals.skipped += figures.skipped.unwrap_or(0);
            totals.stale_commands += figures.stale_commands.unwrap_or(0);
            totals.frames_sent += figures.frames_sent;
            for row in &segment.account {
                totals.frames_due += row.sent;
                totals.frames_received += row.received;
                totals.lost_on_wire += row.lost_on_wire;
                totals.lost_at_queue += row.lost_at_queue;
                totals.not_there += row.before_it_came + row.after_it_left;
            }
        }
        totals
    }
}
