//! The variables of the FMU: inputs, parameters and outputs, each a row of one of the plant's tables.
//!
//! | variables | rows of |
//! |---|---|
//! | valve commands, hands, emergency stop, linkage | this file |
//! | set-up of the run | [`plant::Setup`] |
//! | `supply.pressure_bar` … | [`plant::parameters::table::KEYS`], in the rig file's units |
//! | `drive_position_m` … | [`plant::Truth::COLUMNS`] |
//! | terms of switched-on effects | [`plant::Plant::term_names`] |
//! | `drive_position_measured_m` … | the sensors |
//!
//! A value reference is the index in the list, from 0, for all types.

use plant::parameters::table::KEYS;
use plant::{Axis, Plant, RigParameters, Setup, SetupError, Truth};
use settings::unit_of;

/// Meaning of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Valve(usize),
    /// Force of a hand on the carriage (0) or on the load's eye (1).
    Hand(usize),
    EmergencyStop,
    /// Whether linkage is requested.
    Link,
    /// Position of the carriage at the start.
    CarriagePosition,
    AddedMass,
    /// Seed of the sensors' noise.
    Seed,
    /// A parameter of the rig: key, and index in its values.
    Rig(usize, usize),
    /// A column of [`Truth`].
    Truth(usize),
    Term(usize),
    /// Sensor value: axis and channel (position, force, pressure a, pressure b).
    Measured(usize, usize),
    /// The valve command in effect in this cycle.
    Acting(usize),
    Linked,
}

/// Type of a variable, with its start value if it has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Real(Option<f64>),
    Integer(Option<i32>),
    Boolean(Option<bool>),
}

/// Use of a variable by the importer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Causality {
    /// Set before the start only.
    Parameter,
    /// Set between steps.
    Input,
    /// Read.
    Output,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Variable {
    /// Unique name.
    pub name: String,
    pub role: Role,
    pub kind: Kind,
    pub causality: Causality,
    /// Whether it changes only at instants.
    pub discrete: bool,
    /// Unit, empty for none.
    pub unit: &'static str,
    /// Range of the values, in the unit of the variable.
    pub range: Option<(f64, f64)>,
    pub about: String,
}

/// All variables of a rig.
///
/// # Errors
/// [`SetupError`]: the rig does not allow the default set-up.
pub(crate) fn of(rig: &RigParameters) -> Result<Vec<Variable>, SetupError> {
    let plant = Plant::new(rig, &start_setup(rig))?;
    Ok([inputs(), setup(rig), numbers(rig), truths(), terms(&plant), measured()].concat())
}

/// The default set-up of the plant, adapted to a shorter rig.
pub(crate) fn start_setup(rig: &RigParameters) -> Setup {
    let setup = Setup::default();
    Setup { carriage_position_m: setup.carriage_position_m.min(rig.cylinder().stroke_m), ..setup }
}

fn variable(name: impl Into<String>, role: Role, kind: Kind, about: impl Into<String>) -> Variable {
    let (name, about) = (name.into(), about.into());
    let unit = unit_of(&name).unwrap_or_default();
    Variable { name, role, kind, causality: Causality::Output, discrete: false, unit, range: None, about }
}

fn inputs() -> Vec<Variable> {
    let mut list = Vec::new();
    for (place, axis) in Axis::ALL.map(Axis::name).into_iter().enumerate() {
        let about = format!(
            "Valve command of the {axis}, rounded to 1/2047; set before a step, it acts from one millisecond after the step's begin, as on the bus"
        );
        let valve = variable(format!("{axis}_valve"), Role::Valve(place), Kind::Real(Some(0.0)), about);
        list.push(Variable { range: Some((-1.0, 1.0)), ..valve });
    }
    for (place, on) in ["carriage", "load"].iter().enumerate() {
        let about = format!("A hand's push on the {}, in +x", ["carriage", "load's eye"][place]);
        let name = format!("hand_force_{on}_N");
        list.push(variable(name, Role::Hand(place), Kind::Real(Some(0.0)), about));
    }
    let stop = "Discharges the supply and shuts the valves, while true";
    list.push(variable("emergency_stop", Role::EmergencyStop, Kind::Boolean(Some(false)), stop));
    let link = "Whether the load's eye shall sit in the carriage; at the start it is put there, later it must lie in the gap";
    list.push(variable("link", Role::Link, Kind::Boolean(Some(false)), link));
    list.into_iter()
        .map(|instance| Variable { causality: Causality::Input, discrete: true, ..instance })
        .collect()
}

