//! The account of the frames of a segment, exact to the frame, for every identifier and every receiver
//!
//! ```text
//!   sent = received + lost on the wire + lost at the receiver's queue + passed before it came + passed after it left
//!    │        │            └──────────────┴── the host of the embedded bus counts them ──┴──────────────┘
//!    │        └── the receiver counts them           can://: the kernel's overflow count stands in the queue's place
//!    └── the sender counts them
//!
//!   gaps at the receiver + before its first frame + after its last  =  sent + refused at the sender - received
//! ```
//!
//! Counters and ticks count the frames that a sender meant to send, so frames refused by its transmit queue are missing in the
//! second equation too and are added to `sent`. That equation is an independent count: from the counters in commands (4 bits)
//! and from the rig's ticks (number of sensor frames sent), without data of host or kernel. There is no tolerance: a host
//! counts what passed while a peer was absent, so the ends of a connection are exact too.

use protocol::frames::ALIVE_RANGE;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Frames by the name of their identifier.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Counts(BTreeMap<String, u64>);

impl Counts {
    pub(super) fn of(&self, id: &str) -> u64 {
        self.0.get(id).copied().unwrap_or(0)
    }

    pub(super) fn add(&mut self, id: &str, frames: u64) {
        *self.0.entry(id.to_owned()).or_default() += frames;
    }

    pub(super) fn add_all(&mut self, other: &Self) {
        other.0.iter().for_each(|(id, frames)| self.add(id, *frames));
    }

    pub(super) fn total(&self) -> u64 {
        self.0.values().sum()
    }

    pub(super) fn ids(&self) -> impl Iterator<Item = &String> {
        self.0.keys()
    }
}

impl<const N: usize> From<[(&str, u64); N]> for Counts {
    fn from(counts: [(&str, u64); N]) -> Self {
        Self(counts.into_iter().map(|(id, frames)| (id.to_owned(), frames)).collect())
    }
}

/// Counters of the host of the embedded bus for a peer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct PeerCounts {
    /// Frames received from the peer.
    pub taken: Counts,
    /// Frames of others before the peer connected.
    pub before: Counts,
    /// Frames put into the peer's queue.
    pub delivered: Counts,
    /// Frames lost to its full queue.
    pub dropped: Counts,
    /// Frames of others while the peer was in bus-off of a modelled bus.
    pub missed_in_bus_off: Counts,
    /// Frames of others after the peer disconnected.
    pub after: Counts,
}

/// Gaps that a receiver found by counters in the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gaps {
    /// The rig, for the commands of an axis: gaps between the first and the last command.
    Commands {
        /// Missing between them.
        lost: u64,
        /// Counter of the first command received; a sender starts with 1.
        first: u8,
        last: u8,
        /// Times that a command expired, came too late, or its counter jumped: four bits do not show how many were lost there.
        pauses: u64,
    },
    /// A controller, for the sensors of its axis, by the rig's ticks.
    Sensors {
        /// Missing between the first and the last tick; the last one announces the end.
        lost: u64,
        /// Missing before the first tick received.
        before: u64,
    },
}

impl Gaps {
    /// Number of missing frames when `sent` were sent; exact.
    pub(super) fn missing(&self, sent: u64) -> u64 {
        match *self {
            Self::Commands { lost, first, last, .. } => {
                let before = (u64::from(first) + ALIVE_RANGE - 1) % ALIVE_RANGE;
                let after = (sent % ALIVE_RANGE + ALIVE_RANGE - u64::from(last)) % ALIVE_RANGE;
                before + lost + after
            }
            Self::Sensors { lost, before } => lost + before,
        }
    }

    fn pauses(&self) -> u64 {
        match self {
            Self::Commands { pauses, .. } => *pauses,
            Self::Sensors { .. } => 0,
        }
    }
}

