//! The valve command that acts in each cycle, by the rules of the rig ([`protocol::commands`]).
//!
//! ```text
//!   t_k ── sensors k ──── command, echo k ──── t_k+1 ── sensors k+1 ────
//!                              └── stamp before t_k+1: latched for [t_k+1, t_k+2)
//! ```

use super::LoggedBy;
use super::cycles::LoggedFrame;
use plant::Axis;
use protocol::commands::{CommandIntake, STALE_AFTER_CYCLES};
use protocol::frames::Frame;
use protocol::live_cycles::LiveCycles;
use std::collections::VecDeque;

/// Valve commands that act on both axes, cycle by cycle.
pub(super) struct ValveCommands {
    intakes: [CommandIntake; 2],
    live: LiveCycles,
    logged_by: LoggedBy,
    /// Commands and stops that no cycle has taken yet.
    waiting: VecDeque<LoggedFrame>,
    /// Who holds the emergency stop: console, rig, drive, load.
    holders: [bool; 4],
    /// A stop from before the log, known from the rig's status only.
    stopped_before: bool,
    first: u64,
    accepted: [bool; 2],
    /// Whether a command came for the cycle.
    fresh: [bool; 2],
    opening: [Option<f64>; 2],
}

impl ValveCommands {
    /// Before the log's first cycle.
    pub(super) fn new(first: u64, logged_by: LoggedBy) -> Self {
        Self {
            intakes: Default::default(),
            live: LiveCycles::default(),
            logged_by,
            waiting: VecDeque::new(),
            holders: [false; 4],
            stopped_before: false,
            first,
            accepted: [false; 2],
            fresh: [false; 2],
            opening: [None; 2],
        }
    }

    /// Processes a frame, in the order of the log.
    pub(super) fn note(&mut self, logged: LoggedFrame) {
        match logged.frame {
            Frame::RigEmergencyStop(stop) => self.holders[1] = !stop.release,
            Frame::RigStatus(status) => {
                let valves = |logged: &LoggedFrame| {
                    matches!(logged.frame, Frame::DriveValveCommand(_) | Frame::LoadValveCommand(_))
                };
                let holder_known = self.holders.contains(&true) || !self.waiting.iter().all(valves);
                self.stopped_before = status.emergency_stop && (self.stopped_before || !holder_known);
            }
            Frame::DriveValveCommand(_)
            | Frame::LoadValveCommand(_)
            | Frame::ConsoleEmergencyStop(_)
            | Frame::DriveEmergencyStop(_)
            | Frame::LoadEmergencyStop(_) => self.waiting.push_back(logged),
            _ => {}
        }
    }

    /// A cycle computed and not sent: the command before continues to act.
    pub(super) fn skip(&mut self, cycle: u64) -> [Option<f64>; 2] {
        self.live.skipped(cycle, 1);
        self.opening
    }

    /// Commands that act over the cycle that began at `start_ns`.
    pub(super) fn latch(&mut self, cycle: u64, start_ns: u64) -> [Option<f64>; 2] {
        self.live.sent(cycle);
        self.fresh = [false; 2];
        while let Some(logged) = self.waiting.pop_front_if(|logged| logged.stamp_ns < start_ns) {
            match logged.frame {
                Frame::DriveValveCommand(command) => self.take(Axis::Drive, command),
                Frame::LoadValveCommand(command) => self.take(Axis::Load, command),
                Frame::ConsoleEmergencyStop(stop) => self.holders[0] = !stop.release,
                Frame::DriveEmergencyStop(stop) => self.holders[2] = !stop.release,
                Frame::LoadEmergencyStop(stop) => self.holders[3] = !stop.release,
                _ => {}
            }
        }
        let stopped = self.stopped_before || self.holders.contains(&true);
        for axis in Axis::ALL.map(Axis::index) {
            let intake = &mut self.intakes[axis];
            intake.latch(&self.live);
            // The rig starts with both valves shut; of one that ran before nobody knows, until its commands would be stale.
            let known = self.first == 0 || self.accepted[axis] || cycle - self.first > STALE_AFTER_CYCLES;
            // Where a listener heard no command, the rig may have heard one.
            let command_known = self.fresh[axis] || self.logged_by == LoggedBy::Rig || intake.stale();
            let opening = if stopped { 0.0 } else { intake.opening() };
            self.opening[axis] = (stopped || known && command_known).then(|| plant::quantise_valve(opening));
        }
        self.opening
    }

    fn take(&mut self, axis: Axis, command: protocol::frames::ValveCommand) {
        let intake = &mut self.intakes[axis.index()];
        if intake.take(command, &self.live) {
            self.accepted[axis.index()] = true;
            self.fresh[axis.index()] = true;
        }
    }

    /// Commands that the counters miss, and times that two senders were at work, by axis.
    pub(super) fn counted(&self) -> [(u64, u64); 2] {
        self.intakes.each_ref().map(|intake| (intake.counters.lost, intake.counters.two_sources))
    }
}
