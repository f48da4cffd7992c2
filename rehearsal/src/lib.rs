//! Rehearsal: the plant model inside the controller process, without a bus and faster than real time, under the same program.
//!
//! ```text
//!   cycle k:  people act ─► sensors sampled ─► frames ─► node answers   ─► commands, kept for k + 1
//!                                                        commands of k - 1 latched ─► row recorded ─► plant steps
//! ```
//!
//! The frames are the bus's own, coded and decoded, and the order is that of the lockstep barrier: what is rehearsed gives
//! the same measurement, to the byte, as emulator and controllers in lockstep. This crate looks into the plant; the rehearsed
//! controllers see the frames alone.
//!
//! The rig is the emulator's node ([`rig_node`]), over the plant or over another simulation ([`SimulatedRig`]).

#![warn(missing_docs)] // an interface of other crates

mod files;

pub use files::{RehearsalError, cycle_tables, of_inputs, scene};

use axis_control::axis::{AxisController, AxisRecord};
use axis_control::node::{ControllerNode, NodeEvent, NodeQueues, STOPPED_CYCLES};
use crossbeam_channel::{Receiver, Sender, bounded};
use plant::scene::Action;
use plant::{Axis, CycleRecord, People, Plant, RigParameters, Scene, Sensors, SetupError};
use protocol::bus::{FrameSink, SendError};
use protocol::can::CanFrame;
use protocol::frames::{EncodeError, Frame, ValveCommand};
use rig_node::{PeopledPlant, RigNode, SimulatedRig};

/// Length of the queues: a cycle leaves two rows and few events.
const QUEUE_LENGTH: usize = 64;

/// Parts of a rehearsal.
pub struct RehearsalParts<'a> {
    /// The rig's numbers.
    pub rig: &'a RigParameters,
    /// How it is set up, and what people do to it.
    pub scene: &'a Scene,
    /// Of the sensors' noise.
    pub seed: u64,
    /// Those of the axes that are controlled.
    pub controllers: Vec<AxisController>,
}

/// A simulated rig and its controllers, moved by one cycle at a time.
pub struct Rehearsal<R = PeopledPlant> {
    rig: RigNode<R>,
    node: ControllerNode,
    wire: Wire,
    records: Receiver<AxisRecord>,
    news: Receiver<NodeEvent>,
    cycle: u64,
    closing: bool,
    encode_error: Option<EncodeError>,
    listener: Option<Sender<CanFrame>>,
}

/// Records of a cycle.
pub struct RehearsalRow<C = CycleRecord> {
    /// Readings and truth of the rig.
    pub cycle: C,
    /// Record of each axis; `None` where it was not recorded.
    pub axes: [Option<AxisRecord>; 2],
}

/// Frames that the controllers sent in a cycle and that a rig obeys, by identifier.
#[derive(Default)]
struct Wire {
    /// Stops of drive and load, then their commands.
    sent: [Option<Frame>; 4],
}

/// Place of the first valve command among these frames.
const COMMANDS: usize = 2;

impl Rehearsal {
    /// A rehearsal of the plant before its first cycle.
    pub fn new(parts: RehearsalParts<'_>) -> Result<Self, SetupError> {
        let RehearsalParts { rig, scene, seed, controllers } = parts;
        let plant = Plant::new(rig, &scene.setup())?;
        let peopled = PeopledPlant::new(plant, Sensors::new(rig, seed), People::new(scene));
        Ok(Self::with_rig(peopled, controllers))
    }

    /// Does something to the rig that the scene does not hold, before the next cycle.
    pub fn act(&mut self, action: Action) {
        self.rig.rig_mut().act(action, |_| {});
    }

    /// The plant as it is between two cycles.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        self.rig.rig().plant()
    }
}

