//! Inputs and outputs of the main chain in a cycle, and the causes of its transitions.

use crate::chains::settled::ControlError;
use crate::chains::{Console, Fault, Partner};
use protocol::frames::{EmergencyStopChainState, MainChainState};
use std::fmt;

/// Measurement of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisMeasurement {
    /// Position sensor as it came, less the matched offset, rig coordinates, m.
    pub(crate) position_m: f64,
    pub(crate) error: ControlError,
}

/// Inputs of the chain in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MainInputs {
    pub(crate) cycle: u64,
    /// `None` before the first sensors of this axis.
    pub(crate) measurement: Option<AxisMeasurement>,
    /// All steps of the preparation are done, or there are none.
    pub(crate) prepared: bool,
    pub(crate) partner: Partner,
    /// State of this axis's emergency stop chain in this cycle.
    pub(crate) emergency_stop: EmergencyStopChainState,
    pub(crate) console: Console,
    /// A fault of this axis: sensors, limits, algorithm, force or matching chain.
    pub(crate) fault: Option<Fault>,
}

/// What is asked of the axis. `elapsed_s` is the time since the phase began, s, and may go on beyond its duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
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

/// State of the chain after a cycle, and what it asks of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MainOutput {
    pub(crate) state: MainChainState,
    /// Repetitions before this one; the bus has its low 8 bits.
    pub(crate) repetition: u32,
    /// The condition for leaving the state is fulfilled on this side.
    pub(crate) ok: bool,
    pub(crate) phase: Phase,
    pub(crate) fault: Option<Fault>,
}

/// Why the main chain entered its state; `Display` says it in a clause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MainCause {
    /// The controller was started; the chain waits for the rig.
    Began,
    /// The rig's cycles began again; the chain waits for the rig.
    RigRestarted,
    /// The condition of the state before held on this axis, and on the other one if its controller is needed.
    Ready,
    /// Final settling is over, and another repetition follows.
    NextRepetition,
    /// The emergency stop chain of this axis is not ready.
    EmergencyStop,
    /// `RunControl` abort.
    Console,
    /// The other axis's main chain is aborted.
    PartnerAborted,
    /// The other axis's main chain is in fault.
    PartnerFault,
    /// A fault that this axis found, in itself or in its partner.
    Fault(Fault),
    /// The emergency stop chain is ready again, and nobody aborted the run: the repetition begins anew.
    Recovered,
    /// `RunControl` start after an abort, or after a fault without an emergency stop: the repetition begins anew.
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
