//! The distributions that a report knows: tag, where it comes from, what it is. The only place where they stand.

use super::model::Source;
use super::reference;
use runlog::Axis;
use runlog::process::Process;

/// What follows the process in a tag: emulator-, controller-, controller-drive-, controller-load-.
const OF_A_PROCESS: [(&str, &str); 7] = [
    ("wakeup", "Wake-up latency against the scheduled time, missed cycles included"),
    ("receive", "Stage that takes frames"),
    ("step", "Stage that computes"),
    ("send", "Stage that sends frames"),
    ("execution", "Execution time of a cycle, from waking to done"),
    ("completion", "Cycle completion, from the scheduled time to done"),
    ("period-error", "Difference of two wake-ups from the period"),
];

/// Ping-pongs that `scripts/latency` sets beside a run: its name for each, and what it is.
pub(crate) const PING_PONGS: [(&str, &str); 3] = [
    ("bus", "on the same bus"),
    ("embedded", "on the embedded bus"),
    ("socketpair", "on a bare pair of sockets"),
];
/// What begins the tag of a ping-pong.
pub const PING_PONG: &str = "ping-pong-";
/// What ends the tag of one that is measured to the answer's arrival, as the rig's round trip is.
pub const TO_ARRIVAL: &str = "-to-arrival";

/// Tag of the rig's wake-up latency.
pub const WAKE_UP: &str = "emulator-wakeup";
/// Tags of the round trips, the drive's and the load's.
pub const ROUND_TRIPS: [&str; 2] = ["drive-round-trip", "load-round-trip"];

/// What follows the axis in a tag: drive-, load-.
const OF_AN_AXIS: [(&str, Source, &str); 4] = [
    ("round-trip", Source::Emulator, "Sensors sent to the command that answers them received"),
    ("command-age", Source::Emulator, "Sensors sent to their command applied: command age in ns"),
    ("rig-to-controller", Source::Joined, "Bus latency one way, sensors from rig to controller"),
    ("controller-to-rig", Source::Joined, "Bus latency one way, command from controller to rig"),
];

const PROCESSES: [(Process, Source, &str); 4] = [
    (Process::Emulator, Source::Emulator, "emulator"),
    (Process::ControllerOf(Axis::Drive), Source::Controller, "drive controller"),
    (Process::ControllerOf(Axis::Load), Source::Controller, "load controller"),
    (Process::Controller, Source::Controller, "controller"),
];

/// A distribution that a report knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kind {
    /// Its name in logs and reports, such as `emulator-wakeup`.
    pub tag: String,
    /// Which process measures it.
    pub source: Source,
    /// What it is, in words.
    pub about: String,
}

/// All kinds, in the order in which a report shows them.
pub fn all() -> Vec<Kind> {
    let reference = Kind {
        tag: reference::TAG.into(),
        source: Source::Reference,
        about: "cyclictest beside the runs: wake-up latency of its timer thread".into(),
    };
    let mut kinds = Vec::new();
    for (process, source, who) in PROCESSES {
        for (what, about) in OF_A_PROCESS {
            let about = if process == Process::Emulator || what != "wakeup" {
                format!("{about} ({who})")
            } else {
                format!("From the arrival of the sensors to waking ({who})")
            };
            kinds.push(Kind { tag: format!("{}-{what}", process.name()), source, about });
        }
    }
    for axis in Axis::NAMES {
        for (what, source, about) in OF_AN_AXIS {
            kinds.push(Kind {
                tag: format!("{axis}-{what}"),
                source,
                about: format!("{about} ({axis} axis)"),
            });
        }
    }
    // The reference follows the wake-up it is compared with.
    kinds.insert(1, reference);
    let after =
        kinds.iter().position(|kind| kind.tag == ROUND_TRIPS[0]).map_or(kinds.len(), |place| place + 1);
    kinds.splice(after..after, ping_pongs());
    kinds
}

fn ping_pongs() -> impl Iterator<Item = Kind> {
    let ends = [
        ("", "16 bytes there and back, the answer read"),
        (
            TO_ARRIVAL,
            "16 bytes there and back, to the answer's arrival at the queue, as the rig's round trip",
        ),
    ];
    PING_PONGS.into_iter().flat_map(move |(name, place)| {
        ends.map(|(end, what)| Kind {
            tag: format!("{PING_PONG}{name}{end}"),
            source: Source::Reference,
            about: format!("Ping-pong beside the runs, {place}: {what}"),
        })
    })
}

/// The kind of a tag; one that is not known is shown after the others, with its tag for a name.
pub fn of(tag: &str) -> Kind {
    all().into_iter().find(|kind| kind.tag == tag).unwrap_or_else(|| {
        let prefix = |(process, source, _): &(Process, Source, &str)| {
            tag.starts_with(process.name()).then_some(*source)
        };
        let foreign = if tag.starts_with(PING_PONG) { Source::Reference } else { Source::Emulator };
        let source = PROCESSES.iter().find_map(prefix).unwrap_or(foreign);
        Kind { tag: tag.into(), source, about: tag.replace('-', " ") }
    })
}

/// Where a tag stands in a report.
pub fn place(tag: &str) -> usize {
    all().iter().position(|kind| kind.tag == tag).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_known_once_and_foreign_ones_are_shown_last() {
        let kinds = all();
        let mut tags: Vec<_> = kinds.iter().map(|kind| &kind.tag).collect();
        tags.sort();
        tags.dedup();
        assert_eq!(tags.len(), kinds.len());
        assert!([WAKE_UP].iter().chain(&ROUND_TRIPS).all(|tag| place(tag) < kinds.len()));
        assert_eq!(of("controller-load-step").source, Source::Controller);
        assert_eq!(of("load-rig-to-controller").source, Source::Joined);
        assert_eq!(of("controller-of-somebody").source, Source::Controller);
        assert!(place("controller-of-somebody") > place("drive-round-trip"));
        assert_eq!(of("ping-pong-bus-to-arrival").source, Source::Reference);
        assert_eq!(place("ping-pong-bus"), place("drive-round-trip") + 1);
    }
}
