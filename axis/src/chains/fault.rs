//! What ends a run by fault: a name for files, a reason for the bus, a sentence for people, and when its cause is gone.
//!
//! Every fault shuts the own valve in the cycle in which it is found and trips the central emergency stop with its reason.

use protocol::frames::EmergencyStopReason;
use std::fmt;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    PartnerMissing,
    PartnerOtherExperiment,
    PartnerLost,
    PartnerRestarted,
    PartnerNotOk,
    SettlingTimeout,
    PreparationTimeout,
    RelieveTimeout,
    MatchingTimeout,
    OffsetImplausible,
    NotLinked,
    SensorLoss,
    LimitExceeded,
    ControllerFault,
}

impl Fault {
    pub const ALL: [Self; 14] = [
        Self::PartnerMissing,
        Self::PartnerOtherExperiment,
        Self::PartnerLost,
        Self::PartnerRestarted,
        Self::PartnerNotOk,
        Self::SettlingTimeout,
        Self::PreparationTimeout,
        Self::RelieveTimeout,
        Self::MatchingTimeout,
        Self::OffsetImplausible,
        Self::NotLinked,
        Self::SensorLoss,
        Self::LimitExceeded,
        Self::ControllerFault,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::PartnerMissing => "partner-missing",
            Self::PartnerOtherExperiment => "partner-other-experiment",
            Self::PartnerLost => "partner-lost",
            Self::PartnerRestarted => "partner-restarted",
            Self::PartnerNotOk => "partner-not-ok",
            Self::SettlingTimeout => "settling-timeout",
            Self::PreparationTimeout => "preparation-timeout",
            Self::RelieveTimeout => "relieve-timeout",
            Self::MatchingTimeout => "matching-timeout",
            Self::OffsetImplausible => "offset-implausible",
            Self::NotLinked => "not-linked",
            Self::SensorLoss => "sensor-loss",
            Self::LimitExceeded => "limit-exceeded",
            Self::ControllerFault => "controller-fault",
        }
    }

    /// Reason in the frame that trips the emergency stop.
    pub const fn reason(self) -> EmergencyStopReason {
        match self {
            Self::PartnerMissing
            | Self::PartnerOtherExperiment
            | Self::PartnerLost
            | Self::PartnerRestarted
            | Self::PartnerNotOk => EmergencyStopReason::PartnerLost,
            Self::SensorLoss => EmergencyStopReason::SensorLoss,
            Self::OffsetImplausible | Self::LimitExceeded => EmergencyStopReason::LimitExceeded,
            Self::SettlingTimeout
            | Self::PreparationTimeout
            | Self::RelieveTimeout
            | Self::MatchingTimeout
            | Self::NotLinked
            | Self::ControllerFault => EmergencyStopReason::ControllerFault,
        }
    }

    pub const fn sentence(self) -> &'static str {
        match self {
            Self::PartnerMissing => {
                "the other axis's controller was not heard waiting for the rig: start it, or use --alone"
            }
            Self::PartnerOtherExperiment => {
                "the other axis's controller runs another experiment: give both the same file"
            }
            Self::PartnerLost => {
                "the other axis's controller fell silent for 100 ms: see whether it still runs"
            }
            Self::PartnerRestarted => "the other axis's controller began anew in the middle of the run",
            Self::PartnerNotOk => "the other axis did not get ready in time, though this one was",
            Self::SettlingTimeout => {
                "the axis did not come to rest at its set-point in time: look for oscillation, a lasting error or a hand"
            }
            Self::PreparationTimeout => "the steps before the initial force were not done in time",
            Self::RelieveTimeout => "the force between the axes could not be relieved in time",
            Self::MatchingTimeout => {
                "the positions could not be matched in time: both axes must be linked and at rest"
            }
            Self::OffsetImplausible => {
                "the matched offset is too large for a sensor's: see whether the axes are really linked"
            }
            Self::NotLinked => {
                "the rods are not linked, so there is nothing to press against: link them, in an experiment's file by \
                 linked = true in [rig]"
            }
            Self::SensorLoss => "the own sensors fell silent for 50 ms: see whether the rig still sends them",
            Self::LimitExceeded => {
                "the own force or a chamber's pressure was beyond its sensor's range for half a second: look for a blocked \
                 axis, too high a supply, or a broken sensor"
            }
            Self::ControllerFault => "the algorithm gave no number or missed its time",
        }
    }

    /// Whether what caused the fault is over, so that a release may be taken.
    ///
    /// What a person must judge (time-outs, limits, the algorithm) is over when that person releases.
    pub const fn is_over(self, partner_fresh: bool, sensors_fresh: bool) -> bool {
        match self {
            Self::PartnerMissing
            | Self::PartnerOtherExperiment
            | Self::PartnerLost
            | Self::PartnerRestarted
            | Self::PartnerNotOk => partner_fresh && sensors_fresh,
            _ => sensors_fresh,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name(), self.sentence())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_fault_has_a_name_a_reason_and_a_sentence_of_its_own() {
        let names: HashSet<_> = Fault::ALL.iter().map(|fault| fault.name()).collect();
        let sentences: HashSet<_> = Fault::ALL.iter().map(|fault| fault.sentence()).collect();
        assert_eq!([names.len(), sentences.len()], [Fault::ALL.len(); 2]);
        for fault in Fault::ALL {
            assert_ne!(fault.reason(), EmergencyStopReason::None, "{fault}");
        }
    }

    #[test]
    fn a_partners_fault_is_over_when_it_is_heard_again() {
        assert!(!Fault::PartnerLost.is_over(false, true));
        assert!(Fault::PartnerLost.is_over(true, true));
        assert!(!Fault::SensorLoss.is_over(true, false));
        assert!(Fault::SettlingTimeout.is_over(false, true));
    }
}
