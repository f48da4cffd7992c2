//! Sends frames when they are due, and watches for a rig meanwhile.
//!
//! The thread waits until each frame's absolute due time, in pieces, so that Ctrl-C and a rig that comes alive are seen within
//! [`PIECE`]. Error of a frame = when the bus took it - when it was due; it is never negative, and counts what a late
//! predecessor cost, too.

use super::kind::Kind;
use super::schedule::Schedule;
use protocol::bus::{Bus, Received};
use realtime::{Clock, Instant, Interrupt, Recorder};
use std::time::Duration;

/// Longest wait between two looks at the bus and for Ctrl-C.
const PIECE: Duration = Duration::from_millis(5);
/// Time from the decision to begin until the first frame is due.
const LEAD: Duration = Duration::from_millis(20);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// With the last frame.
    Whole,
    /// By Ctrl-C or SIGTERM.
    Interrupted,
    /// A rig came alive, and the log would have disturbed it.
    LiveRig,
}

pub(super) struct Played {
    pub(super) end: End,
    /// Frames that the bus took.
    pub(super) sent: u64,
    /// Frames that it did not take.
    pub(super) dropped: u64,
    pub(super) error_ns: Recorder,
}

/// Frames of a rig that wait at our queue: somebody else's, since no bus lets a peer hear itself.
pub(super) fn heard_of_a_rig(bus: &mut dyn Bus) -> u64 {
    let mut heard = 0;
    while let Received::Frame(frame, _) = bus.receive() {
        heard += u64::from(Kind::of(&frame) == Kind::Rig);
    }
    heard
}

/// Sends the whole schedule.
pub(super) fn play(
    bus: &mut dyn Bus,
    clock: &impl Clock,
    schedule: &Schedule,
    spin: Duration,
    interrupt: &Interrupt,
) -> Played {
    let mut played = Played { end: End::Whole, sent: 0, dropped: 0, error_ns: Recorder::new() };
    let start = clock.now() + LEAD;
    let disturbs = schedule.disturbs_a_rig();
    for next in &schedule.frames {
        let due = start + Duration::from_nanos(next.after_ns);
        if let Some(end) = wait(bus, clock, due.saturating_sub(spin), disturbs, interrupt) {
            played.end = end;
            return played;
        }
        clock.spin_until(due);
        match bus.send(&next.frame) {
            Ok(sent_ns) => {
                played.sent += 1;
                played.error_ns.record(sent_ns.saturating_sub(due.as_nanos()));
            }
            Err(_) => played.dropped += 1,
        }
    }
    played
}

/// Waits until `due`, unless something ends the replay.
fn wait(
    bus: &mut dyn Bus,
    clock: &impl Clock,
    due: Instant,
    disturbs: bool,
    interrupt: &Interrupt,
) -> Option<End> {
    loop {
        if interrupt.came() {
            return Some(End::Interrupted);
        }
        // What others send is taken in any case: a queue that is full would say nothing of a rig.
        if heard_of_a_rig(bus) > 0 && disturbs {
            return Some(End::LiveRig);
        }
        let now = clock.now();
        if now >= due {
            return None;
        }
        clock.wait_until(due.min(now + PIECE));
    }
}