/// A process on the bus, with its counters and those of the host.
#[derive(Clone, Debug, Default)]
pub(super) struct Participant {
    pub name: String,
    /// Frames that it passed to the bus.
    pub sent: Counts,
    /// Frames refused by its transmit queue, or by a bus that was down.
    pub refused: Counts,
    /// Frames that it took from the bus.
    pub received: Counts,
    /// Frames of any identifier dropped by the kernel at its queue; SocketCAN only.
    pub overflow: u64,
    /// Counters of the host; `None` without a host.
    pub host_counts: Option<PeerCounts>,
    /// Gaps by identifier, where frames have counters.
    pub gaps: BTreeMap<String, Gaps>,
}

/// Counters of the wire of the embedded bus.
#[derive(Clone, Debug, Default)]
pub(super) struct Wire {
    /// Frames lost by injection.
    pub injected: Counts,
    /// Frames that a modelled wire never sent: full transmit queue, or bus-off.
    pub never_sent: Counts,
    pub passed: Counts,
    /// Peers other than the processes of the segment, which may have sent.
    pub others: Vec<PeerCounts>,
}

/// One identifier at one receiver.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Row {
    /// Identifier, as candump names it.
    pub id: String,
    pub sender: String,
    pub receiver: String,
    /// Frames sent, by the sender's count.
    pub sent: u64,
    /// Frames refused by the sender's transmit queue: never sent, but counted as missing.
    pub refused_at_sender: u64,
    /// Frames received, by the receiver's count.
    pub received: u64,
    /// Lost by injection, or never sent by a modelled wire, by the host's count.
    pub lost_on_wire: u64,
    /// Lost at the receiver's queue, or missed in bus-off, by the host's count; on can:// by the kernel's.
    pub lost_at_queue: u64,
    /// Passed before the receiver connected.
    pub before_it_came: u64,
    /// Passed after it disconnected.
    pub after_it_left: u64,
    /// Missing by the gaps at the receiver and the ends of its series; null where frames have no counter.
    pub missing_by_gaps: Option<u64>,
    /// Pauses and restarts of the sender, or answers that came too late: frames lost in them leave no gap.
    #[serde(default)]
    pub pauses: u64,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FrameAccount {
    /// Each identifier at each receiver.
    pub rows: Vec<Row>,
    /// Contradictions of the account, a sentence each; empty when it balances.
    pub broken: Vec<String>,
    /// Contradictions between gaps and counts, a sentence each.
    pub gaps_broken: Vec<String>,
}

impl Row {
    fn missing(&self) -> i128 {
        i128::from(self.sent) - i128::from(self.received)
    }

    fn explained(&self) -> u64 {
        self.lost_on_wire + self.lost_at_queue + self.before_it_came + self.after_it_left
    }
}

/// Computes the account; `wire` is that of the embedded bus.
pub(super) fn close(participants: &[Participant], wire: Option<&Wire>) -> FrameAccount {
    let mut account = FrameAccount::default();
    let senders = senders(participants, wire);
    if let Some(wire) = wire {
        check_host(participants, wire, &senders, &mut account.broken);
    }
    for participant in participants {
        let first_row = account.rows.len();
        for (id, (sender, sent)) in senders.iter().filter(|(id, _)| participant.sent.of(id) == 0) {
            let host_counts = participant.host_counts.clone().unwrap_or_default();
            let refused = participants.iter().map(|participant| participant.refused.of(id)).sum::<u64>();
            account.rows.push(Row {
                id: id.clone(),
                sender: sender.clone(),
                receiver: participant.name.clone(),
                sent: *sent,
                refused_at_sender: refused,
                received: participant.received.of(id),
                lost_on_wire: wire.map_or(0, |wire| wire.injected.of(id) + wire.never_sent.of(id)),
                lost_at_queue: host_counts.dropped.of(id) + host_counts.missed_in_bus_off.of(id),
                before_it_came: host_counts.before.of(id),
                after_it_left: host_counts.after.of(id),
                missing_by_gaps: participant.gaps.get(id).map(|gaps| gaps.missing(*sent + refused)),
                pauses: participant.gaps.get(id).map_or(0, Gaps::pauses),
            });
        }
        let rows = &mut account.rows[first_row..];
        if wire.is_none() {
            take_overflow(participant, rows, &mut account.broken);
        }
        check_rows(rows, &mut account.broken, &mut account.gaps_broken);
        for id in participant.received.ids().filter(|id| !senders.contains_key(*id)) {
            account.broken.push(format!("{} received {id}, which nobody has sent", participant.name));
        }
    }
    account
}

