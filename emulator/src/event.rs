//! Events of the 1 ms path: small copies without allocation; the writer thread formats them.

use crate::faults::mark::Mark;
use plant::scene::{HandForces, Outcome};
use runlog::Axis;
use runlog::event;

pub(crate) type Event = event::Event<Mark>;
pub(crate) type EventKind = event::EventKind<Mark>;

pub(crate) fn of_outcome(outcome: Outcome) -> EventKind {
    match outcome {
        Outcome::Stopped => EventKind::EmergencyStop,
        Outcome::Released => EventKind::EmergencyStopReleased,
        Outcome::StillHeld => EventKind::EmergencyStopStillHeld,
        Outcome::Linked => EventKind::Linked,
        Outcome::LinkRefused => EventKind::LinkRefused,
        Outcome::LinkGivenUp => EventKind::LinkGivenUp,
        Outcome::Unlinked => EventKind::Unlinked,
        Outcome::Weights { added_mass_kg } => EventKind::Weights { added_mass_kg },
        Outcome::WeightsRefused => EventKind::WeightsRefused,
    }
}

/// The event for a changed force of the console's hand.
pub(crate) fn of_hand(HandForces { carriage_n, load_eye_n }: HandForces) -> EventKind {
    EventKind::ConsoleHand { carriage_n, load_eye_n }
}

pub(crate) fn axis_of(axis: plant::Axis) -> Axis {
    match axis {
        plant::Axis::Drive => Axis::Drive,
        plant::Axis::Load => Axis::Load,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::Fault;
    use crate::faults::mark::Cause;
    use runlog::event::FaultChange;

    #[test]
    fn each_kind_is_recorded_as_itself() {
        let kinds = [
            EventKind::Skipped { cycles: 3 },
            EventKind::CommandStale(Axis::Drive),
            EventKind::CommandFresh(Axis::Load),
            EventKind::TwoSources(Axis::Load),
            EventKind::OneSource(Axis::Drive),
            EventKind::EmergencyStop,
            EventKind::EmergencyStopReleased,
            EventKind::EmergencyStopStillHeld,
            EventKind::Linked,
            EventKind::Unlinked,
            EventKind::LinkRefused,
            EventKind::LinkGivenUp,
            EventKind::Weights { added_mass_kg: 2.5 },
            EventKind::WeightsRefused,
            EventKind::ConsoleHand { carriage_n: 1.0, load_eye_n: 2.0 },
            EventKind::Malformed { raw_id: 7 },
            EventKind::SecondRig { id: 0x110 },
            EventKind::NotFinite,
            EventKind::BusLost,
            EventKind::BusBack,
        ];
        for kind in kinds {
            let written = serde_json::to_string(&kind).unwrap();
            let read: event::EventKind = serde_json::from_str(&written).unwrap();
            assert_eq!(format!("{read:?}"), format!("{kind:?}"));
        }
        let fault = Fault::new("babbling-node", None, &[]).unwrap();
        let mark = Mark { number: 3, what: FaultChange::Ends, fault, cause: Cause::Console };
        let json = serde_json::to_string(&EventKind::Fault(mark)).unwrap();
        let numbers = r#"{"bytes":8.0,"frames_per_ms":3.0,"id":16.0}"#;
        let expected = r#"{"fault":{"number":3,"what":"ends","fault":"babbling-node","at":"bus","numbers":"#;
        assert_eq!(json, format!(r#"{expected}{numbers},"cause":"console"}}}}"#));
    }
}
