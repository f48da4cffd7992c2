//! Effect of active faults on plant, sensors and hands: each adds to one overlay, which is then applied as a whole.
//!
//! Faults of a kind at one place add up where sums make sense (offsets, leaks, masses), multiply where they are factors, and
//! otherwise the strongest counts; so their order does not matter, except for spikes. Drifts of one sensor share one error: it
//! grows by the sum of their rates and is reset when that sum is 0, not in part when one of them ends.

use super::Fault;
use super::table::{BusKind, Channel, Kind, NODES, put_sensor};
use plant::faults::{Faults, SensorFault, SupplyFault};
use plant::scene::HandForces;
use plant::{RigParameters, parameters};
use protocol::bus::{Frames, WireFault};

/// m³/s per normal litre per minute.
const M3_PER_S_PER_NL_PER_MIN: f64 = 1e-3 / 60.0;

/// Joint effect of all active faults.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Overlay {
    /// Faults of the plant, for `Plant::set_faults`.
    pub plant: Faults,
    /// Faults of the sensors of drive and load: position, force, pressure a, pressure b.
    pub(crate) sensors: [[SensorFault; 4]; 2],
    pub(crate) hands: HandForces,
}

impl Overlay {
    /// Adds the effect of a fault; faults of frames and nodes act on the wire instead.
    pub fn put(&mut self, fault: &Fault, rig: &RigParameters) {
        let (place, values) = (fault.place_index(), fault.values);
        let first = values[0];
        // Places of chambers are those of the drive, then those of the load.
        let (axis, chamber) = (place / 2, place % 2);
        match fault.spec.kind {
            Kind::Sensor(Channel::Pressure, kind) => {
                put_sensor(kind, values, &mut self.sensors[axis][2 + chamber]);
            }
            Kind::Sensor(Channel::Position, kind) => put_sensor(kind, values, &mut self.sensors[place][0]),
            Kind::Sensor(Channel::Force, kind) => put_sensor(kind, values, &mut self.sensors[place][1]),
            Kind::ValveStuck => self.plant.axes[place].valve.stuck = true,
            Kind::ValveDead => self.plant.axes[place].valve.dead = true,
            Kind::ValveSlow => self.plant.axes[place].valve.lag_s += first,
            Kind::ValveOffset => self.plant.axes[place].valve.offset += first,
            Kind::ValveLimited => {
                let limit = &mut self.plant.axes[place].valve.limit;
                *limit = limit.min(first);
            }
            Kind::SupplySag => self.put_supply(rig.supply(), rig.supply().pressure_pa - first, values[1]),
            Kind::SupplyLoss => self.put_supply(rig.supply(), 0.0, first),
            Kind::Leak => {
                self.plant.axes[axis].leakage_m3_per_s[chamber] += first * M3_PER_S_PER_NL_PER_MIN;
            }
            Kind::Burst => self.plant.axes[axis].burst_kv_m3_per_h[chamber] += first,
            Kind::FrictionRise => self.plant.axes[place].friction_factor *= first,
            Kind::AddedMass => self.plant.axes[place].added_mass_kg += first,
            Kind::EndStopHit if place == 0 => self.hands.carriage_n += first,
            // The load extends in -x.
            Kind::EndStopHit => self.hands.load_eye_n -= first,
            Kind::Unlink | Kind::Bus(_) => {}
        }
    }

    /// The lowest target counts, with its time constant.
    fn put_supply(&mut self, set: &parameters::SupplyParameters, pressure_pa: f64, time_constant_s: f64) {
        let pressure_pa = pressure_pa.max(set.atmospheric_pressure_pa);
        if self.plant.supply.is_none_or(|fault| pressure_pa < fault.pressure_pa) {
            self.plant.supply = Some(SupplyFault { pressure_pa, time_constant_s });
        }
    }
}

/// The fault in the form of the wire, and the frames that it concerns; `None` for a fault of plant or sensors.
pub fn on_wire(fault: &Fault) -> Option<(WireFault, Frames)> {
    let Kind::Bus(kind) = fault.spec.kind else { return None };
    let place = fault.place_index();
    let [first, second, third] = fault.values;
    let (probability, whole) = (first, second as u32);
    let wire = match kind {
        BusKind::Loss => WireFault::Loss { probability },
        BusKind::Delay => WireFault::Delay { delay_ms: first as u32 },
        BusKind::Duplication => WireFault::Duplication { probability, copies: whole },
        BusKind::Reordering => WireFault::Reordering { probability },
        BusKind::Corruption => WireFault::Corruption { probability, bits: whole },
        BusKind::WrongLength => WireFault::WrongLength { probability, bytes: whole as u8 },
        BusKind::WrongCounter => WireFault::WrongCounter { probability, step: whole as u8 },
        BusKind::Babbling => {
            WireFault::Babbling { id: first as u16, frames_per_ms: second, bytes: third as u8 }
        }
        BusKind::BusOff => WireFault::BusOff { node: NODES[place].1 },
    };
    let frames = fault.spec.places.frame_id(place).map_or(Frames::All, Frames::Id);
    Some((wire, frames))
}
