//! The wire itself: frames enter, win or wait, are sent or hit, and end; everything in the order of the model's own time.
//!
//! At one instant, first a transmission ends, then frames enter, then nodes recover, then arbitration starts among all that
//! wait: a frame that enters at the very moment in which the wire gets free takes part.

use super::WireTiming;
use super::errors::{ERROR_BITS, Errors, SUSPEND_BITS};
use super::node::{ErrorStateChange, Node, Queued, RECOVERY_BITS};
use super::report::{Identifier, Lateness, NodeReport, WireTimeReport};
use crate::bus::host::FramesById;
use crate::can::CanFrame;
use std::collections::BTreeMap;

/// A node, by the order in which it came.
pub type NodeId = usize;

/// Something that happened on the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WireEvent {
    /// A frame was sent to its end: for everyone but its sender and the deaf.
    Delivered {
        /// As it was sent.
        frame: CanFrame,
        /// Who sent it.
        from: NodeId,
        /// When its sender queued it, ns.
        entered_ns: u64,
        /// When its transmission ended, ns.
        ended_ns: u64,
        /// Nodes that were off the bus.
        deaf: Vec<NodeId>,
    },
    /// A node gets an error frame with its own state.
    ErrorFrame {
        /// Node whose state it reports.
        node: NodeId,
        /// The error frame.
        frame: CanFrame,
        /// When, ns.
        at_ns: u64,
    },
}

struct Transmission {
    queued: Queued,
    from: NodeId,
    began_ns: u64,
    ends_ns: u64,
    hit: bool,
}

/// A simulated bus: one frame at a time, the rank of identifiers decides, errors come as drawn.
pub struct WireModel {
    timing: WireTiming,
    errors: Errors,
    nodes: Vec<Node>,
    /// Frames to come, by time and order of entering.
    coming: BTreeMap<(u64, u64), (NodeId, CanFrame)>,
    sending: Option<Transmission>,
    now_ns: u64,
    /// Since when the wire has been idle, when nothing is sent.
    idle_since_ns: u64,
    entered: u64,
    first_ns: Option<u64>,
    last_ns: u64,
    busy_ns: u64,
    frames: u64,
    failed: u64,
    entered_late: Lateness,
    identifiers: BTreeMap<u32, Identifier>,
}

impl WireModel {
    /// An idle wire at time 0.
    #[must_use]
    pub fn new(timing: WireTiming, seed: u64) -> Self {
        Self {
            timing,
            errors: Errors::new(&timing, seed),
            nodes: Vec::new(),
            coming: BTreeMap::new(),
            sending: None,
            now_ns: 0,
            idle_since_ns: 0,
            entered: 0,
            first_ns: None,
            last_ns: 0,
            busy_ns: 0,
            frames: 0,
            failed: 0,
            entered_late: Lateness::default(),
            identifiers: BTreeMap::new(),
        }
    }

    /// A node more.
    pub fn join(&mut self) -> NodeId {
        self.nodes.push(Node::default());
        self.nodes.len() - 1
    }

    /// A node is gone. What it had queued is still sent, as a controller's mailboxes are.
    pub fn leave(&mut self, node: NodeId) {
        self.nodes[node].gone = true;
    }

    /// A node queues a frame at `at_ns`. What the model has passed already enters now, and is counted as late.
    pub fn enter(&mut self, node: NodeId, frame: CanFrame, at_ns: u64) {
        if at_ns < self.now_ns {
            self.entered_late.note(self.now_ns - at_ns);
        }
        self.entered += 1;
        self.coming.insert((at_ns.max(self.now_ns), self.entered), (node, frame));
    }

