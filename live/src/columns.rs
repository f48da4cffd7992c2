//! The columns of the live page: name, unit, and source of each value.
//!
//! A value comes from the cycles of the telemetry, by the name of its column in `measurement.csv` or `truth.csv`; set-points
//! come from the controllers' ChainValues on the bus. Without telemetry measured values come from the bus, and columns of the
//! truth are empty.

use runlog::Axis;
use runlog::cycle_tables::{AXIS_COLUMNS, MEASURED};
use runlog::telemetry::Table;
use std::sync::LazyLock;

/// Names of the axes, the prefixes of their columns.
pub(crate) const AXES: [&str; 2] = Axis::NAMES;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    /// Column of `measurement.csv`, by its index.
    Measured(usize),
    /// Sum of columns of `truth.csv`, times this factor.
    Truth(Vec<String>, f64),
    /// A signal of the controller of this axis.
    Controller(usize, ControllerSignal),
    /// Supply pressure, which the bus carries too.
    Supply,
}

/// A signal that a controller sends in its ChainValues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ControllerSignal {
    /// Set-point of the position.
    Position,
    /// Set-point of the force.
    Force,
    /// Set-point less sensor.
    Error,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Column {
    /// Name, ending in its unit where it has one.
    pub name: String,
    /// Unit in SI; `1` for a plain number.
    pub unit: &'static str,
    /// Where its values come from.
    pub source: Source,
}

pub(crate) static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let mut columns: Vec<_> = (0..AXES.len()).flat_map(of_axis).collect();
    let truth = |name: &str| Source::Truth(vec![name.to_owned()], 1.0);
    for (name, unit, source) in [
        ("supply_pressure_pa", "Pa", Source::Supply),
        ("linkage_distance_m", "m", truth("linkage_distance_m")),
        ("linkage_force_n", "N", truth("linkage_contact_force_N")),
    ] {
        columns.push(Column { name: name.to_owned(), unit, source });
    }
    columns
});

fn of_axis(axis: usize) -> Vec<Column> {
    // The load's rod extends in -x: values in rod coordinates change their sign.
    let along_x = [1.0, -1.0][axis];
    let measured = |name: &str| {
        let place = AXIS_COLUMNS.iter().position(|known| *known == name);
        Source::Measured(axis * AXIS_COLUMNS.len() + place.expect("a column of each axis"))
    };
    let truth = |names: &[&str], factor: f64| {
        Source::Truth(names.iter().map(|name| format!("{}_{name}", AXES[axis])).collect(), factor)
    };
    let friction = ["viscous_friction_N", "sliding_friction_N", "holding_force_N"];
    [
        ("position_m", "m", measured("position_m")),
        ("set_point_m", "m", Source::Controller(axis, ControllerSignal::Position)),
        ("control_error_m", "m", Source::Controller(axis, ControllerSignal::Error)),
        ("true_position_m", "m", truth(&["position_m"], 1.0)),
        ("velocity_m_per_s", "m/s", truth(&["rod_velocity_m_per_s"], along_x)),
        ("pressure_a_pa", "Pa", measured("pressure_a_Pa")),
        ("pressure_b_pa", "Pa", measured("pressure_b_Pa")),
        ("true_pressure_a_pa", "Pa", truth(&["pressure_a_Pa"], 1.0)),
        ("true_pressure_b_pa", "Pa", truth(&["pressure_b_Pa"], 1.0)),
        ("valve_opening", "1", measured("valve")),
        ("spool_opening", "1", truth(&["spool"], 1.0)),
        ("force_n", "N", measured("force_N")),
        ("force_set_point_n", "N", Source::Controller(axis, ControllerSignal::Force)),
        ("flow_a_m3_per_s", "m^3/s", truth(&["flow_a_m3_per_s"], 1.0)),
        ("flow_b_m3_per_s", "m^3/s", truth(&["flow_b_m3_per_s"], 1.0)),
        ("pneumatic_force_n", "N", truth(&["pneumatic_force_N"], along_x)),
        ("friction_force_n", "N", truth(&friction, along_x)),
        ("hand_force_n", "N", truth(&["hand_force_N"], along_x)),
    ]
    .map(|(name, unit, source)| Column { name: format!("{}_{name}", AXES[axis]), unit, source })
    .into()
}

