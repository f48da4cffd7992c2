//! The lockstep barrier: who may act in which cycle, and in which order frames are delivered.
//!
//! ```text
//!              all have joined           rig: done(k)           rig's frames to all
//!   Gathering ─────────────────► RigActs ────────────► RigDone ─────────────────────► MembersAct
//!               Go(0) to the rig    ▲                            Go(k) to the members    │   │
//!                                   │  posted frames to all but their senders            │   │
//!                                   └────────────────────────────────────────────────────┘   │
//!                                      every member: done(k); Go(k+1) to the rig             │
//!                                                                                            ▼
//!                                         5 s of wall time without done(k): the host names the member
//! ```
//!
//! Frames of one release are sorted by identifier, then by the sender's name, then by the order of posting: the log
//! does not depend on which process was faster, nor on how many processes the controllers are. A foreign controller
//! knows nothing of this: it counts as done when a command on its identifier echoes the cycle, or when the sensors that it
//! would answer were lost on the way to it: it cannot answer what it never saw. Such a cycle is not released before it has read
//! what did reach it ([`Barrier::unanswering`]): else simulated time would run away from it.
//!
//! This file decides; [`super::host`] reads, writes and keeps the time.

use super::control::Role;
use crate::can::CanFrame;
use crate::frames::{
    DRIVE_SENSORS, DRIVE_VALVE_COMMAND, ECHO_RANGE, Frame, LOAD_SENSORS, LOAD_VALVE_COMMAND,
};
use std::collections::BTreeMap;

/// The sensors that each command answers, both by identifier.
const ANSWERS: [(u16, u16); 2] =
    [(DRIVE_VALVE_COMMAND.id, DRIVE_SENSORS.id), (LOAD_VALVE_COMMAND.id, LOAD_SENSORS.id)];

/// A connection of the host, by the order in which it was accepted.
pub(super) type PeerId = u64;

/// Who takes part, besides the rig.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BarrierConfig {
    /// Controllers that will join by name.
    pub members: usize,
    /// Identifiers of the command frames of foreign controllers, which join by their echo.
    pub echo_ids: Vec<u16>,
}

/// Deliveries and turns of the host when a phase is complete.
pub(super) struct Release {
    /// Frames with their senders, in the order of delivery.
    pub(super) frames: Vec<(CanFrame, PeerId)>,
    /// Who may act next.
    pub(super) go: Vec<PeerId>,
    pub(super) cycle: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Gathering,
    RigActs,
    RigDone,
    MembersAct,
}

struct Member {
    name: String,
    done: bool,
}

/// A foreign controller, one for each of [`BarrierConfig::echo_ids`].
struct ForeignMember {
    command_id: u16,
    /// Who has echoed a cycle before; `None` until somebody does.
    peer: Option<PeerId>,
    done: bool,
    /// Done without an answer: the sensors of this cycle were lost.
    lost: bool,
}

impl ForeignMember {
    fn answers(&self, sensors: &CanFrame) -> bool {
        ANSWERS.iter().any(|(command, id)| *command == self.command_id && sensors.standard_id() == Some(*id))
    }
}

/// A frame that waits for the end of its phase, with its sender's name for a fixed order.
struct PendingFrame {
    frame: CanFrame,
    from: PeerId,
    sender: String,
}

pub(super) struct Barrier {
    /// Controllers that have to join by name before the first cycle.
    expected: usize,
    phase: Phase,
    pub(super) cycle: u32,
    rig: Option<PeerId>,
    members: BTreeMap<PeerId, Member>,
    foreign_members: Vec<ForeignMember>,
    from_rig: Vec<PendingFrame>,
    from_others: Vec<PendingFrame>,
}

impl Barrier {
    pub(super) fn new(config: BarrierConfig) -> Self {
        let foreign = |command_id| ForeignMember { command_id, peer: None, done: false, lost: false };
        Self {
            expected: config.members,
            phase: Phase::Gathering,
            cycle: 0,
            rig: None,
            members: BTreeMap::new(),
            foreign_members: config.echo_ids.into_iter().map(foreign).collect(),
            from_rig: Vec::new(),
            from_others: Vec::new(),
        }
    }

    /// Whether it is the members' turn, who have the rig's frames then.
    pub(super) fn members_act(&self) -> bool {
        self.phase == Phase::MembersAct
    }

