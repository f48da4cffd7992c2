//! The controllers of a process on the bus: frames in, commands out, whatever paces them.
//!
//! ```text
//!   take(frame)* ──► answer: for each axis with fresh sensors, one command that echoes their cycle;
//!                            every ten cycles, and on change, status and values of its chains; its emergency stop
//! ```
//!
//! Only the newest sensors of an axis are answered: a backlog is read, not replayed. An axis hears its partner a cycle after it
//! spoke, also in one process: one or two give the same log. Nothing here allocates, locks, prints or blocks.

use crate::axis::{Answer, AxisController, AxisRecord};
use crate::chains::main::MainCause;
use crate::program::Program;
use crate::rig_view::{RigView, TickEvent};
use crossbeam_channel::{Receiver, Sender};
use nominal::Axis;
use protocol::frames::{DecodeError, EmergencyStop, Frame, MainChainState, Sensors, ValveCommand};
use protocol::{bus::FrameSink, can::CanFrame, periods::TICK_CYCLES};
use runlog::controller_report::IgnoredFrames;
use std::collections::VecDeque;
use std::fmt::Display;

/// Ticks of the rig without sensors of an axis after which these count as lost: 50 ms, before its partner gives it up.
const SILENT_TICKS: u64 = 5;
/// Cycles after an abort or a fault during which the valve is still commanded shut and the record goes on.
pub const STOPPED_CYCLES: u64 = 2000;
/// Frames of a partner that wait for their cycle; a cycle has three at most.
const DELAYED_FRAMES: usize = 16;

/// An event of a run for people: printed, and listed in the report.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeEvent {
    /// The main chain of an axis went to this state in this cycle, because of this.
    State {
        /// Axis of the chain.
        axis: Axis,
        /// The state that was entered.
        #[serde(serialize_with = "in_words")]
        state: MainChainState,
        /// The rig's cycle whose answer reports the state. Without sensors there is no answer, and the report comes late.
        cycle: u64,
        /// Why it was entered.
        #[serde(serialize_with = "in_words")]
        cause: MainCause,
    },
    /// The rig's cycles began again, and all controllers with them.
    RigRestarted,
    /// The bus is down, after it was up.
    BusLost,
    /// The bus is up again.
    BusBack,
    /// Neither sensors nor a tick of the rig came for 0.2 s; once for each silence.
    SensorsSilent,
}

fn in_words<S: serde::Serializer>(shown: &impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(shown)
}

/// A parameter that shall change, already checked against its table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Axis whose program holds the parameter.
    pub axis: Axis,
    /// Index in [`Program::variables`].
    pub place: usize,
    /// New value, in the variable's unit.
    pub value: f64,
}

/// The queues between a node and the threads that may wait.
pub struct NodeQueues {
    /// A row of an axis each recorded cycle.
    pub records: Sender<AxisRecord>,
    /// Events; one that finds the queue full is lost.
    pub news: Sender<NodeEvent>,
    /// Changes of parameters, applied before the next cycle is answered.
    pub changes: Receiver<Change>,
    /// Lockstep waits for the recorder rather than lose a row.
    pub waits: bool,
}

/// Frames between two axes of one process, each received in the cycle after the one in which it was sent, as over the bus.
#[derive(Default)]
struct FrameDelay(VecDeque<(u64, Frame)>);

impl FrameDelay {
    fn new() -> Self {
        Self(VecDeque::with_capacity(DELAYED_FRAMES))
    }

    fn post(&mut self, cycle: u64, frame: Frame) {
        if self.0.len() == DELAYED_FRAMES {
            self.0.pop_front();
        }
        self.0.push_back((cycle, frame));
    }

    fn received_in(&mut self, cycle: u64) -> Option<Frame> {
        self.0.pop_front_if(|(sent, _)| *sent < cycle).map(|(_, frame)| frame)
    }
}

struct Member<P> {
    controller: AxisController,
    /// Frames of the partner in this process.
    partner_frames: FrameDelay,
    answered: u64,
    stopped_for: u64,
    silent_ticks: u64,
    /// Measurement and calibration, if that was asked for.
    port: Option<P>,
}

