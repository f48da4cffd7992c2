//! A slave on the bus: commands wait until the controller's work in a cycle is done, then responses and DAQ packets are sent.
//!
//! In real time a command is answered in the wake-up that it causes, in lockstep in its cycle. At most [`COMMANDS`] are
//! answered at a time and [`INBOX`] wait; further ones are dropped and counted. Nothing here allocates, locks, prints or blocks:
//! requests for files go to the worker of [`crate::parameter_files`] by a queue.

use crate::a2l::{self, A2lError, AxisDescription};
use crate::config::XcpConfig;
use crate::identifiers;
use crate::image::{Image, ParameterActions};
use crate::lock::Lock;
use crate::packet::{BYTES, Packet};
use crate::parameter_files::{ParameterCopy, PortMessage};
use crate::signals::{self, CycleData};
use crate::slave::{Slave, SlaveCounters};
use axis_control::axis::AxisController;
use axis_control::node::CalibrationPort;
use axis_control::program::Program;
use crossbeam_channel::{Receiver, Sender, TrySendError};
use nominal::Axis;
use protocol::bus::FrameSink;
use protocol::can::CanFrame;
use protocol::frames::{Sensors, ValveCommand};
use std::collections::VecDeque;

/// Most commands that wait; more than the packets of the longest block.
pub(crate) const INBOX: usize = 64;
/// Most commands that are answered at a time.
pub(crate) const COMMANDS: usize = 8;

/// Counters of a port and its slave, as the controller's report holds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PortCounters {
    #[serde(flatten)]
    pub(crate) slave: SlaveCounters,
    /// Commands lost to a full queue.
    pub(crate) commands_dropped: u64,
    /// DAQ packets lost to a full queue, or that the bus did not accept.
    pub(crate) daq_dropped: u64,
    /// Responses that the bus did not accept.
    pub(crate) answers_dropped: u64,
    /// Parameter values that clients changed.
    pub(crate) changed: u64,
}

/// The queues between a port and the worker for files.
pub struct Queues {
    /// Requests and reports to the worker.
    pub messages: Sender<PortMessage>,
    /// Copies of the parameters that the worker returns.
    pub returned: Receiver<ParameterCopy>,
}

/// Applies a client's writes to the program of the axis, in the 1 ms path.
struct ProgramActions<'a> {
    axis: Axis,
    cycle: u64,
    program: &'a mut Program,
    messages: &'a Sender<PortMessage>,
    spare: &'a mut Option<Vec<f64>>,
    changed: &'a mut u64,
}

impl ParameterActions for ProgramActions<'_> {
    fn set(&mut self, place: usize, value: f64) {
        let Self { axis, cycle, .. } = *self;
        // Checked against its table by the image.
        if self.program.set(place, value).is_ok() {
            *self.changed += 1;
            // A full queue loses a message alone; the counter stays right.
            let _ = self.messages.try_send(PortMessage::Changed { axis, cycle, place, value });
        }
    }

    fn store(&mut self, values: &[f64]) -> bool {
        let Some(mut copy) = self.spare.take().filter(|copy| copy.capacity() >= values.len()) else {
            return false;
        };
        copy.clear();
        copy.extend_from_slice(values);
        match self.messages.try_send(PortMessage::Store { axis: self.axis, values: copy }) {
            Ok(()) => true,
            Err(
                TrySendError::Full(PortMessage::Store { values, .. })
                | TrySendError::Disconnected(PortMessage::Store { values, .. }),
            ) => {
                *self.spare = Some(values);
                false
            }
            Err(_) => false,
        }
    }

    fn load(&mut self) -> bool {
        self.messages.try_send(PortMessage::Load { axis: self.axis }).is_ok()
    }
}

/// An XCP slave with its two identifiers on the bus and its queues to the worker for files.
pub struct Port {
    /// The axis of its controller.
    pub axis: Axis,
    command_id: u16,
    response_id: u16,
    slave: Slave,
    queues: Queues,
    /// Buffer for a copy of the parameters; `None` while the worker has it.
    spare: Option<Vec<f64>>,
    inbox: VecDeque<CanFrame>,
    cycle: u64,
    /// DAQ packets that may still be sent in this cycle.
    daq_budget: u32,
    counters: PortCounters,
}

