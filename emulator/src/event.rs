//! What a run has to tell a person, each with its cycle.

use crate::faults::mark::Mark;
use plant::Axis;
use plant::scene::{HandForces, Outcome};
use serde::Serialize;
use std::fmt;

/// Something that happened in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Cycle in which it was noticed.
    pub cycle: u64,
    /// What happened.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// The loop woke late: so many cycles were computed without being sent.
    Skipped {
        /// Number of cycles.
        cycles: u64,
    },
    /// No fresh command for 20 cycles: valve shut.
    CommandStale(#[serde(serialize_with = "axis_name")] Axis),
    /// Fresh commands again.
    CommandFresh(#[serde(serialize_with = "axis_name")] Axis),
    /// Two senders on one command identifier: valve shut.
    TwoSources(#[serde(serialize_with = "axis_name")] Axis),
    /// One of them has been silent for 20 cycles.
    OneSource(#[serde(serialize_with = "axis_name")] Axis),
    /// Somebody tripped the emergency stop.
    EmergencyStop,
    /// Somebody released it.
    EmergencyStopReleased,
    /// The rig released its own stop, and somebody else holds it still.
    EmergencyStopStillHeld,
    /// The rods were linked.
    Linked,
    /// The rods were parted.
    Unlinked,
    /// Linking was refused because the eye is not within the gap.
    LinkRefused,
    /// No try at linking succeeded in the time that the experiment gives it.
    LinkGivenUp,
    /// Weights were put on the carriage or taken off.
    Weights {
        /// Weights in all, kg.
        added_mass_kg: f64,
    },
    /// Weights that the rig file does not allow were asked for.
    WeightsRefused,
    /// The console's hand pushes otherwise than before.
    ConsoleHand {
        /// In +x on the carriage, N.
        carriage_n: f64,
        /// In +x on the load's eye, N.
        load_eye_n: f64,
    },
    /// A frame that `rig.dbc` does not allow was ignored; only the first of a kind is reported.
    Malformed {
        /// Its identifier with the kernel's flags.
        raw_id: u32,
    },
    /// A frame arrived that only a rig sends: there is a second rig on the bus.
    SecondRig { id: u16 },
    /// A fault was put into the run, ended, or could not be.
    Fault(Mark),
    /// The plant's state is no longer finite: the run ends in silence.
    NotFinite,
    /// The bus went away.
    BusLost,
    /// The bus came back.
    BusBack,
}

impl EventKind {
    /// Whether it is a fault, of which one wants to know what was going on before.
    #[must_use]
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

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cycle {}: {}", self.cycle, self.kind)
    }
}

impl fmt::Display for EventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Skipped { cycles } => write!(f, "woke late, {cycles} cycle(s) computed but not sent"),
            Self::CommandStale(axis) => write!(
                f,
                "no fresh {} command for 20 cycles, valve shut; is its controller running?",
                axis.name()
            ),
            Self::CommandFresh(axis) => write!(f, "fresh {} commands again, valve follows", axis.name()),
            Self::TwoSources(axis) => write!(
                f,
                "fault two-sources: two senders on the {} command, valve shut; stop one of them",
                axis.name()
            ),
            Self::OneSource(axis) => {
                write!(f, "one sender left on the {} command, valve follows", axis.name())
            }
            Self::EmergencyStop => write!(f, "emergency stop"),
            Self::EmergencyStopReleased => write!(f, "emergency stop released"),
            Self::EmergencyStopStillHeld => {
                write!(f, "the rig released its emergency stop; another still holds it")
            }
            Self::Linked => write!(f, "rods linked"),
            Self::Unlinked => write!(f, "rods parted"),
            Self::LinkRefused => {
                write!(f, "link refused: the load eye is not within the gap of the carriage")
            }
            Self::LinkGivenUp => {
                write!(f, "link given up: the load eye never came within the gap of the carriage")
            }
            Self::Weights { added_mass_kg } => write!(f, "weights on the carriage: {added_mass_kg} kg"),
            Self::WeightsRefused => {
                write!(f, "weights refused: more than mass.added_limit_kg of the rig file")
            }
            Self::ConsoleHand { carriage_n, load_eye_n } => {
                write!(
                    f,
                    "the console's hand pushes the carriage with {carriage_n} N, the load eye with {load_eye_n} N"
                )
            }
            Self::Malformed { raw_id } => write!(
                f,
                "a frame with identifier {raw_id:#05x} is not as rig.dbc says and was ignored; more are counted silently"
            ),
            Self::SecondRig { id } => {
                write!(f, "frame {id:#05x} came from elsewhere: another rig is on this bus; stop one of them")
            }
            Self::Fault(mark) => write!(f, "{mark}"),
            Self::NotFinite => write!(f, "fault not-finite: the plant's state is no longer finite"),
            Self::BusLost => write!(f, "the bus is gone; trying to come back"),
            Self::BusBack => write!(f, "the bus is back"),
        }
    }
}