    /// Members in the barrier, the rig not counted.
    pub(super) fn member_count(&self) -> usize {
        self.members.len() + self.foreign_members.len()
    }

    /// All connections in the barrier.
    pub(super) fn everyone(&self) -> Vec<PeerId> {
        self.rig.iter().chain(self.members.keys()).copied().collect()
    }

    /// Whether losing a frame at this peer's queue would break determinism.
    pub(super) fn must_not_lose(&self, peer: PeerId) -> bool {
        self.rig == Some(peer) || self.members.contains_key(&peer)
    }

    /// A peer joins; false when the part is taken. Later joiners of a running barrier act from the next release on.
    pub(super) fn join(&mut self, peer: PeerId, role: Role, name: String) -> bool {
        match role {
            // The first stays: a second emulator must not end the run of the first.
            Role::Rig if self.rig.is_some() => return false,
            Role::Rig => self.rig = Some(peer),
            Role::Member => {
                let done = self.phase == Phase::MembersAct;
                self.members.insert(peer, Member { name, done });
            }
        }
        true
    }

    /// A peer's connection is gone: the others go on without it.
    pub(super) fn leave(&mut self, peer: PeerId) {
        self.members.remove(&peer);
        if self.rig == Some(peer) {
            self.rig = None;
        }
    }

    pub(super) fn post(&mut self, from: PeerId, frame: CanFrame) {
        if self.rig == Some(from) {
            self.from_rig.push(PendingFrame { frame, from, sender: String::new() });
            return;
        }
        let sender = match self.members.get(&from) {
            Some(member) => member.name.clone(),
            None => {
                if self.phase == Phase::MembersAct {
                    self.note_echo(&frame, from);
                }
                String::new()
            }
        };
        self.from_others.push(PendingFrame { frame, from, sender });
    }

