//! The rig on its bus: one cycle of plant, sensors, commands and records, whatever paces it.
//!
//! ```text
//!   t_k  missed cycles ──► publish(k) ─────────► take(frame)* ────────────► act(k) ──► t_k+1
//!        computed, not     people, sensors,      what arrived before t_k    latch, record,
//!        sent              send frames           (in lockstep: before Go)   step the plant
//! ```
//!
//! A command that arrived before t_k acts over [t_k, t_k+1) (bus.md, Time). Missed cycles are computed with the command
//! latched before, so a stall changes which inputs there are and never the physics. Nothing here allocates, locks, prints
//! or blocks. What breaks on purpose is in `broken.rs`.

mod broken;

use crate::console::Command;
use crate::event::{Event, EventKind};
use crate::exchange::{AxisCycle, ExchangeWatch, RoundTrip, TimingRecord};
use crate::faults::course::FaultCourse;
use crate::recording::Recorder;
use crate::telegrams::{self, CommandState, SaturatedSensors, TickCause};
use crossbeam_channel::Receiver;
use plant::scene::{Action, HandForces, Holder};
use plant::tables::CycleRecord;
use plant::{Axis, AxisReadings, Inputs, People, Plant, Sensors};
use protocol::bus::Bus;
use protocol::can::CanFrame;
use protocol::commands::{Change, CommandCounters, CommandIntake};
use protocol::frames::{
    ChainStatus, DecodeError, EmergencyStop, Frame, LinkRequest, MainChainState, ValveCommand,
};
use protocol::live_cycles::LiveCycles;
use protocol::periods;
use realtime::Overrun;
use runlog::candump::FrameRecord;
use runlog::timing::CycleTiming;
use std::time::Duration;

/// Longest wait for room in the recorder's queue after a stall, in ms; a writer that is slower than this has failed.
const LONGEST_WAIT_MS: u32 = 2000;

/// Places of the hands that push.
const SCRIPT: usize = 0;
const BUS: usize = 1;
const CONSOLE: usize = 2;
const FAULTS: usize = 3;

/// What a station is made of.
pub struct StationParts {
    /// The plant in its initial state.
    pub plant: Plant,
    /// Its sensors.
    pub sensors: Sensors,
    /// Who does what to it by hand.
    pub people: People,
    /// What breaks.
    pub faults: FaultCourse,
    /// What is typed at the console, if it is open.
    pub console: Option<Receiver<Command>>,
    /// Where cycles, frames and events go.
    pub recorder: Recorder,
    /// Whether frames of the bench (hand force, link, weights) are obeyed.
    pub bench_frames: bool,
    /// Whether simulated time is the bus's time.
    pub lockstep: bool,
}

/// Frames that arrived, by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FrameCounters {
    /// Not as `rig.dbc` says: length, checksum, reserved bits, a raw value out of range.
    pub malformed: u64,
    /// Identifiers that `rig.dbc` does not know, extended and remote frames.
    pub unknown: u64,
    /// Frames that only the rig sends.
    pub second_rig: u64,
}

/// What a station counted.
pub struct StationFigures {
    /// Frames by what became of them.
    pub frames: FrameCounters,
    /// Commands of drive and load by what became of them.
    pub commands: [CommandCounters; 2],
    /// Cycles computed without being sent.
    pub skipped: u64,
    /// Records lost to full queues.
    pub records_dropped: u64,
}

/// The rig on its bus.
pub struct Station {
    plant: Plant,
    sensors: Sensors,
    inputs: Inputs,
    people: People,
    faults: FaultCourse,
    console: Option<Receiver<Command>>,
    quit_asked: bool,
    /// Hands of the script, of the bus, of the console and of faults; their sum acts.
    hands: [HandForces; 4],
    commands: [CommandIntake; 2],
    live: LiveCycles,
    recorder: Recorder,
    bench_frames: bool,
    lockstep: bool,
    readings: [AxisReadings; 2],
    skipped: u64,
    bus_was_up: bool,
    bus_disconnects: u64,
    frames: FrameCounters,
    /// Sensors that saturated since the last status.
    saturated: [SaturatedSensors; 2],
    exchange: [ExchangeWatch; 2],
    chains_done: [Option<bool>; 2],
}

