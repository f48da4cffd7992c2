//! The wire of the embedded bus: what it does to frames on purpose.
//!
//! ```text
//!   frame ── bus-off, loss ──► corruption, length, counter ──► delay ──► reordering ──► duplication ──► all others
//!              │ lost for all    another frame from here on      │ held until its time, or until the next of its identifier
//! ```
//!
//! What the bus's URL says (`?loss=P&seed=N`) lasts for ever; everything else begins and ends by [`WireOrder`]s, which whoever
//! has the host's [`WireOrders`] gives without waiting. Draws come from a seeded generator for each fault, so that the same
//! frames in the same order meet the same; a lost frame is lost for every receiver, as on a real wire where all nodes see
//! one error frame. A frame that is changed here is one that its sender sent wrongly: what the wire itself garbles is found
//! by CAN's own checksum and sent again, which the wire that keeps time models (`error_rate`).
//!
//! Names and ranges are the emulator's table of faults; `kinds.rs` has the numbers of each.

mod kinds;
#[cfg(test)]
mod tests;

pub use kinds::{Frames, WireFault, WireNode};

use super::lockstep::PeerId;
use super::url::WireOptions;
use crate::can::CanFrame;
use crate::frames::{DRIVE_SENSORS, DRIVE_VALVE_COMMAND, LOAD_VALVE_COMMAND};
use crossbeam_channel::{Receiver, Sender, bounded};
use kinds::FaultRng;
use std::collections::BTreeMap;

use super::host_report::FramesById;

/// Orders that may wait for the host.
const ORDERS: usize = 256;
/// Nanoseconds in a millisecond.
const MS_NS: u64 = 1_000_000;
/// Frames that a babbling node is given at once after a pause of the host.
const BURST: f64 = 200.0;

/// Order to a host to begin or end a fault of its wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireOrder {
    /// A fault begins.
    Begin {
        /// Number by which it is ended.
        number: u16,
        /// Kind of the fault, with its parameters.
        fault: WireFault,
        /// Which frames it concerns.
        frames: Frames,
        /// Seed of its draws.
        seed: u64,
    },
    /// The fault of this number ends; what it holds back goes on.
    End {
        /// Number that the order to begin gave it.
        number: u16,
    },
}

/// Queue of orders to a host; giving one takes no lock and does not wait.
#[derive(Clone)]
pub struct WireOrders(Sender<WireOrder>);