    fn note_echo(&mut self, frame: &CanFrame, from: PeerId) {
        let Some(foreign) =
            self.foreign_members.iter_mut().find(|foreign| frame.standard_id() == Some(foreign.command_id))
        else {
            return;
        };
        let echo = match Frame::decode(frame) {
            Ok(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => command.echo,
            _ => return,
        };
        if u64::from(echo) == u64::from(self.cycle) % ECHO_RANGE {
            (foreign.peer, foreign.done, foreign.lost) = (Some(from), true, false);
        }
    }

    /// A frame of this release was lost: for everyone, or at the queue of one peer. Whoever would have answered it is done
    /// with this cycle; as long as nobody has answered, a foreign member's queue may be that of the one who would.
    pub(super) fn lost(&mut self, frame: &CanFrame, at: Option<PeerId>) {
        // What is delivered while the members act is the rig's; everything else answers nothing.
        if self.phase != Phase::MembersAct {
            return;
        }
        for foreign in self.foreign_members.iter_mut().filter(|foreign| foreign.answers(frame)) {
            let reached = at.is_some_and(|at| foreign.peer.is_some_and(|peer| peer != at));
            foreign.lost |= !reached && !foreign.done;
            foreign.done |= !reached;
        }
    }

    /// A peer says that it posted all its frames of `cycle`.
    pub(super) fn done(&mut self, from: PeerId, cycle: u32) {
        if cycle != self.cycle {
            return;
        }
        if self.rig == Some(from) && self.phase == Phase::RigActs {
            self.phase = Phase::RigDone;
        } else if let Some(member) = self.members.get_mut(&from) {
            member.done = true;
        }
    }

    /// The name of the first that keeps the barrier waiting, in order of joining; `None` while it is the rig's turn.
    pub(super) fn waits_for(&self) -> Option<String> {
        if self.phase != Phase::MembersAct {
            return None;
        }
        let joined = self.members.values().find(|member| !member.done).map(|member| member.name.clone());
        joined.or_else(|| {
            let foreign = self.foreign_members.iter().find(|foreign| !foreign.done)?;
            Some(format!("echo on {:#05x}", foreign.command_id))
        })
    }

    /// Where the members' turn is over: the foreign controllers that had nothing to answer, as far as they are known.
    pub(super) fn unanswering(&self) -> impl Iterator<Item = Option<PeerId>> {
        let over = self.phase == Phase::MembersAct && self.waits_for().is_none();
        self.foreign_members.iter().filter(move |foreign| over && foreign.lost).map(|foreign| foreign.peer)
    }

    /// The release that is due, if a phase is complete. `connected` is the number of peers, joined or not.
    pub(super) fn release(&mut self, connected: usize) -> Option<Release> {
        match self.phase {
            Phase::Gathering => {
                let rig = self.rig?;
                let foreign_members = connected.saturating_sub(self.members.len() + 1);
                if self.members.len() < self.expected || foreign_members < self.foreign_members.len() {
                    return None;
                }
                self.phase = Phase::RigActs;
                Some(Release { frames: Vec::new(), go: vec![rig], cycle: 0 })
            }
            Phase::RigActs => None,
            Phase::RigDone => {
                self.phase = Phase::MembersAct;
                let go = self.members.keys().copied().collect();
                Some(Release { frames: sorted(&mut self.from_rig), go, cycle: self.cycle })
            }
            Phase::MembersAct => {
                let rig = self.rig?;
                if self.waits_for().is_some() {
                    return None;
                }
                self.members.values_mut().for_each(|member| member.done = false);
                self.foreign_members
                    .iter_mut()
                    .for_each(|foreign| (foreign.done, foreign.lost) = (false, false));
                self.cycle += 1;
                self.phase = Phase::RigActs;
                Some(Release { frames: sorted(&mut self.from_others), go: vec![rig], cycle: self.cycle })
            }
        }
    }
}

fn sorted(posted: &mut Vec<PendingFrame>) -> Vec<(CanFrame, PeerId)> {
    // Stable: frames of one sender on one identifier keep their order.
    posted.sort_by(|a, b| (a.frame.raw_id(), &a.sender).cmp(&(b.frame.raw_id(), &b.sender)));
    posted.drain(..).map(|entry| (entry.frame, entry.from)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::ValveCommand;

    const RIG: PeerId = 0;

    fn frame(id: u16) -> CanFrame {
        CanFrame::new(id, &[id as u8])
    }

    fn ids(release: &Release) -> Vec<u16> {
        release.frames.iter().filter_map(|(frame, _)| frame.standard_id()).collect()
    }

    /// A barrier of a rig and the named members, released into cycle 0.
    fn started(names: &[&str]) -> Barrier {
        let mut barrier = Barrier::new(BarrierConfig { members: names.len(), echo_ids: vec![] });
        barrier.join(RIG, Role::Rig, "rig".into());
        for (peer, name) in (1..).zip(names) {
            assert!(barrier.release(names.len() + 1).is_none(), "released before {name} joined");
            barrier.join(peer, Role::Member, (*name).into());
        }
        let release = barrier.release(names.len() + 1).unwrap();
        assert_eq!((release.go, release.cycle), (vec![RIG], 0));
        barrier
    }

    #[test]
    fn one_cycle_goes_rig_members_rig() {
        let mut barrier = started(&["drive", "load"]);
        barrier.post(RIG, frame(0x121));
        barrier.post(RIG, frame(0x120));
        assert!(barrier.release(3).is_none());
        barrier.done(RIG, 0);
        let to_members = barrier.release(3).unwrap();
        assert_eq!((ids(&to_members), to_members.go.as_slice()), (vec![0x120, 0x121], &[1, 2][..]));

        barrier.post(2, frame(0x111));
        barrier.done(2, 0);
        assert!(barrier.release(3).is_none());
        assert_eq!(barrier.waits_for().as_deref(), Some("drive"));
        barrier.post(1, frame(0x110));
        barrier.done(1, 0);
        let to_rig = barrier.release(3).unwrap();
        assert_eq!((ids(&to_rig), to_rig.go.as_slice(), to_rig.cycle), (vec![0x110, 0x111], &[RIG][..], 1));
    }

    #[test]
    fn order_of_delivery_does_not_depend_on_who_was_faster() {
        let orders = [[1, 2], [2, 1]].map(|order| {
            let mut barrier = started(&["b", "a"]);
            barrier.done(RIG, 0);
            barrier.release(3).unwrap();
            for peer in order {
                barrier.post(peer, frame(0x150));
                barrier.post(peer, frame(0x110));
                barrier.done(peer, 0);
            }
            barrier.release(3).unwrap().frames
        });
        assert_eq!(orders[0], orders[1]);
    }

    #[test]
    fn a_second_rig_does_not_take_the_firsts_place() {
        let mut barrier = started(&["drive"]);
        assert!(!barrier.join(9, Role::Rig, "another".into()));
        assert_eq!(barrier.everyone(), [RIG, 1]);
    }

    #[test]
    fn done_for_another_cycle_counts_for_nothing() {
        let mut barrier = started(&["drive"]);
        barrier.done(RIG, 7);
        assert!(barrier.release(2).is_none());
    }

    #[test]
    fn a_member_that_leaves_no_longer_holds_the_barrier() {
        let mut barrier = started(&["drive", "load"]);
        barrier.done(RIG, 0);
        barrier.release(3).unwrap();
        barrier.done(1, 0);
        barrier.leave(2);
        assert_eq!(barrier.release(2).unwrap().cycle, 1);
        assert_eq!(barrier.member_count(), 1);
    }

    const STRANGER: PeerId = 5;

    /// A barrier of a rig and a foreign drive controller, in cycle 0, with the rig's sensors under way.
    fn started_with_stranger() -> Barrier {
        let mut barrier = Barrier::new(BarrierConfig { members: 0, echo_ids: vec![DRIVE_VALVE_COMMAND.id] });
        barrier.join(RIG, Role::Rig, "rig".into());
        assert!(barrier.release(1).is_none(), "released before the foreign member connected");
        barrier.release(2).unwrap();
        sensors_under_way(&mut barrier);
        barrier
    }

    fn sensors_under_way(barrier: &mut Barrier) {
        barrier.done(RIG, barrier.cycle);
        barrier.release(2).unwrap();
        assert!(barrier.release(2).is_none(), "nobody has answered yet");
    }

    fn answer(barrier: &mut Barrier, echo: u16) {
        let command = ValveCommand { opening: 0.0, alive: 0, echo, enable: true };
        barrier.post(STRANGER, Frame::DriveValveCommand(command).encode().unwrap());
    }

    #[test]
    fn a_foreign_controller_is_done_when_its_command_echoes_the_cycle() {
        let mut barrier = started_with_stranger();
        for (echo, released) in [(9, false), (0, true)] {
            answer(&mut barrier, echo);
            assert_eq!(barrier.release(2).is_some(), released, "echo {echo}");
        }
    }

    #[test]
    fn a_foreign_controller_is_done_when_the_sensors_that_it_answers_are_lost() {
        for (lost, at, released) in [
            (DRIVE_SENSORS.id, None, true),
            (DRIVE_SENSORS.id, Some(STRANGER), true),
            // A listener that does not read is none of its business, nor are the other axis and the tick.
            (DRIVE_SENSORS.id, Some(STRANGER + 1), false),
            (LOAD_SENSORS.id, None, false),
            (0x130, None, false),
        ] {
            let mut barrier = started_with_stranger();
            answer(&mut barrier, 0);
            barrier.release(2).unwrap();
            // Lost between the members' turn and the rig's sensors: somebody else's frame.
            barrier.lost(&frame(lost), at);
            sensors_under_way(&mut barrier);
            barrier.lost(&frame(lost), at);
            assert_eq!(barrier.release(2).is_some(), released, "{lost:#x} lost at {at:?}");
        }
    }

    #[test]
    fn as_long_as_nobody_answered_any_strangers_queue_may_be_the_one() {
        let mut barrier = started_with_stranger();
        barrier.lost(&frame(DRIVE_SENSORS.id), Some(STRANGER + 1));
        assert!(barrier.release(2).is_some());
    }

    #[test]
    fn a_foreign_controller_without_an_answer_is_reported_at_the_end_of_the_members_turn() {
        let unanswering = |barrier: &Barrier| barrier.unanswering().collect::<Vec<_>>();
        let mut barrier = started_with_stranger();
        barrier.lost(&frame(DRIVE_SENSORS.id), None);
        assert_eq!(unanswering(&barrier), [None], "nobody has answered before");
        barrier.release(2).unwrap();
        assert!(unanswering(&barrier).is_empty(), "the rig's turn");
        sensors_under_way(&mut barrier);
        answer(&mut barrier, 1);
        barrier.lost(&frame(DRIVE_SENSORS.id), None);
        assert!(unanswering(&barrier).is_empty(), "it has answered this cycle");
        barrier.release(2).unwrap();
        sensors_under_way(&mut barrier);
        barrier.lost(&frame(DRIVE_SENSORS.id), Some(STRANGER));
        assert_eq!(unanswering(&barrier), [Some(STRANGER)]);
    }
}