impl Port {
    /// A port for this controller. `title` is that of its program, `random` the start of the lock's seeds.
    ///
    /// # Errors
    /// [`A2lError`] when the A2L file cannot be made: a bug.
    pub fn new(
        controller: &AxisController,
        title: &str,
        config: &XcpConfig,
        random: [u8; 16],
        queues: Queues,
    ) -> Result<Self, A2lError> {
        let (axis, program) = (controller.axis, &controller.program);
        let variables = program.variables();
        let a2l::Description { bytes, texts } =
            a2l::description(&AxisDescription { axis, title, variables })?;
        let (command_id, response_id) = identifiers(axis);
        let image = Image::new(bytes, variables.to_vec(), program.values());
        let lock = Lock::new(config.key.clone(), random);
        let slave = Slave::new(image, texts, lock, config.daq_packets_per_cycle);
        Ok(Self {
            axis,
            command_id,
            response_id,
            slave,
            queues,
            spare: Some(Vec::with_capacity(variables.len())),
            inbox: VecDeque::with_capacity(INBOX),
            cycle: 0,
            daq_budget: 0,
            counters: PortCounters::default(),
        })
    }

    /// Counters since the start.
    pub fn counters(&self) -> PortCounters {
        let daq_dropped = self.counters.daq_dropped + self.slave.daq.dropped;
        PortCounters { slave: self.slave.counters, daq_dropped, ..self.counters }
    }

    /// Reports right and wrong keys since `before`.
    fn report_keys(&mut self, before: &SlaveCounters) {
        let (axis, cycle) = (self.axis, self.cycle);
        let after = &self.slave.counters;
        if after.unlocked > before.unlocked {
            let _ = self.queues.messages.try_send(PortMessage::Unlocked { axis, cycle });
        }
        if after.wrong_keys > before.wrong_keys {
            let _ = self.queues.messages.try_send(PortMessage::WrongKey { axis, cycle });
        }
    }

    fn answer(&mut self, packet: Option<Packet>, bus: &mut dyn FrameSink) {
        if let Some(packet) = packet
            && !self.send(packet, bus)
        {
            self.counters.answers_dropped += 1;
        }
    }

    fn send(&self, packet: [u8; BYTES], bus: &mut dyn FrameSink) -> bool {
        bus.send(&CanFrame::new(self.response_id, &packet)).is_ok()
    }
}

impl CalibrationPort for Port {
    fn take(&mut self, frame: &CanFrame) -> bool {
        if frame.standard_id() != Some(self.command_id) {
            return false;
        }
        if self.inbox.len() == INBOX {
            self.counters.commands_dropped += 1;
        } else {
            self.inbox.push_back(*frame);
        }
        true
    }

    fn restart(&mut self) {
        self.slave.image.trace.restart();
    }

    fn observe(
        &mut self,
        controller: &AxisController,
        cycle: u64,
        sensors: &Sensors,
        command: &ValveCommand,
    ) {
        let record = controller.record(cycle, sensors, command);
        let signals =
            signals::sample(&CycleData { input: controller.program.algorithm_input(), sensors, record });
        self.slave.cycle(cycle, &signals, controller.program.values());
        self.cycle = cycle;
        self.daq_budget = self.slave.daq.per_cycle;
    }

    fn serve(&mut self, program: &mut Program, bus: &mut dyn FrameSink) {
        while let Ok(ParameterCopy { values, stored }) = self.queues.returned.try_recv() {
            self.spare = Some(values);
            let event = self.slave.stored().filter(|_| stored);
            self.answer(event, bus);
        }
        for _ in 0..COMMANDS {
            let Some(frame) = self.inbox.pop_front() else { break };
            let before = self.slave.counters;
            let mut act = ProgramActions {
                axis: self.axis,
                cycle: self.cycle,
                program: &mut *program,
                messages: &self.queues.messages,
                spare: &mut self.spare,
                changed: &mut self.counters.changed,
            };
            let answer = self.slave.command(frame.data(), self.cycle, &mut act);
            self.report_keys(&before);
            self.answer(answer, bus);
        }
        while self.daq_budget > 0 {
            let Some(packet) = self.slave.next_daq() else { break };
            self.daq_budget -= 1;
            if !self.send(packet, bus) {
                self.counters.daq_dropped += 1;
            }
        }
    }
}
