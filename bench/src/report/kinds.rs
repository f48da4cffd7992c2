//! The distributions that a report knows: tag, where it comes from, what it is. The only place where they stand.

use super::model::Source;
use super::reference;

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

/// What follows the axis in a tag: drive-, load-.
const OF_AN_AXIS: [(&str, Source, &str); 4] = [
    ("round-trip", Source::Emulator, "Sensors sent to the command that answers them received"),
    ("command-age", Source::Emulator, "Sensors sent to their command applied: command age in ns"),
    ("rig-to-controller", Source::Joined, "Bus latency one way, sensors from rig to controller"),
    ("controller-to-rig", Source::Joined, "Bus latency one way, command from controller to rig"),
];

const PROCESSES: [(&str, Source, &str); 4] = [
    ("emulator", Source::Emulator, "emulator"),
    ("controller-drive", Source::Controller, "drive controller"),
    ("controller-load", Source::Controller, "load controller"),
    ("controller", Source::Controller, "controller"),
];

/// One kind of distribution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kind {
    /// Its tag.
    pub tag: String,
    /// Where it comes from.
    pub source: Source,
    /// What it is, for a person.
    pub about: String,
}

/// All kinds, in the order in which a report shows them.
#[must_use]
pub fn all() -> Vec<Kind> {
    let reference = Kind {
        tag: reference::TAG.into(),
        source: Source::Reference,
        about: "cyclictest beside the runs: wake-up latency of its timer thread".into(),
    };
    let mut kinds = Vec::new();
    for (process, source, who) in PROCESSES {
        for (what, about) in OF_A_PROCESS {
            let about = if process == "emulator" || what != "wakeup" {
                format!("{about} ({who})")
            } else {
                format!("From the arrival of the sensors to waking ({who})")
            };
            kinds.push(Kind { tag: format!("{process}-{what}"), source, about });
        }
    }
    for axis in ["drive", "load"] {
        for (what, source, about) in OF_AN_AXIS {
            kinds.push(Kind {
                tag: format!("{axis}-{what}"),
                source,
                about: format!("{about} ({axis} axis)"),
            });
        }
    }
    // What is set beside each other stands beside each other.
    kinds.insert(1, reference);
    kinds
}

/// The kind of a tag; one that is not known is shown after the others, with its tag for a name.
#[must_use]
pub fn of(tag: &str) -> Kind {
    let known = all().into_iter().find(|kind| kind.tag == tag);
    known.unwrap_or_else(|| {
        let prefix =
            |(process, source, _): &(&str, Source, &str)| tag.starts_with(process).then_some(*source);
        let source = PROCESSES.iter().find_map(prefix).unwrap_or(Source::Emulator);
        Kind { tag: tag.into(), source, about: tag.replace('-', " ") }
    })
}

/// Where a tag stands in a report.
#[must_use]
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
        assert_eq!(of("controller-load-step").source, Source::Controller);
        assert_eq!(of("load-rig-to-controller").source, Source::Joined);
        assert_eq!(of("controller-of-somebody").source, Source::Controller);
        assert!(place("controller-of-somebody") > place("drive-round-trip"));
    }
}
