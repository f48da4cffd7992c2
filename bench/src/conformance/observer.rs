//! Record of the frames of a controller, with their violations. No input or output: frames, stamps and cycles are arguments.
//!
//! The 12 bits of the echo stand for the newest cycle sent that ends with them. A cycle that was never sent, because it was
//! skipped or its sensors were lost, cannot be answered.

use super::cli::CheckedAxis;
use protocol::can::CanFrame;
use protocol::checksum;
use protocol::frames::{ALIVE_RANGE, DecodeError, ECHO_RANGE, EmergencyStop, Frame, MessageSpec};

/// Most frames that are kept; a controller that floods the bus is cut off here.
const MOST_FRAMES: usize = 500_000;

/// A frame of the controller under test.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ObservedFrame {
    Command {
        /// Opening commanded, 0 without the enable bit.
        opening: f64,
        /// Cycles between the one answered and the newest one sent; `None` when it answers none.
        age: Option<u64>,
        /// Difference of its counter from the command before; `None` for the first.
        step: Option<u8>,
    },
    /// A command that the rig rejects.
    Malformed(MalformedCommand),
    Stop(EmergencyStop),
    /// Another frame that the controller may send.
    Permitted,
    /// A frame that violates rig.dbc or belongs to another node, in the notation of candump.
    NotPermitted(String),
}

/// Why the rig rejects a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MalformedCommand {
    /// Its length is not five bytes.
    Length,
    /// Its checksum is wrong.
    Checksum,
    /// Unused bits are not 0.
    Reserved,
    /// Its opening is beyond ±2047 counts.
    Range,
}

#[derive(Clone, Debug)]
pub(super) struct ReceivedFrame {
    /// The newest cycle that had been sent.
    pub(super) cycle: u64,
    pub(super) stamp_ns: u64,
    pub(super) frame: ObservedFrame,
}

pub(super) struct Observer {
    command: &'static MessageSpec,
    /// Nodes of rig.dbc whose frames the controller may send.
    nodes: Vec<&'static str>,
    /// By cycle: whether the sensors of the axis were sent.
    sent: Vec<bool>,
    last_alive: Option<u8>,
    pub(super) received: Vec<ReceivedFrame>,
    /// The opening in effect.
    pub(super) opening: f64,
}

impl Observer {
    pub(super) fn new(axis: CheckedAxis, both_axes: bool) -> Self {
        let axes = [CheckedAxis::Drive, CheckedAxis::Load];
        let nodes = axes.into_iter().filter(|one| *one == axis || both_axes);
        Self {
            nodes: nodes.map(|axis| axis.command().sender).collect(),
            command: axis.command(),
            sent: Vec::new(),
            last_alive: None,
            received: Vec::new(),
            opening: 0.0,
        }
    }

    /// Records that `cycle` is sent now, with or without sensors.
    pub(super) fn note_sent(&mut self, cycle: u64, with_sensors: bool) {
        self.sent.resize(cycle as usize, false);
        self.sent.push(with_sensors);
    }

    /// Records a frame that arrived at `stamp_ns`, after the last recorded cycle.
    pub(super) fn take(&mut self, frame: &CanFrame, stamp_ns: u64) {
        if self.received.len() < MOST_FRAMES {
            let frame = self.judge(frame);
            let cycle = (self.sent.len() as u64).saturating_sub(1);
            self.received.push(ReceivedFrame { cycle, stamp_ns, frame });
        }
    }

    /// Whether the controller floods the bus.
    pub(super) fn babbles(&self) -> bool {
        self.received.len() >= MOST_FRAMES
    }

    fn judge(&mut self, frame: &CanFrame) -> ObservedFrame {
        if frame.standard_id() == Some(self.command.id) {
            return self.judge_command(frame);
        }
        let allowed = frame
            .standard_id()
            .and_then(MessageSpec::by_id)
            .is_some_and(|spec| self.nodes.contains(&spec.sender));
        match Frame::decode(frame) {
            Ok(Frame::DriveEmergencyStop(stop) | Frame::LoadEmergencyStop(stop)) if allowed => {
                ObservedFrame::Stop(stop)
            }
            Ok(_) if allowed => ObservedFrame::Permitted,
            _ => ObservedFrame::NotPermitted(frame.to_string()),
        }
    }

