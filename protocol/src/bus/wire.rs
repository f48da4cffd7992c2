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
use kinds::Draw;
use std::collections::BTreeMap;

use super::host_report::FramesById;

/// Orders that may wait for the host.
const ORDERS: usize = 256;
/// Nanoseconds in a millisecond.
const MS_NS: u64 = 1_000_000;
/// Frames that a babbling node is given at once after a pause of the host.
const BURST: f64 = 200.0;

/// What the host is asked to do to frames from now on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireOrder {
    /// A fault begins.
    Begin {
        /// Number by which it is ended.
        number: u16,
        /// What it is.
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

/// The way in which orders reach a host; giving one takes no lock and waits for nobody.
#[derive(Clone)]
pub struct WireOrders(Sender<WireOrder>);

impl WireOrders {
    /// Gives an order; false when the host has gone, or is too slow for so many.
    #[must_use]
    pub fn give(&self, order: WireOrder) -> bool {
        self.0.try_send(order).is_ok()
    }
}

/// What becomes of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fate {
    /// It goes to everyone but its sender and the deaf.
    Carried {
        frame: CanFrame,
        from: PeerId,
        deaf: Vec<PeerId>,
    },
    Lost(CanFrame),
    Held(CanFrame),
}

struct Active {
    number: u16,
    fault: WireFault,
    frames: Frames,
    draw: Draw,
    /// Up to when a babbling node has spoken, and what it owes beyond whole frames.
    spoken_ns: u64,
    owes: f64,
}

/// A frame that comes later, by the number of the fault that holds it.
struct Held {
    number: u16,
    /// When; `None`: behind the next frame of its identifier.
    due_ns: Option<u64>,
    frame: CanFrame,
    from: PeerId,
    /// How often it comes beyond once.
    copies: u32,
}

/// What the wire does now.
pub(super) struct Wire {
    active: Vec<Active>,
    held: Vec<Held>,
    /// Who sent the sensors and the commands of drive and load last.
    speakers: [Option<PeerId>; 3],
    orders: Receiver<WireOrder>,
    give: Sender<WireOrder>,
    /// Frames that met a fault, by its name and their identifier.
    pub(super) met: BTreeMap<&'static str, FramesById>,
}

