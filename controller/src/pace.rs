//! What moves the controllers: the rig's frames as they arrive, or the lockstep barrier.
//!
//! In real time the controllers have no clock of their own that could drift against the rig's: the sensors of a cycle wake
//! them, and their wake-up latency is counted from the arrival of the frame at our queue (see [`crate::timing`]).

use crate::Node;
use crate::timing::{Stopwatch, StopwatchAccount};
use axis_control::node::{NodeEvent, STOPPED_CYCLES};
use axis_control::rig_view::PerAxis;
use protocol::bus::control::{Kind, Role};
use protocol::bus::{Bus, BusError, Received};
use realtime::{Clock, Continued, Interrupt, VitalsReader};
use std::time::{Duration, Instant as WallInstant};

/// Longest wait for a frame before looking at the world again.
const PATIENCE: Duration = Duration::from_millis(20);
/// Silence of the rig after which a message is printed; the rig shuts its valve by itself.
const SILENCE: Duration = Duration::from_millis(200);
/// Silence after Done that counts as the rig's end.
const DONE_SILENCE: Duration = Duration::from_secs(1);
/// Silence of the bus after which a rig that ended is expected to say nothing more: five times what lies between two of its
/// farewells.
const QUIET: Duration = Duration::from_millis(50);
/// Longest stay after the rig's end on a bus that others keep busy.
const LONGEST_STAY: Duration = Duration::from_millis(300);
/// Answers that the allocation count leaves out at the start.
const WARM_UP: u64 = 1000;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// The rig said that it ends, or fell silent after Done.
    RigEnded,
    Interrupted,
    /// The bus was gone, or no sensors came, for longer than the grace time.
    BusGone,
    /// The experiment was aborted or a fault stopped it, and nothing may start it again.
    Stopped,
    LockstepTimeout,
}

/// The node of a run, its bus and what may end it.
pub(crate) struct RunContext<'a> {
    pub(crate) node: &'a mut Node,
    pub(crate) bus: &'a mut dyn Bus,
    /// How long the rig may be silent.
    pub(crate) grace: Duration,
    pub(crate) interrupt: &'a Interrupt,
}

pub(crate) struct RunOutcome {
    pub(crate) end: End,
    /// Allocations in the 1 ms path after warm-up, if the counting allocator is built in; `None` when nothing was watched.
    pub(crate) allocations: Option<u64>,
    pub(crate) stopwatch: StopwatchAccount,
}

/// Answers frames as they arrive, under a stopwatch.
pub(crate) fn run_real(
    context: RunContext<'_>,
    mut stopwatch: Stopwatch<impl Clock + Send>,
    continued: Continued,
) -> RunOutcome {
    let RunContext { node, bus, grace, interrupt } = context;
    let mut vitals = VitalsReader::new(continued);
    let mut rig = RigLife::new(node);
    // Not being connected yet is no loss; only what was up can be lost.
    let mut was_up = true;
    let mut ever_up = false;
    let mut disconnects = 0;
    let mut watch = None;
    stopwatch.begin();
    let end = loop {
        bus.wait_readable(PATIENCE);
        if watch.is_none() && node.answered() >= WARM_UP {
            watch = Some(realtime::allocations::watch());
        }
        stopwatch.woke();
        while let Received::Frame(frame, stamp_ns) = bus.receive() {
            let sensors = node.take(&frame);
            stopwatch.took(&frame, stamp_ns, sensors);
        }
        stopwatch.took_all();
        let answered = node.answer(&mut stopwatch.bus(bus));
        stopwatch.answered(answered, || vitals.read());
        if interrupt.came() {
            break End::Interrupted;
        }
        if node.ending() {
            break End::RigEnded;
        }
        ever_up |= bus.is_up();
        // Both at once after a stall in which it went and came back.
        let times_gone = bus.counters().disconnects;
        let went = times_gone != std::mem::replace(&mut disconnects, times_gone);
        if went && ever_up && was_up {
            was_up = false;
            node.tell(NodeEvent::BusLost);
        }
        if ever_up && bus.is_up() != was_up {
            was_up = bus.is_up();
            node.tell(if was_up { NodeEvent::BusBack } else { NodeEvent::BusLost });
        }
        let quiet = rig.quiet(node);
        if node.stopped_for() > STOPPED_CYCLES {
            break End::Stopped;
        }
        if quiet > DONE_SILENCE && node.done() {
            break End::RigEnded;
        }
        if quiet > grace {
            break End::BusGone;
        }
    };
    let allocations = watch.map(|watch| {
        drop(watch);
        realtime::allocations::counted()
    });
    RunOutcome { end, allocations, stopwatch: stopwatch.finish() }
}

/// Takes what is still said on the bus when `rig_ended`, then takes leave and what had arrived by then. The frames are counted by
/// the bus and have no other effect.
///
/// The rig says several times that it ends, and whoever shares the bus may still speak; a controller that left at the first word
/// would leave frames in its queue that the bus delivered and that nobody received, and the account would have an open end.
pub(crate) fn hear_out(bus: &mut dyn Bus, rig_ended: bool) {
    let take_all = |bus: &mut dyn Bus| {
        std::iter::from_fn(|| matches!(bus.receive(), Received::Frame(..)).then_some(())).count()
    };
    let began = WallInstant::now();
    let mut last_heard = began;
    while rig_ended && bus.is_up() && last_heard.elapsed() < QUIET && began.elapsed() < LONGEST_STAY {
        bus.wait_readable(QUIET);
        if take_all(bus) > 0 {
            last_heard = WallInstant::now();
        }
    }
    bus.leave();
    take_all(bus);
}

struct RigLife {
    heard: (PerAxis, Option<u64>),
    last: WallInstant,
    silent: bool,
}

impl RigLife {
    fn new(node: &Node) -> Self {
        Self { heard: Self::heard(node), last: WallInstant::now(), silent: false }
    }

    /// What others say is no life of the rig: it sends sensors and ticks.
    fn heard(node: &Node) -> (PerAxis, Option<u64>) {
        (node.view().received, node.view().cycle())
    }

    /// For how long it has been silent; tells a person when that begins.
    fn quiet(&mut self, node: &mut Node) -> Duration {
        let before = std::mem::replace(&mut self.heard, Self::heard(node));
        if self.heard != before {
            self.last = WallInstant::now();
        }
        let quiet = self.last.elapsed();
        if (quiet > SILENCE) != self.silent {
            self.silent = !self.silent;
            if self.silent {
                node.tell(NodeEvent::SensorsSilent);
            }
        }
        quiet
    }
}

pub(crate) fn run_lockstep(context: RunContext<'_>, name: &str) -> Result<RunOutcome, BusError> {
    let RunContext { node, bus, grace, interrupt } = context;
    bus.join_lockstep(Role::Member, name)?;
    let mut waiting_since = None;
    let end = loop {
        match bus.receive() {
            Received::Frame(frame, _) => {
                node.take(&frame);
            }
            Received::Barrier(control) => match control.kind {
                Kind::Go { .. } => {
                    waiting_since = None;
                    // Here, since a run that goes on never finds the queue empty.
                    if interrupt.came() {
                        break End::Interrupted;
                    }
                    if node.ending() {
                        break End::RigEnded;
                    }
                    node.answer(bus);
                    bus.done(control.cycle);
                    if node.stopped_for() > STOPPED_CYCLES {
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
                    let ended = node.ending() || node.done();
                    break if ended { End::RigEnded } else { End::BusGone };
                }
                bus.wait_readable(Duration::from_millis(100));
            }
        }
    };
    Ok(RunOutcome { end, allocations: None, stopwatch: StopwatchAccount::default() })
}