fn setup(rig: &RigParameters) -> Vec<Variable> {
    let parameter = |name: &str, role, kind, most, about: &str| {
        let range = Some((0.0, most));
        Variable { causality: Causality::Parameter, range, ..variable(name, role, kind, about) }
    };
    let Setup { carriage_position_m, added_mass_kg, .. } = start_setup(rig);
    let (position, mass) = (Kind::Real(Some(carriage_position_m)), Kind::Real(Some(added_mass_kg)));
    let (stroke_m, limit_kg) = (rig.cylinder().stroke_m, rig.mass().added_limit_kg);
    let at_the_start = "Carriage position at the start";
    let seed = "Seed of the sensors' noise; the same seed gives the same noise as in a run";
    vec![
        parameter("carriage_position_m", Role::CarriagePosition, position, stroke_m, at_the_start),
        parameter("added_mass_kg", Role::AddedMass, mass, limit_kg, "Weights on the carriage"),
        parameter("sensor_seed", Role::Seed, Kind::Integer(Some(1)), f64::from(i32::MAX), seed),
    ]
}

fn numbers(rig: &RigParameters) -> Vec<Variable> {
    let mut list = Vec::new();
    for (place, key) in KEYS.iter().enumerate() {
        for (index, number) in rig.numbers(&key.path()).iter().enumerate() {
            let name = if key.count == 1 { key.path() } else { format!("{}[{}]", key.path(), index + 1) };
            let instance = variable(name, Role::Rig(place, index), Kind::Real(Some(*number)), key.meaning);
            list.push(Variable {
                causality: Causality::Parameter,
                unit: key.unit.name(),
                range: Some((key.min, key.max)),
                ..instance
            });
        }
    }
    list
}

fn truths() -> Vec<Variable> {
    let column = |(place, name): (usize, &&str)| {
        let flag = *name == "check_valves_shut";
        let kind = if flag { Kind::Boolean(None) } else { Kind::Real(None) };
        let about = "True state or term, as in truth.csv (plant/src/truth.rs says what it is)";
        Variable { discrete: flag, ..variable(*name, Role::Truth(place), kind, about) }
    };
    Truth::COLUMNS.iter().enumerate().map(column).collect()
}

fn terms(plant: &Plant) -> Vec<Variable> {
    let about = "What a switched-on effect adds to its balance, as in truth.csv";
    let term = |(place, name)| variable(name, Role::Term(place), Kind::Real(None), about);
    plant.term_names().into_iter().enumerate().map(term).collect()
}

fn measured() -> Vec<Variable> {
    let channels =
        ["position_measured_m", "force_measured_N", "pressure_a_measured_Pa", "pressure_b_measured_Pa"];
    let mut list = Vec::new();
    for (axis, name) in Axis::ALL.map(Axis::name).into_iter().enumerate() {
        for (channel, suffix) in channels.iter().enumerate() {
            let about = "What the sensor shows, with noise, rounded and clipped, as in measurement.csv";
            let role = Role::Measured(axis, channel);
            list.push(variable(format!("{name}_{suffix}"), role, Kind::Real(None), about));
        }
        let about = "The valve command that acts over the millisecond to come";
        list.push(variable(format!("{name}_valve_acting"), Role::Acting(axis), Kind::Real(None), about));
    }
    let about = "Whether the load's eye sits in the carriage";
    list.push(variable("linked", Role::Linked, Kind::Boolean(None), about));
    list.into_iter().map(|instance| Variable { discrete: true, ..instance }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_every_row_of_the_plants_tables_is_a_variable() {
        let rig = RigParameters::baseline()
            .with_effect("piston-leakage", "load", &[("leakage_nl_per_min", 5.0)])
            .unwrap();
        let list = of(&rig).unwrap();
        let names: BTreeSet<_> = list.iter().map(|instance| instance.name.as_str()).collect();
        assert_eq!(names.len(), list.len());
        assert!(Truth::COLUMNS.iter().all(|column| names.contains(column)));
        let numbers: usize = KEYS.iter().map(|key| key.count).sum();
        assert_eq!(list.iter().filter(|instance| matches!(instance.role, Role::Rig(..))).count(), numbers);
        assert!(list.iter().any(|instance| matches!(instance.role, Role::Term(_))), "the leakage has terms");
    }

    #[test]
    fn starts_lie_in_their_ranges_and_outputs_have_none() {
        for instance in of(&RigParameters::baseline()).unwrap() {
            let start = match instance.kind {
                Kind::Real(start) => start,
                Kind::Integer(start) => start.map(f64::from),
                Kind::Boolean(start) => start.map(|flag| f64::from(u8::from(flag))),
            };
            assert_eq!(start.is_none(), instance.causality == Causality::Output, "{}", instance.name);
            if let (Some(start), Some((least, most))) = (start, instance.range) {
                assert!((least..=most).contains(&start), "{}", instance.name);
            }
        }
    }

    #[test]
    fn a_name_ends_with_its_unit() {
        for (name, unit) in [
            ("drive_rod_acceleration_m_per_s2", "m/s^2"),
            ("load_edge_flow_a_m3_per_s", "m^3/s"),
            ("supply_pressure_Pa", "Pa"),
            ("drive_spool", ""),
        ] {
            assert_eq!(variable(name, Role::Linked, Kind::Real(None), "").unit, unit, "{name}");
        }
    }
}