    fn judge_command(&mut self, frame: &CanFrame) -> ObservedFrame {
        let data = frame.data();
        if data.len() != usize::from(self.command.length) {
            return ObservedFrame::Malformed(MalformedCommand::Length);
        }
        let (crc, before) = data.split_last().expect("a command has five bytes");
        if checksum::of(self.command.id, before) != *crc {
            return ObservedFrame::Malformed(MalformedCommand::Checksum);
        }
        let command = match Frame::decode(frame) {
            Ok(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => command,
            Err(DecodeError::ReservedBits { .. }) => {
                return ObservedFrame::Malformed(MalformedCommand::Reserved);
            }
            _ => return ObservedFrame::Malformed(MalformedCommand::Range),
        };
        let modulo = ALIVE_RANGE as u8;
        let step = self.last_alive.replace(command.alive);
        let step = step.map(|last| (command.alive + modulo - last) % modulo);
        let opening = if command.enable { command.opening } else { 0.0 };
        self.opening = opening;
        ObservedFrame::Command { opening, age: self.age(u64::from(command.echo)), step }
    }

    /// Age of the newest cycle sent that ends with these bits.
    fn age(&self, echo: u64) -> Option<u64> {
        let newest = (self.sent.len() as u64).checked_sub(1)?;
        let age = newest.wrapping_sub(echo) % ECHO_RANGE;
        let answered = newest.checked_sub(age)?;
        self.sent[answered as usize].then_some(age)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::{EmergencyStopReason, ValveCommand};

    fn command(alive: u8, echo: u16) -> CanFrame {
        Frame::DriveValveCommand(ValveCommand { opening: 1.0, alive, echo, enable: true }).encode().unwrap()
    }

    /// What a controller is asked to have sent, after cycles up to 4999 of which 4990 was skipped.
    fn judged(frames: &[CanFrame]) -> Vec<ObservedFrame> {
        let mut observer = Observer::new(CheckedAxis::Drive, false);
        (0..5000).filter(|cycle| *cycle != 4990).for_each(|cycle| observer.note_sent(cycle, cycle != 4995));
        frames.iter().for_each(|frame| observer.take(frame, 0));
        observer.received.into_iter().map(|received| received.frame).collect()
    }

    #[test]
    fn a_command_has_an_age_and_its_counter_a_step() {
        let echo = |cycle: u16| cycle % 4096;
        let frames =
            [command(15, echo(4999)), command(0, echo(4998)), command(2, echo(4990)), command(2, echo(4995))];
        let of = |age, step| ObservedFrame::Command { opening: 1.0, age, step };
        let expected = [of(Some(0), None), of(Some(1), Some(1)), of(None, Some(2)), of(None, Some(0))];
        assert_eq!(judged(&frames), expected);
        // Of a cycle to come: the 12 bits are those of one long ago, which was sent.
        assert_eq!(judged(&[command(0, echo(5001))]), [of(Some(4094), None)]);
    }

    #[test]
    fn errors_of_a_command_are_distinguished() {
        let good = command(0, 0);
        let with = |change: &dyn Fn(&mut Vec<u8>), sum: bool| {
            let mut data = good.data()[..4].to_vec();
            change(&mut data);
            data.push(checksum::of(0x110, &data) ^ u8::from(!sum));
            CanFrame::new(0x110, &data)
        };
        let frames = [
            CanFrame::new(0x110, &good.data()[..4]),
            with(&|_| {}, false),
            with(&|data| data[3] |= 0x80, true),
            with(&|data| (data[0], data[1]) = (0, data[1] & 0xF0 | 0x08), true),
        ];
        let expected = [
            MalformedCommand::Length,
            MalformedCommand::Checksum,
            MalformedCommand::Reserved,
            MalformedCommand::Range,
        ]
        .map(ObservedFrame::Malformed);
        assert_eq!(judged(&frames), expected);
    }

    #[test]
    fn what_is_not_its_own_is_named() {
        let stop = EmergencyStop { reason: EmergencyStopReason::SensorLoss, release: false };
        let frames = [
            Frame::DriveEmergencyStop(stop).encode().unwrap(),
            Frame::LoadEmergencyStop(stop).encode().unwrap(),
            CanFrame::new(0x150, &[0; 5]),
            CanFrame::new(0x150, &[0; 4]),
            CanFrame::from_raw(0x8000_0110, &[]),
        ];
        let not = |text: &str| ObservedFrame::NotPermitted(text.into());
        let expected = [
            ObservedFrame::Stop(stop),
            not("10B#0300"),
            ObservedFrame::Permitted,
            not("150#00000000"),
            not("00000110#"),
        ];
        assert_eq!(judged(&frames), expected);
    }
}
