//! A node on the wire: its transmit queue, its error counters, and what becomes of it when they rise.
//!
//! ```text
//!                TEC or REC >= 128                 TEC >= 256
//!   error-active ───────────────► error-passive ─────────────► bus-off: sends and hears nothing
//!        ▲  ▲      both < 128            │                        │ restart time, then 128 times 11 recessive bits
//!        │  └────────────────────────────┘                        │
//!        └────────────────────────────────────────────────────────┘ both 0
//! ```
//!
//! A sender's TEC goes up by 8 with an error and down by 1 with a frame; the REC of everyone else by 1 and 1. What a node is
//! reported is an error frame as a SocketCAN interface gives it to its listeners.
//!
//! Source: ISO 11898-1, fault confinement; Linux `include/uapi/linux/can/error.h`.

use super::bits;
use crate::bus::host::FramesById;
use crate::can::{CanFrame, ERROR_FLAG};

/// Frames that wait in a node's queue at most; what comes on top is dropped and counted, as at a full transmit queue.
pub(super) const QUEUE_FRAMES: usize = 64;
/// Sequences of 11 recessive bits that a bus-off node waits for.
pub(super) const RECOVERY_SEQUENCES: u64 = 128;
/// Recessive bits of such a sequence.
pub(super) const RECOVERY_BITS: u32 = 11;

const PASSIVE_FROM: u32 = 128;
const BUS_OFF_FROM: u32 = 256;
/// Where a REC beyond 127 goes with a frame that was received well: 119 to 127.
const REC_AFTER_PASSIVE: u32 = 127;

/// Classes of error frames, and the second byte of those about a controller.
const CLASS_CONTROLLER: u32 = 0x004;
const CLASS_BUS_OFF: u32 = 0x040;
const CLASS_RESTARTED: u32 = 0x100;
const CLASS_COUNTERS: u32 = 0x200;
const RECEIVER_PASSIVE: u8 = 0x10;
const SENDER_PASSIVE: u8 = 0x20;
const ACTIVE_AGAIN: u8 = 0x40;

/// A frame that waits.
#[derive(Clone, Copy)]
pub(super) struct Queued {
    pub(super) rank: u32,
    /// Order of entering; one identifier is sent in it.
    pub(super) number: u64,
    pub(super) frame: CanFrame,
    pub(super) bits: u32,
    pub(super) entered_ns: u64,
}

impl Queued {
    pub(super) fn new(frame: CanFrame, number: u64, entered_ns: u64) -> Self {
        let rank = bits::arbitration_rank(&frame);
        Self { rank, number, frame, bits: bits::on_the_wire(&frame), entered_ns }
    }

    pub(super) fn key(&self) -> (u32, u64) {
        (self.rank, self.number)
    }
}

/// Progress of the recovery of a node from bus-off.
#[derive(Clone, Copy)]
pub(super) struct BusOffRecovery {
    /// Time from which recessive bits count, ns.
    pub(super) counts_from_ns: u64,
    /// Sequences of them still missing.
    pub(super) missing: u64,
}

/// Change of a node's error state, which is reported to the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ErrorStateChange {
    Passive,
    Active,
    BusOff,
    Restarted,
}

#[derive(Default)]
pub(super) struct Node {
    /// By [`Queued::key`].
    waiting: Vec<Queued>,
    pub(super) tec: u32,
    pub(super) rec: u32,
    pub(super) passive: bool,
    pub(super) bus_off: Option<BusOffRecovery>,
    /// Gone from the bus; what it had queued is still sent.
    pub(super) gone: bool,
    /// An error-passive sender does not begin before this.
    pub(super) suspended_until_ns: u64,
    pub(super) counters: NodeCounters,
}

#[derive(Clone, Default)]
pub(super) struct NodeCounters {
    pub(super) sent: u64,
    pub(super) errors: u64,
    pub(super) tec_max: u32,
    pub(super) rec_max: u32,
    pub(super) passives: u64,
    pub(super) bus_offs: u64,
    pub(super) missed: u64,
    pub(super) dropped_at_full_queue: FramesById,
    pub(super) dropped_in_bus_off: FramesById,
}

impl Node {
    /// Takes a frame into the queue; false when it was dropped.
    pub(super) fn enqueue(&mut self, queued: Queued) -> bool {
        if self.bus_off.is_some() {
            self.counters.dropped_in_bus_off.count(&queued.frame);
        } else if self.waiting.len() >= QUEUE_FRAMES {
            self.counters.dropped_at_full_queue.count(&queued.frame);
        } else {
            self.put(queued);
            return true;
        }
        false
    }

    /// Puts a frame where it belongs, one that was sent in vain too.
    pub(super) fn put(&mut self, queued: Queued) {
        let place = self.waiting.partition_point(|other| other.key() < queued.key());
        self.waiting.insert(place, queued);
    }

    /// The frame that the node would send next.
    pub(super) fn first(&self) -> Option<&Queued> {
        self.waiting.first()
    }

    pub(super) fn take_first(&mut self) -> Queued {
        self.waiting.remove(0)
    }

    /// Whether it takes part in what happens on the wire.
    pub(super) fn on_the_bus(&self) -> bool {
        self.bus_off.is_none() && !self.gone
    }

    pub(super) fn has_sent(&mut self) -> Option<ErrorStateChange> {
        self.counters.sent += 1;
        self.tec = self.tec.saturating_sub(1);
        self.confine()
    }

