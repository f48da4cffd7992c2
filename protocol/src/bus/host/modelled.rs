//! The host over a wire that keeps time: what the model says happened is carried out, in real time and in lockstep.

use super::{ForRig, GONE, Host, RIG_HERE, SendOutcome};
use crate::bus::lockstep::{PeerId, Release};
use crate::bus::timed::TimedWire;
use crate::can::{CanFrame, ERROR_FLAG};
use crate::periods::CYCLE_NS;
use crate::wire_time::WireEvent;
use std::io;

impl Host {
    /// The wire, when it keeps the machine's time.
    pub(super) fn wire_in_real_time(&self) -> Option<&TimedWire> {
        self.timed.as_ref().filter(|_| self.barrier.is_none())
    }

    /// Real time: everything up to `to_ns` of the model's time happens, and the timer is set to what comes next.
    pub(super) fn advance_wire(&mut self, to_ns: u64) -> io::Result<()> {
        let Some(timed) = &mut self.timed else { return Ok(()) };
        let mut events = std::mem::take(&mut self.wire_events);
        timed.model.advance(to_ns, &mut events);
        for event in events.drain(..) {
            let ended_ns = match &event {
                WireEvent::Delivered { ended_ns, .. } => Some(*ended_ns),
                WireEvent::ErrorFrame { .. } => None,
            };
            self.happen(event);
            if let (Some(ended_ns), Some(timed)) = (ended_ns, &mut self.timed) {
                timed.note_delivery(ended_ns);
            }
        }
        self.wire_events = events;
        self.timed.as_mut().map_or(Ok(()), |timed| timed.arm().map_err(io::Error::from))
    }

    /// Lockstep: the frames of a release enter the wire, and what is through by its end is delivered.
    pub(super) fn carry_through_wire(&mut self, release: &Release) {
        let members_turn = self.barrier.as_ref().is_some_and(|barrier| barrier.members_act());
        let Some(timed) = &mut self.timed else { return };
        let begins_ns = u64::from(release.cycle) * CYCLE_NS;
        // The rig speaks as its cycle begins; the others when they have heard it.
        let enters_ns = if members_turn { begins_ns } else { timed.model.now_ns() };
        let mut error_frames = Vec::new();
        for (frame, from) in &release.frames {
            if frame.raw_id() & ERROR_FLAG == 0 {
                timed.enter(*from, frame, enters_ns);
            } else {
                error_frames.push((*frame, *from));
            }
        }
        error_frames.iter().for_each(|(frame, from)| self.deliver(frame, *from, &[]));
        if members_turn {
            self.carry_rigs_frames(release, begins_ns);
        } else {
            self.carry_until(begins_ns);
        }
    }

    /// Time goes on until all the rig said in this cycle is through, to the cycle's end at most.
    fn carry_rigs_frames(&mut self, release: &Release, begins_ns: u64) {
        let mut missing: Vec<CanFrame> = release
            .frames
            .iter()
            .map(|(frame, _)| *frame)
            .filter(|frame| frame.raw_id() & ERROR_FLAG == 0)
            .collect();
        let mut events = std::mem::take(&mut self.wire_events);
        while !missing.is_empty()
            && self.timed.as_mut().is_some_and(|timed| timed.advance_once(begins_ns + CYCLE_NS, &mut events))
        {
            for event in events.drain(..) {
                if let WireEvent::Delivered { frame, entered_ns, .. } = &event
                    && *entered_ns >= begins_ns
                    && let Some(place) = missing.iter().position(|missing| missing == frame)
                {
                    missing.swap_remove(place);
                }
                self.happen(event);
            }
        }
        self.wire_events = events;
        if let Some(barrier) = &mut self.barrier {
            // Whoever answers them does so when they come, in a later cycle: they do not hold up this one.
            missing.iter().for_each(|frame| barrier.lost(frame, None));
        }
    }

    fn carry_until(&mut self, to_ns: u64) {
        let mut events = std::mem::take(&mut self.wire_events);
        if let Some(timed) = &mut self.timed {
            timed.model.advance(to_ns, &mut events);
        }
        events.drain(..).for_each(|event| self.happen(event));
        self.wire_events = events;
    }

    fn happen(&mut self, event: WireEvent) {
        let Some(timed) = &self.timed else { return };
        match event {
            WireEvent::Delivered { frame, from, deaf, .. } => {
                let from = timed.peer_of(from).unwrap_or(GONE);
                let deaf: Vec<PeerId> = deaf.into_iter().filter_map(|node| timed.peer_of(node)).collect();
                self.deliver(&frame, from, &deaf);
            }
            WireEvent::ErrorFrame { node, frame, .. } => {
                let Some(peer) = timed.peer_of(node) else { return };
                self.tell_of_error(peer, &frame);
            }
        }
    }

    /// An error frame for one peer: what its own controller has to say.
    fn tell_of_error(&mut self, id: PeerId, frame: &CanFrame) {
        if let (RIG_HERE, Some(for_rig)) = (id, &mut self.for_rig) {
            for_rig.push_back(ForRig::Frame(*frame));
            return;
        }
        let in_barrier = self.barrier.as_ref().is_some_and(|barrier| barrier.must_not_lose(id));
        let Some(peer) = self.peers.get_mut(&id) else { return };
        if in_barrier {
            peer.post(&frame.to_bytes());
        } else if matches!(peer.send(&frame.to_bytes()), SendOutcome::Dropped) {
            self.report.peers[peer.report].dropped_at_queue.count(frame);
        }
    }
}
