//! The modelled wire in the host: from the stamps of what peers send to the moment in which everyone else has it.
//!
//! ```text
//!   real time   packets ── arrival stamp ──► model ── end of the transmission ──► timerfd ──► to all others
//!   lockstep    cycle k: the rig's frames enter at k ms. When all of them are through, the members have them and answer: their
//!               frames enter at that time. At k+1 ms everyone has what is through by then; the rest goes on in cycle k+1, and
//!               so do the rig's frames if they need longer than the cycle.
//! ```
//!
//! The model's time never depends on when the host came round: a frame enters when it arrived in the host's queue, and a late
//! turn of the host makes deliveries late, which is counted apart, and nothing else. Before time goes on, all queues are read
//! up to it (`Host::turn`), so that no frame is reported too late, save one whose sender was interrupted between stamp and
//! queue: it enters a little late, and is counted.
//!
//! A timer descriptor wakes the host, since epoll by itself knows whole milliseconds.

use super::host_report::PeerReport;
use super::lockstep::PeerId;
use super::packets::ns_of;
use super::url::WireOptions;
use crate::can::CanFrame;
use crate::wire_time::{Lateness, NodeId, WireEvent, WireModel, WireTimeReport};
use rustix::time::{
    ClockId, Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec, timerfd_create,
    timerfd_settime,
};
use std::collections::BTreeMap;
use std::os::fd::OwnedFd;

const NS_PER_S: u64 = 1_000_000_000;

/// Receiver of the wire's reports on a node.
#[derive(Clone, Copy, Debug)]
pub(super) enum ReportTarget {
    /// The rig that lives in the host's process.
    Rig,
    /// A node that is a fault.
    Babbler,
    /// By its place among the reported peers.
    Peer(usize),
}

/// The model, and who is which of its nodes.
pub(super) struct TimedWire {
    pub(super) model: WireModel,
    nodes: BTreeMap<PeerId, NodeId>,
    /// For each node, the receiver of its reports.
    report_targets: Vec<ReportTarget>,
    pub(super) timer: OwnedFd,
    /// Expiry that the timer was set to, ns of the model's time.
    armed_ns: Option<u64>,
    /// Time 0 of the model by the machine's clock, ns.
    zero_ns: u64,
    late: Lateness,
}

impl TimedWire {
    /// A wire whose time begins now; `None` when it takes no time.
    pub(super) fn new(options: &WireOptions) -> rustix::io::Result<Option<Self>> {
        let Some(timing) = options.timing else { return Ok(None) };
        let flags = TimerfdFlags::CLOEXEC | TimerfdFlags::NONBLOCK;
        Ok(Some(Self {
            model: WireModel::new(timing, options.seed),
            nodes: BTreeMap::new(),
            report_targets: Vec::new(),
            timer: timerfd_create(TimerfdClockId::Monotonic, flags)?,
            armed_ns: None,
            zero_ns: ns_of(ClockId::Monotonic),
            late: Lateness::default(),
        }))
    }

    /// A peer comes onto the wire.
    pub(super) fn join(&mut self, peer: PeerId, target: ReportTarget) {
        let node = self.model.join();
        self.nodes.insert(peer, node);
        self.report_targets.push(target);
    }

    pub(super) fn leave(&mut self, peer: PeerId) {
        if let Some(node) = self.nodes.remove(&peer) {
            self.model.leave(node);
        }
    }

    /// The peer of a node that is still there.
    pub(super) fn peer_of(&self, node: NodeId) -> Option<PeerId> {
        self.nodes.iter().find(|(_, of_peer)| **of_peer == node).map(|(peer, _)| *peer)
    }

    pub(super) fn knows(&self, peer: PeerId) -> bool {
        self.nodes.contains_key(&peer)
    }

    /// A peer's frame arrived at `at_ns` of the model's time.
    pub(super) fn enter(&mut self, peer: PeerId, frame: &CanFrame, at_ns: u64) {
        if let Some(node) = self.nodes.get(&peer) {
            self.model.enter(*node, *frame, at_ns);
        }
    }

    /// Time of the model by the machine's clock, of what happened so many ns ago.
    pub(super) fn time_ns(&self, age_ns: u64) -> u64 {
        ns_of(ClockId::Monotonic).saturating_sub(self.zero_ns).saturating_sub(age_ns)
    }

    /// Time up to which the model has gone, by the machine's clock, ns.
    pub(super) fn read_up_to_ns(&self) -> u64 {
        self.zero_ns + self.model.now_ns()
    }

    /// Advances to the next instant with events, up to `limit_ns`, and adds these. False when there is none.
    pub(super) fn advance_once(&mut self, limit_ns: u64, events: &mut Vec<WireEvent>) -> bool {
        let Some(at_ns) = self.model.next_ns().filter(|at_ns| *at_ns <= limit_ns) else { return false };
        self.model.advance(at_ns, events);
        true
    }

    /// A frame whose transmission ended at `ended_ns` has been handed on.
    pub(super) fn note_delivery(&mut self, ended_ns: u64) {
        self.late.note(self.time_ns(0).saturating_sub(ended_ns));
    }

    /// Sets the timer to the model's next event. Setting it clears what it has reported, so that it need not be read.
    pub(super) fn arm(&mut self) -> rustix::io::Result<()> {
        let next_ns = self.model.next_ns();
        let expired = self.armed_ns.is_some_and(|armed_ns| armed_ns <= self.model.now_ns());
        if next_ns == self.armed_ns && !expired {
            return Ok(());
        }
        // All zeros would switch it off; a time long past makes it expire at once.
        let at_ns = next_ns.map_or(0, |next_ns| self.zero_ns + next_ns);
        let at = Timespec { tv_sec: (at_ns / NS_PER_S) as i64, tv_nsec: (at_ns % NS_PER_S) as i64 };
        let once = Itimerspec { it_interval: Timespec { tv_sec: 0, tv_nsec: 0 }, it_value: at };
        timerfd_settime(&self.timer, TimerfdTimerFlags::ABSTIME, &once)?;
        self.armed_ns = next_ns;
        Ok(())
    }

    /// The model's report, with the nodes' names.
    pub(super) fn report(&self, peers: &[PeerReport]) -> WireTimeReport {
        let mut report = WireTimeReport { delivered_late: self.late, ..self.model.report() };
        for (node, target) in report.nodes.iter_mut().zip(&self.report_targets) {
            node.name = match target {
                ReportTarget::Rig => "rig".into(),
                ReportTarget::Babbler => "babbling node".into(),
                ReportTarget::Peer(place) => peers[*place].name.clone(),
            };
        }
        report
    }
}