    pub(super) fn has_received(&mut self) -> Option<ErrorStateChange> {
        self.rec = if self.rec >= PASSIVE_FROM { REC_AFTER_PASSIVE } else { self.rec.saturating_sub(1) };
        self.confine()
    }

    /// Its frame was hit by an error.
    pub(super) fn has_failed(&mut self) -> Option<ErrorStateChange> {
        self.counters.errors += 1;
        self.tec += 8;
        self.counters.tec_max = self.counters.tec_max.max(self.tec);
        self.confine()
    }

    /// Another one's frame was hit.
    pub(super) fn has_seen_failure(&mut self) -> Option<ErrorStateChange> {
        // The counter has 8 bits in controllers; beyond passive it says nothing.
        self.rec = (self.rec + 1).min(255);
        self.counters.rec_max = self.counters.rec_max.max(self.rec);
        self.confine()
    }

    fn confine(&mut self) -> Option<ErrorStateChange> {
        if self.tec >= BUS_OFF_FROM {
            return Some(ErrorStateChange::BusOff);
        }
        let was = std::mem::replace(&mut self.passive, self.tec >= PASSIVE_FROM || self.rec >= PASSIVE_FROM);
        match (was, self.passive) {
            (false, true) => {
                self.counters.passives += 1;
                Some(ErrorStateChange::Passive)
            }
            (true, false) => Some(ErrorStateChange::Active),
            _ => None,
        }
    }

    /// Goes off the bus; what waits, and `sending`, is dropped.
    pub(super) fn go_off(&mut self, sending: &CanFrame, counts_from_ns: u64) {
        self.bus_off = Some(BusOffRecovery { counts_from_ns, missing: RECOVERY_SEQUENCES });
        self.counters.bus_offs += 1;
        self.counters.dropped_in_bus_off.count(sending);
        for queued in self.waiting.drain(..) {
            self.counters.dropped_in_bus_off.count(&queued.frame);
        }
    }

    /// Recovers, with counters at 0.
    pub(super) fn come_back(&mut self) {
        (self.bus_off, self.tec, self.rec, self.passive, self.suspended_until_ns) = (None, 0, 0, false, 0);
    }

    /// The error frame that reports a change to the node's programs.
    pub(super) fn error_frame(&self, change: ErrorStateChange) -> CanFrame {
        let (class, detail) = match change {
            ErrorStateChange::Passive if self.tec >= PASSIVE_FROM => (CLASS_CONTROLLER, SENDER_PASSIVE),
            ErrorStateChange::Passive => (CLASS_CONTROLLER, RECEIVER_PASSIVE),
            ErrorStateChange::Active => (CLASS_CONTROLLER, ACTIVE_AGAIN),
            ErrorStateChange::BusOff => (CLASS_BUS_OFF, 0),
            ErrorStateChange::Restarted => (CLASS_RESTARTED, 0),
        };
        let count = |counter: u32| u8::try_from(counter).unwrap_or(u8::MAX);
        let data = [0, detail, 0, 0, 0, 0, count(self.tec), count(self.rec)];
        CanFrame::from_raw(ERROR_FLAG | class | CLASS_COUNTERS, &data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_errors_make_a_sender_passive_and_thirty_two_put_it_off() {
        let mut node = Node::default();
        let changes: Vec<_> = (1..=32).filter_map(|n| node.has_failed().map(|change| (n, change))).collect();
        assert_eq!(changes, [(16, ErrorStateChange::Passive), (32, ErrorStateChange::BusOff)]);
        assert_eq!(node.counters.tec_max, 256);
    }

    #[test]
    fn good_frames_bring_a_passive_node_back() {
        let mut sender = Node::default();
        (0..16).for_each(|_| _ = sender.has_failed());
        assert_eq!(sender.has_sent(), Some(ErrorStateChange::Active));
        let mut receiver = Node::default();
        let passive = (0..200).filter_map(|_| receiver.has_seen_failure()).count();
        assert_eq!((passive, receiver.passive, receiver.rec), (1, true, 200));
        assert_eq!(receiver.has_received(), Some(ErrorStateChange::Active));
        assert_eq!(receiver.rec, REC_AFTER_PASSIVE);
    }

    #[test]
    fn error_frames_are_those_of_socketcan() {
        let mut node = Node::default();
        (0..16).for_each(|_| _ = node.has_failed());
        assert_eq!(node.error_frame(ErrorStateChange::Passive).to_string(), "20000204#0020000000008000");
        (0..16).for_each(|_| _ = node.has_failed());
        assert_eq!(node.error_frame(ErrorStateChange::BusOff).to_string(), "20000240#000000000000FF00");
        node.come_back();
        assert_eq!(node.error_frame(ErrorStateChange::Restarted).to_string(), "20000300#0000000000000000");
    }

    #[test]
    fn a_queue_keeps_the_order_of_arbitration_and_of_entering_and_is_bounded() {
        let mut node = Node::default();
        for (number, id) in [(1, 0x120), (2, 0x110), (3, 0x120), (4, 0x110)] {
            assert!(node.enqueue(Queued::new(CanFrame::new(id, &[]), number, 0)));
        }
        let order: Vec<_> = (0..4).map(|_| node.take_first().number).collect();
        assert_eq!(order, [2, 4, 1, 3]);
        let taken = (0..100).filter(|n| node.enqueue(Queued::new(CanFrame::new(1, &[]), *n, 0))).count();
        assert_eq!(taken, QUEUE_FRAMES);
        assert_eq!(node.counters.dropped_at_full_queue.by_name()["001"], 36);
    }
}
