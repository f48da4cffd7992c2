//! What a modelled wire counted: response times by identifier on the model's own clock, load, errors, and what became of each
//! node.

use crate::bus::host::FramesById;
use crate::can::CanFrame;
use crate::frames::MessageSpec;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Time from entering a node's queue to the end of the transmission, intermission included, in ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ResponseReport {
    /// Shortest.
    pub min: u64,
    /// Their mean, ns.
    pub mean: u64,
    /// Longest.
    pub max: u64,
}

/// How frames of one identifier came: what a bound must allow for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ArrivalReport {
    /// Shortest time between two of them, ns; null when there were less than two.
    pub least_distance_ns: Option<u64>,
    /// How much earlier than a whole number of periods after an earlier one a frame came at most, ns; null without a period.
    pub release_jitter_ns: Option<u64>,
}

/// Figures of one identifier.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct IdentifierReport {
    /// Frames sent to their end.
    pub frames: u64,
    /// Response times.
    pub response_ns: ResponseReport,
    /// Longest time from entering the queue to the start of the transmission that succeeded, ns.
    pub queueing_ns_max: u64,
    /// Bits on the wire, intermission included: fewest, most.
    pub bits: [u32; 2],
    /// Attempts that were hit by an error; as many retransmissions, save the last before a bus-off.
    pub errors: u64,
    /// How they came.
    pub arrivals: ArrivalReport,
}

/// Figures of one node.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct NodeReport {
    /// Name in the barrier, else the process number; `rig` for one in the host.
    pub name: String,
    /// Frames sent to their end.
    pub sent: u64,
    /// Attempts that were hit by an error.
    pub errors: u64,
    /// Transmit error counter at the end, and its maximum.
    pub tec: [u32; 2],
    /// Receive error counter at the end, and its maximum.
    pub rec: [u32; 2],
    /// Times it became error-passive.
    pub error_passive: u64,
    /// Times it went off the bus.
    pub bus_offs: u64,
    /// Whether it is off now.
    pub bus_off: bool,
    /// Frames of others that it missed while it was off.
    pub missed_in_bus_off: u64,
    /// Frames that its full queue did not take, by identifier.
    pub dropped_at_full_queue: FramesById,
    /// Frames dropped because it was, or went, off the bus, by identifier.
    pub dropped_in_bus_off: FramesById,
}

/// How much later than the model says something was done, ns of the machine's clock. It changes nothing in the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Lateness {
    /// How often it was done.
    pub count: u64,
    /// Mean of all times it was done.
    pub mean_ns: u64,
    /// Most.
    pub max_ns: u64,
    #[serde(skip)]
    sum_ns: u64,
}

impl Lateness {
    /// Takes note of one.
    pub fn note(&mut self, late_ns: u64) {
        self.count += 1;
        self.sum_ns += late_ns;
        self.max_ns = self.max_ns.max(late_ns);
        self.mean_ns = self.sum_ns / self.count;
    }
}

/// What a modelled wire counted. All times but the two of [`Lateness`] are of the model's clock.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct WireTimeReport {
    /// Bit rate.
    pub bits_per_s: u32,
    /// From the first frame's entering to the last one's end, ns.
    pub observed_ns: u64,
    /// Time of it in which the wire was busy, ns.
    pub busy_ns: u64,
    /// Share of it, in parts per million.
    pub load_ppm: u64,
    /// Frames sent to their end.
    pub frames: u64,
    /// Attempts hit by an error.
    pub errors: u64,
    /// Bus-offs of all nodes.
    pub bus_offs: u64,
    /// Frames that reached the model after it had passed their time, and by how much.
    pub entered_late: Lateness,
    /// Frames handed to their receivers, and how much later than the model says. 0 in lockstep, which has no other clock.
    pub delivered_late: Lateness,
    /// By identifier, as candump names them.
    pub identifiers: BTreeMap<String, IdentifierReport>,
    /// The nodes, in the order of the host's peers; a rig in the host comes first.
    pub nodes: Vec<NodeReport>,
}

/// Running figures of one identifier.
#[derive(Default)]
pub(super) struct Identifier {
    report: IdentifierReport,
    sum_ns: u64,
    arrivals: Arrivals,
}

impl Identifier {
    pub(super) fn arrived(&mut self, frame: &CanFrame, now_ns: u64) {
        self.arrivals.note(frame, now_ns);
    }

    pub(super) fn failed(&mut self) {
        self.report.errors += 1;
    }

    /// A frame of `bits` bits, entered, begun and ended at these times.
    pub(super) fn sent(&mut self, bits: u32, [entered_ns, began_ns, ended_ns]: [u64; 3]) {
        let IdentifierReport { frames, response_ns, queueing_ns_max, bits: range, .. } = &mut self.report;
        let response = ended_ns - entered_ns;
        *frames += 1;
        self.sum_ns += response;
        let first = *frames == 1;
        *response_ns = ResponseReport {
            min: if first { response } else { response_ns.min.min(response) },
            mean: self.sum_ns / *frames,
            max: response_ns.max.max(response),
        };
        *queueing_ns_max = (*queueing_ns_max).max(began_ns - entered_ns);
        *range = if first { [bits, bits] } else { [range[0].min(bits), range[1].max(bits)] };
    }

    pub(super) fn report(&self) -> IdentifierReport {
        IdentifierReport { arrivals: self.arrivals.report, ..self.report.clone() }
    }
}

/// Watches how frames of one identifier come.
#[derive(Default)]
struct Arrivals {
    report: ArrivalReport,
    last_ns: Option<u64>,
    count: i64,
    /// Least of `count * period - time` so far.
    least_lead_ns: i64,
}

impl Arrivals {
    fn note(&mut self, frame: &CanFrame, now_ns: u64) {
        if let Some(last_ns) = self.last_ns.replace(now_ns) {
            let distance_ns = now_ns.saturating_sub(last_ns);
            let least = self.report.least_distance_ns.map_or(distance_ns, |least| least.min(distance_ns));
            self.report.least_distance_ns = Some(least);
        }
        let period_ms = frame.standard_id().and_then(MessageSpec::by_id).map_or(0, |spec| spec.cycle_time_ms);
        if period_ms == 0 {
            return;
        }
        let lead_ns = self.count * i64::from(period_ms) * 1_000_000 - now_ns as i64;
        self.least_lead_ns = if self.count == 0 { lead_ns } else { self.least_lead_ns.min(lead_ns) };
        self.count += 1;
        let jitter_ns = (lead_ns - self.least_lead_ns) as u64;
        self.report.release_jitter_ns = self.report.release_jitter_ns.max(Some(jitter_ns));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jitter_of(times_us: &[u64]) -> ArrivalReport {
        let mut arrivals = Arrivals::default();
        let frame = CanFrame::new(0x120, &[0; 8]);
        times_us.iter().for_each(|time_us| arrivals.note(&frame, time_us * 1000));
        arrivals.report
    }

    #[test]
    fn jitter_is_what_a_frame_comes_early_after_any_earlier_one() {
        let of = |least_us: u64, jitter_us: u64| ArrivalReport {
            least_distance_ns: Some(least_us * 1000),
            release_jitter_ns: Some(jitter_us * 1000),
        };
        assert_eq!(jitter_of(&[500, 1500, 2500]), of(1000, 0));
        // The second is late by 200, the third in time.
        assert_eq!(jitter_of(&[500, 1700, 2500]), of(800, 200));
        // A skipped period makes later ones late, not early.
        assert_eq!(jitter_of(&[500, 1500, 4500, 5400]), of(900, 100));
    }
}
