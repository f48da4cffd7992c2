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
//! What is simulated is behind [`SimulatedRig`], so that another simulation can take the plant's place under the same frames and
//! the same order.

mod files;

pub use files::{PlantTables, RehearsalError, of_inputs, scene};

use axis_control::axis::{AxisController, AxisRecord};
use axis_control::node::{ControllerNode, News, Outlets, STOPPED_CYCLES};
use crossbeam_channel::{Receiver, Sender, bounded};
use plant::scene::{Action, HandForces, Holder, Outcome, RigCall};
use plant::tables::CycleRecord;
use plant::{AxisReadings, Inputs as PlantInputs, People, Plant, RigParameters, Scene, Sensors, SetupError};
use protocol::bus::control::Role;
use protocol::bus::{Bus, BusCounters, BusError, Received, SendError};
use protocol::can::CanFrame;
use protocol::frames::{
    ALIVE_RANGE, EmergencyStop, EncodeError, Frame, RIG_STATUS, RigStatus, Sensors as SensorFrame, Tick,
    ValveCommand,
};
use protocol::periods;
use std::time::Duration;

/// Rows and news of a cycle: two and some.
const OUTLET_ROOM: usize = 64;

/// A rig that is simulated, with what people do to it: what a rehearsal moves by one period at a time.
pub trait SimulatedRig {
    /// What a cycle leaves: what the rig shows, and what only a simulation knows.
    type Cycle;

    /// Begins a cycle: people act, then the sensors are sampled. `acting` are the valve openings of drive and load over the
    /// cycle, unless an emergency stop comes in it.
    fn sample(&mut self, cycle: u64, acting: [f64; 2], tell: &mut dyn FnMut(Outcome)) -> [AxisReadings; 2];

    /// What the rig has to say about its own emergency stop in `cycle`; what is given counts as said.
    fn rig_call(&mut self, cycle: u64) -> Option<RigCall>;

    /// Takes note of a stop or a release by a controller.
    fn emergency_stop(&mut self, holder: Holder, release: bool) -> Option<Outcome>;

    /// What the rig tells of itself now.
    fn standing(&self) -> Standing;

    /// Ends the cycle: moves by one period under these valve openings of drive and load.
    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> Self::Cycle;
}

/// What a rig tells of itself beside its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Absolute pressure of the supply node, Pa.
    pub supply_pressure_pa: f64,
    /// Whether the load's eye sits in the carriage.
    pub linked: bool,
    /// Whether the emergency stop is tripped.
    pub emergency_stop: bool,
    /// Whether the non-return valves at the chambers are shut.
    pub check_valves_shut: bool,
}

/// What a rehearsal is made of.
pub struct RehearsalParts<'a> {
    /// The rig that is simulated.
    pub rig: &'a RigParameters,
    /// How it is set up, and what people do to it.
    pub scene: &'a Scene,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// The controllers of both axes.
    pub controllers: Vec<AxisController>,
}

/// A simulated rig and its controllers, moved by one cycle at a time.
pub struct Rehearsal<R = PeopledPlant> {
    rig: R,
    node: ControllerNode,
    wire: Wire,
    records: Receiver<AxisRecord>,
    news: Receiver<News>,
    /// Position, force, pressures of each axis that saturated since the last status.
    saturated: [[bool; 4]; 2],
    cycle: u64,
    closing: bool,
    off_the_wire: Option<EncodeError>,
    listener: Option<Sender<CanFrame>>,
}

/// What a cycle left.
pub struct Rehearsed<C = CycleRecord> {
    /// What the rig shows and what only a simulation knows.
    pub cycle: C,
    /// What each axis did; `None` where it was not recorded.
    pub axes: [Option<AxisRecord>; 2],
}

/// The plant with its sensors, and the people around it.
pub struct PeopledPlant {
    plant: Plant,
    people: People,
    sensors: Sensors,
    inputs: PlantInputs,
    readings: [AxisReadings; 2],
}

/// Frames that the controllers sent in a cycle, by what the rig does with them.
#[derive(Default)]
struct Wire {
    counters: BusCounters,
    commands: [Option<ValveCommand>; 2],
    stops: [Option<EmergencyStop>; 2],
    /// Acting commands.
    latched: [Option<ValveCommand>; 2],
}

impl SimulatedRig for PeopledPlant {
    type Cycle = CycleRecord;

    fn sample(&mut self, cycle: u64, _acting: [f64; 2], tell: &mut dyn FnMut(Outcome)) -> [AxisReadings; 2] {
        let hands = self.people.begin_cycle(cycle, &mut self.plant, tell);
        // Added to none, for the signs of zero that the emulator has.
        (HandForces::default() + hands).put_into(&mut self.inputs);
        self.readings = self.sensors.sample(&self.plant, &self.inputs);
        self.readings
    }

    fn rig_call(&mut self, cycle: u64) -> Option<RigCall> {
        self.people.rig_call(cycle)
    }

