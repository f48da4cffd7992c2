//! What an axis hands over in a cycle: to the bus, to a person, to the record.

use super::AxisController;
use crate::node::NodeEvent;
use crate::set_point::{ForceSetPoint, SetPoint};
use nominal::Axis;
use protocol::frames::{
    ChainStatus, ChainValues, EmergencyStop, EmergencyStopChainState, ForceChainState, MainChainState,
    MatchingChainState, Sensors, ValveCommand,
};

#[derive(Clone, Copy, Debug)]
pub struct Answer {
    pub command: ValveCommand,
    /// The axis's own emergency stop, when it is due.
    pub emergency_stop: Option<EmergencyStop>,
    pub status: Option<ChainStatus>,
    pub values: Option<ChainValues>,
    pub news: Option<NodeEvent>,
    pub record: Option<AxisRecord>,
}

/// A row of `controller-drive.csv` or `controller-load.csv`; rig coordinates.
#[derive(Clone, Copy, Debug)]
pub struct AxisRecord {
    pub axis: Axis,
    /// The rig's cycle whose sensors are answered.
    pub cycle: u64,
    pub main: MainChainState,
    pub force_chain: ForceChainState,
    pub matching: MatchingChainState,
    pub emergency_stop: EmergencyStopChainState,
    pub set_position: Option<SetPoint>,
    pub set_force: Option<ForceSetPoint>,
    /// Position sensor, less the matched offset, m.
    pub position_m: f64,
    /// Its rate, filtered, m/s.
    pub velocity_m_per_s: f64,
    pub force_n: f64,
    /// Velocity that the algorithm wants, along the axis's extension, m/s.
    pub wanted_velocity_m_per_s: f64,
    /// Opening sent, -1 to 1.
    pub opening: f64,
    pub enabled: bool,
}

impl AxisController {
    pub fn record(&self, cycle: u64, sensors: &Sensors, command: &ValveCommand) -> AxisRecord {
        let geometry = self.program.geometry();
        let status = self.status();
        let asked = self.asked.as_ref();
        AxisRecord {
            axis: self.axis,
            cycle,
            main: status.main_chain,
            force_chain: status.force_chain,
            matching: status.matching_chain,
            emergency_stop: status.emergency_stop_chain,
            set_position: asked.filter(|_| self.work.is_position()).map(|asked| asked.demand.position),
            set_force: asked.filter(|_| !self.work.is_position()).map(|asked| asked.demand.force),
            position_m: sensors.position_m - geometry.offset_m,
            velocity_m_per_s: geometry.direction() * self.program.ready().velocity_m_per_s,
            force_n: sensors.force_n,
            wanted_velocity_m_per_s: asked.map_or(0.0, |asked| self.program.wanted_m_per_s(asked.hand)),
            opening: command.opening,
            enabled: command.enable,
        }
    }
}
