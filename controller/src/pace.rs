//! The loop of the controllers, driven by the rig's frames as they arrive, or by the lockstep barrier.
//!
//! In real time the controllers have no clock of their own that could drift against that of the rig: the sensors of a cycle
//! wake them, and their wake-up latency counts from the arrival of the frame at our queue (see [`crate::timing`]).

use crate::Node;
use crate::timing::{Stopwatch, StopwatchAccount};
use axis_control::node::{NodeEvent, STOPPED_CYCLES};
use axis_control::rig_view::PerAxis;
use protocol::bus::control::{Kind, Role};
use protocol::bus::{Bus, BusError, Received};
use realtime::{Clock, Continued, Interrupt, VitalsReader};
use std::time::{Duration, Instant as WallInstant};

/// Longest wait for a frame before signals and silence are checked.
const LONGEST_WAIT: Duration = Duration::from_millis(20);
/// Silence of the rig after which a message is printed; the rig shuts its valve by itself.
const SILENCE: Duration = Duration::from_millis(200);
/// Silence after Done that counts as the end of the rig.
const DONE_SILENCE: Duration = Duration::from_secs(1);
/// Silence of the bus after the end of the rig that counts as the end of all frames: five times the interval of the last ticks.
const END_SILENCE: Duration = Duration::from_millis(50);
/// Longest time that frames are drained from a busy bus after the end of the rig.
const LONGEST_DRAIN: Duration = Duration::from_millis(300);
/// Answers at the start without allocation count.
const WARM_UP: u64 = 1000;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RunEnd {
    /// The rig announced its end, or was silent after Done.
    RigEnded,
    Interrupted,
    /// The bus was down, or no sensors came, for longer than the grace time.
    BusGone,
    /// The experiment was aborted or stopped by a fault, and cannot be started again.
    Stopped,
    LockstepTimeout,
}

/// The node of a run, its bus and what may end it.
pub(crate) struct RunContext<'a> {
    pub(crate) node: &'a mut Node,
    pub(crate) bus: &'a mut dyn Bus,
    /// Longest silence of the rig.
    pub(crate) grace: Duration,
    pub(crate) interrupt: &'a Interrupt,
}

pub(crate) struct RunOutcome {
    pub(crate) end: RunEnd,
    /// Allocations in the 1 ms path after warm-up; `None` without the counting allocator, and for a run shorter than the
    /// warm-up.
    pub(crate) allocations: Option<u64>,
    pub(crate) stopwatch: StopwatchAccount,
}

/// Answers frames as they arrive, under a stopwatch.
pub(crate) fn run_real(
    context: RunContext<'_>,
    mut stopwatch: Stopwatch<impl Clock>,
    continued: Continued,
) -> RunOutcome {
    let RunContext { node, bus, grace, interrupt } = context;
    let mut vitals = VitalsReader::new(continued);
    let mut rig = RigActivity::new(node);
    // A bus that was never up is not lost.
    let mut was_up = true;
    let mut ever_up = false;
    let mut disconnects = 0;
    let mut count_scope = None;
    stopwatch.begin();
    let end = loop {
        bus.wait_readable(LONGEST_WAIT);
        if count_scope.is_none() && node.answered >= WARM_UP {
            count_scope = Some(realtime::allocations::count_scope());
        }
        stopwatch.woke();
        while let Received::Frame(frame, stamp_ns) = bus.receive() {
            let sensors = node.take(&frame);
            stopwatch.frame_taken(&frame, stamp_ns, sensors);
        }
        stopwatch.batch_taken();
        let answered = node.answer(&mut stopwatch.bus(bus));
        stopwatch.answered(answered, || vitals.read());
        if interrupt.came() {
            break RunEnd::Interrupted;
        }
        if node.ending {
            break RunEnd::RigEnded;
        }
        ever_up |= bus.is_up();
        // Both events, after a stall in which the bus went and returned.
        let times_gone = bus.counters().disconnects;
        let went = times_gone != std::mem::replace(&mut disconnects, times_gone);
        if went && ever_up && was_up {
            was_up = false;
            node.report(NodeEvent::BusLost);
        }
        if ever_up && bus.is_up() != was_up {
            was_up = bus.is_up();
            node.report(if was_up { NodeEvent::BusBack } else { NodeEvent::BusLost });
        }
        let quiet = rig.silence(node);
        if node.stopped_for() > STOPPED_CYCLES {
            break RunEnd::Stopped;
        }
        if quiet > DONE_SILENCE && node.done() {
            break RunEnd::RigEnded;
        }
        if quiet > grace {
            break RunEnd::BusGone;
        }
    };
    let allocations = count_scope.map(|scope| {
        drop(scope);
        realtime::allocations::counted()
    });
    RunOutcome { end, allocations, stopwatch: stopwatch.finish() }
}