/// Access to a controller from outside its program: signals are measured, parameters are changed between two cycles. A port does
/// nothing by itself.
pub trait CalibrationPort {
    /// Processes a frame that is a command to the port; returns whether it was one.
    fn take(&mut self, _: &CanFrame) -> bool {
        false
    }

    /// The rig's cycles began again, and the controller with them: samples of old cycles are another rig's.
    fn restart(&mut self) {}

    /// Samples the signals of a controller after it has answered the sensors of a cycle.
    fn observe(&mut self, _: &AxisController, _: u64, _: &Sensors, _: &ValveCommand) {}

    /// Answers waiting commands and sends what is due, once all valves have their commands.
    fn serve(&mut self, _: &mut Program, _: &mut dyn FrameSink) {}
}

/// The port of a controller without measurement and calibration; it has no value.
#[derive(Clone, Copy, Debug)]
pub enum NoPort {}

impl CalibrationPort for NoPort {}

/// The controllers of a process, one or two, each with its port `P` if it has one.
pub struct ControllerNode<P = NoPort> {
    /// The rig as its frames show it.
    pub view: RigView,
    members: Vec<Member<P>>,
    queues: NodeQueues,
    /// Counts of received frames that `rig.dbc` does not know, or that do not decode.
    pub ignored: IgnoredFrames,
    /// Rows of the record that were lost: the queue was full, or its reader has ended.
    pub records_dropped: u64,
    /// The rig has announced its end: nothing is answered until its cycles begin again.
    pub ending: bool,
    /// Cycles that an axis answered, each once.
    pub answered: u64,
    newest_answered: Option<u64>,
}

impl ControllerNode {
    /// Puts the controllers, one or two, on the bus.
    pub fn new(controllers: Vec<AxisController>, queues: NodeQueues) -> Self {
        Self::with_ports(controllers, queues, |_| None)
    }
}

impl<P: CalibrationPort> ControllerNode<P> {
    /// Puts the controllers, one or two, on the bus, each with the port that `port_of` gives for its axis.
    pub fn with_ports(
        controllers: Vec<AxisController>,
        queues: NodeQueues,
        mut port_of: impl FnMut(Axis) -> Option<P>,
    ) -> Self {
        let member = |controller: AxisController| Member {
            port: port_of(controller.axis),
            controller,
            partner_frames: FrameDelay::new(),
            answered: 0,
            stopped_for: 0,
            silent_ticks: 0,
        };
        Self {
            view: RigView::default(),
            members: controllers.into_iter().map(member).collect(),
            queues,
            ignored: IgnoredFrames::default(),
            records_dropped: 0,
            ending: false,
            answered: 0,
            newest_answered: None,
        }
    }

    /// Processes a frame; returns the axis whose sensors it carried.
    pub fn take(&mut self, frame: &CanFrame) -> Option<Axis> {
        if self.members.iter_mut().filter_map(|member| member.port.as_mut()).any(|port| port.take(frame)) {
            return None;
        }
        match Frame::decode(frame) {
            Ok(Frame::DriveSensors(sensors)) => return Some(self.take_sensors(Axis::Drive, sensors)),
            Ok(Frame::LoadSensors(sensors)) => return Some(self.take_sensors(Axis::Load, sensors)),
            Ok(Frame::RigStatus(status)) => self.view.take_status(status),
            Ok(Frame::Tick(tick)) => match self.view.take_tick(&tick) {
                TickEvent::Usual => self.members.iter_mut().for_each(|member| member.silent_ticks += 1),
                TickEvent::Ending => self.ending = true,
                TickEvent::Restarted => {
                    self.ending = false;
                    self.newest_answered = None;
                    self.members.iter_mut().for_each(|member| {
                        member.controller.restart();
                        member.partner_frames.0.clear();
                        member.silent_ticks = 0;
                        member.port.iter_mut().for_each(CalibrationPort::restart);
                    });
                    self.report(NodeEvent::RigRestarted);
                }
            },
            Ok(frame) => self.members.iter_mut().for_each(|member| member.controller.receive(&frame)),
            Err(DecodeError::NotPlainData { .. } | DecodeError::UnknownIdentifier { .. }) => {
                self.ignored.unknown += 1;
            }
            Err(_) => self.ignored.malformed += 1,
        }
        None
    }

