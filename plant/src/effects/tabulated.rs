//! tabulated: a term that a table gives: what records show and no effect of the catalogue explains.
//!
//! ```text
//! force = F(variable)         along the axis' own extension, N
//! flow  = q(variable) g(p)    into a chamber, m^3/s under normal conditions
//! g(p)  = p / p_exhaust for q < 0, 2 - p / p_supply for q > 0, within 0 to 1
//! ```
//!
//! F, q a straight line between two points of the table, constant beyond its ends. Extension and pressures are those of the axis
//! at the midpoint of a step; speed and spool are those at its beginning, since the force itself decides on the speed after.
//! Several tables of a balance add up. A table is bounded, so that no slope of it can make a step run away; g lets no flow out of
//! an empty chamber, and none into one that would burst.
//!
//! A table over the speed is no friction: at rest it is a force of its value at 0, and break-away does not know of it.
//!
//! It is no effect of the catalogue: it has no sheet, and no name in a report. `[[tabulated]]` of a rig file holds it.
//!
//! Properties: exact at the points; constant beyond them; two tables are their sum; a constant is an inclination.
//!
//! Source: discrepancy-notes.md, Pipeline 8: an unknown input over the variable that it follows.

use crate::integrator::Lanes;
use crate::lanes::Axes;
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;
use crate::state::{Axis, AxisState};
use crate::truth::{AirState, AxisTruth};
use std::fmt::Write as _;

/// Fewest and most points of a table.
pub const POINTS: [usize; 2] = [2, 64];
/// Largest force of a table, N.
pub const MOST_FORCE_N: f64 = 2000.0;
/// Largest flow of a table, Nl/min.
pub const MOST_FLOW_NL_PER_MIN: f64 = 2000.0;

/// What a table adds to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Balance {
    /// Force on the piston.
    Force,
    /// Flow into chamber a.
    FlowA,
    /// Flow into chamber b.
    FlowB,
}

impl Balance {
    /// The balances of an axis.
    pub const ALL: [Balance; 3] = [Balance::Force, Balance::FlowA, Balance::FlowB];

    /// As in `drive.force`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Balance::Force => "force",
            Balance::FlowA => "flow-a",
            Balance::FlowB => "flow-b",
        }
    }

    /// Key of the values in a rig file; it says their unit.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Balance::Force => "value_n",
            Balance::FlowA | Balance::FlowB => "value_nl_per_min",
        }
    }

    /// Largest value of a table, either sign, in the unit of the file.
    #[must_use]
    pub const fn most(self) -> f64 {
        match self {
            Balance::Force => MOST_FORCE_N,
            Balance::FlowA | Balance::FlowB => MOST_FLOW_NL_PER_MIN,
        }
    }

    /// The unit of its values in a file.
    #[must_use]
    pub const fn unit(self) -> Unit {
        match self {
            Balance::Force => Unit::Newton,
            Balance::FlowA | Balance::FlowB => Unit::NormalLitrePerMinute,
        }
    }
}

/// What a table is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Extension of the axis, m.
    Extension,
    /// Velocity along it, m/s.
    Velocity,
    /// Its size, m/s.
    Speed,
    /// Its sign: -1, 0 at rest, 1.
    Direction,
    /// Opening of the spool, -1 to 1.
    Spool,
    /// Absolute pressure of chamber a, Pa.
    PressureA,
    /// Absolute pressure of chamber b, Pa.
    PressureB,
    /// Pressure of a minus that of b, Pa.
    PressureDifference,
    /// Extension on the way out, its negative on the way in, 0 at rest, m: a law over the position that knows the direction.
    DirectedExtension,
}

impl Variable {
    /// The variables that a table may be over.
    #[rustfmt::skip] // one line
    pub const ALL: [Variable; 9] = [
        Variable::Extension, Variable::Velocity, Variable::Speed, Variable::Direction,
        Variable::Spool, Variable::PressureA, Variable::PressureB, Variable::PressureDifference,
        Variable::DirectedExtension,
    ];

    /// As in a rig file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Variable::Extension => "x",
            Variable::Velocity => "v",
            Variable::Speed => "|v|",
            Variable::Direction => "sign(v)",
            Variable::Spool => "u",
            Variable::PressureA => "p_a",
            Variable::PressureB => "p_b",
            Variable::PressureDifference => "p_a-p_b",
            Variable::DirectedExtension => "x sign(v)",
        }
    }

    /// Its SI unit; nothing of a plain number.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Variable::Extension | Variable::DirectedExtension => "m",
            Variable::Velocity | Variable::Speed => "m/s",
            Variable::Direction | Variable::Spool => "",
            Variable::PressureA | Variable::PressureB | Variable::PressureDifference => "Pa",
        }
    }

    /// What it is at an instant of an axis, in SI.
    #[must_use]
    pub fn value(self, state: &AxisState, truth: &AxisTruth) -> f64 {
        self.of(&AxisConditions {
            extension_m: state.extension_m,
            velocity_m_per_s: state.rod_velocity_m_per_s,
            spool: state.spool,
            pressure_pa: [truth.pressure_a_pa, truth.pressure_b_pa],
        })
    }

    fn of(self, at: &AxisConditions) -> f64 {
        let [a, b] = at.pressure_pa;
        match self {
            Variable::Extension => at.extension_m,
            Variable::Velocity => at.velocity_m_per_s,
            Variable::Speed => at.velocity_m_per_s.abs(),
            Variable::Direction => direction(at.velocity_m_per_s),
            Variable::DirectedExtension => at.extension_m * direction(at.velocity_m_per_s),
            Variable::Spool => at.spool,
            Variable::PressureA => a,
            Variable::PressureB => b,
            Variable::PressureDifference => a - b,
        }
    }
}

