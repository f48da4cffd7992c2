//! Counts of the host of the embedded bus: frames, and every loss by identifier.
//!
//! Counting is on the way of a frame, so it keeps identifiers as numbers; they become names when a report is written.

use crate::can::CanFrame;
use crate::wire_time::WireTimeReport;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Frames by identifier. Written by the names that candump gives identifiers, `110`; what is no plain data frame by all
/// eight digits, the kernel's flags included.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FramesById(BTreeMap<u32, u64>);

impl FramesById {
    /// Counts one frame.
    pub fn count(&mut self, frame: &CanFrame) {
        *self.0.entry(frame.raw_id()).or_default() += 1;
    }

    /// Adds what `later` counted beyond `earlier`.
    pub(super) fn add_difference(&mut self, later: &Self, earlier: &Self) {
        for (raw_id, frames) in &later.0 {
            let more = frames - earlier.0.get(raw_id).copied().unwrap_or(0);
            if more > 0 {
                *self.0.entry(*raw_id).or_default() += more;
            }
        }
    }

    /// Whether nothing was counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Frames of all identifiers.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }

    /// Frames of each identifier, by its name.
    #[must_use]
    pub fn by_name(&self) -> BTreeMap<String, u64> {
        self.0.iter().map(|(raw_id, frames)| (Self::name_of(*raw_id), *frames)).collect()
    }

    /// Name of an identifier with the kernel's flags.
    #[must_use]
    pub fn name_of(raw_id: u32) -> String {
        if raw_id < 0x800 { format!("{raw_id:03X}") } else { format!("{raw_id:08X}") }
    }
}

impl Serialize for FramesById {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.by_name().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for FramesById {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let by_name = BTreeMap::<String, u64>::deserialize(deserializer)?;
        let parsed =
            by_name.iter().map(|(name, frames)| Some((u32::from_str_radix(name, 16).ok()?, *frames)));
        parsed
            .collect::<Option<_>>()
            .map(Self)
            .ok_or_else(|| D::Error::custom("an identifier is hexadecimal"))
    }
}

/// Counts of the host for one peer. To the frame, for each identifier of others:
///
/// ```text
///   on_wire = before_it_came + delivered + dropped_at_queue + missed_in_bus_off + after_it_left
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct PeerReport {
    /// Name in the barrier, else the process number.
    pub name: String,
    /// Frames taken from the peer.
    pub frames_received: u64,
    /// The same, by identifier.
    pub received_by_id: FramesById,
    /// Frames of the others that passed the wire before the peer was there.
    pub before_it_came: FramesById,
    /// Frames that the peer's queue took; what is in it can be received, also when the host has gone.
    pub delivered: FramesById,
    /// Frames that its full queue did not take, by identifier.
    pub dropped_at_queue: FramesById,
    /// Frames of the others that passed a modelled wire while the peer was off the bus.
    pub missed_in_bus_off: FramesById,
    /// Frames of the others that passed the wire when the peer took no more, or had gone.
    pub after_it_left: FramesById,
}

/// Counts of the host.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct HostReport {
    /// Frames that reached the wire, lost ones included.
    pub frames: u64,
    /// Frames that the wire lost on purpose, by identifier.
    pub injected_loss: FramesById,
    /// Frames that passed the wire and were for all who were there, by identifier.
    pub on_wire: FramesById,
    /// Packets that were neither frame nor control packet.
    pub malformed: u64,
    /// Frames that met a fault of the wire, by its name and by identifier; those of a babbling node are those that it said.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub faults: BTreeMap<Cow<'static, str>, FramesById>,
    /// The peers in the order in which they came.
    pub peers: Vec<PeerReport>,
    /// Counts of a wire that keeps time; left out where it takes none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wire_time: Option<WireTimeReport>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{EXTENDED_FLAG, REMOTE_FLAG};

    #[test]
    fn identifiers_are_written_by_name_and_in_the_names_order() {
        let mut frames = FramesById::default();
        for raw_id in [0x7FF, REMOTE_FLAG | 0x110, 0x11, EXTENDED_FLAG | 0x110, 0x11] {
            frames.count(&CanFrame::from_raw(raw_id, &[]));
        }
        let report = HostReport { frames: 5, injected_loss: frames, ..HostReport::default() };
        assert_eq!(
            serde_json::to_string(&report).unwrap(),
            r#"{"frames":5,"injected_loss":{"011":2,"40000110":1,"7FF":1,"80000110":1},"on_wire":{},"malformed":0,"peers":[]}"#
        );
        let text = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<HostReport>(&text).unwrap(), report, "read as it was written");
    }
}
