//! Ours against the reference, pair by pair: the median ratio with an interval that needs no distribution.
//!
//! A pair is a run with the reference measured right beside it, so that what the machine did in those minutes is in both. What is
//! reported of the ratios is their [`median`].

use super::kinds::{ROUND_TRIPS, WAKE_UP};
use super::model::{Ratio, RunPart};
use super::reference;
use super::samples::Pick;
use figures::median::{Median, median};

/// What is set against what: our distribution, percentile, the reference's distribution.
const COMPARED: [(&str, &str, Pick, &str); 6] = [
    (WAKE_UP, "p50", |reported| reported.p50, reference::TAG),
    (WAKE_UP, "p99", |reported| reported.p99, reference::TAG),
    (ROUND_TRIPS[0], "p50", |reported| reported.p50, "ping-pong-bus"),
    // Like for like: both end when the answer has arrived.
    (ROUND_TRIPS[0], "p50", |reported| reported.p50, "ping-pong-bus-to-arrival"),
    (ROUND_TRIPS[0], "p50", |reported| reported.p50, "ping-pong-embedded"),
    (ROUND_TRIPS[0], "p50", |reported| reported.p50, "ping-pong-socketpair"),
];

/// Names of all ratios that there can be.
pub(crate) fn names() -> impl Iterator<Item = String> {
    COMPARED.iter().map(|(tag, percentile, _, theirs)| format!("{tag} {percentile} / {theirs} {percentile}"))
}

/// The ratios of all runs that have a reference beside them.
pub(crate) fn ratios(runs: &[RunPart]) -> Vec<Ratio> {
    let mut ratios = Vec::new();
    for ((tag, _, of, theirs), name) in COMPARED.into_iter().zip(names()) {
        let pair = |run: &RunPart| {
            let ours = of(run.percentiles_ns.get(tag)?)?;
            let theirs = of(run.percentiles_ns.get(theirs)?)?;
            (theirs > 0).then_some((ours, theirs))
        };
        ratios.extend(ratio(name, runs.iter().filter_map(pair).collect()));
    }
    ratios
}

/// The name of a ratio in a threshold file: `emulator-wakeup.p50` for `emulator-wakeup p50 / cyclictest p50`, and
/// `drive-round-trip.p50/ping-pong-bus` for one against another reference.
pub(crate) fn short_name(name: &str) -> String {
    let (ours, theirs) = name.split_once(" / ").unwrap_or((name, reference::TAG));
    let ours = ours.replace(' ', ".");
    let theirs = theirs.split(' ').next().unwrap_or(theirs);
    if theirs == reference::TAG { ours } else { format!("{ours}/{theirs}") }
}

/// The ratio of these pairs, ours first; nothing without a pair.
pub(crate) fn ratio(name: String, pairs_ns: Vec<(u64, u64)>) -> Option<Ratio> {
    let ratios = pairs_ns.iter().map(|(ours, theirs)| *ours as f64 / *theirs as f64).collect();
    let Median { value, interval, confidence } = median(ratios)?;
    Some(Ratio { name, pairs_ns, median: value, interval, confidence })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PercentilesNs;
    use crate::{made_up, parts};

    #[test]
    fn ten_pairs_give_the_second_and_the_ninth() {
        let pairs = (1..=10).rev().map(|n| (n * 100, 1000)).collect();
        let reported = ratio("a p50 / b p50".into(), pairs).unwrap();
        assert!((reported.median - 0.55).abs() < 1e-12);
        assert_eq!(reported.interval, Some((0.2, 0.9)));
        assert!((reported.confidence.unwrap() - 0.978_515_625).abs() < 1e-12);
        assert_eq!(short_name("a p50 / cyclictest p50"), "a.p50");
        assert_eq!(short_name("a p50 / ping-pong-bus p50"), "a.p50/ping-pong-bus");
    }

    #[test]
    fn round_trips_are_held_against_the_ping_pongs_of_their_own_run() {
        let run = |ours: Option<u64>, bus: Option<u64>| {
            let reported = |p50: Option<u64>| PercentilesNs { p50, count: 1, ..PercentilesNs::default() };
            let of = [
                ("drive-round-trip", ours),
                ("ping-pong-bus", bus),
                ("ping-pong-bus-to-arrival", bus.map(|ns| ns - 10)),
            ];
            let of = of.map(|(tag, p50)| (tag.to_owned(), reported(p50)));
            parts::part(&made_up::run(10), None, of.into())
        };
        let reported = ratios(&[run(Some(60), Some(40)), run(Some(90), Some(30)), run(Some(70), None)]);
        let reported: Vec<_> =
            reported.iter().map(|ratio| (ratio.name.as_str(), ratio.pairs_ns.clone())).collect();
        assert_eq!(
            reported,
            [
                ("drive-round-trip p50 / ping-pong-bus p50", vec![(60, 40), (90, 30)]),
                ("drive-round-trip p50 / ping-pong-bus-to-arrival p50", vec![(60, 30), (90, 20)]),
            ]
        );
    }

    #[test]
    fn few_pairs_have_a_median_and_no_interval() {
        let reported = ratio("x".into(), vec![(3, 2), (5, 2), (4, 2)]).unwrap();
        assert_eq!((reported.median, reported.interval, reported.confidence), (2.0, None, None));
        assert!(ratio("x".into(), vec![]).is_none());
    }
}