impl Station {
    /// Puts the rig on its bus, before cycle 0.
    #[must_use]
    pub fn new(parts: StationParts) -> Self {
        let StationParts {
            mut plant,
            mut sensors,
            people,
            faults,
            console,
            recorder,
            bench_frames,
            lockstep,
        } = parts;
        if faults.possible() {
            plant.expect_faults();
            sensors.seed_faults(faults.seed());
        }
        let inputs = Inputs::default();
        // Replaced by the first cycle's own sample; a scratch value has no meaning, and costs a draw of noise.
        let readings = sensors.sample(&plant, &inputs);
        Self {
            plant,
            sensors,
            inputs,
            people,
            faults,
            console,
            quit_asked: false,
            hands: [HandForces::default(); 4],
            commands: Default::default(),
            live: LiveCycles::new(),
            recorder,
            bench_frames,
            lockstep,
            readings,
            skipped: 0,
            bus_was_up: true,
            bus_disconnects: 0,
            frames: FrameCounters::default(),
            saturated: [SaturatedSensors::default(); 2],
            exchange: Default::default(),
            chains_done: [None; 2],
        }
    }

    /// Computes `count` cycles from `first` on that the loop missed, with the commands latched before.
    pub fn miss(&mut self, first: u64, count: u64) {
        if count == 0 {
            return;
        }
        self.skipped += count;
        self.live.skipped(first, count);
        self.tell(first + count, EventKind::Skipped { cycles: count });
        let mut left_ms = LONGEST_WAIT_MS;
        for cycle in first..first + count {
            self.wait_for_writer(&mut left_ms);
            self.begin(cycle);
            self.sample();
            self.advance(cycle);
        }
    }

