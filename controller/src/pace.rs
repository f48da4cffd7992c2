//! What moves the controllers: the rig's frames as they arrive, or the lockstep barrier.
//!
//! In real time the controllers have no clock of their own that could drift against the rig's: the sensors of a cycle wake
//! them, and their wake-up latency is counted from the arrival of the frame at our queue.

use crate::station::{News, Station};
use plant::Axis;
use protocol::bus::control::{Kind, Role};
use protocol::bus::{Bus, BusError, Received};
use protocol::frames::{DRIVE_SENSORS, LOAD_SENSORS};
use realtime::{Clock, Interrupt, Recorder as Histogram};
use std::time::{Duration, Instant as WallInstant};

/// Longest wait for a frame before looking at the world again.
const PATIENCE: Duration = Duration::from_millis(20);
/// Silence of the rig after which a person is told; the rig shuts its valve by itself.
const SILENCE: Duration = Duration::from_millis(200);
/// Silence after Done that counts as the rig's end.
const DONE_SILENCE: Duration = Duration::from_secs(1);
/// Cycles after an abort or a fault during which the valve is still told to stay shut and the record goes on.
pub(crate) const STOPPED_CYCLES: u64 = 2000;
/// Answers that the allocation count leaves out at the start.
const WARM_UP: u64 = 1000;
/// Period of the answers, ns.
const PERIOD_NS: u64 = 1_000_000;

/// Why the controllers ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The rig said that it ends, or fell silent after Done.
    RigEnded,
    /// Ctrl-C or SIGTERM.
    Interrupted,
    /// The bus was gone, or no sensors came, for longer than the grace time.
    BusGone,
    /// The experiment was aborted or a fault stopped it, and nothing may start it again.
    Stopped,
    /// Lockstep: a member was not done in time.
    LockstepTimeout,
}

/// Controllers on their bus, and what may end their run.
pub struct Ride<'a> {
    /// The controllers.
    pub station: &'a mut Station,
    /// Their peer on the bus.
    pub bus: &'a mut dyn Bus,
    /// How long the rig may be silent.
    pub grace: Duration,
    /// Set by a signal.
    pub interrupt: &'a Interrupt,
}

/// What a pace measured.
pub struct Paced {
    /// Why it ended.
    pub end: End,
    /// Arrival of the sensors of our first axis to our waking up, ns.
    pub wakeup_ns: Histogram,
    /// Waking up to the last frame sent, ns.
    pub execution_ns: Histogram,
    /// |time between two answers - period|, ns.
    pub period_error_ns: Histogram,
    /// Allocations in the 1 ms path after warm-up, if the counting allocator is built in; `None` when nothing was watched.
    pub allocations: Option<u64>,
}

impl Paced {
    fn new() -> Self {
        Self {
            end: End::RigEnded,
            wakeup_ns: Histogram::new(),
            execution_ns: Histogram::new(),
            period_error_ns: Histogram::new(),
            allocations: None,
        }
    }
}

/// Answers frames as they arrive.
pub fn run_real(ride: Ride<'_>, clock: &impl Clock) -> Paced {
    let Ride { station, bus, grace, interrupt } = ride;
    let mut paced = Paced::new();
    let wakes = if station.has(Axis::Drive) { DRIVE_SENSORS.id } else { LOAD_SENSORS.id };
    // What others say is no life of the rig: it sends sensors and ticks.
    let life = |station: &Station| (station.view().received(), station.view().cycle());
    let mut alive = life(station);
    let mut last_life = WallInstant::now();
    let mut last_answer_ns = None;
    let mut silent = false;
    // Not being connected yet is no loss; only what was up can be lost.
    let mut was_up = true;
    let mut ever_up = false;
    let mut watch = None;
    paced.end = loop {
        bus.wait_readable(PATIENCE);
        if watch.is_none() && station.answered() >= WARM_UP {
            watch = Some(realtime::allocations::watch());
        }
        let woke_ns = clock.now().as_nanos();
        while let Received::Frame(frame, stamp_ns) = bus.receive() {
            // Every frame's own waiting counts, so that a stall shows with all the frames that waited for its end.
            if frame.standard_id() == Some(wakes) {
                paced.wakeup_ns.record(woke_ns.saturating_sub(stamp_ns));
            }
            station.take(&frame);
        }
        if station.answer(bus) {
            paced.execution_ns.record(clock.now().as_nanos().saturating_sub(woke_ns));
            if let Some(last_ns) = last_answer_ns.replace(woke_ns) {
                paced.period_error_ns.record(PERIOD_NS.abs_diff(woke_ns.saturating_sub(last_ns)));
            }
        }
        if interrupt.came() {
            break End::Interrupted;
        }
        if station.ending() {
            break End::RigEnded;
        }
        let alive_before = std::mem::replace(&mut alive, life(station));
        if alive != alive_before {
            last_life = WallInstant::now();
        }
        let quiet = last_life.elapsed();
        ever_up |= bus.is_up();
        if ever_up && bus.is_up() != was_up {
            was_up = bus.is_up();
            station.tell(if was_up { News::BusBack } else { News::BusLost });
        }
        if (quiet > SILENCE) != silent {
            silent = !silent;
            if silent {
                station.tell(News::SensorsSilent);
            }
        }
        if station.stopped_for() > STOPPED_CYCLES {
            break End::Stopped;
        }
        if quiet > DONE_SILENCE && station.done() {
            break End::RigEnded;
        }
        if quiet > grace {
            break End::BusGone;
        }
    };
    paced.allocations = watch.map(|watch| {
        drop(watch);
        realtime::allocations::counted()
    });
    paced
}

/// Answers when the barrier says so.
///
/// # Errors
/// [`BusError::NoBarrier`] on a bus without one.
pub fn run_lockstep(ride: Ride<'_>, name: &str) -> Result<Paced, BusError> {
    let Ride { station, bus, grace, interrupt } = ride;
    bus.join_lockstep(Role::Member, name)?;
    let mut paced = Paced::new();
    let mut waiting_since = None;
    paced.end = loop {
        match bus.receive() {
            Received::Frame(frame, _) => station.take(&frame),
            Received::Barrier(control) => match control.kind {
                Kind::Go { .. } => {
                    waiting_since = None;
                    // Here, since a run that goes on never finds the queue empty.
                    if interrupt.came() {
                        break End::Interrupted;
                    }
                    if station.ending() {
                        break End::RigEnded;
                    }
                    station.answer(bus);
                    bus.done(control.cycle);
                    if station.stopped_for() > STOPPED_CYCLES {
                        break End::Stopped;
                    }
                }
                Kind::TimedOut => break End::LockstepTimeout,
                _ => {}
            },
            Received::Nothing => {
                if interrupt.came() {
                    break End::Interrupted;
                }
                // A host that went took the rig with it; simulated time does not go on elsewhere.
                let since = *waiting_since.get_or_insert_with(WallInstant::now);
                if bus.counters().disconnects > 0 || since.elapsed() > grace {
                    // The farewell itself may be lost on the wire; a rig that goes when all is done has ended.
                    let ended = station.ending() || station.done();
                    break if ended { End::RigEnded } else { End::BusGone };
                }
                bus.wait_readable(Duration::from_millis(100));
            }
        }
    };
    Ok(paced)
}
