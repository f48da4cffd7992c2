//! What an axis hands over in a cycle: to the bus, to a person, to the record.

use crate::set_point::{ForceSetPoint, SetPoint};
use crate::station::News;
use plant::Axis;
use protocol::frames::{
    ChainStatus, ChainValues, EmergencyStop, EmergencyStopChainState, ForceChainState, MainChainState,
    MatchingChainState, ValveCommand,
};

/// The answer to the sensors of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// To the valve.
    pub command: ValveCommand,
    /// The axis's own emergency stop, when it is due.
    pub emergency_stop: Option<EmergencyStop>,
    /// States of the chains, when they are due.
    pub status: Option<ChainStatus>,
    /// Values of the chains, when they are due.
    pub values: Option<ChainValues>,
    /// What a person is told.
    pub news: Option<News>,
    /// A row of the record.
    pub record: Option<AxisRecord>,
}

/// A row of `controller-drive.csv` or `controller-load.csv`; rig coordinates.
#[derive(Clone, Copy, Debug)]
pub struct AxisRecord {
    /// The axis.
    pub axis: Axis,
    /// The rig's cycle whose sensors are answered.
    pub cycle: u64,
    /// State of the main chain.
    pub main: MainChainState,
    /// State of the force chain.
    pub force_chain: ForceChainState,
    /// State of the matching chain.
    pub matching: MatchingChainState,
    /// State of the emergency stop chain.
    pub emergency_stop: EmergencyStopChainState,
    /// Position asked for; `None` where none is.
    pub set_position: Option<SetPoint>,
    /// Force asked for; `None` where none is.
    pub set_force: Option<ForceSetPoint>,
    /// Position sensor, less the matched offset, m.
    pub position_m: f64,
    /// Its rate, filtered, m/s.
    pub velocity_m_per_s: f64,
    /// Force sensor, N.
    pub force_n: f64,
    /// Velocity that the algorithm wants, own extension, m/s.
    pub wanted_velocity_m_per_s: f64,
    /// Opening sent, -1 to 1.
    pub opening: f64,
    /// Whether the valve is asked to act.
    pub enabled: bool,
}