impl WireOrders {
    /// Gives an order; false when the host has gone, or is too slow for so many.
    #[must_use]
    pub fn give(&self, order: WireOrder) -> bool {
        self.0.try_send(order).is_ok()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum FrameOutcome {
    /// It is delivered to all peers but its sender and the deaf ones.
    Carried {
        frame: CanFrame,
        from: PeerId,
        deaf: Vec<PeerId>,
    },
    Lost(CanFrame),
    Held(CanFrame),
}

struct ActiveFault {
    number: u16,
    fault: WireFault,
    frames: Frames,
    rng: FaultRng,
    /// Time up to which a babbling node has sent, and its fraction of a frame still to be sent.
    babbled_until_ns: u64,
    owed_frames: f64,
}

/// A frame that is delivered later, with the number of the fault that holds it.
struct HeldFrame {
    number: u16,
    /// Time of delivery; `None`: after the next frame of its identifier.
    due_ns: Option<u64>,
    frame: CanFrame,
    from: PeerId,
    /// Number of duplicates.
    copies: u32,
}

/// The wire with its active faults and held frames.
pub(super) struct Wire {
    active: Vec<ActiveFault>,
    held: Vec<HeldFrame>,
    /// Peers that sent the sensors and the commands of drive and load last.
    node_peers: [Option<PeerId>; 3],
    orders: Receiver<WireOrder>,
    give: Sender<WireOrder>,
    /// Frames that a fault acted on, by its name and their identifier.
    pub(super) frames_by_fault: BTreeMap<&'static str, FramesById>,
}

impl Wire {
    pub(super) fn new(options: &WireOptions) -> Self {
        let (give, orders) = bounded(ORDERS);
        let mut wire = Self {
            active: Vec::new(),
            held: Vec::new(),
            node_peers: [None; 3],
            orders,
            give,
            frames_by_fault: BTreeMap::new(),
        };
        if options.loss > 0.0 {
            let fault = WireFault::Loss { probability: options.loss };
            wire.begin(0, fault, Frames::All, options.seed, 0);
        }
        wire
    }

    /// The way in which orders reach this wire.
    pub(super) fn orders(&self) -> WireOrders {
        WireOrders(self.give.clone())
    }

    /// Whether nothing is done to frames.
    pub(super) fn is_plain(&self) -> bool {
        self.active.is_empty() && self.held.is_empty()
    }

    /// Carries out the orders; frames that an ended fault held are released.
    pub(super) fn take_orders(&mut self, now_ns: u64, outcomes: &mut Vec<FrameOutcome>) {
        while let Ok(order) = self.orders.try_recv() {
            match order {
                WireOrder::Begin { number, fault, frames, seed } => {
                    self.begin(number, fault, frames, seed, now_ns);
                }
                WireOrder::End { number } => {
                    self.active.retain(|active| active.number != number);
                    self.release(outcomes, |held| held.number == number);
                }
            }
        }
    }

    fn begin(&mut self, number: u16, fault: WireFault, frames: Frames, seed: u64, now_ns: u64) {
        self.active.push(ActiveFault {
            number,
            fault,
            frames,
            rng: FaultRng::new(seed),
            babbled_until_ns: now_ns,
            owed_frames: 0.0,
        });
    }

    pub(super) fn release_due(&mut self, now_ns: u64, outcomes: &mut Vec<FrameOutcome>) {
        self.release(outcomes, |held| held.due_ns.is_some_and(|due_ns| due_ns <= now_ns));
    }

    /// Releases all held frames, when the host ends.
    pub(super) fn release_all(&mut self, outcomes: &mut Vec<FrameOutcome>) {
        self.release(outcomes, |_| true);
    }

    fn release(&mut self, outcomes: &mut Vec<FrameOutcome>, which: impl Fn(&HeldFrame) -> bool) {
        let deaf = self.deaf(&[]);
        for held in self.held.extract_if(.., |held| which(held)) {
            for _ in 0..=held.copies {
                outcomes.push(FrameOutcome::Carried {
                    frame: held.frame,
                    from: held.from,
                    deaf: deaf.clone(),
                });
            }
        }
    }

    pub(super) fn babble(&mut self, now_ns: u64, babbled: &mut Vec<CanFrame>) {
        for active in &mut self.active {
            let WireFault::Babbling { id, frames_per_ms, bytes } = active.fault else { continue };
            let since_ms = now_ns.saturating_sub(active.babbled_until_ns) as f64 / MS_NS as f64;
            active.babbled_until_ns = now_ns.max(active.babbled_until_ns);
            active.owed_frames = (active.owed_frames + since_ms * frames_per_ms).min(BURST);
            let whole = active.owed_frames.floor();
            active.owed_frames -= whole;
            let frame = CanFrame::new(id, &[0; 8][..usize::from(bytes.min(8))]);
            for _ in 0..whole as usize {
                self.frames_by_fault.entry(active.fault.name()).or_default().count(&frame);
                babbled.push(frame);
            }
        }
    }

    /// Longest time that the host may sleep, ns; `None`: no limit.
    pub(super) fn longest_sleep_ns(&self, now_ns: u64) -> Option<u64> {
        let babbles = self.active.iter().any(|active| matches!(active.fault, WireFault::Babbling { .. }));
        let due_ns = self.held.iter().filter_map(|held| held.due_ns).min();
        let due_ns = due_ns.map(|due_ns| due_ns.saturating_sub(now_ns));
        if babbles { Some(due_ns.unwrap_or(MS_NS).min(MS_NS)) } else { due_ns }
    }

    /// Peers that receive nothing: `deaf` and the nodes that are off the bus.
    fn deaf(&self, deaf: &[PeerId]) -> Vec<PeerId> {
        let mut deaf = deaf.to_vec();
        deaf.extend(self.active.iter().filter_map(|active| self.off(&active.fault)));
        deaf
    }

    /// The peer that a fault takes off the bus.
    fn off(&self, fault: &WireFault) -> Option<PeerId> {
        if let WireFault::BusOff { node } = fault { self.node_peers[*node as usize] } else { None }
    }

    /// Learns which peer is which node from the identifiers that it sends.
    pub(super) fn learn_node(&mut self, frame: &CanFrame, from: PeerId) {
        let ids = [DRIVE_SENSORS.id, DRIVE_VALVE_COMMAND.id, LOAD_VALVE_COMMAND.id];
        if let Some(node) = ids.iter().position(|id| frame.standard_id() == Some(*id)) {
            self.node_peers[node] = Some(from);
        }
    }

    /// Adds the outcome of a frame that enters the wire at `now_ns`, and of the frames that waited for it.
    pub(super) fn pass(
        &mut self,
        frame: &CanFrame,
        from: PeerId,
        deaf: &[PeerId],
        now_ns: u64,
        outcomes: &mut Vec<FrameOutcome>,
    ) {
        let frames_by_fault = &mut self.frames_by_fault;
        let mut note = |fault: &WireFault| frames_by_fault.entry(fault.name()).or_default().count(frame);
        let (mut changed, mut hold, mut copies) = (*frame, None, 0);
        for active in self.active.iter_mut().filter(|active| active.frames.hold(frame)) {
            match active.fault {
                WireFault::BusOff { node } if self.node_peers[node as usize] == Some(from) => {
                    note(&active.fault);
                    outcomes.push(FrameOutcome::Lost(*frame));
                    return;
                }
                WireFault::BusOff { .. } | WireFault::Babbling { .. } => continue,
                WireFault::Delay { delay_ms } => {
                    let due_ns = now_ns + u64::from(delay_ms) * MS_NS;
                    hold = Some((active.number, Some(due_ns)));
                }
                fault if !active.rng.hits(fault.probability()) => continue,
                WireFault::Loss { .. } => {
                    note(&active.fault);
                    outcomes.push(FrameOutcome::Lost(*frame));
                    return;
                }
                WireFault::Reordering { .. } => {
                    let waits =
                        |held: &HeldFrame| held.due_ns.is_none() && held.frame.raw_id() == frame.raw_id();
                    // One at a time: the next one is what it waits for.
                    if hold.is_some() || self.held.iter().any(waits) {
                        continue;
                    }
                    hold = Some((active.number, None));
                }
                WireFault::Duplication { copies: more, .. } => copies += more,
                fault => changed = fault.change(&changed, &mut active.rng),
            }
            note(&active.fault);
        }
        if let Some((number, due_ns)) = hold {
            outcomes.push(FrameOutcome::Held(*frame));
            self.held.push(HeldFrame { number, due_ns, frame: changed, from, copies });
            return;
        }
        let deaf = self.deaf(deaf);
        for _ in 0..=copies {
            outcomes.push(FrameOutcome::Carried { frame: changed, from, deaf: deaf.clone() });
        }
        let id = frame.raw_id();
        self.release(outcomes, |held| held.due_ns.is_none() && held.frame.raw_id() == id);
    }
}
