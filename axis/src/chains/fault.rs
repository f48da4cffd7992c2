//! What ends a run by fault: a name for files, a reason for the bus, a sentence for people, and when its cause is gone.
//!
//! Every fault shuts the axis's valve in the cycle in which it is found and trips the central emergency stop with its reason.

use protocol::frames::EmergencyStopReason;
use std::fmt;

/// The faults, each as `Variant "name" Reason: "sentence"`; the reason is that in the frame that trips the emergency stop.
macro_rules! faults {
    ($($variant:ident $name:literal $reason:ident: $sentence:literal,)*) => {
        /// Why a controller ended its run and tripped the emergency stop; `Display` gives name and sentence.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Fault {
            $(
                #[doc = concat!("`", $name, ": ", $sentence, "`")]
                $variant,
            )*
        }

        impl Fault {
            /// Every fault, each at the index of its variant.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// Name in files and messages, such as `partner-lost`.
            pub const fn name(self) -> &'static str {
                [$($name),*][self as usize]
            }

            /// Reason in the frame that trips the emergency stop.
            pub(crate) const fn reason(self) -> EmergencyStopReason {
                [$(EmergencyStopReason::$reason),*][self as usize]
            }

            /// Finding and advice for people, without a capital at the start and without a full stop.
            pub const fn sentence(self) -> &'static str {
                [$($sentence),*][self as usize]
            }
        }
    };
}

faults! {
    PartnerMissing "partner-missing" PartnerLost:
        "the other axis's controller was not heard waiting for the rig: start it, or use --alone",
    PartnerOtherExperiment "partner-other-experiment" PartnerLost:
        "the other axis's controller runs another experiment: give both the same file",
    PartnerLost "partner-lost" PartnerLost:
        "the other axis's controller fell silent for 100 ms: see whether it still runs",
    PartnerRestarted "partner-restarted" PartnerLost:
        "the other axis's controller began anew in the middle of the run",
    PartnerNotOk "partner-not-ok" PartnerLost:
        "the other axis did not get ready in time, though this one was",
    SettlingTimeout "settling-timeout" ControllerFault:
        "the axis did not come to rest at its set-point in time: look for oscillation, a lasting error or a hand",
    PreparationTimeout "preparation-timeout" ControllerFault:
        "the steps before the initial force were not done in time",
    RelieveTimeout "relieve-timeout" ControllerFault:
        "the force between the axes could not be relieved in time",
    MatchingTimeout "matching-timeout" ControllerFault:
        "the positions could not be matched in time: both axes must be linked and at rest",
    OffsetImplausible "offset-implausible" LimitExceeded:
        "the matched offset is too large for a sensor's: see whether the axes are really linked",
    NotLinked "not-linked" ControllerFault:
        "the rods are not linked, so there is nothing to press against: link them, in an experiment's file by \
         linked = true in [rig]",
    SensorLoss "sensor-loss" SensorLoss:
        "this axis's sensors fell silent for 50 ms: see whether the rig still sends them",
    LimitExceeded "limit-exceeded" LimitExceeded:
        "this axis's force or a chamber's pressure was beyond its sensor's range for half a second: look for a \
         blocked axis, too high a supply, or a broken sensor",
    ControllerFault "controller-fault" ControllerFault: "the algorithm returned NaN or infinity, or exceeded its time limit",
}

impl Fault {
    /// Whether what caused the fault is over, so that a release may be taken.
    ///
    /// What a person must judge (time-outs, limits, the algorithm) is over when that person releases.
    pub(crate) const fn is_over(self, partner_fresh: bool, sensors_fresh: bool) -> bool {
        sensors_fresh && (partner_fresh || !matches!(self.reason(), EmergencyStopReason::PartnerLost))
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
