//! Inputs and outputs of the main chain in a cycle, and the causes of its transitions.

use crate::chains::settled::ControlError;
use crate::chains::{Console, Fault, Partner};
use protocol::frames::{EmergencyStopChainState, MainChainState};
use std::fmt;

/// Measurement of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMeasurement {
    /// Position sensor as it came, less the matched offset, rig coordinates, m.
    pub position_m: f64,
    pub error: ControlError,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct MainInputs {
    pub cycle: u64,
    /// `None` before the first sensors of this axis.
    pub measurement: Option<AxisMeasurement>,
    pub prepared: bool,
    pub partner: Partner,
    /// State of this axis's emergency stop chain in this cycle.
    pub emergency_stop: EmergencyStopChainState,
    pub console: Console,
    /// A fault of this axis: sensors, limits, algorithm, force or matching chain.
    pub fault: Option<Fault>,
}

/// What is asked of the axis. `elapsed_s` is the time since the phase began, s, and may go on beyond its duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// Hold the valve shut.
    Shut,
    /// Move from `from_m`, where the carriage was, to the start along a Bestehorn sinoid. An axis that is not
    /// positioned holds still; its `duration_s` is 0.
    Approach { elapsed_s: f64, from_m: f64, duration_s: f64 },
    /// Take the steps before the initial force.
    Prepare,
    /// Ramp to the initial force; the position stays at the start.
    RampForce { elapsed_s: f64 },
    /// Stay at the start with the initial force.
    HoldStart,
    /// Run the experiment.
    Experiment { elapsed_s: f64 },
    /// Stay at the end.
    HoldEnd,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainOutput {
    pub state: MainChainState,
    /// Repetitions before this one; the bus has its low 8 bits.
    pub repetition: u32,
    /// The condition for leaving the state is fulfilled on this side.
    pub ok: bool,
    pub phase: Phase,
    pub fault: Option<Fault>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MainCause {
    Began,
    RigRestarted,
    Ready,
    NextRepetition,
    EmergencyStop,
    Console,
    PartnerAborted,
    PartnerFault,
    Fault(Fault),
    Recovered,
    Started,
}

impl fmt::Display for MainCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Began => "the controller began",
            Self::RigRestarted => "the rig began anew",
            Self::Ready => "both axes are ready",
            Self::NextRepetition => "another repetition follows",
            Self::EmergencyStop => "the emergency stop is tripped",
            Self::Console => "the console ended the run",
            Self::PartnerAborted => "the other axis's controller ended the run",
            Self::PartnerFault => "the other axis's controller has a fault",
            Self::Fault(fault) => return write!(f, "{fault}"),
            Self::Recovered => "the rig has recovered from the emergency stop",
            Self::Started => "the console started the run anew",
        })
    }
}