/// Indices of the columns' values in a cycle of the telemetry.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Layout {
    measured: [Option<usize>; MEASURED.len()],
    /// For each column that is a sum of columns of the truth, their indices; empty when one is missing.
    truth: Vec<Vec<usize>>,
    supply: Option<usize>,
}

impl Layout {
    /// Layout for the columns of a description: table and name of each.
    pub(crate) fn new<'a>(described: impl Iterator<Item = (Table, &'a str)>) -> Self {
        let described: Vec<_> = described.collect();
        let place = |table: Table, name: &str| described.iter().position(|known| *known == (table, name));
        let measured = std::array::from_fn(|index| {
            let (axis, column) = (AXES[index / AXIS_COLUMNS.len()], AXIS_COLUMNS[index % AXIS_COLUMNS.len()]);
            place(Table::Measurement, &format!("{axis}_{column}"))
        });
        let truth = COLUMNS.iter().map(|column| match &column.source {
            Source::Truth(names, _) => {
                let places: Option<Vec<_>> = names.iter().map(|name| place(Table::Truth, name)).collect();
                places.unwrap_or_default()
            }
            _ => Vec::new(),
        });
        Self { measured, truth: truth.collect(), supply: place(Table::Truth, "supply_pressure_Pa") }
    }

    /// The measured values of a cycle.
    pub(crate) fn measured(&self, values: &[f64]) -> [Option<f64>; MEASURED.len()] {
        self.measured.map(|place| values.get(place?).copied())
    }

    pub(crate) fn supply_pa(&self, values: &[f64]) -> Option<f64> {
        values.get(self.supply?).copied()
    }

    /// The value of a column that is a sum of columns of the truth, by the index of the column.
    pub(crate) fn truth(&self, column: usize, factor: f64, values: &[f64]) -> Option<f64> {
        let places = self.truth.get(column).filter(|places| !places.is_empty())?;
        let sum: Option<f64> = places.iter().map(|place| values.get(*place)).sum();
        sum.map(|sum| factor * sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::unit_of;

    #[test]
    fn names_are_unique_and_end_with_their_unit() {
        for (place, column) in COLUMNS.iter().enumerate() {
            assert!(COLUMNS[..place].iter().all(|other| other.name != column.name), "{}", column.name);
            assert_eq!(unit_of(&column.name).unwrap_or("1"), column.unit, "{}", column.name);
            assert_eq!(column.unit == "1", column.name.ends_with("_opening"), "{}", column.name);
            assert_eq!(column.name, column.name.to_lowercase());
        }
    }

    #[test]
    fn a_sum_is_none_unless_all_its_terms_are_recorded() {
        let place = |name: &str| COLUMNS.iter().position(|column| column.name == name).unwrap();
        let friction = place("load_friction_force_n");
        let names = ["load_viscous_friction_N", "load_sliding_friction_N", "load_holding_force_N"];
        let layout = Layout::new(names.iter().map(|name| (Table::Truth, *name)));
        assert_eq!(layout.truth(friction, -1.0, &[1.0, 2.0, 4.0]), Some(-7.0));
        let without = Layout::new(names[1..].iter().map(|name| (Table::Truth, *name)));
        assert_eq!(without.truth(friction, -1.0, &[1.0, 2.0]), None);
        assert_eq!(layout.measured(&[1.0; 3]), [None; MEASURED.len()]);
        let measured = Layout::new([(Table::Measurement, "load_valve")].into_iter());
        assert_eq!(measured.measured(&[0.5])[AXIS_COLUMNS.len()], Some(0.5));
    }
}