impl<R: SimulatedRig> Rehearsal<R> {
    /// A rehearsal of any simulated rig under the controllers of both axes, before its first cycle.
    #[must_use]
    pub fn with_rig(rig: R, controllers: Vec<AxisController>) -> Self {
        let (record_sender, records) = bounded(QUEUE_LENGTH);
        let (news_sender, news) = bounded(QUEUE_LENGTH);
        let (_, changes) = bounded(1);
        let node_queues = NodeQueues { records: record_sender, news: news_sender, changes, waits: false };
        Self {
            rig: RigNode::new(rig, true),
            node: ControllerNode::new(controllers, node_queues),
            wire: Wire::default(),
            records,
            news,
            cycle: 0,
            closing: false,
            encode_error: None,
            listener: None,
        }
    }

    /// Runs one cycle of 1 ms; `on_event` gets the events of the rig with their cycle.
    pub fn step(&mut self, mut on_event: impl FnMut(u64, R::Event)) -> RehearsalRow<R::Cycle> {
        let cycle = self.cycle;
        self.cycle += 1;
        let acting = self.rig.openings(self.wire.commands());
        self.rig.rig_mut().expect_valves(acting);
        let readings = self.rig.begin(cycle, &mut |event| on_event(cycle, event));
        // The rig's last cycle is the one in which it hears that all are done; nobody answers it.
        self.closing = self.node.done();
        let Self { rig, node, listener, encode_error, .. } = self;
        rig.publish(cycle, false, &readings, |frame| match frame.encode() {
            Ok(frame) => {
                listener.iter().for_each(|listener| _ = listener.try_send(frame));
                node.take(&frame);
            }
            Err(error) => _ = encode_error.get_or_insert(error),
        });
        // What the controllers sent in the last cycle arrives before this one acts.
        for frame in std::mem::take(&mut self.wire.sent).into_iter().flatten() {
            self.rig.take(frame, &mut |event| on_event(cycle, event));
        }
        for axis in Axis::ALL {
            self.rig.latch(axis);
        }
        if !self.closing {
            self.node.answer(&mut self.wire);
        }
        let cycle = self.rig.step(cycle);
        let mut axes = [None, None];
        self.records.try_iter().for_each(|record| axes[record.axis.index()] = Some(record));
        RehearsalRow { cycle, axes }
    }

    /// Copies each frame of the rig into this queue; what does not fit is lost.
    pub fn listen(&mut self, listener: Sender<CanFrame>) {
        self.listener = Some(listener);
    }

    /// The simulated rig.
    #[must_use]
    pub fn rig(&self) -> &R {
        self.rig.rig()
    }

    /// The node of the controllers.
    #[must_use]
    pub fn node(&self) -> &ControllerNode {
        &self.node
    }

    /// Cycles so far.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycle
    }

    /// Events of the node since they were taken last.
    pub fn take_news(&mut self) -> impl Iterator<Item = NodeEvent> {
        self.news.try_iter()
    }

    /// Whether the controllers are done, or stopped for good, or the rig broke.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.closing || self.encode_error.is_some() || self.node.stopped_for() > STOPPED_CYCLES
    }

    /// The first value of the rig that rig.dbc does not allow: its numbers drive it out of all bounds.
    #[must_use]
    pub fn encode_error(&self) -> Option<EncodeError> {
        self.encode_error
    }
}

impl Wire {
    /// The valve commands of drive and load that were sent last.
    fn commands(&self) -> [Option<ValveCommand>; 2] {
        [0, 1].map(|axis| match self.sent[COMMANDS + axis] {
            Some(Frame::DriveValveCommand(command) | Frame::LoadValveCommand(command)) => Some(command),
            _ => None,
        })
    }
}

impl FrameSink for Wire {
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError> {
        let Ok(frame) = Frame::decode(frame) else { return Ok(0) };
        let place = match frame {
            Frame::DriveEmergencyStop(_) => 0,
            Frame::LoadEmergencyStop(_) => 1,
            Frame::DriveValveCommand(_) => COMMANDS,
            Frame::LoadValveCommand(_) => COMMANDS + 1,
            _ => return Ok(0),
        };
        self.sent[place] = Some(frame);
        Ok(0)
    }
}
