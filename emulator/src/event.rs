//! What a run has to tell a person, each with its cycle.

use crate::faults::mark::Mark;
use plant::Axis;
use plant::scene::{HandForces, Outcome};
use serde::Serialize;

/// Something that happened in a cycle, with its message; no error, which is `thiserror`'s word for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, thiserror::Error)]
#[error("cycle {cycle}: {kind}")]
pub struct Event {
    /// Cycle in which it was noticed.
    pub cycle: u64,
    pub kind: EventKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    #[error("woke late, {cycles} cycle(s) computed but not sent")]
    Skipped { cycles: u64 },
    #[error("no fresh {} command for 20 cycles, valve shut; is its controller running?", .0.name())]
    CommandStale(#[serde(serialize_with = "axis_name")] Axis),
    #[error("fresh {} commands again, valve follows", .0.name())]
    CommandFresh(#[serde(serialize_with = "axis_name")] Axis),
    #[error("fault two-sources: two senders on the {} command, valve shut; stop one of them", .0.name())]
    TwoSources(#[serde(serialize_with = "axis_name")] Axis),
    /// The other has been silent for 20 cycles.
    #[error("one sender left on the {} command, valve follows", .0.name())]
    OneSource(#[serde(serialize_with = "axis_name")] Axis),
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

fn axis_name<S: serde::Serializer>(axis: &Axis, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(axis.name())
}
