//! What a run has to tell a person, each with its cycle.
//!
//! These are the events of the 1 ms path: small copies without allocation. Files and telemetry have them as [`runlog::event`],
//! which the writer thread makes of them.

use crate::faults::mark::Mark;
use plant::Axis;
use plant::scene::{HandForces, Outcome};
use runlog::event as record;

/// Something that happened in a cycle, with its message; no error, which is `thiserror`'s word for it.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("cycle {cycle}: {kind}")]
pub struct Event {
    /// Cycle in which it was noticed.
    pub cycle: u64,
    pub kind: EventKind,
}

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EventKind {
    #[error("woke late, {cycles} cycle(s) computed but not sent")]
    Skipped { cycles: u64 },
    #[error("no fresh {} command for 20 cycles, valve shut; is its controller running?", .0.name())]
    CommandStale(Axis),
    #[error("fresh {} commands again, valve follows", .0.name())]
    CommandFresh(Axis),
    #[error("fault two-sources: two senders on the {} command, valve shut; stop one of them", .0.name())]
    TwoSources(Axis),
    /// The other has been silent for 20 cycles.
    #[error("one sender left on the {} command, valve follows", .0.name())]
    OneSource(Axis),
    #[error("emergency stop")]
    EmergencyStop,
    #[error("emergency stop released")]
    EmergencyStopReleased,
    #[error("the rig released its emergency stop; another still holds it")]
    EmergencyStopStillHeld,
    #[error("rods linked")]
    Linked,
    #[error("rods parted")]
    Unlinked,
    #[error("link refused: the load eye is not within the gap of the carriage")]
    LinkRefused,
    /// No try succeeded in the time that the experiment gives it.
    #[error("link given up: the load eye never came within the gap of the carriage")]
    LinkGivenUp,
    /// In all.
    #[error("weights on the carriage: {added_mass_kg} kg")]
    Weights { added_mass_kg: f64 },
    #[error("weights refused: more than mass.added_limit_kg of the rig file")]
    WeightsRefused,
    /// In +x, otherwise than before.
    #[error("the console's hand pushes the carriage with {carriage_n} N, the load eye with {load_eye_n} N")]
    ConsoleHand { carriage_n: f64, load_eye_n: f64 },
    /// Only the first of a kind is reported; the identifier has the kernel's flags.
    #[error(
        "a frame with identifier {raw_id:#05x} is not as rig.dbc says and was ignored; more are counted silently"
    )]
    Malformed { raw_id: u32 },
    #[error("frame {id:#05x} came from elsewhere: another rig is on this bus; stop one of them")]
    SecondRig { id: u16 },
    /// Put into the run, ended, or it could not be.
    #[error("{0}")]
    Fault(Mark),
    /// The run ends in silence.
    #[error("fault not-finite: the plant's state is no longer finite")]
    NotFinite,
    #[error("the bus is gone; trying to come back")]
    BusLost,
    #[error("the bus is back")]
    BusBack,
}

impl EventKind {
    /// Whether it is a fault, of which one wants to know what was going on before.
    pub fn is_fault(&self) -> bool {
        matches!(
            self,
            Self::TwoSources(_)
                | Self::CommandStale(_)
                | Self::NotFinite
                | Self::BusLost
                | Self::EmergencyStop
        )
    }
}

impl From<Outcome> for EventKind {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Stopped => Self::EmergencyStop,
            Outcome::Released => Self::EmergencyStopReleased,
            Outcome::StillHeld => Self::EmergencyStopStillHeld,
            Outcome::Linked => Self::Linked,
            Outcome::LinkRefused => Self::LinkRefused,
            Outcome::LinkGivenUp => Self::LinkGivenUp,
            Outcome::Unlinked => Self::Unlinked,
            Outcome::Weights { added_mass_kg } => Self::Weights { added_mass_kg },
            Outcome::WeightsRefused => Self::WeightsRefused,
        }
    }
}

impl From<HandForces> for EventKind {
    fn from(HandForces { carriage_n, load_eye_n }: HandForces) -> Self {
        Self::ConsoleHand { carriage_n, load_eye_n }
    }
}

impl From<Event> for record::Event {
    fn from(Event { cycle, kind }: Event) -> Self {
        Self { cycle, kind: kind.into() }
    }
}

impl From<EventKind> for record::EventKind {
    fn from(kind: EventKind) -> Self {
        match kind {
            EventKind::Skipped { cycles } => Self::Skipped { cycles },
            EventKind::CommandStale(axis) => Self::CommandStale(recorded(axis)),
            EventKind::CommandFresh(axis) => Self::CommandFresh(recorded(axis)),
            EventKind::TwoSources(axis) => Self::TwoSources(recorded(axis)),
            EventKind::OneSource(axis) => Self::OneSource(recorded(axis)),
            EventKind::EmergencyStop => Self::EmergencyStop,
            EventKind::EmergencyStopReleased => Self::EmergencyStopReleased,
            EventKind::EmergencyStopStillHeld => Self::EmergencyStopStillHeld,
            EventKind::Linked => Self::Linked,
            EventKind::Unlinked => Self::Unlinked,
            EventKind::LinkRefused => Self::LinkRefused,
            EventKind::LinkGivenUp => Self::LinkGivenUp,
            EventKind::Weights { added_mass_kg } => Self::Weights { added_mass_kg },
            EventKind::WeightsRefused => Self::WeightsRefused,
            EventKind::ConsoleHand { carriage_n, load_eye_n } => Self::ConsoleHand { carriage_n, load_eye_n },
            EventKind::Malformed { raw_id } => Self::Malformed { raw_id },
            EventKind::SecondRig { id } => Self::SecondRig { id },
            EventKind::Fault(mark) => Self::Fault(mark.into()),
            EventKind::NotFinite => Self::NotFinite,
            EventKind::BusLost => Self::BusLost,
            EventKind::BusBack => Self::BusBack,
        }
    }
}

fn recorded(axis: Axis) -> record::Axis {
    match axis {
        Axis::Drive => record::Axis::Drive,
        Axis::Load => record::Axis::Load,
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
            // Variants and fields have the same names in both.
            assert_eq!(format!("{:?}", record::EventKind::from(kind)), format!("{kind:?}"));
        }
        let fault = Fault::new("babbling-node", None, &[]).unwrap();
        let mark = Mark { number: 3, what: FaultChange::Ends, fault, cause: Cause::Console };
        let json = serde_json::to_string(&record::EventKind::from(EventKind::Fault(mark))).unwrap();
        let numbers = r#"{"bytes":8.0,"frames_per_ms":3.0,"id":16.0}"#;
        let expected = r#"{"fault":{"number":3,"what":"ends","fault":"babbling-node","at":"bus","numbers":"#;
        assert_eq!(json, format!(r#"{expected}{numbers},"cause":"console"}}}}"#));
    }
}
