//! Outputs of an axis in a cycle: frames for the bus, an event for people, a row of the record.
//!
//! The columns of the record, `controller-drive.csv` and `controller-load.csv`, stand here: who writes the tables, and who makes
//! figures of the rows in memory, goes through [`AxisRecord::CHAINS`] and [`AxisRecord::NUMBERS`].

use super::AxisController;
use crate::node::NodeEvent;
use crate::set_point::{ForceSetPoint, SetPoint};
use nominal::Axis;
use protocol::frames::{
    ChainStatus, ChainValues, EmergencyStop, EmergencyStopChainState, ForceChainState, MainChainState,
    MatchingChainState, Sensors, ValveCommand,
};

/// Outputs of an axis in a cycle: frames for the bus, an event for people, a row of the record.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Sent in every cycle; not enabled, with opening 0, when nothing is asked of the axis.
    pub command: ValveCommand,
    /// The axis's own emergency stop, when it is due.
    pub emergency_stop: Option<EmergencyStop>,
    /// States of the chains, every ten cycles and when the status is another.
    pub status: Option<ChainStatus>,
    /// Averaged position, set-points and control error, every ten cycles and with a status that changed.
    pub values: Option<ChainValues>,
    /// The main chain entered another state.
    pub(crate) news: Option<NodeEvent>,
    /// Row of the record; `None` in cycles that are not recorded.
    pub record: Option<AxisRecord>,
}

/// A row of `controller-drive.csv` or `controller-load.csv`; rig coordinates.
#[derive(Clone, Copy, Debug)]
pub struct AxisRecord {
    /// Axis that answered.
    pub axis: Axis,
    /// The rig's cycle whose sensors are answered.
    pub cycle: u64,
    /// State of the main chain after these sensors were processed; the same holds of the other chains.
    pub main: MainChainState,
    /// State of the force chain; on an axis without forces to follow it is idle, or done with the main chain.
    pub force_chain: ForceChainState,
    /// State of the matching chain; on an axis without forces to follow it is idle.
    pub matching: MatchingChainState,
    /// State of the emergency stop chain; the valve is shut in all but ready.
    pub emergency_stop: EmergencyStopChainState,
    /// Position set-point; `None` under force control, and when nothing is asked of the axis.
    pub set_position: Option<SetPoint>,
    /// Force set-point; `None` under position control, and when nothing is asked of the axis.
    pub set_force: Option<ForceSetPoint>,
    /// Position sensor, less the matched offset, m.
    pub position_m: f64,
    /// Its rate, filtered, m/s.
    pub velocity_m_per_s: f64,
    /// Force sensor, not filtered, N, compression positive.
    pub force_n: f64,
    /// Velocity that the algorithm wants, along the axis's extension, m/s.
    pub wanted_velocity_m_per_s: f64,
    /// Opening sent, -1 to 1.
    pub opening: f64,
    /// Whether the valve shall act; if not, the opening is 0.
    pub enabled: bool,
}

/// A column of the record that holds the state of a chain.
#[derive(Clone, Copy, Debug)]
pub struct StateColumn {
    /// Name in the head of the table.
    pub name: &'static str,
    /// The state, as `rig.dbc` names it.
    pub state: fn(&AxisRecord) -> &'static str,
}

/// A column of the record that holds a number.
#[derive(Clone, Copy, Debug)]
pub struct NumberColumn {
    /// Name in the head of the table, ending in the SI unit where there is one.
    pub name: &'static str,
    /// The number in that unit; none is an empty cell.
    pub value: fn(&AxisRecord) -> Option<f64>,
    /// Whether a tiny number is written with an exponent, in place of its zeros.
    pub exponent: bool,
}

impl NumberColumn {
    const fn new(name: &'static str, value: fn(&AxisRecord) -> Option<f64>) -> Self {
        Self { name, value, exponent: false }
    }

    const fn with_exponent(self) -> Self {
        Self { exponent: true, ..self }
    }
}

impl AxisRecord {
    /// The first columns of the table, behind `time_s`.
    pub const CHAINS: [StateColumn; 4] = [
        StateColumn { name: "main_chain", state: |row| row.main.name() },
        StateColumn { name: "force_chain", state: |row| row.force_chain.name() },
        StateColumn { name: "matching_chain", state: |row| row.matching.name() },
        StateColumn { name: "emergency_stop_chain", state: |row| row.emergency_stop.name() },
    ];

    /// The columns behind the chains. Flags are 0 and 1.
    pub const NUMBERS: [NumberColumn; 10] = [
        NumberColumn::new("set_position_m", |row| row.set_position.map(|point| point.position_m)),
        NumberColumn::new("set_velocity_m_per_s", |row| row.set_position.map(|point| point.velocity_m_per_s)),
        NumberColumn::new("set_force_N", |row| row.set_force.map(|point| point.force_n)),
        NumberColumn::new("position_m", |row| Some(row.position_m)),
        NumberColumn::new("velocity_m_per_s", |row| Some(row.velocity_m_per_s)).with_exponent(),
        NumberColumn::new("force_N", |row| Some(row.force_n)),
        NumberColumn::new("wanted_velocity_m_per_s", |row| Some(row.wanted_velocity_m_per_s)).with_exponent(),
        NumberColumn::new("opening", |row| Some(row.opening)),
        NumberColumn::new("enabled", |row| Some(f64::from(u8::from(row.enabled)))),
        NumberColumn::new("moving", |row| Some(f64::from(u8::from(row.moving())))),
    ];

    /// Whether the set-point in force changes, of position or force.
    #[must_use]
    pub fn moving(&self) -> bool {
        self.set_position.is_some_and(|point| point.moving)
            || self.set_force.is_some_and(|point| point.moving)
    }
}

impl AxisController {
    /// The row of `cycle`, also where that cycle is not recorded. `sensors` and `command` are those of its answer, which is the
    /// last one: states and set-points are taken from there.
    pub fn record(&self, cycle: u64, sensors: &Sensors, command: &ValveCommand) -> AxisRecord {
        let geometry = self.program.geometry();
        let status = self.status();
        let request = self.request.as_ref();
        AxisRecord {
            axis: self.axis,
            cycle,
            main: status.main_chain,
            force_chain: status.force_chain,
            matching: status.matching_chain,
            emergency_stop: status.emergency_stop_chain,
            set_position: request
                .filter(|_| self.demand_generator.is_position())
                .map(|request| request.demand.position),
            set_force: request
                .filter(|_| !self.demand_generator.is_position())
                .map(|request| request.demand.force),
            position_m: sensors.position_m - geometry.offset_m,
            velocity_m_per_s: geometry.direction() * self.program.algorithm_input().velocity_m_per_s,
            force_n: sensors.force_n,
            wanted_velocity_m_per_s: request
                .map_or(0.0, |request| self.program.wanted_m_per_s(request.algorithm)),
            opening: command.opening,
            enabled: command.enable,
        }
    }
}
