//! Frames of the rig: sensors every cycle, tick and status every ten ([`protocol::periods`]).

use crate::rig::RigCondition;
use plant::AxisReadings;
use plant::scene::RigCall;
use protocol::commands::CommandIntake;
use protocol::frames::{ALIVE_RANGE, EmergencyStop, Frame, RIG_STATUS, RigStatus, Sensors, Tick};

pub(crate) fn sensors(readings: &AxisReadings, cycle: u64) -> Sensors {
    Sensors {
        position_m: readings.position.value,
        force_n: readings.force.value,
        pressure_a_pa: readings.pressure_a.value,
        pressure_b_pa: readings.pressure_b.value,
        alive: (cycle % ALIVE_RANGE) as u8,
    }
}

/// Reason for sending a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickCause {
    /// Its period is over.
    Period,
    /// Cycles were missed; the sensors of its cycle follow.
    Miss,
    /// No more sensors come.
    Farewell,
}

/// The tick of `cycle`, with `skipped` cycles in all so far.
pub(crate) fn tick(cause: TickCause, cycle: u64, skipped: u64, lockstep: bool) -> Frame {
    let (catch_up, ending) = (cause == TickCause::Miss, cause == TickCause::Farewell);
    // Both counters wrap as their fields in rig.dbc do.
    Frame::Tick(Tick { cycle: cycle as u32, skipped: skipped as u16, catch_up, lockstep, ending })
}

/// The rig's own emergency stop: somebody pressed its button, or released it.
pub(crate) fn emergency_stop(call: RigCall) -> Frame {
    Frame::RigEmergencyStop(EmergencyStop::of_operator(call == RigCall::Release))
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SaturatedSensors {
    position: bool,
    force: bool,
    pressure_a: bool,
    pressure_b: bool,
}

impl SaturatedSensors {
    pub(crate) fn note(&mut self, readings: &AxisReadings) {
        self.position |= readings.position.saturated;
        self.force |= readings.force.saturated;
        self.pressure_a |= readings.pressure_a.saturated;
        self.pressure_b |= readings.pressure_b.saturated;
    }
}

/// The rig's status, with the sensors that saturated since the last one.
pub(crate) fn status(
    condition: &RigCondition,
    [drive, load]: &[SaturatedSensors; 2],
    commands: &[CommandIntake; 2],
) -> Frame {
    Frame::RigStatus(RigStatus {
        // A node that chambers feed back into may rise above the set pressure, and its sensor ends where the wire does.
        supply_pressure_pa: condition.supply_pressure_pa.min(RIG_STATUS.signals[0].max),
        linked: condition.linked,
        emergency_stop: condition.emergency_stop,
        check_valves_shut: condition.check_valves_shut,
        drive_position_saturated: drive.position,
        drive_force_saturated: drive.force,
        drive_pressure_a_saturated: drive.pressure_a,
        drive_pressure_b_saturated: drive.pressure_b,
        load_position_saturated: load.position,
        load_force_saturated: load.force,
        load_pressure_a_saturated: load.pressure_a,
        load_pressure_b_saturated: load.pressure_b,
        drive_stale: commands[0].stale(),
        load_stale: commands[1].stale(),
        drive_two_sources: commands[0].disputed(),
        load_two_sources: commands[1].disputed(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PeopledPlant, SimulatedRig};
    use plant::{People, Plant, RigParameters, Scene, Setup};
    use protocol::frames::{SignalSpec, WEIGHTS};

    fn signal(message: &protocol::frames::MessageSpec, name: &str) -> &'static SignalSpec {
        message.signals.iter().find(|signal| signal.name == name).expect("the signal is in rig.dbc")
    }

    #[test]
    fn the_plant_takes_every_weight_that_the_wire_can_carry() {
        let rig = RigParameters::baseline();
        let mut plant = Plant::new(&rig, &Setup::default()).unwrap();
        let weights = signal(WEIGHTS, "added_mass");
        for added_mass_kg in [weights.min, weights.max] {
            assert!(plant.set_added_mass_kg(added_mass_kg).is_ok(), "{added_mass_kg} kg");
        }
    }

    #[test]
    fn a_supply_beyond_its_sensors_range_is_sent_as_the_limit() {
        assert_eq!(RIG_STATUS.signals[0].name, "supply_pressure");
        let rig = RigParameters::baseline().with("supply.pressure_bar", &[11.0]).unwrap();
        let plant = Plant::new(&rig, &Setup::default()).unwrap();
        let rig = PeopledPlant::new(plant, plant::Sensors::new(&rig, 1), People::new(&Scene::default()));
        let frame = status(&rig.condition(), &Default::default(), &Default::default());
        let Frame::RigStatus(sent) = frame else { panic!("a status") };
        assert_eq!(sent.supply_pressure_pa, RIG_STATUS.signals[0].max);
        assert_eq!(Frame::RigStatus(sent).encode().unwrap().data().len(), 4);
    }

    #[test]
    fn the_rig_repeats_its_emergency_stop_as_often_as_the_wire_says() {
        assert_eq!(plant::scene::REPEAT_CYCLES, protocol::periods::EMERGENCY_STOP_CYCLES);
    }

    #[test]
    fn saturated_sensors_are_sent_as_their_limit() {
        // The parked load sits 0.8 mm beyond its sensor's range (rig-model.md, Sensors).
        let rig = RigParameters::baseline();
        let plant = Plant::new(&rig, &Setup::default()).unwrap();
        let readings = plant::Sensors::new(&rig, 1).sample(&plant, &plant::Inputs::default());
        assert!(readings[1].position.saturated);
        let frame = Frame::LoadSensors(sensors(&readings[1], 7)).encode().unwrap();
        assert_eq!(frame.data()[..2], [0xFF, 0xFF]);
    }
}