    fn take_sensors(&mut self, axis: Axis, sensors: Sensors) -> Axis {
        self.view.take_sensors(axis, sensors);
        axis
    }

    /// Answers fresh sensors; returns for each axis the cycle that was answered.
    pub fn answer(&mut self, bus: &mut dyn FrameSink) -> [Option<u64>; 2] {
        if self.ending {
            return [None; 2];
        }
        let mut answered: [Option<(u64, Sensors, ValveCommand)>; 2] = [None; 2];
        self.take_changes();
        for place in 0..self.members.len() {
            let axis = self.members[place].controller.axis;
            if let Some((cycle, sensors)) = self.view.fresh_sensors(axis) {
                let status = self.view.status().copied();
                let member = &mut self.members[place];
                while let Some(frame) = member.partner_frames.received_in(cycle) {
                    member.controller.receive(&frame);
                }
                let answer = member.controller.answer(cycle, &sensors, status.as_ref());
                member.answered += 1;
                member.silent_ticks = 0;
                let stopped =
                    matches!(member.controller.state(), MainChainState::Aborted | MainChainState::Fault)
                        && !member.controller.may_restart();
                member.stopped_for = if stopped { member.stopped_for + 1 } else { 0 };
                self.send(place, cycle, &answer, bus);
                answered[axis.index()] = Some((cycle, sensors, answer.command));
            } else if self.members[place].silent_ticks >= SILENT_TICKS {
                self.report_missing_sensors(place, bus);
            }
        }
        // When all valves have their commands.
        for Member { controller, port, .. } in &mut self.members {
            if let Some(port) = port {
                if let Some((cycle, sensors, command)) = &answered[controller.axis.index()] {
                    port.observe(controller, *cycle, sensors, command);
                }
                port.serve(&mut controller.program, bus);
            }
        }
        let cycles = answered.map(|answer| answer.map(|(cycle, ..)| cycle));
        self.count(cycles);
        cycles
    }

    /// One axis may answer a cycle whose sensors of the other were overtaken: it counts, and once if both answer it.
    fn count(&mut self, mut cycles: [Option<u64>; 2]) {
        cycles.sort_unstable();
        for cycle in cycles.into_iter().flatten() {
            if self.newest_answered.is_none_or(|newest| cycle > newest) {
                self.newest_answered = Some(cycle);
                self.answered += 1;
            }
        }
    }

    /// The rig goes on, and sensors of the axis do not come: after each tick the axis says what a fault has to say.
    fn report_missing_sensors(&mut self, place: usize, bus: &mut dyn FrameSink) {
        let Some(cycle) = self.view.cycle else { return };
        let member = &mut self.members[place];
        if member.answered == 0 {
            // It never had any: it waits for its rig.
            return;
        }
        let axis = member.controller.axis;
        let stop = member.controller.without_sensors(cycle);
        member.stopped_for += if member.controller.may_restart() { 0 } else { TICK_CYCLES };
        member.silent_ticks = SILENT_TICKS - 1;
        if let Some(stop) = stop {
            self.send_to_all(place, cycle, &emergency_stop_frame(axis, stop), bus);
        }
    }

    /// Onto the bus, and to the partner if it lives in this process.
    fn send_to_all(&mut self, place: usize, cycle: u64, frame: &Frame, bus: &mut dyn FrameSink) {
        send(bus, frame);
        self.members.iter_mut().enumerate().filter(|(other, _)| *other != place).for_each(|(_, member)| {
            member.partner_frames.post(cycle, as_received(frame));
        });
    }

    fn send(&mut self, place: usize, cycle: u64, answer: &Answer, bus: &mut dyn FrameSink) {
        let axis = self.members[place].controller.axis;
        send(bus, &frame(axis, [Frame::DriveValveCommand, Frame::LoadValveCommand], answer.command));
        let frames = [
            answer.emergency_stop.map(|stop| emergency_stop_frame(axis, stop)),
            answer
                .status
                .map(|status| frame(axis, [Frame::DriveChainStatus, Frame::LoadChainStatus], status)),
            answer
                .values
                .map(|values| frame(axis, [Frame::DriveChainValues, Frame::LoadChainValues], values)),
        ];
        for frame in frames.into_iter().flatten() {
            self.send_to_all(place, cycle, &frame, bus);
        }
        if let Some(news) = answer.news {
            self.report(news);
        }
        if let Some(record) = answer.record {
            let sent = if self.queues.waits {
                self.queues.records.send(record).is_ok()
            } else {
                self.queues.records.try_send(record).is_ok()
            };
            self.records_dropped += u64::from(!sent);
        }
    }

