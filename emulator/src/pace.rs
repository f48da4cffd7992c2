//! What moves the rig from cycle to cycle: the real clock, or the lockstep barrier.

pub(crate) mod lockstep;
pub(crate) mod real;

use crate::node::EmulatorNode;
use protocol::bus::Bus;
use realtime::{Continued, Freeze, Interrupt, LoopStatistics, Overrun};
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// How time passes.
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

/// Why a run ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum End {
    ControllersDone,
    /// The time that was asked for has passed.
    TimeUp,
    /// Somebody typed quit at the console.
    Quit,
    Interrupted,
    /// The writer could not write; it has said why.
    OutputFailed,
    /// The bus was gone for longer than the grace time.
    BusGone,
    /// Another rig was on the bus before this one.
    SecondRig,
    /// Lockstep: not all expected members joined in time.
    NobodyJoined,
    /// Lockstep: all members left without saying Done.
    MembersLeft,
    /// Lockstep: this member was not done in time.
    LockstepTimeout(String),
    Overrun(Overrun),
    /// The plant's state is no longer finite.
    NotFinite,
}

/// What both paces share with the rest of the program.
#[derive(Default)]
pub(crate) struct Shared {
    /// Set by the signals that end a run.
    pub interrupt: Interrupt,
    /// Set by the signal that freezes the flight recorder.
    pub freeze: Freeze,
    /// How often the process was continued after a stop.
    pub continued: Continued,
    /// Set by the writer when it cannot write.
    pub output_failed: AtomicBool,
    /// Newest cycle, for the progress line.
    pub cycle: AtomicU64,
    /// Skipped cycles, for the progress line.
    pub skipped: AtomicU64,
    /// Whether a controller was heard, for the progress line.
    pub controller_received: AtomicBool,
}

/// When a run ends by itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Cycles to run; `None` runs until the controllers are done.
    pub cycles: Option<u64>,
    /// How long the bus may be gone.
    pub bus_grace: Duration,
    /// Lockstep: how long to wait for the members to join.
    pub join: Duration,
    /// Lockstep: how long a member may take for a cycle.
    pub cycle: Duration,
}

/// A rig on its bus, and what may end its run.
pub(crate) struct RunContext<'a> {
    pub node: &'a mut EmulatorNode,
    pub bus: &'a mut dyn Bus,
    pub limits: &'a Limits,
    /// What is shared with the rest of the program.
    pub shared: &'a Shared,
}

/// What a pace leaves behind.
pub(crate) struct RunOutcome {
    pub end: End,
    /// Cycles begun, skipped ones included.
    pub cycles: u64,
    /// When cycle 0 was due, in ns of the run's clock.
    pub cycle_zero_ns: u64,
    /// Statistics of the loop; `None` in lockstep, which has no schedule.
    pub statistics: Option<LoopStatistics>,
    /// Allocations in the 1 ms path after warm-up, if the counting allocator is built in; `None` when nothing was watched.
    pub allocations: Option<u64>,
}

impl RunContext<'_> {
    /// Tells the progress after `cycles`, and why the run should end, if it should.
    fn after_cycle(&mut self, cycles: u64) -> Option<End> {
        let Self { node, limits, shared, .. } = self;
        shared.cycle.store(cycles, Ordering::Relaxed);
        shared.skipped.store(node.skipped(), Ordering::Relaxed);
        shared.controller_received.store(node.controller_received(), Ordering::Relaxed);
        if !node.is_finite(cycles - 1) {
            Some(End::NotFinite)
        } else if shared.interrupt.came() {
            Some(End::Interrupted)
        } else if shared.output_failed.load(Ordering::Relaxed) {
            Some(End::OutputFailed)
        } else if node.quit_asked() {
            Some(End::Quit)
        } else if limits.cycles.is_some_and(|limit| cycles >= limit) {
            Some(End::TimeUp)
        } else {
            node.controllers_done().then_some(End::ControllersDone)
        }
    }
}
