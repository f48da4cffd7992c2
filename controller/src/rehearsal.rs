//! Rehearsal: the plant model inside the controller process, without a bus and faster than real time, under the same program.
//!
//! ```text
//!   cycle k:  people act ─► sensors sampled ─► frames ─► station answers ─► commands, kept for k + 1
//!                                                        commands of k - 1 latched ─► row recorded ─► plant steps
//! ```
//!
//! The frames are the bus's own, coded and decoded, and the order is that of the lockstep barrier: what is rehearsed gives
//! the same measurement, to the byte, as emulator and controllers in lockstep. This is the only place where the controller
//! looks into the plant (tuning, which does too, belongs to the tests); the rehearsed controllers see the frames alone.

use crate::axis::{AxisController, AxisRecord};
use crate::pace::STOPPED_CYCLES;
use crate::station::{News, Outlets, Station};
use crossbeam_channel::{Receiver, bounded};
use plant::scene::{Action, HandForces, Holder, Outcome, RigCall};
use plant::tables::CycleRecord;
use plant::{
    Axis, AxisReadings, Inputs as PlantInputs, People, Plant, RigParameters, Scene, Sensors, SetupError,
};
use protocol::bus::control::Role;
use protocol::bus::{Bus, BusCounters, BusError, Received, SendError};
use protocol::can::CanFrame;
use protocol::frames::{
    ALIVE_RANGE, EmergencyStop, EmergencyStopReason, Frame, RIG_STATUS, RigStatus, Sensors as SensorFrame,
    Tick, ValveCommand,
};
use protocol::periods;
use std::time::Duration;

/// Rows and news of a cycle: two and some.
const OUTLET_ROOM: usize = 64;

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

/// A plant and its controllers, moved by one cycle at a time.
pub struct Rehearsal {
    plant: Plant,
    people: People,
    sensors: Sensors,
    inputs: PlantInputs,
    station: Station,
    wire: Wire,
    records: Receiver<AxisRecord>,
    news: Receiver<News>,
    /// Position, force, pressures of each axis that saturated since the last status.
    saturated: [[bool; 4]; 2],
    cycle: u64,
    closing: bool,
}

/// What a cycle left.
pub struct Rehearsed {
    /// What the rig shows and what only a simulation knows.
    pub cycle: CycleRecord,
    /// What each axis did; `None` where it was not recorded.
    pub axes: [Option<AxisRecord>; 2],
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

impl Rehearsal {
    /// A rehearsal before its first cycle.
    ///
    /// # Errors
    /// [`SetupError`] if the rig cannot be set up so.
    pub fn new(parts: RehearsalParts<'_>) -> Result<Self, SetupError> {
        let RehearsalParts { rig, scene, seed, controllers } = parts;
        let plant = Plant::new(rig, &scene.setup())?;
        let (record_sender, records) = bounded(OUTLET_ROOM);
        let (news_sender, news) = bounded(OUTLET_ROOM);
        let (_, changes) = bounded(1);
        let outlets = Outlets { records: record_sender, news: news_sender, changes, waits: false };
        let mut sensors = Sensors::new(rig, seed);
        let inputs = PlantInputs::default();
        // The emulator's station draws once before its first cycle; equal draws give equal noise.
        let _ = sensors.sample(&plant, &inputs);
        Ok(Self {
            people: People::new(scene),
            plant,
            sensors,
            inputs,
            station: Station::new(controllers, outlets),
            wire: Wire::default(),
            records,
            news,
            saturated: [[false; 4]; 2],
            cycle: 0,
            closing: false,
        })
    }

    /// Moves on by one cycle.
    pub fn step(&mut self, mut tell: impl FnMut(u64, Outcome)) -> Rehearsed {
        let cycle = self.cycle;
        self.cycle += 1;
        let hands = self.people.begin_cycle(cycle, &mut self.plant, |outcome| tell(cycle, outcome));
        // Added to none, for the signs of zero that the emulator has.
        (HandForces::default() + hands).put_into(&mut self.inputs);
        let readings = self.sensors.sample(&self.plant, &self.inputs);
        // The rig's last cycle is the one in which it hears that all are done; nobody answers it.
        self.closing = self.station.done();
        self.publish(cycle, &readings);
        // What the controllers sent in the last cycle arrives before this one acts.
        let stops = std::mem::take(&mut self.wire.stops);
        for (stop, holder) in stops.into_iter().zip([Holder::Drive, Holder::Load]) {
            let outcome =
                stop.and_then(|stop| self.people.emergency_stop(holder, stop.release, &mut self.plant));
            outcome.into_iter().for_each(|outcome| tell(cycle, outcome));
        }
        self.wire.latch();
        if !self.closing {
            self.station.answer(&mut self.wire);
        }
        for axis in Axis::ALL {
            let command = self.wire.latched[axis.index()].filter(|command| command.enable);
            let opening =
                command.filter(|_| !self.plant.emergency_stop()).map_or(0.0, |command| command.opening);
            self.inputs.valve[axis.index()] = plant::quantise_valve(opening);
        }
        let truth = self.plant.truth(&self.inputs);
        let terms = self.plant.terms(&self.inputs);
        let record = CycleRecord { cycle, valve: self.inputs.valve, readings, truth, terms };
        self.plant.step(&self.inputs);
        let mut axes = [None, None];
        self.records.try_iter().for_each(|record| axes[record.axis.index()] = Some(record));
        Rehearsed { cycle: record, axes }
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
        if let Some(call) = self.people.rig_call(cycle) {
            let release = call == RigCall::Release;
            let reason = if release { EmergencyStopReason::None } else { EmergencyStopReason::Operator };
            self.hand_over(&Frame::RigEmergencyStop(EmergencyStop { reason, release }));
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
                supply_pressure_pa: self.plant.supply_pressure_pa().min(RIG_STATUS.signals[0].max),
                linked: self.plant.linked(),
                emergency_stop: self.plant.emergency_stop(),
                check_valves_shut: self.plant.check_valves_shut(),
                ..RigStatus::default()
            };
            self.hand_over(&Frame::RigStatus(status));
        }
    }

    fn hand_over(&mut self, frame: &Frame) {
        let frame = frame.encode().unwrap_or_else(|error| {
            panic!("the rehearsed rig made a frame that rig.dbc does not allow: {error}")
        });
        self.station.take(&frame);
    }

    /// Does something to the rig that the scene does not hold, before the next cycle.
    pub fn act(&mut self, action: Action) {
        self.people.act(action, &mut self.plant, |_| {});
    }

    /// The controllers.
    #[must_use]
    pub fn station(&self) -> &Station {
        &self.station
    }

    /// The controllers, whose programs may be changed between two cycles.
    pub fn station_mut(&mut self) -> &mut Station {
        &mut self.station
    }

    /// The plant.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
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

    /// Whether the controllers are done, or stopped for good.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.closing || self.station.stopped_for() > STOPPED_CYCLES
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

impl Wire {
    /// The commands of the last cycle act now.
    fn latch(&mut self) {
        for (latched, command) in self.latched.iter_mut().zip(&mut self.commands) {
            *latched = command.take().or(*latched);
        }
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