    /// Time up to which everything has happened, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// When something happens next, if nothing enters before; `None` when nothing will.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        let arrival = self.coming.keys().next().map(|(at_ns, _)| *at_ns);
        let end = self.sending.as_ref().map(|sending| sending.ends_ns);
        let idle = || {
            let starts = self.nodes.iter().filter(|node| node.first().is_some());
            let recoveries = self.nodes.iter().filter_map(|node| self.recovery_ns(node));
            starts.map(|node| node.suspended_until_ns).chain(recoveries).min()
        };
        let on_wire = if end.is_some() { end } else { idle() };
        [arrival, on_wire].into_iter().flatten().min()
    }

    /// When a node in bus-off will be back if the wire stays idle.
    fn recovery_ns(&self, node: &Node) -> Option<u64> {
        let off = node.bus_off.filter(|_| !node.gone)?;
        let from_ns = off.counts_from_ns.max(self.idle_since_ns);
        Some(from_ns + off.missing * self.timing.duration_ns(RECOVERY_BITS))
    }

    /// Lets time come to `to_ns`, and adds what happened to `events`, in its order.
    pub fn advance(&mut self, to_ns: u64, events: &mut Vec<WireEvent>) {
        while let Some(at_ns) = self.next_ns().filter(|at_ns| *at_ns <= to_ns) {
            self.now_ns = self.now_ns.max(at_ns);
            self.step(events);
        }
        self.now_ns = self.now_ns.max(to_ns);
    }

    fn step(&mut self, events: &mut Vec<WireEvent>) {
        if let Some(sending) = self.sending.take_if(|sending| sending.ends_ns <= self.now_ns) {
            self.end(sending, events);
        }
        while let Some(entry) = self.coming.first_entry().filter(|entry| entry.key().0 <= self.now_ns) {
            let ((at_ns, number), (node, frame)) = entry.remove_entry();
            self.take_in(node, Queued::new(frame, number, at_ns));
        }
        if self.sending.is_none() {
            self.recover(events);
            self.start();
        }
    }

    fn take_in(&mut self, node: NodeId, queued: Queued) {
        if self.nodes[node].enqueue(queued) {
            self.first_ns = self.first_ns.or(Some(queued.entered_ns));
            let identifier = self.identifiers.entry(queued.frame.raw_id()).or_default();
            identifier.arrived(&queued.frame, queued.entered_ns);
        }
    }

    fn recover(&mut self, events: &mut Vec<WireEvent>) {
        for id in 0..self.nodes.len() {
            if self.recovery_ns(&self.nodes[id]).is_some_and(|at_ns| at_ns <= self.now_ns) {
                self.nodes[id].come_back();
                self.report_change(id, ErrorStateChange::Restarted, events);
            }
        }
    }

    /// Arbitration: the lowest of all frames that are ready is sent.
    fn start(&mut self) {
        let ready = |node: &&mut Node| node.suspended_until_ns <= self.now_ns;
        let contenders = self.nodes.iter_mut().enumerate().filter(|(_, node)| ready(node));
        let first = contenders.filter_map(|(id, node)| Some((node.first()?.key(), id))).min();
        let Some((_, from)) = first else { return };
        self.count_idle_sequences();
        let queued = self.nodes[from].take_first();
        let hit = self.errors.hit(&queued.frame, queued.bits, self.now_ns);
        let length = hit.map_or(queued.bits, |place| place + ERROR_BITS);
        let ends_ns = self.now_ns + self.timing.duration_ns(length);
        self.sending =
            Some(Transmission { queued, from, began_ns: self.now_ns, ends_ns, hit: hit.is_some() });
    }

    /// A node in bus-off has seen the recessive bits of an idle wire.
    fn count_idle_sequences(&mut self) {
        let length_ns = self.timing.duration_ns(RECOVERY_BITS);
        for off in self.nodes.iter_mut().filter_map(|node| node.bus_off.as_mut()) {
            let from_ns = off.counts_from_ns.max(self.idle_since_ns);
            off.missing = off.missing.saturating_sub(self.now_ns.saturating_sub(from_ns) / length_ns);
        }
    }

    /// The end of a transmission: 11 recessive bits, delimiter and intermission among them, after a frame and an error alike.
    fn end(&mut self, sending: Transmission, events: &mut Vec<WireEvent>) {
        let now_ns = self.now_ns;
        (self.idle_since_ns, self.last_ns) = (now_ns, now_ns);
        self.busy_ns += now_ns - sending.began_ns;
        let tail_ns = self.timing.duration_ns(RECOVERY_BITS);
        for off in self.nodes.iter_mut().filter_map(|node| node.bus_off.as_mut()) {
            off.missing -= u64::from(off.missing > 0 && off.counts_from_ns + tail_ns <= now_ns);
        }
        if sending.hit {
            self.end_in_error(sending, events);
        } else {
            self.end_well(sending, events);
        }
    }

    fn end_well(&mut self, sending: Transmission, events: &mut Vec<WireEvent>) {
        let Transmission { queued, from, began_ns, .. } = sending;
        let ended_ns = self.now_ns;
        self.frames += 1;
        let identifier = self.identifiers.entry(queued.frame.raw_id()).or_default();
        identifier.sent(queued.bits, [queued.entered_ns, began_ns, ended_ns]);
        let mut deaf = Vec::new();
        for (id, node) in self.nodes.iter_mut().enumerate() {
            if node.bus_off.is_some() && !node.gone {
                node.counters.missed += 1;
                deaf.push(id);
            }
        }
        events.push(WireEvent::Delivered {
            frame: queued.frame,
            from,
            entered_ns: queued.entered_ns,
            ended_ns,
            deaf,
        });
        self.confine(from, Node::has_sent, Node::has_received, events);
        self.suspend(from);
    }

    fn end_in_error(&mut self, sending: Transmission, events: &mut Vec<WireEvent>) {
        let Transmission { queued, from, .. } = sending;
        self.failed += 1;
        self.identifiers.entry(queued.frame.raw_id()).or_default().failed();
        if self.confine(from, Node::has_failed, Node::has_seen_failure, events)
            == Some(ErrorStateChange::BusOff)
        {
            let counts_from_ns = self.now_ns + u64::from(self.timing.restart_ms) * 1_000_000;
            self.nodes[from].go_off(&queued.frame, counts_from_ns);
        } else {
            self.nodes[from].put(queued);
            self.suspend(from);
        }
    }

    /// Error counters of all: `sender` for the one, `others` for the rest. Returns the new state of the sender.
    fn confine(
        &mut self,
        from: NodeId,
        sender: fn(&mut Node) -> Option<ErrorStateChange>,
        others: fn(&mut Node) -> Option<ErrorStateChange>,
        events: &mut Vec<WireEvent>,
    ) -> Option<ErrorStateChange> {
        let mut of_sender = None;
        for id in 0..self.nodes.len() {
            let node = &mut self.nodes[id];
            let change = if id == from {
                of_sender = sender(node);
                of_sender
            } else if node.on_the_bus() {
                others(node)
            } else {
                None
            };
            if let Some(change) = change {
                self.report_change(id, change, events);
            }
        }
        of_sender
    }

    fn suspend(&mut self, from: NodeId) {
        let node = &mut self.nodes[from];
        if node.passive {
            node.suspended_until_ns = self.now_ns + self.timing.duration_ns(SUSPEND_BITS);
        }
    }

    fn report_change(&self, node: NodeId, change: ErrorStateChange, events: &mut Vec<WireEvent>) {
        if !self.nodes[node].gone {
            let frame = self.nodes[node].error_frame(change);
            events.push(WireEvent::ErrorFrame { node, frame, at_ns: self.now_ns });
        }
    }

    /// Report of the counts so far. Nodes have no names here, and nothing is delivered by the model.
    #[must_use]
    pub fn report(&self) -> WireTimeReport {
        let observed_ns = self.first_ns.map_or(0, |first_ns| self.last_ns.saturating_sub(first_ns));
        let load_ppm = self.busy_ns.saturating_mul(1_000_000).checked_div(observed_ns).unwrap_or(0);
        WireTimeReport {
            bits_per_s: self.timing.bits_per_s,
            observed_ns,
            busy_ns: self.busy_ns,
            load_ppm,
            frames: self.frames,
            errors: self.failed,
            bus_offs: self.nodes.iter().map(|node| node.counters.bus_offs).sum(),
            entered_late: self.entered_late,
            delivered_late: Lateness::default(),
            identifiers: self
                .identifiers
                .iter()
                .map(|(raw_id, identifier)| (FramesById::name_of(*raw_id), identifier.report()))
                .collect(),
            nodes: self.nodes.iter().map(node_report).collect(),
        }
    }
}

fn node_report(node: &Node) -> NodeReport {
    let counters = node.counters.clone();
    NodeReport {
        name: String::new(),
        sent: counters.sent,
        errors: counters.errors,
        tec: [node.tec, counters.tec_max],
        rec: [node.rec, counters.rec_max],
        error_passive: counters.passives,
        bus_offs: counters.bus_offs,
        bus_off: node.bus_off.is_some(),
        missed_in_bus_off: counters.missed,
        dropped_at_full_queue: counters.dropped_at_full_queue,
        dropped_in_bus_off: counters.dropped_in_bus_off,
    }
}

#[cfg(test)]
mod tests;
