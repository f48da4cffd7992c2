//! Events of a run: as the 1 ms path of the emulator notes them, as `summary.json` lists them and as the telemetry sends them.
//!
//! In the emulator the mark of a fault is a small copy, whose text is made when the event is written. Files and viewers read
//! [`FaultMark`]. In JSON a kind without details is its name in kebab case, another one an object of its name and its details:
//! `"linked"`, `{"weights":{"added_mass_kg":2.5}}`.

use crate::axis::Axis;
use protocol::commands::STALE_AFTER_CYCLES;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An event with its message; no error, which is `thiserror`'s word for it. `M` is the mark of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[error("cycle {cycle}: {kind}")]
pub struct Event<M = FaultMark> {
    /// The rig's cycle in which it was noticed.
    pub cycle: u64,
    /// What happened.
    pub kind: EventKind<M>,
}

/// The kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind<M = FaultMark> {
    /// The emulator woke late: the cycles it had missed were computed, and no frames of them were sent.
    #[error("woke late, {cycles} cycle(s) computed but not sent")]
    Skipped {
        /// Cycles that were computed and not sent.
        cycles: u64,
    },
    /// No fresh command of the axis for 20 cycles; its valve is shut.
    #[error("no fresh {} command for {STALE_AFTER_CYCLES} cycles, valve shut; is its controller running?", .0.name())]
    CommandStale(Axis),
    /// Fresh commands of the axis after stale ones.
    #[error("fresh {} commands again, valve follows", .0.name())]
    CommandFresh(Axis),
    /// Two senders on the command of the axis; its valve is shut.
    #[error("fault two-sources: two senders on the {} command, valve shut; stop one of them", .0.name())]
    TwoSources(Axis),
    /// One of two senders has been silent for 20 cycles.
    #[error("one sender left on the {} command, valve follows", .0.name())]
    OneSource(Axis),
    /// The emergency stop tripped.
    #[error("emergency stop")]
    EmergencyStop,
    /// The emergency stop was released.
    #[error("emergency stop released")]
    EmergencyStopReleased,
    /// The rig released its emergency stop, and another node still holds it.
    #[error("the rig released its emergency stop; another still holds it")]
    EmergencyStopStillHeld,
    /// The rods were linked.
    #[error("rods linked")]
    Linked,
    /// The rods were parted.
    #[error("rods parted")]
    Unlinked,
    /// The load eye was not within the gap of the carriage.
    #[error("link refused: the load eye is not within the gap of the carriage")]
    LinkRefused,
    /// No attempt to link succeeded in the time that the experiment gives it.
    #[error("link given up: the load eye never came within the gap of the carriage")]
    LinkGivenUp,
    /// Weights were put on the carriage or taken off.
    #[error("weights on the carriage: {added_mass_kg} kg")]
    Weights {
        /// Mass of all weights on the carriage, kg.
        added_mass_kg: f64,
    },
    /// More weights than the rig file allows.
    #[error("weights refused: more than mass.added_limit_kg of the rig file")]
    WeightsRefused,
    /// The hand of the console pushes otherwise than before.
    #[error("the console's hand pushes the carriage with {carriage_n} N, the load eye with {load_eye_n} N")]
    ConsoleHand {
        /// Force on the carriage in +x, N.
        carriage_n: f64,
        /// Force on the load eye in +x, N.
        load_eye_n: f64,
    },
    /// The first frame of the run that is not as `rig.dbc` says.
    #[error(
        "a frame with identifier {raw_id:#05x} is not as rig.dbc says and was ignored; more are counted silently"
    )]
    Malformed {
        /// Identifier with the kernel's flags.
        raw_id: u32,
    },
    /// The first frame of the run from elsewhere that only the rig sends.
    #[error("frame {id:#05x} came from elsewhere: another rig is on this bus; stop one of them")]
    SecondRig {
        /// Identifier of the frame.
        id: u16,
    },
    /// A fault began, ended, or did not begin.
    #[error("{0}")]
    Fault(M),
    /// The plant's state is no longer finite; the run ends in silence.
    #[error("fault not-finite: the plant's state is no longer finite")]
    NotFinite,
    /// The bus is gone.
    #[error("the bus is gone; trying to come back")]
    BusLost,
    /// The bus is there again after a loss.
    #[error("the bus is back")]
    BusBack,
}