/// -1, 0 at rest, 1.
fn direction(velocity_m_per_s: f64) -> f64 {
    if velocity_m_per_s == 0.0 { 0.0 } else { velocity_m_per_s.signum() }
}

/// A table as a rig file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tabulated {
    /// Axis whose balance the table is added to.
    pub axis: Axis,
    /// What it adds to.
    pub balance: Balance,
    /// What it is over.
    pub variable: Variable,
    /// Points, strictly growing, in SI: m, m/s, Pa, or a plain number.
    pub at: Vec<f64>,
    /// Values there: N along the axis' own extension, or Nl/min into the chamber.
    pub value: Vec<f64>,
}

impl Tabulated {
    /// What a rig file says to have this table, numbers to the bit.
    #[must_use]
    pub fn toml(&self) -> String {
        let mut text = format!(
            "[[tabulated]]\nbalance = \"{}.{}\"\nvariable = \"{}\"\n",
            self.axis.name(),
            self.balance.name(),
            self.variable.name()
        );
        for (key, numbers) in [("at", &self.at), (self.balance.key(), &self.value)] {
            // TOML writes NaN in small letters.
            let numbers: Vec<String> = numbers
                .iter()
                .map(|number| if number.is_nan() { "nan".to_owned() } else { format!("{number:?}") })
                .collect();
            let _ = writeln!(text, "{key} = [{}]", numbers.join(", "));
        }
        text
    }
}

/// Values of an axis at an instant that tables, terms and forces depend on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisConditions {
    pub(crate) extension_m: f64,
    pub(crate) velocity_m_per_s: f64,
    pub(crate) spool: f64,
    pub(crate) pressure_pa: [f64; 2],
}

impl AxisConditions {
    /// At the instant of a state.
    pub(crate) fn at(lanes: &Lanes, air: &AirState, axis: usize) -> Self {
        let piston = lanes.piston(axis);
        AxisConditions {
            extension_m: piston.extension,
            velocity_m_per_s: piston.velocity,
            spool: lanes.spool.to_array()[axis],
            pressure_pa: air.of_axis_pa(axis),
        }
    }
}

/// A table in SI.
#[derive(Debug, Clone)]
struct Law {
    balance: Balance,
    variable: Variable,
    at: Vec<f64>,
    value: Vec<f64>,
}

impl Law {
    fn value(&self, conditions: &AxisConditions) -> f64 {
        interpolated(&self.at, &self.value, self.variable.of(conditions))
    }
}

