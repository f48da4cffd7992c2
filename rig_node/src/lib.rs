//! The simulated rig as a node of its bus: sensors, frames and commands of a cycle, whatever carries and paces them.
//!
//! ```text
//!   begin(k) ──────────► publish(k) ─────────► take(frame)* ──────────► latch, step(k) ──► t_k+1
//!   people, sensors      tick, sensors,        arrived before t_k       the command that acts
//!   sampled              status                                         over [t_k, t_k+1)
//! ```
//!
//! A command that arrived before t_k acts over [t_k, t_k+1) (bus.md, Time). What is simulated is a [`SimulatedRig`]: the plant
//! with people around it ([`PeopledPlant`]), the emulator's with faults, the record maker's own. Nothing here allocates after the
//! start, locks, prints or blocks.

#![warn(missing_docs)] // an interface of other crates

mod rig;
mod telegrams;

pub use rig::{HandForceSource, PeopledPlant, RigCondition, SimulatedRig};
pub use telegrams::TickCause;

use plant::scene::StopHolder;
use plant::{Axis, AxisReadings};
use protocol::commands::{Change, CommandIntake};
use protocol::frames::{EmergencyStop, Frame, ValveCommand};
use protocol::live_cycles::LiveCycles;
use protocol::periods;
use telegrams::SaturatedSensors;

const _: () = assert!(plant::PERIOD_S == periods::CYCLE_S, "a step of the plant is a cycle of the bus");

/// A simulated rig on its bus.
pub struct RigNode<R> {
    rig: R,
    commands: [CommandIntake; 2],
    live: LiveCycles,
    /// Sensors that saturated since the last status.
    saturated: [SaturatedSensors; 2],
    skipped: u64,
    lockstep: bool,
}

/// Outcome of a received frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameOutcome {
    /// A valve command was accepted.
    Command {
        /// Whose valve.
        axis: Axis,
        /// Low bits of the cycle that it answers.
        echo: u16,
    },
    /// The node processed it.
    Handled,
    /// The node does not process it; the caller decides, since not every rig obeys it.
    Unhandled(Frame),
}

/// State of the command of an axis over a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latched {
    /// Change of the command's state.
    pub change: Option<Change>,
    /// Age of the command that is obeyed, in cycles that were sent; `None` without one.
    pub age_cycles: Option<u64>,
}

impl<R: SimulatedRig> RigNode<R> {
    /// The rig before cycle 0. `lockstep`: simulated time is the bus's time.
    #[must_use]
    pub fn new(rig: R, lockstep: bool) -> Self {
        Self {
            rig,
            commands: Default::default(),
            live: LiveCycles::default(),
            saturated: Default::default(),
            skipped: 0,
            lockstep,
        }
    }

    /// Cycles from `first` on that are computed and not sent.
    pub fn skip(&mut self, first: u64, count: u64) {
        self.skipped += count;
        self.live.skipped(first, count);
    }

    /// Begins `cycle`: people act, then the sensors are sampled.
    pub fn begin(&mut self, cycle: u64, on_event: &mut dyn FnMut(R::Event)) -> [AxisReadings; 2] {
        let readings = self.rig.sample(cycle, on_event);
        self.saturated.iter_mut().zip(&readings).for_each(|(saturated, readings)| saturated.note(readings));
        readings
    }

    /// Sends what is due in `cycle`, which began with these readings. `after_miss` sends the tick first, so that receivers know
    /// which cycle the sensors are of.
    pub fn publish(
        &mut self,
        cycle: u64,
        after_miss: bool,
        [drive, load]: &[AxisReadings; 2],
        mut send: impl FnMut(&Frame),
    ) {
        if after_miss {
            send(&self.tick(TickCause::Miss, cycle));
        }
        // Ahead of the sensors, which wake the controllers.
        if let Some(call) = self.rig.rig_call(cycle) {
            send(&telegrams::emergency_stop(call));
        }
        send(&Frame::DriveSensors(telegrams::sensors(drive, cycle)));
        send(&Frame::LoadSensors(telegrams::sensors(load, cycle)));
        self.live.sent(cycle);
        if periods::tick_is_due(cycle) && !after_miss {
            send(&self.tick(TickCause::Period, cycle));
        }
        if periods::status_is_due(cycle) {
            let saturated = std::mem::take(&mut self.saturated);
            send(&telegrams::status(&self.rig.condition(), &saturated, &self.commands));
        }
    }

