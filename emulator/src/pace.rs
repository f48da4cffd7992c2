//! What moves the rig from cycle to cycle: the real clock, or the lockstep barrier.

use crate::station::Station;
use protocol::bus::control::{Kind, Role};
use protocol::bus::host::BARRIER_TIMEOUT;
use protocol::bus::{Bus, BusError, Received};
use protocol::can::CanFrame;
use realtime::{Clock, Interrupt, LoopStatistics, Overrun, PeriodicConfig, PeriodicLoop};
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant as WallInstant};

/// Basic cycle (bus.md, Time).
pub const CYCLE: Duration = Duration::from_millis(1);
/// How long after the farewell the answers to the last cycles may still come in.
const FAREWELL: Duration = Duration::from_millis(30);
/// Lockstep: how long an interrupted rig still waits for the members' turn.
const LAST_TURN: Duration = Duration::from_millis(500);
/// Frames that may arrive between a cycle's start and a late loop's reading; they belong to the next cycle.
const EARLY_FRAMES: usize = 256;
/// Cycles that a watched section leaves out at the start: first touches of memory, first frames of each kind.
const WARM_UP_CYCLES: u64 = 1000;

/// How time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
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
pub enum End {
    /// The controllers said Done.
    ControllersDone,
    /// The time that was asked for has passed.
    TimeUp,
    /// Ctrl-C or SIGTERM.
    Interrupted,
    /// The writer could not write; it has said why.
    OutputFailed,
    /// The bus was gone for longer than the grace time.
    BusGone,
    /// Lockstep: not all expected members joined in time.
    NobodyJoined,
    /// Lockstep: all members left without saying Done.
    MembersLeft,
    /// Lockstep: this member was not done in time.
    LockstepTimeout(String),
    /// Overrun policy `stop`.
    Overrun(Overrun),
    /// The plant's state is no longer finite.
    NotFinite,
}

/// What both paces share with the rest of the program.
#[derive(Default)]
pub struct Shared {
    /// Set by a signal.
    pub interrupt: Interrupt,
    /// Set by the writer when it cannot write.
    pub output_failed: AtomicBool,
    /// Newest cycle, for the progress line.
    pub cycle: AtomicU64,
    /// Skipped cycles, for the progress line.
    pub skipped: AtomicU64,
}

/// When a run ends by itself.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Cycles to run; `None` runs until the controllers are done.
    pub cycles: Option<u64>,
    /// How long the bus may be gone.
    pub bus_grace: Duration,
    /// Lockstep: how long to wait for the members to join.
    pub join: Duration,
}

/// What a pace leaves behind.
pub struct Paced {
    /// Why it ended.
    pub end: End,
    /// Cycles begun, skipped ones included.
    pub cycles: u64,
    /// Statistics of the loop; `None` in lockstep, which has no schedule.
    pub statistics: Option<LoopStatistics>,
    /// Allocations in the 1 ms path after warm-up, if the counting allocator is built in; `None` when nothing was watched.
    pub allocations: Option<u64>,
}

/// Runs the rig on the clock.
pub fn run_real<C: Clock>(
    station: &mut Station,
    bus: &mut dyn Bus,
    clock: C,
    config: PeriodicConfig,
    limits: &Limits,
    shared: &Shared,
) -> Paced {
    let start = clock.now() + CYCLE;
    let mut periodic = PeriodicLoop::new(clock, config, start);
    let mut inbox = Inbox::new();
    let mut bus_lost_at: Option<u64> = None;
    let mut cycles = 0;
    let mut watch = None;
    let grace_cycles = limits.bus_grace.as_millis() as u64;
    let end = loop {
        let cycle = match periodic.next_cycle() {
            Ok(cycle) => cycle,
            Err(overrun) => break End::Overrun(overrun),
        };
        let index = cycle.index;
        if watch.is_none() && index >= WARM_UP_CYCLES {
            watch = Some(realtime::allocations::watch());
        }
        station.miss(index - cycle.skipped, cycle.skipped);
        station.publish(index, cycle.skipped > 0, bus);
        inbox.take_before(cycle.scheduled.as_nanos(), bus, |frame, stamp_ns| {
            station.take(frame, stamp_ns, index);
        });
        station.act(index);
        cycles = index + 1;
        shared.cycle.store(cycles, Ordering::Relaxed);
        shared.skipped.store(station.skipped(), Ordering::Relaxed);
        bus_lost_at = if bus.is_up() { None } else { bus_lost_at.or(Some(index)) };
        if bus_lost_at.is_some_and(|lost| index - lost > grace_cycles) {
            break End::BusGone;
        }
        if let Some(end) = common_end(station, cycles, limits, shared) {
            break end;
        }
        periodic.end_of_work();
    };
    let allocations = watch.map(|watch| {
        drop(watch);
        realtime::allocations::counted()
    });
    if end != End::NotFinite {
        station.publish_end(cycles, bus);
        let until = WallInstant::now() + FAREWELL;
        while let Some(left) = until.checked_duration_since(WallInstant::now()) {
            inbox.take_before(u64::MAX, bus, |frame, stamp_ns| station.take(frame, stamp_ns, cycles));
            bus.wait_readable(left);
        }
    }
    Paced { end, cycles, statistics: Some(periodic.into_statistics()), allocations }
}