    fn take_changes(&mut self) {
        while let Ok(change) = self.queues.changes.try_recv() {
            let of_axis = |member: &&mut Member<P>| member.controller.axis == change.axis;
            let Some(member) = self.members.iter_mut().find(of_axis) else { continue };
            // Checked by whoever sent it.
            let _ = member.controller.program.set(change.place, change.value);
        }
    }

    /// Queues a message for people; a full queue loses it.
    pub fn report(&mut self, news: NodeEvent) {
        let _ = self.queues.news.try_send(news);
    }

    /// The controllers in the order in which they answer.
    pub fn controllers(&self) -> impl Iterator<Item = &AxisController> {
        self.members.iter().map(|member| &member.controller)
    }

    /// Port of the controller of `axis`; `None` where it has none, or where another process has the axis.
    pub fn port(&self, axis: Axis) -> Option<&P> {
        self.member(axis)?.port.as_ref()
    }

    fn member(&self, axis: Axis) -> Option<&Member<P>> {
        self.members.iter().find(|member| member.controller.axis == axis)
    }

    /// Whether all axes of this process are done: no repetition is left.
    pub fn done(&self) -> bool {
        self.controllers().all(|controller| controller.state() == MainChainState::Done)
    }

    /// Cycles answered by `axis`; 0 where it is none of ours.
    pub fn answered_by(&self, axis: Axis) -> u64 {
        self.member(axis).map_or(0, |member| member.answered)
    }

    /// Cycles answered since an axis was stopped for good, by an abort or a fault; 0 while none is.
    pub fn stopped_for(&self) -> u64 {
        self.members.iter().map(|member| member.stopped_for).max().unwrap_or(0)
    }
}

/// Content in the frame of an axis: that of the drive or that of the load.
fn frame<T>(axis: Axis, of: [fn(T) -> Frame; 2], content: T) -> Frame {
    of[axis.index()](content)
}

fn emergency_stop_frame(axis: Axis, stop: EmergencyStop) -> Frame {
    frame(axis, [Frame::DriveEmergencyStop, Frame::LoadEmergencyStop], stop)
}

fn encode(frame: &Frame) -> CanFrame {
    frame
        .encode()
        .unwrap_or_else(|error| panic!("a controller made a frame that rig.dbc does not allow: {error}"))
}

/// The frame as it arrives elsewhere: values rounded to what the wire carries.
pub(crate) fn as_received(frame: &Frame) -> Frame {
    Frame::decode(&encode(frame)).unwrap_or_else(|error| panic!("an encoded frame does not decode: {error}"))
}

/// Sends a frame that a controller made itself; what the bus does not take is counted there.
fn send(bus: &mut dyn FrameSink, frame: &Frame) {
    let _ = bus.send(&encode(frame));
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::ChainStatus;

    #[test]
    fn mail_is_heard_in_the_cycle_after_it_was_sent() {
        let mut partner_frames = FrameDelay::new();
        let frame = Frame::DriveChainStatus(ChainStatus::default());
        partner_frames.post(7, frame);
        assert!(partner_frames.received_in(7).is_none());
        partner_frames.post(8, frame);
        assert!(partner_frames.received_in(8).is_some() && partner_frames.received_in(8).is_none());
        assert!(partner_frames.received_in(9).is_some());
    }

    #[test]
    fn a_partner_that_is_not_heard_for_long_leaves_the_newest() {
        let mut partner_frames = FrameDelay::new();
        (0..100)
            .for_each(|cycle| partner_frames.post(cycle, Frame::DriveChainStatus(ChainStatus::default())));
        assert_eq!((0..200).filter(|_| partner_frames.received_in(1000).is_some()).count(), DELAYED_FRAMES);
    }
}