    fn emergency_stop(&mut self, holder: Holder, release: bool) -> Option<Outcome> {
        self.people.emergency_stop(holder, release, &mut self.plant)
    }

    fn standing(&self) -> Standing {
        Standing {
            supply_pressure_pa: self.plant.supply_pressure_pa(),
            linked: self.plant.linked(),
            emergency_stop: self.plant.emergency_stop(),
            check_valves_shut: self.plant.check_valves_shut(),
        }
    }

    fn step(&mut self, cycle: u64, valve: [f64; 2]) -> CycleRecord {
        self.inputs.valve = valve;
        let truth = self.plant.truth(&self.inputs);
        let terms = self.plant.terms(&self.inputs);
        self.plant.step(&self.inputs);
        CycleRecord { cycle, valve, readings: self.readings, truth, terms }
    }
}

impl Rehearsal {
    /// A rehearsal of the plant before its first cycle.
    ///
    /// # Errors
    /// [`SetupError`] if the rig cannot be set up so.
    pub fn new(parts: RehearsalParts<'_>) -> Result<Self, SetupError> {
        let RehearsalParts { rig, scene, seed, controllers } = parts;
        let plant = Plant::new(rig, &scene.setup())?;
        let mut sensors = Sensors::new(rig, seed);
        let inputs = PlantInputs::default();
        // The emulator's node draws once before its first cycle; equal draws give equal noise.
        let readings = sensors.sample(&plant, &inputs);
        let people = People::new(scene);
        Ok(Self::with_rig(PeopledPlant { plant, people, sensors, inputs, readings }, controllers))
    }

    /// Does something to the rig that the scene does not hold, before the next cycle.
    pub fn act(&mut self, action: Action) {
        self.rig.people.act(action, &mut self.rig.plant, |_| {});
    }

    /// The plant.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.rig.plant
    }
}

impl<R: SimulatedRig> Rehearsal<R> {
    /// A rehearsal of any simulated rig under the controllers of both axes, before its first cycle.
    #[must_use]
    pub fn with_rig(rig: R, controllers: Vec<AxisController>) -> Self {
        let (record_sender, records) = bounded(OUTLET_ROOM);
        let (news_sender, news) = bounded(OUTLET_ROOM);
        let (_, changes) = bounded(1);
        let outlets = Outlets { records: record_sender, news: news_sender, changes, waits: false };
        Self {
            rig,
            node: ControllerNode::new(controllers, outlets),
            wire: Wire::default(),
            records,
            news,
            saturated: [[false; 4]; 2],
            cycle: 0,
            closing: false,
            off_the_wire: None,
            listener: None,
        }
    }

    /// Moves on by one cycle.
    pub fn step(&mut self, mut tell: impl FnMut(u64, Outcome)) -> Rehearsed<R::Cycle> {
        let cycle = self.cycle;
        self.cycle += 1;
        let stopped = self.rig.standing().emergency_stop;
        let acting = openings(&self.wire.acting(), stopped);
        let readings = self.rig.sample(cycle, acting, &mut |outcome| tell(cycle, outcome));
        // The rig's last cycle is the one in which it hears that all are done; nobody answers it.
        self.closing = self.node.done();
        self.publish(cycle, &readings);
        // What the controllers sent in the last cycle arrives before this one acts.
        let stops = std::mem::take(&mut self.wire.stops);
        for (stop, holder) in stops.into_iter().zip([Holder::Drive, Holder::Load]) {
            let outcome = stop.and_then(|stop| self.rig.emergency_stop(holder, stop.release));
            outcome.into_iter().for_each(|outcome| tell(cycle, outcome));
        }
        self.wire.latch();
        if !self.closing {
            self.node.answer(&mut self.wire);
        }
        let valve = openings(&self.wire.latched, self.rig.standing().emergency_stop);
        let cycle = self.rig.step(cycle, valve);
        let mut axes = [None, None];
        self.records.try_iter().for_each(|record| axes[record.axis.index()] = Some(record));
        Rehearsed { cycle, axes }
    }