/// What a table of rising points says at `x`: a straight line between them, constant beyond.
///
/// # Panics
/// For a table without points, or with fewer values than points.
#[inline]
#[must_use]
pub fn interpolated(at: &[f64], value: &[f64], x: f64) -> f64 {
    let above = at.partition_point(|point| *point <= x);
    if above == 0 || above == at.len() {
        return value[above.min(at.len() - 1)];
    }
    let share = (x - at[above - 1]) / (at[above] - at[above - 1]);
    value[above - 1] + (value[above] - value[above - 1]) * share
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Tables {
    laws: Vec<Law>,
    exhaust_pa: f64,
    supply_pa: f64,
}

impl Tables {
    pub(crate) fn of(rig: &RigParameters, axis: Axis) -> Self {
        let of_axis = rig.tabulated().iter().filter(|table| table.axis == axis);
        let laws = of_axis.map(|table| Law {
            balance: table.balance,
            variable: table.variable,
            at: table.at.clone(),
            value: table.value.iter().map(|value| table.balance.unit().to_si(*value)).collect(),
        });
        Tables {
            laws: laws.collect(),
            exhaust_pa: rig.supply().exhaust_pressure_pa,
            supply_pa: rig.supply().pressure_pa,
        }
    }

    /// Whether any adds to the force, or to the flow into a chamber.
    pub(crate) fn adds(&self, balance: Balance) -> bool {
        self.laws.iter().any(|law| law.balance == balance)
    }

    /// Whether any adds to a flow.
    pub(crate) fn adds_air(&self) -> bool {
        self.adds(Balance::FlowA) || self.adds(Balance::FlowB)
    }

    /// Force along the axis's extension, N.
    pub(crate) fn force(&self, conditions: &AxisConditions) -> f64 {
        self.sum(Balance::Force, conditions)
    }

    /// Flow into a chamber, m^3/s.
    pub(crate) fn flow(&self, chamber: usize, conditions: &AxisConditions) -> f64 {
        let flow = self.sum([Balance::FlowA, Balance::FlowB][chamber], conditions);
        let pressure_pa = conditions.pressure_pa[chamber];
        neither_empties_nor_bursts(flow, pressure_pa, [self.exhaust_pa, self.supply_pa])
    }

    fn sum(&self, balance: Balance, conditions: &AxisConditions) -> f64 {
        self.laws.iter().filter(|law| law.balance == balance).map(|law| law.value(conditions)).sum()
    }
}

/// A flow into a chamber times g(p) of the module's head; `ends_pa` are exhaust and supply.
#[inline]
pub(super) fn neither_empties_nor_bursts(flow: f64, pressure_pa: f64, ends_pa: [f64; 2]) -> f64 {
    let [exhaust_pa, supply_pa] = ends_pa;
    if flow < 0.0 {
        flow * (pressure_pa / exhaust_pa).clamp(0.0, 1.0)
    } else {
        // Twice the supply's is more than a piston that is pushed back compresses a chamber to.
        flow * (2.0 - pressure_pa / supply_pa).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conditions(extension_m: f64, velocity_m_per_s: f64) -> AxisConditions {
        AxisConditions { extension_m, velocity_m_per_s, spool: 0.25, pressure_pa: [4e5, 3e5] }
    }

    fn tables(tables: &[Tabulated]) -> Tables {
        Tables::of(&RigParameters::baseline().with_tabulated(tables).expect("good"), Axis::Drive)
    }

    fn table(balance: Balance, variable: Variable, at: &[f64], value: &[f64]) -> Tabulated {
        Tabulated { axis: Axis::Drive, balance, variable, at: at.to_vec(), value: value.to_vec() }
    }

    #[test]
    fn it_is_exact_at_its_points_straight_between_and_constant_beyond() {
        let tables =
            tables(&[table(Balance::Force, Variable::Extension, &[0.0, 0.1, 0.4], &[2.0, 4.0, -8.0])]);
        for (x, force) in
            [(-1.0, 2.0), (0.0, 2.0), (0.05, 3.0), (0.1, 4.0), (0.25, -2.0), (0.4, -8.0), (9.0, -8.0)]
        {
            assert!((tables.force(&conditions(x, 0.0)) - force).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn each_variable_is_what_its_name_says() {
        let expected = [0.2, -0.5, 0.5, -1.0, 0.25, 4e5, 3e5, 1e5, -0.2];
        for (variable, expected) in Variable::ALL.into_iter().zip(expected) {
            assert_eq!(variable.of(&conditions(0.2, -0.5)), expected, "{}", variable.name());
        }
        assert_eq!(Variable::Direction.of(&conditions(0.2, 0.0)), 0.0);
        assert_eq!(Variable::DirectedExtension.of(&conditions(0.2, 0.0)), 0.0);
    }

    #[test]
    fn two_tables_are_their_sum_and_another_balance_has_none_of_it() {
        let one = table(Balance::Force, Variable::Velocity, &[-1.0, 1.0], &[-3.0, 3.0]);
        let two = table(Balance::Force, Variable::PressureDifference, &[0.0, 2e5], &[0.0, 10.0]);
        let both = tables(&[one.clone(), two.clone()]);
        for velocity in [-0.7, 0.0, 0.3] {
            let at = conditions(0.1, velocity);
            let sum =
                tables(std::slice::from_ref(&one)).force(&at) + tables(std::slice::from_ref(&two)).force(&at);
            assert!((both.force(&at) - sum).abs() < 1e-12);
        }
        assert!(!both.adds_air() && both.flow(0, &conditions(0.1, 0.0)) == 0.0);
    }

    #[test]
    fn a_flow_neither_empties_nor_bursts_a_chamber() {
        let flows = tables(&[
            table(Balance::FlowA, Variable::Extension, &[0.0, 1.0], &[-6.0, -6.0]),
            table(Balance::FlowB, Variable::Extension, &[0.0, 1.0], &[6.0, 6.0]),
        ]);
        let flow = |chamber: usize, pressure_pa: f64| {
            flows.flow(chamber, &AxisConditions { pressure_pa: [pressure_pa; 2], ..conditions(0.1, 0.0) })
        };
        assert!((flow(0, 4e5) + 1e-4).abs() < 1e-15 && (flow(1, 4e5) - 1e-4).abs() < 1e-15);
        assert_eq!(flow(0, 0.0), 0.0);
        assert_eq!(flow(1, 3.0 * RigParameters::baseline().supply().pressure_pa), 0.0);
    }
}
