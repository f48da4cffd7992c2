//! Sends frames when they are due, and watches for a rig.
//!
//! The thread waits until each frame's absolute due time, in steps of [`WAIT_STEP`], so that it notices Ctrl-C and a rig. Error
//! of a frame = time when the bus accepted it - due time; it is never negative and includes the delay by a late predecessor.

use super::kind::Kind;
use super::schedule::Schedule;
use protocol::bus::{Bus, Received};
use realtime::{Clock, Instant, Interrupt, Recorder};
use serde::Serialize;
use std::time::Duration;

/// Longest wait between two polls of the bus and of Ctrl-C.
const WAIT_STEP: Duration = Duration::from_millis(5);
/// Time from the decision to begin until the first frame is due.
const LEAD: Duration = Duration::from_millis(20);

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ReplayEnd {
    /// After the last frame.
    #[serde(rename = "whole")]
    Completed,
    /// By Ctrl-C or SIGTERM.
    Interrupted,
    /// A rig started that the log would have disturbed.
    LiveRig,
}

pub(super) struct ReplayStatistics {
    pub(super) end: ReplayEnd,
    /// Frames that the bus accepted.
    pub(super) sent: u64,
    /// Frames that it did not accept.
    pub(super) dropped: u64,
    pub(super) error_ns: Recorder,
}

/// Number of waiting frames of a rig; they are of another node, since no peer receives its frames.
pub(super) fn take_rig_frames(bus: &mut dyn Bus) -> u64 {
    let mut rig_frames = 0;
    while let Received::Frame(frame, _) = bus.receive() {
        rig_frames += u64::from(Kind::of(&frame) == Kind::Rig);
    }
    rig_frames
}

/// Sends the whole schedule.
pub(super) fn play(
    bus: &mut dyn Bus,
    clock: &impl Clock,
    schedule: &Schedule,
    spin: Duration,
    interrupt: &Interrupt,
) -> ReplayStatistics {
    let mut played =
        ReplayStatistics { end: ReplayEnd::Completed, sent: 0, dropped: 0, error_ns: Recorder::new() };
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
) -> Option<ReplayEnd> {
    loop {
        if interrupt.came() {
            return Some(ReplayEnd::Interrupted);
        }
        // Frames of others are always taken: a full queue would hide a rig.
        if take_rig_frames(bus) > 0 && disturbs {
            return Some(ReplayEnd::LiveRig);
        }
        let now = clock.now();
        if now >= due {
            return None;
        }
        clock.wait_until(due.min(now + WAIT_STEP));
    }
}