/// Runs the rig as the barrier's rig.
///
/// # Errors
/// [`BusError::NoBarrier`] on a bus without one.
pub fn run_lockstep(
    station: &mut Station,
    bus: &mut dyn Bus,
    simulated_ns: &AtomicU64,
    limits: &Limits,
    shared: &Shared,
) -> Result<Paced, BusError> {
    bus.join_lockstep(Role::Rig, "rig")?;
    let mut cycles = 0;
    let mut members_seen = false;
    let end = loop {
        let patience = if cycles == 0 { limits.join } else { BARRIER_TIMEOUT * 2 };
        let members = match wait_for_go(station, bus, cycles, patience, shared) {
            Ok(members) => members,
            Err(end) => break end,
        };
        members_seen |= members > 0;
        simulated_ns.store(cycles * 1_000_000, Ordering::Relaxed);
        station.publish(cycles, false, bus);
        station.act(cycles);
        let this_cycle = cycles;
        cycles += 1;
        shared.cycle.store(cycles, Ordering::Relaxed);
        let end = common_end(station, cycles, limits, shared);
        if let Some(end) = end.or((members_seen && members == 0).then_some(End::MembersLeft)) {
            station.publish_end(cycles, bus);
            bus.done(this_cycle as u32);
            // The members' last words belong into the log; a member that is gone says none.
            let _ = wait_for_go(station, bus, cycles, FAREWELL, shared);
            break end;
        }
        bus.done(this_cycle as u32);
    };
    Ok(Paced { end, cycles, statistics: None, allocations: None })
}

/// Takes frames until the barrier says Go for `cycle`; tells how many members it has.
fn wait_for_go(
    station: &mut Station,
    bus: &mut dyn Bus,
    cycle: u64,
    patience: Duration,
    shared: &Shared,
) -> Result<u8, End> {
    let mut since: Option<WallInstant> = None;
    loop {
        match bus.receive() {
            // Stamped in the cycle in which it was posted: the clock still shows it.
            Received::Frame(frame, stamp_ns) => station.take(&frame, stamp_ns, cycle),
            Received::Barrier(control) => match control.kind {
                Kind::Go { members } if u64::from(control.cycle) == cycle => return Ok(members),
                Kind::TimedOut => return Err(End::LockstepTimeout(control.name())),
                _ => {}
            },
            Received::Nothing => {
                let waited = since.get_or_insert_with(WallInstant::now).elapsed();
                // In the middle of a cycle the members finish their turn, so that they hear the farewell after it.
                if shared.interrupt.came() && (cycle == 0 || waited >= LAST_TURN) {
                    return Err(End::Interrupted);
                }
                if waited >= patience {
                    return Err(if cycle == 0 { End::NobodyJoined } else { End::BusGone });
                }
                bus.wait_readable((patience - waited).min(Duration::from_millis(100)));
            }
        }
    }
}

fn common_end(station: &Station, cycles: u64, limits: &Limits, shared: &Shared) -> Option<End> {
    if !station.is_finite() {
        Some(End::NotFinite)
    } else if shared.interrupt.came() {
        Some(End::Interrupted)
    } else if shared.output_failed.load(Ordering::Relaxed) {
        Some(End::OutputFailed)
    } else if limits.cycles.is_some_and(|limit| cycles >= limit) {
        Some(End::TimeUp)
    } else {
        station.controllers_done().then_some(End::ControllersDone)
    }
}

/// Sorts frames by cycle: what arrived after a cycle's start waits for the next one, however late the loop reads.
struct Inbox {
    early: [Option<(CanFrame, u64)>; EARLY_FRAMES],
    count: usize,
}

impl Inbox {
    fn new() -> Self {
        Self { early: [None; EARLY_FRAMES], count: 0 }
    }

    fn take_before(&mut self, before_ns: u64, bus: &mut dyn Bus, mut take: impl FnMut(&CanFrame, u64)) {
        let waiting = std::mem::take(&mut self.count);
        for slot in 0..waiting {
            if let Some((frame, stamp_ns)) = self.early[slot].take() {
                self.sort(frame, stamp_ns, before_ns, &mut take);
            }
        }
        // A full shelf leaves the rest in the kernel's queue, which has the stamps.
        while self.count < EARLY_FRAMES {
            match bus.receive() {
                Received::Frame(frame, stamp_ns) => self.sort(frame, stamp_ns, before_ns, &mut take),
                Received::Barrier(_) => {}
                Received::Nothing => break,
            }
        }
    }

    fn sort(
        &mut self,
        frame: CanFrame,
        stamp_ns: u64,
        before_ns: u64,
        take: &mut impl FnMut(&CanFrame, u64),
    ) {
        // Frames keep their order: what follows one that waits, waits too. Two clocks make up a stamp, and a thread that is
        // held up between them stamps a frame later than the one behind it.
        if stamp_ns < before_ns && self.count == 0 {
            take(&frame, stamp_ns);
        } else {
            self.early[self.count] = Some((frame, stamp_ns));
            self.count += 1;
        }
    }
}
