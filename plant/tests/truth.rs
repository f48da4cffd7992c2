//! The list of terms: every column has a name with a unit, and the named forces add up to the motion.

use plant::{Axis, Inputs, Plant, RigParameters, Setup, Truth};
use settings::unit_of;

fn moving() -> (Plant, Inputs) {
    let setup = Setup { carriage_position_m: 0.25, linked: true, added_mass_kg: 3.0 };
    let mut plant = Plant::new(&RigParameters::baseline(), &setup).expect("good");
    let inputs = Inputs { valve: [0.5, 0.2], hand_force_carriage_n: 12.0, hand_force_load_n: -7.0 };
    (0..80).for_each(|_| plant.step(&inputs));
    (plant, inputs)
}

fn value(truth: &Truth, column: &str) -> f64 {
    let at = Truth::COLUMNS.iter().position(|name| *name == column);
    truth.values()[at.unwrap_or_else(|| panic!("no column {column}"))]
}

#[test]
fn every_column_is_named_once_with_its_unit() {
    for (i, name) in Truth::COLUMNS.iter().enumerate() {
        let ends_with_unit = match unit_of(name) {
            // Letters as in SI; a quotient is spelt out.
            Some(unit) => unit.contains('/') || name.ends_with(&format!("_{unit}")),
            None => name.ends_with("_spool") || name.ends_with("_shut"),
        };
        assert!(ends_with_unit, "{name} has no unit");
        assert!(!Truth::COLUMNS[..i].contains(name), "{name} stands twice");
    }
}

#[test]
fn the_values_stand_under_their_names() {
    let (plant, inputs) = moving();
    let truth = plant.truth(&inputs);
    for axis in Axis::ALL {
        let (state, name) = (plant.state().axis(axis), axis.name());
        let x = if axis == Axis::Drive { state.extension_m } else { 0.5 - state.extension_m };
        assert_eq!(value(&truth, &format!("{name}_position_m")), x);
        assert_eq!(value(&truth, &format!("{name}_rod_velocity_m_per_s")), state.rod_velocity_m_per_s);
        assert_eq!(value(&truth, &format!("{name}_spool")), state.spool);
        assert_eq!(value(&truth, &format!("{name}_stored_air_b_J")), state.stored_air_b_j);
        assert_eq!(value(&truth, &format!("{name}_flow_a_m3_per_s")), state.flow_a_m3_per_s);
        let axis_truth = truth.axes[axis.index()];
        assert_eq!(value(&truth, &format!("{name}_pressure_b_Pa")), axis_truth.pressure_b_pa);
        assert_eq!(value(&truth, &format!("{name}_edge_flow_b_m3_per_s")), axis_truth.edge_flow_b_m3_per_s);
        assert_eq!(value(&truth, &format!("{name}_sensor_force_N")), axis_truth.sensor_force_n);
    }
    assert_eq!(value(&truth, "supply_pressure_Pa"), 7e5);
    assert_eq!(value(&truth, "check_valves_shut"), 0.0);
    assert_eq!(value(&truth, "linkage_contact_force_N"), truth.contact_force_n);
}

#[test]
fn the_named_forces_add_up_to_mass_times_acceleration() {
    let (plant, inputs) = moving();
    let truth = plant.truth(&inputs);
    for (axis, mass_kg) in truth.axes.iter().zip([8.0, 1.5]) {
        let sum = axis.pneumatic_force_n
            + axis.hand_force_n
            + axis.contact_force_n
            + axis.viscous_friction_n
            + axis.sliding_friction_n
            + axis.holding_force_n;
        // Sums of some hundred newton, few roundings.
        assert!((sum - mass_kg * axis.rod_acceleration_m_per_s2).abs() < 1e-9, "{axis:?}");
    }
    assert_eq!(
        (truth.axes[0].hand_force_n, truth.axes[1].hand_force_n),
        (12.0, 7.0),
        "in each axis' own extension"
    );
    let [drive, load] = truth.axes;
    // rig-model.md, Masses and linkage, with the carriage of 3.5 kg and 3 kg of weights.
    let passed_on = 6.5 * drive.rod_acceleration_m_per_s2 - truth.contact_force_n - 12.0;
    assert_eq!(drive.sensor_force_n, passed_on);
    assert_eq!(load.sensor_force_n, -truth.contact_force_n - 7.0);
}

#[test]
fn the_truth_predicts_the_next_millisecond() {
    // Forward difference of the state against the derivatives that the truth names: first order in 1 ms.
    let (plant, inputs) = moving();
    let mut next = plant.clone();
    next.step(&inputs);
    let (now, then) = (plant.truth(&inputs), next.truth(&inputs));
    for (before, after) in now.axes.iter().zip(&then.axes) {
        let mean = (before.rod_acceleration_m_per_s2 + after.rod_acceleration_m_per_s2) / 2.0;
        let change = (after.rod_velocity_m_per_s - before.rod_velocity_m_per_s) / 1e-3;
        // Trapezoidal rule against the contact's 210 Hz: (2 pi 210 Hz 1 ms)^2 / 12 = 15 % of what the contact moves.
        assert!((change - mean).abs() <= 0.15 * (mean.abs() + 1.0), "{change} {mean}");
        let stored = (after.stored_air_a_j - before.stored_air_a_j) / 1e-3 / 101_325.0;
        let flow = (before.flow_a_m3_per_s + after.flow_a_m3_per_s) / 2.0;
        // Trapezoidal rule against the lag of 8 ms: (1 / 8)^2 / 12 of the change of the flow.
        assert!((stored - flow).abs() <= 2e-3 * 1e-2, "{stored} {flow}");
    }
}

#[test]
fn looking_changes_nothing() {
    let (plant, inputs) = moving();
    let before = *plant.state();
    assert_eq!(plant.truth(&inputs), plant.truth(&inputs));
    assert_eq!(*plant.state(), before);
}