impl<M> EventKind<M> {
    /// Whether the flight recorder saves the seconds before it.
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

/// A fault on purpose that began, ended, or did not begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultMark {
    /// Number of the fault in this run; those of the script are first, from 1.
    pub number: u16,
    /// Whether it began, ended or did not begin.
    pub what: FaultChange,
    /// Name in the table of faults.
    pub fault: String,
    /// Place, one of those that the table lists for the fault.
    pub at: String,
    /// Numbers of the fault by key, in the units of the table.
    pub numbers: BTreeMap<String, f64>,
    /// Line of the script or console, for a person.
    pub cause: String,
}

/// Change of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultChange {
    /// It acts from this cycle on.
    Begins,
    /// It acts no more.
    Ends,
    /// Its time passed, and its condition never held.
    NeverBegan,
    /// It could not be put into the run.
    Refused,
}

impl FaultChange {
    /// As in `faults.csv`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Begins => "begins",
            Self::Ends => "ends",
            Self::NeverBegan => "never-began",
            Self::Refused => "refused",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_read_from_the_json_that_it_is_written_as() {
        let mark = FaultMark {
            number: 3,
            what: FaultChange::NeverBegan,
            fault: "sensor-offset".into(),
            at: "drive.a".into(),
            numbers: [("offset_pa".into(), -2e4), ("after_s".into(), 0.1)].into(),
            cause: "script line 7".into(),
        };
        let fault = r#"{"fault":{"number":3,"what":"never-began","fault":"sensor-offset","at":"drive.a","#
            .to_owned()
            + r#""numbers":{"after_s":0.1,"offset_pa":-20000.0},"cause":"script line 7"}}"#;
        let kinds = [
            (EventKind::Skipped { cycles: 3 }, r#"{"skipped":{"cycles":3}}"#),
            (EventKind::CommandStale(Axis::Drive), r#"{"command-stale":"drive"}"#),
            (EventKind::CommandFresh(Axis::Load), r#"{"command-fresh":"load"}"#),
            (EventKind::TwoSources(Axis::Drive), r#"{"two-sources":"drive"}"#),
            (EventKind::OneSource(Axis::Load), r#"{"one-source":"load"}"#),
            (EventKind::EmergencyStop, r#""emergency-stop""#),
            (EventKind::EmergencyStopReleased, r#""emergency-stop-released""#),
            (EventKind::EmergencyStopStillHeld, r#""emergency-stop-still-held""#),
            (EventKind::Linked, r#""linked""#),
            (EventKind::Unlinked, r#""unlinked""#),
            (EventKind::LinkRefused, r#""link-refused""#),
            (EventKind::LinkGivenUp, r#""link-given-up""#),
            (EventKind::Weights { added_mass_kg: 2.5 }, r#"{"weights":{"added_mass_kg":2.5}}"#),
            (EventKind::WeightsRefused, r#""weights-refused""#),
            (
                EventKind::ConsoleHand { carriage_n: 10.0, load_eye_n: -0.5 },
                r#"{"console-hand":{"carriage_n":10.0,"load_eye_n":-0.5}}"#,
            ),
            (EventKind::Malformed { raw_id: 0x8000_0001 }, r#"{"malformed":{"raw_id":2147483649}}"#),
            (EventKind::SecondRig { id: 0x110 }, r#"{"second-rig":{"id":272}}"#),
            (EventKind::Fault(mark), &fault),
            (EventKind::NotFinite, r#""not-finite""#),
            (EventKind::BusLost, r#""bus-lost""#),
            (EventKind::BusBack, r#""bus-back""#),
        ];
        assert_eq!(FaultChange::NeverBegan.name(), "never-began");
        for (kind, json) in kinds {
            let event = Event { cycle: 1005, kind };
            let text = format!("{{\"cycle\":1005,\"kind\":{json}}}");
            assert_eq!(serde_json::to_string(&event).unwrap(), text);
            assert_eq!(serde_json::from_str::<Event>(&text).unwrap(), event);
        }
    }
}
