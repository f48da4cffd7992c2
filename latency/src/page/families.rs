//! Which distributions stand in one chart and under one heading, and which reference beside them.
//!
//! Ours are recognised by the end of their tag (`emulator-wakeup`, `drive-round-trip`), a reference by the program that measured
//! it: cyclictest waits for a time as our loops do, a ping-pong sends there and back as a round trip does.

use crate::files::EMULATOR;
use crate::model::{Distribution, Source};
use pagekit::svg::CurveStyle;

/// Distributions that answer one question.
pub(super) struct Family<'a> {
    pub(super) identifier: String,
    pub(super) title: String,
    /// What its numbers are, in a sentence.
    pub(super) about: &'static str,
    /// The distributions with their styles, ours first.
    pub(super) members: Vec<(CurveStyle, &'a Distribution)>,
}

/// Order, heading, meaning.
const KINDS: [(Kind, &str, &str); 7] = [
    (
        Kind::Wakeup,
        "Wake-up latency",
        "From the scheduled time to the thread running; missed cycles are in it too.",
    ),
    (
        Kind::RoundTrip,
        "Round trip",
        "From handing the sensors to the bus to the arrival of the command that answers them.",
    ),
    (Kind::OneWay, "One way", "From handing a frame to the bus in one process to its arrival in the other."),
    (
        Kind::Age,
        "Command age",
        "From handing the sensors to the bus to the start of the cycle in which the answering command acts.",
    ),
    (Kind::Stages, "Stages of a cycle", "Length of each stage, and of all from waking to done."),
    (Kind::Cycle, "Completion and period", "From the scheduled time to done; and the error of the period."),
    (Kind::Other, "Other lengths of time", "What else was measured."),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Wakeup,
    RoundTrip,
    OneWay,
    Age,
    Stages,
    Cycle,
    Other,
}

fn kind(distribution: &Distribution) -> Kind {
    let name = distribution.name.as_str();
    let ends = |ends: &[&str]| ends.iter().any(|end| name.ends_with(end));
    match name {
        _ if name.contains("ping-pong") => Kind::RoundTrip,
        _ if distribution.source == Source::Reference => Kind::Wakeup,
        _ if ends(&["wakeup"]) => Kind::Wakeup,
        _ if ends(&["round-trip"]) => Kind::RoundTrip,
        _ if ends(&["rig-to-controller", "controller-to-rig"]) => Kind::OneWay,
        _ if ends(&["command-age"]) => Kind::Age,
        _ if ends(&["-receive", "-step", "-send", "-execution"]) => Kind::Stages,
        _ if ends(&["-completion", "-period-error"]) => Kind::Cycle,
        _ => Kind::Other,
    }
}

/// The process of a stage's tag.
fn process(name: &str) -> &str {
    name.rsplit_once('-').map_or(name, |(process, _)| process)
}

/// The families that have a member, in the order of the page. The stages stand apart for each process: side by side a chart
/// would hold a dozen lines.
pub(super) fn families(distributions: &[Distribution]) -> Vec<Family<'_>> {
    let mut found = Vec::new();
    for (wanted, title, about) in KINDS {
        let members: Vec<_> = distributions.iter().filter(|one| kind(one) == wanted).collect();
        if wanted != Kind::Stages {
            found.push((title.to_owned(), about, members));
            continue;
        }
        let mut processes: Vec<_> = members.iter().map(|one| process(&one.name)).collect();
        processes.sort_unstable();
        processes.dedup();
        // The rig first.
        processes.sort_by_key(|process| *process != EMULATOR);
        for name in processes {
            let stages = members.iter().copied().filter(|one| process(&one.name) == name).collect();
            found.push((format!("{title}: {name}"), about, stages));
        }
    }
    let non_empty = found.into_iter().filter(|(_, _, members)| !members.is_empty());
    let families = non_empty.enumerate().map(|(place, (title, about, members))| Family {
        identifier: format!("family-{place}"),
        title,
        about,
        members: styles(members),
    });
    families.collect()
}

/// Each member with its style, ours first.
fn styles(members: Vec<&Distribution>) -> Vec<(CurveStyle, &Distribution)> {
    let (references, ours): (Vec<_>, Vec<_>) =
        members.into_iter().partition(|one| one.source == Source::Reference);
    let ours = ours.into_iter().enumerate().map(|(place, one)| (CurveStyle::Ours(place), one));
    let references =
        references.into_iter().enumerate().map(|(place, one)| (CurveStyle::Reference(place), one));
    ours.chain(references).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, source: Source) -> Distribution {
        Distribution { name: name.into(), source, ..Distribution::default() }
    }

    #[test]
    fn every_distribution_has_its_place_and_the_reference_beside_ours() {
        let all = [
            named("cyclictest", Source::Reference),
            named("controller-drive-step", Source::Controller),
            named("emulator-step", Source::Emulator),
            named("emulator-wakeup", Source::Emulator),
            named("ping-pong-bus", Source::Reference),
            named("drive-round-trip", Source::Emulator),
            named("load-rig-to-controller", Source::Joined),
            named("something-new", Source::Joined),
        ];
        let families = families(&all);
        let reported: Vec<_> = families
            .iter()
            .map(|family| {
                let members = family.members.iter().map(|(style, one)| (*style, one.name.as_str()));
                (family.title.as_str(), members.collect::<Vec<_>>())
            })
            .collect();
        let (ours, reference) = (CurveStyle::Ours(0), CurveStyle::Reference(0));
        assert_eq!(
            reported,
            [
                ("Wake-up latency", vec![(ours, "emulator-wakeup"), (reference, "cyclictest")]),
                ("Round trip", vec![(ours, "drive-round-trip"), (reference, "ping-pong-bus")]),
                ("One way", vec![(ours, "load-rig-to-controller")]),
                ("Stages of a cycle: emulator", vec![(ours, "emulator-step")]),
                ("Stages of a cycle: controller-drive", vec![(ours, "controller-drive-step")]),
                ("Other lengths of time", vec![(ours, "something-new")]),
            ]
        );
    }
}
