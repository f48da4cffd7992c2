//! The state a run starts from, and what is refused as one.
//!
//! v = 0, spool 0, q = 0, p_b from the rig file, p_a in force balance, the carriage where the experiment says, the
//! load's eye in the middle of the gap when linked, parked at the end of the stroke (rod retracted) when not.
//!
//! Source: rig-model.md, Start.

use serde::{Deserialize, Serialize};

use crate::chamber::Chambers;
use crate::lanes::{Axes, Pair};
use crate::parameters::RigParameters;
use crate::state::{AxisState, State};

/// How the rig is set up before a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Carriage position x, m, 0 to the stroke.
    pub carriage_position_m: f64,
    /// Whether the load's eye sits in the carriage.
    pub linked: bool,
    /// Weights on the carriage, kg, 0 to the rig's limit.
    pub added_mass_kg: f64,
}

impl Default for Setup {
    fn default() -> Self {
        Setup { carriage_position_m: 0.1, linked: false, added_mass_kg: 0.0 }
    }
}

/// Why a setup, a weight or a state is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// The carriage does not lie within the stroke.
    #[error("carriage_position_m = {value}: allowed are 0 to {stroke_m} m")]
    CarriagePosition {
        /// The position asked for, m.
        value: f64,
        /// The stroke, m.
        stroke_m: f64,
    },
    /// The weights are negative, more than the rig takes, or no number.
    #[error("added_mass_kg = {value}: allowed are 0 to {limit_kg} kg")]
    AddedMass {
        /// The weights asked for, kg.
        value: f64,
        /// The rig's limit, kg.
        limit_kg: f64,
    },
    /// A number of a given state lies outside what the rig can be in.
    #[error("state: {name} = {value}: allowed are {min} to {max}")]
    State {
        /// Name of the field, with its axis.
        name: String,
        /// Refused value, in the unit of the field.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
}

/// Checks the weights on the carriage.
pub(crate) fn check_added_mass(rig: &RigParameters, value: f64) -> Result<f64, SetupError> {
    let limit_kg = rig.mass().added_limit_kg;
    if (0.0..=limit_kg).contains(&value) { Ok(value) } else { Err(SetupError::AddedMass { value, limit_kg }) }
}

pub(crate) fn start_state(rig: &RigParameters, setup: &Setup) -> Result<State, SetupError> {
    let stroke_m = rig.cylinder().stroke_m;
    let carriage_m = setup.carriage_position_m;
    if !(0.0..=stroke_m).contains(&carriage_m) {
        return Err(SetupError::CarriagePosition { value: carriage_m, stroke_m });
    }
    let added_mass_kg = check_added_mass(rig, setup.added_mass_kg)?;
    let eye_m = if setup.linked { carriage_m } else { stroke_m };

    let chambers = Chambers::of(rig);
    let extension = Pair::new(carriage_m, stroke_m - eye_m);
    let pressure_b = Pair::both(rig.start().rod_side_pressure_pa);
    let pressure_a = chambers.balancing_pressure_a(pressure_b);
    let air_a = (pressure_a * chambers.volume_a(extension)).to_array();
    let air_b = (pressure_b * chambers.volume_b(extension)).to_array();
    let axis = |i: usize| AxisState {
        extension_m: extension.to_array()[i],
        rod_velocity_m_per_s: 0.0,
        spool: 0.0,
        stored_air_a_j: air_a[i],
        stored_air_b_j: air_b[i],
        flow_a_m3_per_s: 0.0,
        flow_b_m3_per_s: 0.0,
    };
    Ok(State {
        axes: [axis(0), axis(1)],
        supply_pressure_pa: rig.supply().pressure_pa,
        emergency_stop: false,
        linked: setup.linked,
        added_mass_kg,
    })
}

/// Checks a state from outside: everything finite, pistons within the stroke, air in every chamber.
pub(crate) fn check_state(rig: &RigParameters, state: &State) -> Result<(), SetupError> {
    check_added_mass(rig, state.added_mass_kg)?;
    let check = |name: &str, value: f64, min: f64, max: f64| {
        let good = (min..=max).contains(&value);
        if good { Ok(()) } else { Err(SetupError::State { name: name.to_owned(), value, min, max }) }
    };
    // Wide enough for any rig of this kind, so that only nonsense is refused: 1 Pa, a thousand bar, a thousand m/s.
    let (least_pa, most_pa) = (1.0, 1e8);
    let volume = rig.cylinder().dead_volume_m3 + rig.cylinder().stroke_m * rig.cylinder().piston_area_m2;
    let (least_air, most_air) = (rig.cylinder().dead_volume_m3 * least_pa, volume * most_pa);
    for (axis, name) in state.axes.iter().zip(["drive", "load"]) {
        check(&format!("{name} extension_m"), axis.extension_m, 0.0, rig.cylinder().stroke_m)?;
        check(&format!("{name} rod_velocity_m_per_s"), axis.rod_velocity_m_per_s, -1e3, 1e3)?;
        check(&format!("{name} spool"), axis.spool, -1.0, 1.0)?;
        check(&format!("{name} stored_air_a_j"), axis.stored_air_a_j, least_air, most_air)?;
        check(&format!("{name} stored_air_b_j"), axis.stored_air_b_j, least_air, most_air)?;
        check(&format!("{name} flow_a_m3_per_s"), axis.flow_a_m3_per_s, -10.0, 10.0)?;
        check(&format!("{name} flow_b_m3_per_s"), axis.flow_b_m3_per_s, -10.0, 10.0)?;
    }
    let atmosphere = rig.supply().atmospheric_pressure_pa;
    // The node only approaches its targets; a rounding beyond them is still the rig's own state.
    let (least, most) = (atmosphere * (1.0 - 1e-12), rig.supply().pressure_pa * (1.0 + 1e-12));
    check("supply_pressure_pa", state.supply_pressure_pa, least, most)
}