impl Wire {
    pub(super) fn new(options: &WireOptions) -> Self {
        let (give, orders) = bounded(ORDERS);
        let mut wire = Self {
            active: Vec::new(),
            held: Vec::new(),
            speakers: [None; 3],
            orders,
            give,
            met: BTreeMap::new(),
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

    /// Takes what was ordered; frames that an ended fault held go on.
    pub(super) fn take_orders(&mut self, now_ns: u64, fates: &mut Vec<Fate>) {
        while let Ok(order) = self.orders.try_recv() {
            match order {
                WireOrder::Begin { number, fault, frames, seed } => {
                    self.begin(number, fault, frames, seed, now_ns);
                }
                WireOrder::End { number } => {
                    self.active.retain(|active| active.number != number);
                    self.let_go(fates, |held| held.number == number);
                }
            }
        }
    }

    fn begin(&mut self, number: u16, fault: WireFault, frames: Frames, seed: u64, now_ns: u64) {
        self.active.push(Active {
            number,
            fault,
            frames,
            draw: Draw::new(seed),
            spoken_ns: now_ns,
            owes: 0.0,
        });
    }

    /// What is due by `now_ns` of what was held.
    pub(super) fn pass_time(&mut self, now_ns: u64, fates: &mut Vec<Fate>) {
        self.let_go(fates, |held| held.due_ns.is_some_and(|due_ns| due_ns <= now_ns));
    }

    /// Everything that is held, when the host goes.
    pub(super) fn let_all_go(&mut self, fates: &mut Vec<Fate>) {
        self.let_go(fates, |_| true);
    }

    fn let_go(&mut self, fates: &mut Vec<Fate>, which: impl Fn(&Held) -> bool) {
        let deaf = self.deaf(&[]);
        for held in self.held.extract_if(.., |held| which(held)) {
            for _ in 0..=held.copies {
                fates.push(Fate::Carried { frame: held.frame, from: held.from, deaf: deaf.clone() });
            }
        }
    }

    /// What babbling nodes say up to `now_ns`.
    pub(super) fn babble(&mut self, now_ns: u64, babbled: &mut Vec<CanFrame>) {
        for active in &mut self.active {
            let WireFault::Babbling { id, frames_per_ms, bytes } = active.fault else { continue };
            let since_ms = now_ns.saturating_sub(active.spoken_ns) as f64 / MS_NS as f64;
            active.spoken_ns = now_ns.max(active.spoken_ns);
            active.owes = (active.owes + since_ms * frames_per_ms).min(BURST);
            let whole = active.owes.floor();
            active.owes -= whole;
            let frame = CanFrame::new(id, &[0; 8][..usize::from(bytes.min(8))]);
            for _ in 0..whole as usize {
                self.met.entry(active.fault.name()).or_default().count(&frame);
                babbled.push(frame);
            }
        }
    }

    /// How long the host may sleep, ns; `None` for as long as it likes.
    pub(super) fn patience_ns(&self, now_ns: u64) -> Option<u64> {
        let babbles = self.active.iter().any(|active| matches!(active.fault, WireFault::Babbling { .. }));
        let due_ns = self.held.iter().filter_map(|held| held.due_ns).min();
        let due_ns = due_ns.map(|due_ns| due_ns.saturating_sub(now_ns));
        if babbles { Some(due_ns.unwrap_or(MS_NS).min(MS_NS)) } else { due_ns }
    }

    /// Those who hear nothing, with the nodes that are off the bus.
    fn deaf(&self, deaf: &[PeerId]) -> Vec<PeerId> {
        let mut deaf = deaf.to_vec();
        deaf.extend(self.active.iter().filter_map(|active| self.off(&active.fault)));
        deaf
    }

    /// The peer that a fault takes off the bus.
    fn off(&self, fault: &WireFault) -> Option<PeerId> {
        if let WireFault::BusOff { node } = fault { self.speakers[*node as usize] } else { None }
    }

    /// Notes who is who by what they send.
    pub(super) fn note_speaker(&mut self, frame: &CanFrame, from: PeerId) {
        let ids = [DRIVE_SENSORS.id, DRIVE_VALVE_COMMAND.id, LOAD_VALVE_COMMAND.id];
        if let Some(node) = ids.iter().position(|id| frame.standard_id() == Some(*id)) {
            self.speakers[node] = Some(from);
        }
    }

    /// What becomes of a frame that comes to the wire at `now_ns`, and of those that waited for it.
    pub(super) fn pass(
        &mut self,
        frame: &CanFrame,
        from: PeerId,
        deaf: &[PeerId],
        now_ns: u64,
        fates: &mut Vec<Fate>,
    ) {
        let met = &mut self.met;
        let mut note = |fault: &WireFault| met.entry(fault.name()).or_default().count(frame);
        let (mut passing, mut hold, mut copies) = (*frame, None, 0);
        for active in self.active.iter_mut().filter(|active| active.frames.hold(frame)) {
            match active.fault {
                WireFault::BusOff { node } if self.speakers[node as usize] == Some(from) => {
                    note(&active.fault);
                    fates.push(Fate::Lost(*frame));
                    return;
                }
                WireFault::BusOff { .. } | WireFault::Babbling { .. } => continue,
                WireFault::Delay { delay_ms } => {
                    let due_ns = now_ns + u64::from(delay_ms) * MS_NS;
                    hold = Some((active.number, Some(due_ns)));
                }
                fault if !active.draw.hits(fault.probability()) => continue,
                WireFault::Loss { .. } => {
                    note(&active.fault);
                    fates.push(Fate::Lost(*frame));
                    return;
                }
                WireFault::Reordering { .. } => {
                    let waits = |held: &Held| held.due_ns.is_none() && held.frame.raw_id() == frame.raw_id();
                    // One at a time: the next one is what it waits for.
                    if hold.is_some() || self.held.iter().any(waits) {
                        continue;
                    }
                    hold = Some((active.number, None));
                }
                WireFault::Duplication { copies: more, .. } => copies += more,
                fault => passing = fault.change(&passing, &mut active.draw),
            }
            note(&active.fault);
        }
        if let Some((number, due_ns)) = hold {
            fates.push(Fate::Held(*frame));
            self.held.push(Held { number, due_ns, frame: passing, from, copies });
            return;
        }
        let deaf = self.deaf(deaf);
        for _ in 0..=copies {
            fates.push(Fate::Carried { frame: passing, from, deaf: deaf.clone() });
        }
        let id = frame.raw_id();
        self.let_go(fates, |held| held.due_ns.is_none() && held.frame.raw_id() == id);
    }
}
