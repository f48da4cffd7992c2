//! The emulator's node: the rig on its bus with its console and its records, in any pace.
//!
//! ```text
//!   t_k  missed cycles ──► publish(k) ─────────► take(frame)* ────────────► act(k) ──► t_k+1
//!        computed, not     people, sensors,      what arrived before t_k    latch, record,
//!        sent              send frames           (in lockstep: before Go)   step the plant
//! ```
//!
//! The cycle itself is that of [`rig_node`]. Missed cycles are computed with the command in effect before, so that a stall
//! changes the inputs and never the physics. Nothing here allocates, locks or prints; it blocks in
//! `wait_for_writer` alone, after a stall.

use crate::console::Command;
use crate::event::{Event, EventKind, axis_of, of_hand};
use crate::exchange::{AxisCycle, ExchangeTimer, RoundTrip, TimingRecord};
use crate::faults::mark::Mark;
use crate::faults::schedule::{FaultSchedule, FaultTargets};
use crate::recording::Recorder;
use crate::rig::BreakableRig;
use crossbeam_channel::Receiver;
use plant::scene::{Action, HandForces};
use plant::{Axis, AxisReadings, People, Plant, Sensors};
use protocol::bus::Bus;
use protocol::can::CanFrame;
use protocol::commands::{Change, CommandCounters};
use protocol::frames::{ChainStatus, DecodeError, FaultMark, Frame, LinkRequest, MainChainState};
use realtime::Overrun;
use rig_node::{FrameOutcome, HandForceSource, Latched, RigNode, TickCause};
use runlog::candump::FrameRecord;
use runlog::summary::FrameCounters;
use runlog::timing::CycleTiming;
use std::time::Duration;

/// Longest wait for room in the recorder's queue after a stall, ms; a slower writer has failed.
const LONGEST_WAIT_MS: u32 = 2000;

pub(crate) struct NodeParts {
    /// The plant in its initial state.
    pub plant: Plant,
    pub sensors: Sensors,
    /// Actions of people on it.
    pub people: People,
    pub faults: FaultSchedule,
    /// Typed commands, with the console.
    pub console: Option<Receiver<Command>>,
    /// Queues of cycles, frames and events.
    pub recorder: Recorder,
    /// Whether frames of the bench (hand force, link, weights) are processed.
    pub bench_frames: bool,
    /// Whether the bus has simulated time.
    pub lockstep: bool,
}

pub(crate) struct NodeFigures {
    /// Frames by their result.
    pub frames: FrameCounters,
    /// Commands of drive and load by their result.
    pub commands: [CommandCounters; 2],
    /// Cycles computed without being sent.
    pub skipped: u64,
    /// Records lost to full queues.
    pub records_dropped: u64,
}

/// The rig on its bus, with console and records.
pub(crate) struct EmulatorNode {
    node: RigNode<BreakableRig>,
    console: Option<Receiver<Command>>,
    pub(crate) quit_asked: bool,
    recorder: Recorder,
    bench_frames: bool,
    lockstep: bool,
    bus_was_up: bool,
    bus_disconnects: u64,
    pub(crate) frames: FrameCounters,
    exchange: [ExchangeTimer; 2],
    chains_done: [Option<bool>; 2],
}

impl EmulatorNode {
    /// A node before cycle 0.
    pub(crate) fn new(parts: NodeParts) -> Self {
        let NodeParts { plant, sensors, people, faults, console, recorder, bench_frames, lockstep } = parts;
        Self {
            node: RigNode::new(BreakableRig::new(plant, sensors, people, faults), lockstep),
            console,
            quit_asked: false,
            recorder,
            bench_frames,
            lockstep,
            bus_was_up: true,
            bus_disconnects: 0,
            frames: FrameCounters::default(),
            exchange: Default::default(),
            chains_done: [None; 2],
        }
    }

    /// Computes `count` missed cycles from `first` on, with the commands in effect before.
    pub(crate) fn miss(&mut self, first: u64, count: u64) {
        if count == 0 {
            return;
        }
        self.node.skip(first, count);
        self.record_event(first + count, EventKind::Skipped { cycles: count });
        let mut left_ms = LONGEST_WAIT_MS;
        for cycle in first..first + count {
            self.wait_for_writer(&mut left_ms);
            self.begin(cycle);
            self.advance(cycle);
        }
    }

