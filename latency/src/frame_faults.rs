//! Frames that were lost, late, came twice or made no sense, as the reports of rig and controllers count them.
//!
//! [`Summary`](runlog::summary::Summary) and [`ControllerReport`](runlog::controller_report::ControllerReport) make a 0 of a
//! count that an older file does not have. These views of the same keys tell both apart.

use super::model::FrameFaultCounts;
use serde::Deserialize;
use std::collections::BTreeMap;

/// View of `summary.json`.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct FramesAtRig {
    frames_lost_at_rig: Option<u64>,
    frames_late: Option<u64>,
    frames_duplicate: Option<u64>,
    frames_malformed: Option<u64>,
}

/// View of `controller*.json`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct FramesAtController {
    axes: Option<BTreeMap<String, FramesOfAxis>>,
    frames_late: Option<u64>,
    frames_duplicate: Option<u64>,
    /// Frames that are not as `rig.dbc` says.
    frames_ignored: Option<MalformedFrames>,
    /// Frames that are none.
    bus: Option<MalformedFrames>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct FramesOfAxis {
    sensors_lost: Option<LostSensors>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum LostSensors {
    OfAxis(u64),
    /// Earlier versions wrote a count for each axis.
    OfEachAxis(BTreeMap<String, u64>),
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
struct MalformedFrames {
    malformed: Option<u64>,
}

impl From<FramesAtRig> for FrameFaultCounts {
    fn from(frames: FramesAtRig) -> Self {
        Self {
            lost: frames.frames_lost_at_rig,
            late: frames.frames_late,
            duplicate: frames.frames_duplicate,
            malformed: frames.frames_malformed,
        }
    }
}

impl From<FramesAtController> for FrameFaultCounts {
    fn from(frames: FramesAtController) -> Self {
        let axes = frames.axes.unwrap_or_default();
        let lost = axes.values().filter_map(|axis| axis.sensors_lost.as_ref()).map(LostSensors::count);
        let malformed = [frames.frames_ignored, frames.bus].into_iter().flatten();
        Self {
            lost: sum(lost),
            late: frames.frames_late,
            duplicate: frames.frames_duplicate,
            malformed: sum(malformed.map(|frames| frames.malformed)),
        }
    }
}

impl LostSensors {
    fn count(&self) -> Option<u64> {
        match self {
            Self::OfAxis(count) => Some(*count),
            Self::OfEachAxis(counts) => sum(counts.values().map(|count| Some(*count))),
        }
    }
}

/// The counts of several receivers together.
impl std::iter::Sum for FrameFaultCounts {
    fn sum<I: Iterator<Item = Self>>(receivers: I) -> Self {
        receivers.fold(Self::default(), |sum_so_far, more| Self {
            lost: sum([sum_so_far.lost, more.lost]),
            late: sum([sum_so_far.late, more.late]),
            duplicate: sum([sum_so_far.duplicate, more.duplicate]),
            malformed: sum([sum_so_far.malformed, more.malformed]),
        })
    }
}

/// The sum of the counts that are known; `None` when none is.
fn sum(counts: impl IntoIterator<Item = Option<u64>>) -> Option<u64> {
    counts.into_iter().flatten().reduce(u64::saturating_add)
}