/// Takes the remaining frames of the bus if `rig_ended`, then leaves it and takes what had arrived by then. The bus counts the
/// frames; they have no other effect.
///
/// The rig announces its end several times, and other nodes may still send. A controller that left at the first announcement
/// would leave delivered frames in its queue, and the account of the frames would not balance.
pub(crate) fn drain_and_leave(bus: &mut dyn Bus, rig_ended: bool) {
    let take_all = |bus: &mut dyn Bus| {
        std::iter::from_fn(|| matches!(bus.receive(), Received::Frame(..)).then_some(())).count()
    };
    let began = WallInstant::now();
    let mut last_heard = began;
    while rig_ended && bus.is_up() && last_heard.elapsed() < END_SILENCE && began.elapsed() < LONGEST_DRAIN {
        bus.wait_readable(END_SILENCE);
        if take_all(bus) > 0 {
            last_heard = WallInstant::now();
        }
    }
    bus.leave();
    take_all(bus);
}

struct RigActivity {
    counts: (PerAxis, Option<u64>),
    last: WallInstant,
    silent: bool,
}

impl RigActivity {
    fn new(node: &Node) -> Self {
        Self { counts: Self::counts(node), last: WallInstant::now(), silent: false }
    }

    /// Counts of the rig's frames, sensors and ticks; those of other nodes do not count.
    fn counts(node: &Node) -> (PerAxis, Option<u64>) {
        (node.view.received, node.view.cycle)
    }

    /// Duration of its silence; reports when the silence begins.
    fn silence(&mut self, node: &mut Node) -> Duration {
        let before = std::mem::replace(&mut self.counts, Self::counts(node));
        if self.counts != before {
            self.last = WallInstant::now();
        }
        let quiet = self.last.elapsed();
        if (quiet > SILENCE) != self.silent {
            self.silent = !self.silent;
            if self.silent {
                node.report(NodeEvent::SensorsSilent);
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
                    // Checked here, since the queue of a running rig is never empty.
                    if interrupt.came() {
                        break RunEnd::Interrupted;
                    }
                    if node.ending {
                        break RunEnd::RigEnded;
                    }
                    node.answer(bus);
                    bus.done(control.cycle);
                    if node.stopped_for() > STOPPED_CYCLES {
                        break RunEnd::Stopped;
                    }
                }
                Kind::TimedOut => break RunEnd::LockstepTimeout,
                _ => {}
            },
            Received::Nothing => {
                if interrupt.came() {
                    break RunEnd::Interrupted;
                }
                // Without its host the bus has no rig, and simulated time ends.
                let since = *waiting_since.get_or_insert_with(WallInstant::now);
                if bus.counters().disconnects > 0 || since.elapsed() > grace {
                    // The last tick may be lost on the wire; a rig that leaves when all is done has ended.
                    let ended = node.ending || node.done();
                    break if ended { RunEnd::RigEnded } else { RunEnd::BusGone };
                }
                bus.wait_readable(Duration::from_millis(100));
            }
        }
    };
    Ok(RunOutcome { end, allocations: None, stopwatch: StopwatchAccount::default() })
}
