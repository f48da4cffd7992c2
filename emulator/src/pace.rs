//! The loop over the cycles of the rig: by the real clock, or by the lockstep barrier.

pub(crate) mod lockstep;
pub(crate) mod real;

use crate::node::EmulatorNode;
use protocol::bus::Bus;
use realtime::{Continued, Freeze, Interrupt, LoopStatistics, Overrun};
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Source of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// One cycle each millisecond of the machine's clock.
    Real,
    /// As fast as all members of the barrier allow; time is simulated.
    Lockstep,
}

impl FromStr for Pace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "real" => Ok(Self::Real),
            "lockstep" => Ok(Self::Lockstep),
            _ => Err(format!("pace '{text}' is none of real, lockstep")),
        }
    }
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Real => "real",
            Self::Lockstep => "lockstep",
        })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RunEnd {
    ControllersDone,
    /// The requested time has passed.
    TimeUp,
    /// Quit was typed at the console.
    Quit,
    Interrupted,
    /// The writer failed and has reported why.
    OutputFailed,
    /// The bus was down for longer than the grace time.
    BusGone,
    /// Another rig was on the bus before this one.
    SecondRig,
    /// Lockstep: expected members did not join in time.
    NobodyJoined,
    /// Lockstep: all members left before Done.
    MembersLeft,
    /// Lockstep: this member missed its time-out.
    LockstepTimeout(String),
    Overrun(Overrun),
    /// The plant's state is not finite.
    NotFinite,
}

/// State shared with the rest of the program.
#[derive(Default)]
pub(crate) struct Shared {
    /// Set by the signals that end a run.
    pub interrupt: Interrupt,
    /// Set by the signal that freezes the flight recorder.
    pub freeze: Freeze,
    /// Number of continuations of the process after stops.
    pub continued: Continued,
    /// Set by the writer on failure.
    pub output_failed: AtomicBool,
    /// Newest cycle, for the progress line.
    pub cycle: AtomicU64,
    /// Skipped cycles, for the progress line.
    pub skipped: AtomicU64,
    /// Whether a controller was received, for the progress line.
    pub controller_received: AtomicBool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Number of cycles; `None` runs until the controllers are done.
    pub cycles: Option<u64>,
    /// Longest loss of the bus.
    pub bus_grace: Duration,
    /// Lockstep: longest wait for the members to join.
    pub join: Duration,
    /// Lockstep: longest time of a member for a cycle.
    pub cycle: Duration,
}

/// A rig on its bus, and what may end its run.
pub(crate) struct RunContext<'a> {
    pub node: &'a mut EmulatorNode,
    pub bus: &'a mut dyn Bus,
    pub limits: &'a Limits,
    /// State shared with the rest of the program.
    pub shared: &'a Shared,
}

/// Results of the loop.
pub(crate) struct RunOutcome {
    pub end: RunEnd,
    /// Cycles begun, skipped ones included.
    pub cycles: u64,
    /// Due time of cycle 0, ns of the run's clock.
    pub cycle_zero_ns: u64,
    /// Statistics of the loop; `None` in lockstep, which has no schedule.
    pub statistics: Option<LoopStatistics>,
    /// Allocations in the 1 ms path after warm-up; `None` without the counting allocator, and for a run shorter than the
    /// warm-up.
    pub allocations: Option<u64>,
}

impl RunContext<'_> {
    /// Publishes the progress after `cycles`; returns why the run should end, if it should.
    fn after_cycle(&mut self, cycles: u64) -> Option<RunEnd> {
        let Self { node, limits, shared, .. } = self;
        shared.cycle.store(cycles, Ordering::Relaxed);
        shared.skipped.store(node.skipped(), Ordering::Relaxed);
        shared.controller_received.store(node.controller_received(), Ordering::Relaxed);
        if !node.is_finite(cycles - 1) {
            Some(RunEnd::NotFinite)
        } else if shared.interrupt.came() {
            Some(RunEnd::Interrupted)
        } else if shared.output_failed.load(Ordering::Relaxed) {
            Some(RunEnd::OutputFailed)
        } else if node.quit_asked {
            Some(RunEnd::Quit)
        } else if limits.cycles.is_some_and(|limit| cycles >= limit) {
            Some(RunEnd::TimeUp)
        } else {
            node.controllers_done().then_some(RunEnd::ControllersDone)
        }
    }
}