    fn publish(&mut self, cycle: u64, readings: &[AxisReadings; 2]) {
        for (saturated, axis) in self.saturated.iter_mut().zip(readings) {
            let sensors = [&axis.position, &axis.force, &axis.pressure_a, &axis.pressure_b];
            saturated
                .iter_mut()
                .zip(sensors)
                .for_each(|(saturated, reading)| *saturated |= reading.saturated);
        }
        // Ahead of the sensors, as the rig does.
        if let Some(call) = self.rig.rig_call(cycle) {
            let stop = EmergencyStop::of_operator(call == RigCall::Release);
            self.hand_over(&Frame::RigEmergencyStop(stop));
        }
        let [drive, load] = readings;
        self.hand_over(&Frame::DriveSensors(sensor_frame(drive, cycle)));
        self.hand_over(&Frame::LoadSensors(sensor_frame(load, cycle)));
        if periods::tick_is_due(cycle) {
            let tick = Tick { cycle: cycle as u32, lockstep: true, ..Tick::default() };
            self.hand_over(&Frame::Tick(tick));
        }
        if periods::status_is_due(cycle) {
            let [drive, load] = std::mem::take(&mut self.saturated);
            let standing = self.rig.standing();
            let status = RigStatus {
                drive_position_saturated: drive[0],
                drive_force_saturated: drive[1],
                drive_pressure_a_saturated: drive[2],
                drive_pressure_b_saturated: drive[3],
                load_position_saturated: load[0],
                load_force_saturated: load[1],
                load_pressure_a_saturated: load[2],
                load_pressure_b_saturated: load[3],
                // As the emulator's sensor, which ends where the wire does.
                supply_pressure_pa: standing.supply_pressure_pa.min(RIG_STATUS.signals[0].max),
                linked: standing.linked,
                emergency_stop: standing.emergency_stop,
                check_valves_shut: standing.check_valves_shut,
                ..RigStatus::default()
            };
            self.hand_over(&Frame::RigStatus(status));
        }
    }

    fn hand_over(&mut self, frame: &Frame) {
        match frame.encode() {
            Ok(frame) => {
                self.listener.iter().for_each(|listener| _ = listener.try_send(frame));
                self.node.take(&frame);
            }
            Err(error) => {
                let _ = self.off_the_wire.get_or_insert(error);
            }
        }
    }

    /// Copies each frame of the rig into this queue; what does not fit is lost.
    pub fn listen(&mut self, listener: Sender<CanFrame>) {
        self.listener = Some(listener);
    }

    /// The rig.
    #[must_use]
    pub fn rig(&self) -> &R {
        &self.rig
    }

    /// The controllers.
    #[must_use]
    pub fn node(&self) -> &ControllerNode {
        &self.node
    }

    /// The controllers, whose programs may be changed between two cycles.
    pub fn node_mut(&mut self) -> &mut ControllerNode {
        &mut self.node
    }

    /// Cycles begun.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycle
    }

    /// News since they were taken last.
    pub fn take_news(&mut self) -> impl Iterator<Item = News> {
        self.news.try_iter()
    }

    /// Whether the controllers are done, or stopped for good, or the rig broke.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.closing || self.off_the_wire.is_some() || self.node.stopped_for() > STOPPED_CYCLES
    }

    /// The first value of the rig that rig.dbc does not allow: its numbers drive it out of all bounds.
    #[must_use]
    pub fn off_the_wire(&self) -> Option<EncodeError> {
        self.off_the_wire
    }
}

fn sensor_frame(readings: &AxisReadings, cycle: u64) -> SensorFrame {
    SensorFrame {
        position_m: readings.position.value,
        force_n: readings.force.value,
        pressure_a_pa: readings.pressure_a.value,
        pressure_b_pa: readings.pressure_b.value,
        alive: (cycle % ALIVE_RANGE) as u8,
    }
}

/// Valve openings as these commands act.
fn openings(commands: &[Option<ValveCommand>; 2], emergency_stop: bool) -> [f64; 2] {
    commands.map(|command| {
        let command = command.filter(|command| command.enable && !emergency_stop);
        plant::quantise_valve(command.map_or(0.0, |command| command.opening))
    })
}

impl Wire {
    /// The commands that act once they are latched.
    fn acting(&self) -> [Option<ValveCommand>; 2] {
        std::array::from_fn(|axis| self.commands[axis].or(self.latched[axis]))
    }

    /// The commands of the last cycle act now.
    fn latch(&mut self) {
        self.latched = self.acting();
        self.commands = [None, None];
    }
}

impl Bus for Wire {
    fn send(&mut self, frame: &CanFrame) -> Result<u64, SendError> {
        self.counters.sent += 1;
        match Frame::decode(frame) {
            Ok(Frame::DriveValveCommand(command)) => self.commands[0] = Some(command),
            Ok(Frame::LoadValveCommand(command)) => self.commands[1] = Some(command),
            Ok(Frame::DriveEmergencyStop(stop)) => self.stops[0] = Some(stop),
            Ok(Frame::LoadEmergencyStop(stop)) => self.stops[1] = Some(stop),
            _ => {}
        }
        Ok(0)
    }

    fn receive(&mut self) -> Received {
        Received::Nothing
    }

    fn wait_readable(&mut self, _timeout: Duration) {}

    fn is_up(&self) -> bool {
        true
    }

    fn counters(&self) -> &BusCounters {
        &self.counters
    }

    fn join_lockstep(&mut self, _role: Role, name: &str) -> Result<(), BusError> {
        Err(BusError::NoBarrier { url: name.to_owned() })
    }

    fn done(&mut self, _cycle: u32) {}
}