fn senders(participants: &[Participant], wire: Option<&Wire>) -> BTreeMap<String, (String, u64)> {
    let mut senders: BTreeMap<String, (String, u64)> = BTreeMap::new();
    let strangers =
        wire.map_or(&[][..], |wire| &wire.others).iter().map(|host_counts| ("another", &host_counts.taken));
    for (name, sent) in
        participants.iter().map(|participant| (participant.name.as_str(), &participant.sent)).chain(strangers)
    {
        for id in sent.ids() {
            let entry = senders.entry(id.clone()).or_insert_with(|| (name.to_owned(), 0));
            entry.1 += sent.of(id);
            if entry.0 != name {
                entry.0 = format!("{} and {name}", entry.0);
            }
        }
    }
    senders
}

/// Checks the host's counters for consistency before they are compared with others.
fn check_host(
    participants: &[Participant],
    wire: &Wire,
    senders: &BTreeMap<String, (String, u64)>,
    broken: &mut Vec<String>,
) {
    for participant in participants {
        let Some(host_counts) = &participant.host_counts else {
            broken.push(format!("the host never saw {}", participant.name));
            continue;
        };
        let ids: BTreeSet<_> = participant.sent.ids().chain(host_counts.taken.ids()).collect();
        for id in ids.into_iter().filter(|id| participant.sent.of(id) != host_counts.taken.of(id)) {
            let (sent, taken) = (participant.sent.of(id), host_counts.taken.of(id));
            broken.push(format!("{id}: {} sent {sent}, the host took {taken}", participant.name));
        }
        for id in host_counts
            .delivered
            .ids()
            .filter(|id| host_counts.delivered.of(id) != participant.received.of(id))
        {
            let (delivered, received) = (host_counts.delivered.of(id), participant.received.of(id));
            broken.push(format!(
                "{id}: {} received {received}, the host delivered {delivered}",
                participant.name
            ));
        }
    }
    for (id, (_, sent)) in senders {
        let (passed, injected) = (wire.passed.of(id), wire.injected.of(id) + wire.never_sent.of(id));
        if *sent != passed + injected {
            broken.push(format!("{id}: {sent} sent, {passed} passed the wire, {injected} lost on it"));
        }
    }
}

/// Distributes the overflow of the kernel, which has no identifiers: the sum must equal all missing frames.
fn take_overflow(participant: &Participant, rows: &mut [Row], broken: &mut Vec<String>) {
    let missing: i128 = rows.iter().map(Row::missing).sum();
    if missing == i128::from(participant.overflow) && rows.iter().all(|row| row.missing() >= 0) {
        rows.iter_mut().for_each(|row| row.lost_at_queue = row.sent - row.received);
    } else {
        let (name, overflow) = (&participant.name, participant.overflow);
        broken.push(format!("{name} misses {missing} frames in all, its queue dropped {overflow}"));
    }
}

fn check_rows(rows: &[Row], broken: &mut Vec<String>, gaps_broken: &mut Vec<String>) {
    for row in rows {
        let Row { id, sender, receiver, sent, received, .. } = row;
        if row.missing() != i128::from(row.explained()) {
            broken.push(format!(
                "{id}: {sender} sent {sent}, {receiver} received {received}, {} explained by losses or absence",
                row.explained()
            ));
        }
        let by_counts = row.missing() + i128::from(row.refused_at_sender);
        let differs = |by_gaps: i128| by_gaps > by_counts || (by_gaps < by_counts && row.pauses == 0);
        if let Some(by_gaps) = row.missing_by_gaps.filter(|by_gaps| differs(i128::from(*by_gaps))) {
            gaps_broken.push(format!(
                "{id} at {receiver}: {by_counts} missing by the counts, {by_gaps} by the gaps"
            ));
        }
    }
}

#[cfg(test)]
mod tests;