    /// Waits for the writer, up to `left_ms`: after a stall longer than the queue the wait costs no further cycle.
    fn wait_for_writer(&self, left_ms: &mut u32) {
        while *left_ms > 0 && self.recorder.is_full() {
            *left_ms -= 1;
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Samples the sensors of `cycle` and sends the frames that are due. `after_miss` sends the tick first, so that receivers
    /// know the cycle of the sensors.
    pub(crate) fn publish(&mut self, cycle: u64, after_miss: bool, bus: &mut dyn Bus) {
        self.take_console_command(cycle);
        let readings = self.begin(cycle);
        let Self { node, recorder, exchange, .. } = self;
        node.publish(cycle, after_miss, &readings, |frame| {
            let stamp_ns = send(frame, bus, recorder);
            match frame {
                Frame::DriveSensors(_) => exchange[0].begin(cycle, stamp_ns),
                Frame::LoadSensors(_) => exchange[1].begin(cycle, stamp_ns),
                _ => {}
            }
        });
        self.send_fault_marks(bus);
        self.check_bus(cycle, bus);
    }

    /// Reports that the bus went or returned, also when it did both since the last call, as after a stall.
    fn check_bus(&mut self, cycle: u64, bus: &dyn Bus) {
        let disconnects = bus.counters().disconnects;
        let went = disconnects != std::mem::replace(&mut self.bus_disconnects, disconnects);
        if went && self.bus_was_up {
            self.bus_was_up = false;
            self.record_event(cycle, EventKind::BusLost);
        }
        if bus.is_up() != self.bus_was_up {
            self.bus_was_up = bus.is_up();
            self.record_event(cycle, if self.bus_was_up { EventKind::BusBack } else { EventKind::BusLost });
        }
    }

    /// Sends the last tick: no sensors follow after `cycle`.
    pub(crate) fn publish_end(&mut self, cycle: u64, bus: &mut dyn Bus) {
        send(&self.node.tick(TickCause::Farewell, cycle), bus, &mut self.recorder);
    }

    /// Processes a frame that arrived before `cycle`.
    pub(crate) fn take(&mut self, frame: &CanFrame, stamp_ns: u64, cycle: u64) {
        self.recorder.frame(FrameRecord { stamp_ns, frame: *frame });
        match Frame::decode(frame) {
            Ok(known) => self.take_known(known, frame, stamp_ns, cycle),
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                self.frames.ignored.unknown += 1;
            }
            Err(_) => {
                self.frames.ignored.malformed += 1;
                if self.frames.ignored.malformed == 1 {
                    self.record_event(cycle, EventKind::Malformed { raw_id: frame.raw_id() });
                }
            }
        }
    }

    fn take_known(&mut self, known: Frame, frame: &CanFrame, stamp_ns: u64, cycle: u64) {
        let Self { node, recorder, .. } = self;
        let other = match node.take(known, &mut |kind| recorder.event(Event { cycle, kind })) {
            FrameOutcome::Command { axis, echo } => {
                return self.time_command(axis.index(), echo, stamp_ns, cycle);
            }
            FrameOutcome::Handled => return,
            FrameOutcome::Unhandled(other) => other,
        };
        match other {
            Frame::DriveChainStatus(status) => self.note_chain(0, status),
            Frame::LoadChainStatus(status) => self.note_chain(1, status),
            Frame::HandForce(hand) if self.bench_frames => {
                *self.node.rig_mut().hand_forces(HandForceSource::Bus) =
                    HandForces { carriage_n: hand.carriage_n, load_eye_n: hand.load_eye_n };
            }
            Frame::Link(link) if self.bench_frames => match link.request {
                LinkRequest::Link => self.act_by_hand(Action::Link { until_s: None }, cycle),
                LinkRequest::Unlink => self.act_by_hand(Action::Unlink, cycle),
            },
            Frame::Weights(weights) if self.bench_frames => {
                self.act_by_hand(Action::Weights { added_mass_kg: weights.added_mass_kg }, cycle);
            }
            Frame::DriveSensors(_)
            | Frame::LoadSensors(_)
            | Frame::Tick(_)
            | Frame::RigStatus(_)
            | Frame::RigEmergencyStop(_) => {
                self.frames.second_rig += 1;
                if self.frames.second_rig == 1 {
                    let id = frame.standard_id().unwrap_or_default();
                    self.record_event(cycle, EventKind::SecondRig { id });
                }
            }
            _ => {}
        }
    }

    /// Latches the commands of `cycle`: drops stale ones, marks disputed ones, records both, and steps the plant to the start of
    /// the next.
    pub(crate) fn act(&mut self, cycle: u64) {
        for axis in Axis::ALL {
            let Latched { change, age_cycles } = self.node.latch(axis);
            self.exchange[axis as usize].latched(age_cycles);
            if let Some(change) = change {
                self.record_event(cycle, change_event(change, axis));
            }
        }
        self.advance(cycle);
    }

    /// Records the time stamps of this cycle: `row` without the exchange, which the node adds.
    pub(crate) fn record_timing(&mut self, row: CycleTiming) {
        let axes = self.exchange.each_ref().map(ExchangeTimer::cycle);
        let [AxisCycle { exchange: drive, .. }, AxisCycle { exchange: load, .. }] = axes;
        self.recorder.timing(TimingRecord::Cycle { row: CycleTiming { drive, load, ..row }, axes });
    }

    /// Records the overrun that ends the run.
    pub(crate) fn record_overrun(&mut self, overrun: &Overrun, woke_ns: u64) {
        let Overrun { index: first, skipped, late_by } = *overrun;
        let late_ns = late_by.as_nanos() as u64;
        self.recorder.timing(TimingRecord::Stopped { first, skipped, late_ns, woke_ns });
    }

    /// Records `cycle` with its inputs and steps the plant, for sent and for missed cycles.
    fn advance(&mut self, cycle: u64) {
        self.recorder.cycle(self.node.step(cycle));
    }

    fn time_command(&mut self, axis: usize, echo: u16, stamp_ns: u64, cycle: u64) {
        let round_trip_ns = self.exchange[axis].taken(echo, stamp_ns, cycle);
        if let Some(ns) = round_trip_ns.filter(|_| !self.lockstep) {
            self.recorder.round_trip(RoundTrip { axis, cycle, ns });
        }
    }

    fn note_chain(&mut self, axis: usize, status: ChainStatus) {
        self.chains_done[axis] = Some(status.main_chain == MainChainState::Done);
    }

    /// Executes the actions of people and the faults that are due in `cycle`, then samples the sensors.
    fn begin(&mut self, cycle: u64) -> [AxisReadings; 2] {
        let Self { node, recorder, .. } = self;
        node.begin(cycle, &mut |kind| recorder.event(Event { cycle, kind }))
    }

    /// Sends the begins and ends of faults to the bench, if its frames are enabled.
    fn send_fault_marks(&mut self, bus: &mut dyn Bus) {
        while let Some((fault, active)) = self.node.rig_mut().next_fault_mark() {
            if self.bench_frames {
                send(&Frame::FaultMark(FaultMark { fault, active }), bus, &mut self.recorder);
            }
        }
    }

    fn act_by_hand(&mut self, action: Action, cycle: u64) {
        let Self { node, recorder, .. } = self;
        node.rig_mut().act(action, |kind| recorder.event(Event { cycle, kind }));
    }

    /// Takes one command of the console, if one waits: a flood is spread over cycles.
    fn take_console_command(&mut self, cycle: u64) {
        let Some(Ok(command)) = self.console.as_ref().map(Receiver::try_recv) else { return };
        match command {
            Command::Act(action) => self.act_by_hand(action, cycle),
            Command::Hand { on, force_n } => {
                let hand = self.node.rig_mut().hand_forces(HandForceSource::Console);
                *hand.on(on) = force_n;
                let kind = of_hand(*hand);
                self.record_event(cycle, kind);
            }
            Command::Break(fault) => self.break_or_mend(cycle, |faults, broken, on_mark| {
                faults.break_by_hand(fault, broken, on_mark);
            }),
            Command::Mend(like) => self.break_or_mend(cycle, |faults, broken, on_mark| {
                faults.mend(like.as_ref(), broken, on_mark);
            }),
            Command::Quit => self.quit_asked = true,
        }
    }

    fn break_or_mend(
        &mut self,
        cycle: u64,
        act: impl FnOnce(&mut FaultSchedule, FaultTargets<'_>, &mut dyn FnMut(Mark)),
    ) {
        let Self { node, recorder, .. } = self;
        node.rig_mut().break_or_mend(act, |kind| recorder.event(Event { cycle, kind }));
    }

    fn record_event(&mut self, cycle: u64, kind: EventKind) {
        self.recorder.event(Event { cycle, kind });
    }

    /// Whether every controller received so far reports that its chain is done.
    pub(crate) fn controllers_done(&self) -> bool {
        self.chains_done.iter().flatten().count() > 0 && self.chains_done.iter().flatten().all(|done| *done)
    }

    /// Whether the state of the plant is finite; otherwise, which is recorded, the run must end with silence on the bus.
    pub(crate) fn is_finite(&mut self, cycle: u64) -> bool {
        let finite = self.node.rig().plant().state().is_finite();
        if !finite {
            self.record_event(cycle, EventKind::NotFinite);
        }
        finite
    }

    /// Whether any valve command was accepted.
    pub(crate) fn controller_received(&self) -> bool {
        self.node.commands().iter().any(|intake| intake.counters.accepted > 0)
    }

    pub(crate) fn skipped(&self) -> u64 {
        self.node.skipped()
    }

    /// The counters of the run; drops the node and the senders of the recorder's queues.
    pub(crate) fn into_figures(self) -> NodeFigures {
        NodeFigures {
            frames: self.frames,
            commands: self.node.commands().each_ref().map(|intake| intake.counters),
            skipped: self.node.skipped(),
            records_dropped: self.recorder.dropped,
        }
    }
}

/// Sends and records a frame; returns its stamp. The bus counts refused frames.
///
/// # Panics
/// If a value is beyond its range in `rig.dbc`: sensors saturate within it, which a test checks against the rig's ranges.
fn send(frame: &Frame, bus: &mut dyn Bus, recorder: &mut Recorder) -> Option<u64> {
    let frame = frame
        .encode()
        .unwrap_or_else(|error| panic!("the rig made a frame that rig.dbc does not allow: {error}"));
    let stamp_ns = bus.send(&frame).ok()?;
    recorder.frame(FrameRecord { stamp_ns, frame });
    Some(stamp_ns)
}

fn change_event(change: Change, axis: Axis) -> EventKind {
    let axis = axis_of(axis);
    match change {
        Change::Expired => EventKind::CommandStale(axis),
        Change::Fresh => EventKind::CommandFresh(axis),
        Change::TwoSources => EventKind::TwoSources(axis),
        Change::OneSource => EventKind::OneSource(axis),
    }
}

#[cfg(test)]
mod tests;