    /// After a stall longer than the queue, waiting for the writer costs nothing that is not lost already.
    fn wait_for_writer(&self, left_ms: &mut u32) {
        while *left_ms > 0 && self.recorder.is_full() {
            *left_ms -= 1;
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn sample(&mut self) {
        self.readings = self.sensors.sample(&self.plant, &self.inputs);
        for (saturated, readings) in self.saturated.iter_mut().zip(&self.readings) {
            saturated.note(readings);
        }
    }

    /// Samples the sensors of `cycle` and sends what is due. `after_miss` sends the tick first, so that receivers know
    /// which cycle the sensors are of.
    pub fn publish(&mut self, cycle: u64, after_miss: bool, bus: &mut dyn Bus) {
        self.take_typed(cycle);
        self.begin(cycle);
        self.sample();
        let [drive, load] = &self.readings;
        let drive = Frame::DriveSensors(telegrams::sensors(drive, cycle));
        let load = Frame::LoadSensors(telegrams::sensors(load, cycle));
        if after_miss {
            self.send_tick(TickCause::Miss, cycle, bus);
        }
        // Ahead of the sensors, which wake the controllers.
        if let Some(call) = self.people.rig_call(cycle) {
            self.send(&telegrams::emergency_stop(call), bus);
        }
        for (axis, sensors) in [drive, load].iter().enumerate() {
            let stamp_ns = self.send(sensors, bus);
            self.exchange[axis].begin(cycle, stamp_ns);
        }
        self.live.sent(cycle);
        if periods::tick_is_due(cycle) && !after_miss {
            self.send_tick(TickCause::Period, cycle, bus);
        }
        if periods::status_is_due(cycle) {
            let commands = CommandState {
                stale: self.commands.each_ref().map(CommandIntake::stale),
                two_sources: self.commands.each_ref().map(CommandIntake::disputed),
            };
            let saturated = std::mem::take(&mut self.saturated);
            self.send(&telegrams::status(&self.plant, &saturated, commands), bus);
        }
        self.send_fault_marks(bus);
        self.look_at_the_bus(cycle, bus);
    }

    /// Tells when the bus goes and comes, also when it did both since the last look, as after a stall.
    fn look_at_the_bus(&mut self, cycle: u64, bus: &dyn Bus) {
        let disconnects = bus.counters().disconnects;
        let went = disconnects != std::mem::replace(&mut self.bus_disconnects, disconnects);
        if went && self.bus_was_up {
            self.bus_was_up = false;
            self.tell(cycle, EventKind::BusLost);
        }
        if bus.is_up() != self.bus_was_up {
            self.bus_was_up = bus.is_up();
            self.tell(cycle, if self.bus_was_up { EventKind::BusBack } else { EventKind::BusLost });
        }
    }

    /// Says farewell: a tick that tells the controllers that no more sensors come after `cycle`.
    pub fn publish_end(&mut self, cycle: u64, bus: &mut dyn Bus) {
        self.send_tick(TickCause::Farewell, cycle, bus);
    }

    /// Takes a frame that arrived before `cycle`.
    pub fn take(&mut self, frame: &CanFrame, stamp_ns: u64, cycle: u64) {
        self.recorder.frame(FrameRecord { stamp_ns, frame: *frame });
        match Frame::decode(frame) {
            Ok(Frame::DriveValveCommand(command)) => self.take_command(0, command, stamp_ns, cycle),
            Ok(Frame::LoadValveCommand(command)) => self.take_command(1, command, stamp_ns, cycle),
            Ok(Frame::ConsoleEmergencyStop(stop)) => self.obey_emergency_stop(Holder::Console, stop, cycle),
            Ok(Frame::DriveEmergencyStop(stop)) => self.obey_emergency_stop(Holder::Drive, stop, cycle),
            Ok(Frame::LoadEmergencyStop(stop)) => self.obey_emergency_stop(Holder::Load, stop, cycle),
            Ok(Frame::DriveChainStatus(status)) => self.note_chain(0, status),
            Ok(Frame::LoadChainStatus(status)) => self.note_chain(1, status),
            Ok(Frame::HandForce(hand)) if self.bench_frames => {
                self.hands[BUS] = HandForces { carriage_n: hand.carriage_n, load_eye_n: hand.load_eye_n };
            }
            Ok(Frame::Link(link)) if self.bench_frames => match link.request {
                LinkRequest::Link => self.act_by_hand(Action::Link { until_s: None }, cycle),
                LinkRequest::Unlink => self.act_by_hand(Action::Unlink, cycle),
            },
            Ok(Frame::Weights(weights)) if self.bench_frames => {
                self.act_by_hand(Action::Weights { added_mass_kg: weights.added_mass_kg }, cycle);
            }
            Ok(
                Frame::DriveSensors(_)
                | Frame::LoadSensors(_)
                | Frame::Tick(_)
                | Frame::RigStatus(_)
                | Frame::RigEmergencyStop(_),
            ) => {
                self.frames.second_rig += 1;
                if self.frames.second_rig == 1 {
                    let id = frame.standard_id().unwrap_or_default();
                    self.tell(cycle, EventKind::SecondRig { id });
                }
            }
            Ok(_) => {}
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                self.frames.unknown += 1;
            }
            Err(_) => {
                self.frames.malformed += 1;
                if self.frames.malformed == 1 {
                    self.tell(cycle, EventKind::Malformed { raw_id: frame.raw_id() });
                }
            }
        }
    }

    /// Latches the commands for `cycle`, records it, and steps the plant to the start of the next.
    pub fn act(&mut self, cycle: u64) {
        for axis in Axis::ALL {
            let change = self.commands[axis as usize].latch(&self.live);
            let age_cycles = self.commands[axis as usize].obeyed_age_cycles(&self.live);
            self.exchange[axis as usize].latched(age_cycles);
            if let Some(change) = change {
                self.tell(cycle, change_event(change, axis));
            }
        }
        self.advance(cycle);
    }

    /// Hands over when everything of this cycle happened: `row` without the exchange, which the station knows.
    pub fn tell_timing(&mut self, row: CycleTiming) {
        let axes = self.exchange.each_ref().map(ExchangeWatch::cycle);
        let [AxisCycle { exchange: drive, .. }, AxisCycle { exchange: load, .. }] = axes;
        self.recorder.timing(TimingRecord::Cycle { row: CycleTiming { drive, load, ..row }, axes });
    }

    /// Hands over the overrun that ends the run.
    pub fn tell_overrun(&mut self, overrun: &Overrun, woke_ns: u64) {
        let Overrun { index: first, skipped, late_by } = *overrun;
        let late_ns = late_by.as_nanos() as u64;
        self.recorder.timing(TimingRecord::Stopped { first, skipped, late_ns, woke_ns });
    }

    /// Records `cycle` with what acts over it, and steps the plant: for cycles that were sent and for those that were missed.
    fn advance(&mut self, cycle: u64) {
        self.hold_hands();
        for (valve, intake) in self.inputs.valve.iter_mut().zip(&self.commands) {
            // Commands count as 0 while the emergency stop is tripped, and the record shows what acts.
            let opening = if self.plant.emergency_stop() { 0.0 } else { intake.opening() };
            *valve = plant::quantise_valve(opening);
        }
        let mut terms = self.plant.terms(&self.inputs);
        if self.faults.possible() {
            terms.push(self.faults.active() as f64);
        }
        self.recorder.cycle(CycleRecord {
            cycle,
            valve: self.inputs.valve,
            readings: self.readings,
            truth: self.plant.truth(&self.inputs),
            terms,
        });
        self.plant.step(&self.inputs);
    }

    fn send_tick(&mut self, cause: TickCause, cycle: u64, bus: &mut dyn Bus) {
        self.send(&telegrams::tick(cause, cycle, self.skipped, self.lockstep), bus);
    }

    fn send(&mut self, frame: &Frame, bus: &mut dyn Bus) -> Option<u64> {
        let frame = telegrams::encode(frame);
        // What the bus did not take is counted there.
        let stamp_ns = bus.send(&frame).ok()?;
        self.recorder.frame(FrameRecord { stamp_ns, frame });
        Some(stamp_ns)
    }

    fn take_command(&mut self, axis: usize, command: ValveCommand, stamp_ns: u64, cycle: u64) {
        if !self.commands[axis].take(command, &self.live) {
            return;
        }
        let round_trip_ns = self.exchange[axis].taken(command.echo, stamp_ns, cycle);
        if let Some(ns) = round_trip_ns.filter(|_| !self.lockstep) {
            self.recorder.round_trip(RoundTrip { axis, cycle, ns });
        }
    }

    fn note_chain(&mut self, axis: usize, status: ChainStatus) {
        self.chains_done[axis] = Some(status.main_chain == MainChainState::Done);
    }

    fn obey_emergency_stop(&mut self, holder: Holder, stop: EmergencyStop, cycle: u64) {
        if let Some(outcome) = self.people.emergency_stop(holder, stop.release, &mut self.plant) {
            self.tell(cycle, outcome.into());
        }
    }

    /// Lets the script do what is due in `cycle`.
    fn begin(&mut self, cycle: u64) {
        let Self { people, plant, recorder, .. } = self;
        let tell = |outcome| recorder.event(Event { cycle, kind: EventKind::from(outcome) });
        self.hands[SCRIPT] = people.begin_cycle(cycle, plant, tell);
        self.begin_faults(cycle);
        self.hold_hands();
    }

    fn hold_hands(&mut self) {
        let [script, bus, console, faults] = self.hands;
        (script + bus + console + faults).put_into(&mut self.inputs);
    }

    fn act_by_hand(&mut self, action: Action, cycle: u64) {
        let Self { people, plant, recorder, .. } = self;
        people.act(action, plant, |outcome| recorder.event(Event { cycle, kind: EventKind::from(outcome) }));
    }

    /// Takes one command of the console, if one waits: a flood of them is spread over cycles.
    fn take_typed(&mut self, cycle: u64) {
        let Some(Ok(command)) = self.console.as_ref().map(Receiver::try_recv) else { return };
        match command {
            Command::Act(action) => self.act_by_hand(action, cycle),
            Command::Hand { on, force_n } => {
                *self.hands[CONSOLE].on(on) = force_n;
                self.tell(cycle, self.hands[CONSOLE].into());
            }
            Command::Break(fault) => self.break_or_mend(cycle, |course, broken, tell| {
                course.break_by_hand(fault, broken, tell);
            }),
            Command::Mend(like) => self.break_or_mend(cycle, |course, broken, tell| {
                course.mend(like.as_ref(), broken, tell);
            }),
            Command::Quit => self.quit_asked = true,
        }
    }

    fn tell(&mut self, cycle: u64, kind: EventKind) {
        self.recorder.event(Event { cycle, kind });
    }

    /// Whether every controller that was heard says that its chain is done.
    #[must_use]
    pub fn controllers_done(&self) -> bool {
        self.chains_done.iter().flatten().count() > 0 && self.chains_done.iter().flatten().all(|done| *done)
    }

    /// Whether the plant's state is finite; when not, which is told, the run must end with silence on the bus.
    pub fn is_finite(&mut self, cycle: u64) -> bool {
        let finite = self.plant.state().is_finite();
        if !finite {
            self.tell(cycle, EventKind::NotFinite);
        }
        finite
    }

    /// Frames by what became of them.
    #[must_use]
    pub fn frame_counters(&self) -> FrameCounters {
        self.frames
    }

    /// Whether somebody typed quit.
    #[must_use]
    pub fn quit_asked(&self) -> bool {
        self.quit_asked
    }

    /// Whether any valve command was accepted.
    #[must_use]
    pub fn controller_heard(&self) -> bool {
        self.commands.iter().any(|intake| intake.counters().accepted > 0)
    }

    /// Cycles computed without being sent.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// The figures of the run; the station goes, and with it the recorder's sending ends.
    #[must_use]
    pub fn into_figures(self) -> StationFigures {
        StationFigures {
            frames: self.frames,
            commands: self.commands.map(|intake| *intake.counters()),
            skipped: self.skipped,
            records_dropped: self.recorder.dropped(),
        }
    }
}

fn change_event(change: Change, axis: Axis) -> EventKind {
    match change {
        Change::Expired => EventKind::CommandStale(axis),
        Change::Fresh => EventKind::CommandFresh(axis),
        Change::TwoSources => EventKind::TwoSources(axis),
        Change::OneSource => EventKind::OneSource(axis),
    }
}

#[cfg(test)]
mod tests;