    /// The tick of `cycle`.
    #[must_use]
    pub fn tick(&self, cause: TickCause, cycle: u64) -> Frame {
        telegrams::tick(cause, cycle, self.skipped, self.lockstep)
    }

    /// Takes a frame that arrived before the cycle that was sent last.
    pub fn take(&mut self, frame: Frame, on_event: &mut dyn FnMut(R::Event)) -> FrameOutcome {
        match frame {
            Frame::DriveValveCommand(command) => self.take_command(Axis::Drive, command),
            Frame::LoadValveCommand(command) => self.take_command(Axis::Load, command),
            Frame::ConsoleEmergencyStop(stop) => self.obey(StopHolder::Console, stop, on_event),
            Frame::DriveEmergencyStop(stop) => self.obey(StopHolder::Drive, stop, on_event),
            Frame::LoadEmergencyStop(stop) => self.obey(StopHolder::Load, stop, on_event),
            other => FrameOutcome::Unhandled(other),
        }
    }

    fn take_command(&mut self, axis: Axis, command: ValveCommand) -> FrameOutcome {
        let accepted = self.commands[axis.index()].take(command, &self.live);
        if accepted { FrameOutcome::Command { axis, echo: command.echo } } else { FrameOutcome::Handled }
    }

    fn obey(
        &mut self,
        holder: StopHolder,
        stop: EmergencyStop,
        on_event: &mut dyn FnMut(R::Event),
    ) -> FrameOutcome {
        if let Some(event) = self.rig.emergency_stop(holder, stop.release) {
            on_event(event);
        }
        FrameOutcome::Handled
    }

    /// Drops the command of an axis that is stale in the cycle that was sent last, notes a dispute of two senders, and reports
    /// both. The opening is that of [`RigNode::openings`].
    pub fn latch(&mut self, axis: Axis) -> Latched {
        let intake = &mut self.commands[axis.index()];
        let change = intake.latch(&self.live);
        Latched { change, age_cycles: intake.obeyed_age_cycles(&self.live) }
    }

    /// Ends `cycle`, sent or missed: the rig moves by one period under the commands that `latch` left.
    pub fn step(&mut self, cycle: u64) -> R::Cycle {
        let valve = self.openings([None, None]);
        self.rig.step(cycle, valve)
    }

    /// Valve openings of both axes, 0 while the emergency stop is tripped. `coming`: commands that the caller has for the next
    /// cycle already, as the rehearsal; `None`: the command that was latched.
    #[must_use]
    pub fn openings(&self, coming: [Option<ValveCommand>; 2]) -> [f64; 2] {
        let stopped = self.rig.condition().emergency_stop;
        Axis::ALL.map(|axis| {
            let opening = match coming[axis.index()] {
                _ if stopped => 0.0,
                Some(command) if command.enable => command.opening,
                Some(_) => 0.0,
                None => self.commands[axis.index()].opening(),
            };
            plant::quantise_valve(opening)
        })
    }

    /// Simulated rig that the node moves.
    #[must_use]
    pub fn rig(&self) -> &R {
        &self.rig
    }

    /// The rig, to do something to it between two cycles.
    pub fn rig_mut(&mut self) -> &mut R {
        &mut self.rig
    }

    /// Command paths of drive and load.
    #[must_use]
    pub fn commands(&self) -> &[CommandIntake; 2] {
        &self.commands
    }

    /// Cycles computed without being sent.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::scene::Outcome;
    use plant::{People, Plant, RigParameters, Scene, Sensors, Setup};

    #[test]
    fn a_tick_is_sent_when_it_is_due_and_once_after_a_miss() {
        let rig = RigParameters::baseline();
        let plant = Plant::new(&rig, &Setup::default()).unwrap();
        let peopled = PeopledPlant::new(plant, Sensors::new(&rig, 1), People::new(&Scene::default()));
        let mut node = RigNode::new(peopled, false);
        for cycle in 0..25 {
            for after_miss in [false, true] {
                let readings = node.begin(cycle, &mut |_: Outcome| ());
                let mut ticks = 0;
                node.publish(cycle, after_miss, &readings, |frame| {
                    ticks += usize::from(matches!(frame, Frame::Tick(_)));
                });
                let is_due = after_miss || periods::tick_is_due(cycle);
                assert_eq!(ticks, usize::from(is_due), "cycle {cycle}, after a miss: {after_miss}");
            }
        }
    }
}
