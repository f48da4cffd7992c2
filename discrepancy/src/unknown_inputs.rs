//! Unknown inputs of a plant: a force along the extension of an axis, and a flow into a chamber.

use plant::{Inputs, PERIOD_S, Plant, SetupError};

/// From m^3/s to Nl/min.
pub(crate) const NORMAL_LITRES_PER_MINUTE: f64 = 6e4;

/// The inputs with forces along the extensions, N. They act as hand forces, which the force sensors read.
pub(crate) fn pushed(inputs: Inputs, forces_n: [f64; 2]) -> Inputs {
    Inputs {
        hand_force_carriage_n: inputs.hand_force_carriage_n + forces_n[0],
        hand_force_load_n: inputs.hand_force_load_n - forces_n[1],
        ..inputs
    }
}

/// Adds what normal flows into a and b of each axis, m^3/s, bring in a period.
///
/// # Errors
/// [`SetupError`] when the rig cannot be in that state.
pub(crate) fn add_air(plant: &mut Plant, flows_m3_per_s: &[[f64; 2]; 2]) -> Result<(), SetupError> {
    let mut state = *plant.state();
    let air_j = plant.rig().gas().normal_pressure_pa * PERIOD_S;
    for (axis_state, flow) in state.axes.iter_mut().zip(flows_m3_per_s) {
        axis_state.stored_air_a_j += air_j * flow[0];
        axis_state.stored_air_b_j += air_j * flow[1];
    }
    plant.go_on_in(&state)
}
