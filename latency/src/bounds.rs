//! Bounds of a threshold file held against a report.
//!
//! ```toml
//! [bounds]
//! "emulator-wakeup.p99_ns" = { max = 50000 }
//! "ratio.emulator-wakeup.p50" = { max = 1.1 }                   # against cyclictest
//! "ratio.drive-round-trip.p50/ping-pong-bus" = { max = 1.5 }    # against another reference
//! "counts.skipped" = { max = 0 }
//! "findings.frame-loss" = { max = 0 }
//! ```
//!
//! Figures: a distribution of all runs with `p50_ns`, `p90_ns`, `p99_ns`, `p999_ns`, `p9999_ns`, `max_ns` or `count`; a ratio's
//! median; a count summed over the runs; how often a cause was found. A ratio whose interval crosses its bound neither keeps
//! nor breaks it ([`resolution`]). A figure that exists and was not measured breaks its bound; one that does not exist is an
//! error, which names those that do.

use super::kinds;
use super::model::{BoundResult, Cause, Distribution, PercentilesNs, Ratio, Report};
use super::ratios;
use super::resolution::{self, Verdict};
use serde_json::Value;
use settings::{Section, SettingsError, Source};
use std::path::Path;

/// Figures that a message names.
const NAMED: usize = 12;

/// The most that the text of a threshold file allows of a figure.
pub(crate) fn most(text: &str, figure: &str) -> Option<f64> {
    let source = Source::parse(text, Path::new("")).ok()?;
    source.root().section("bounds").ok()??.section(figure).ok()??.peek_number("max")
}

/// Judges a report by the text of a threshold file; `file` is for messages.
pub(crate) fn judge(text: &str, file: &Path, report: &Report) -> Result<Vec<BoundResult>, SettingsError> {
    let source = Source::parse(text, file)?;
    let mut root = source.root();
    let mut bounds = root.needed_section("bounds", "a line for each figure, as figure = { max = 50000 }")?;
    root.finish()?;
    let mut figures = bounds.keys();
    figures.sort_unstable();
    figures.iter().map(|figure| judge_bound(figure, &mut bounds, report)).collect()
}

fn judge_bound(
    figure: &str,
    bounds: &mut Section<'_>,
    report: &Report,
) -> Result<BoundResult, SettingsError> {
    let example = format!("\"{figure}\" = {{ max = 50000 }}, {{ min = 1 }} or with both");
    let bound = bounds.section_as(figure, Some(&example))?;
    let (min, max) = match bound {
        Some(mut bound) => {
            let sides = (bound.finite("min")?, bound.finite("max")?);
            bound.finish()?;
            sides
        }
        None => (None, None),
    };
    if min.is_none() && max.is_none() {
        return Err(bounds.refused(figure, &format!("write {example}")));
    }
    let value = value(figure, report).ok_or_else(|| bounds.wrong_at(figure, &unknown(figure, report)))?;
    let ratio = figure.strip_prefix("ratio.").and_then(|name| ratio(name, report));
    let verdict = match ratio {
        Some(ratio) => resolution::verdict(ratio, min, max),
        None if value.is_some_and(|value| {
            min.is_none_or(|min| value >= min) && max.is_none_or(|max| value <= max)
        }) =>
        {
            Verdict::Kept
        }
        None => Verdict::Broken,
    };
    let (resolved, pairs_to_resolve) = match verdict {
        Verdict::NotResolved { pairs } => (false, pairs),
        Verdict::Kept | Verdict::Broken => (true, None),
    };
    Ok(BoundResult {
        figure: figure.to_owned(),
        value,
        min,
        max,
        kept: verdict == Verdict::Kept,
        interval: ratio.and_then(|ratio| ratio.interval),
        resolved,
        pairs_to_resolve,
    })
}

/// The ratio of a name as [`ratios::short_name`] makes it.
fn ratio<'a>(name: &str, report: &'a Report) -> Option<&'a Ratio> {
    report.ratios.iter().find(|ratio| ratios::short_name(&ratio.name) == name)
}

/// The value of a figure: the inner nothing when it was not measured, the outer when there is none of that name.
fn value(figure: &str, report: &Report) -> Option<Option<f64>> {
    if let Some(name) = figure.strip_prefix("ratio.") {
        let known = ratios::names().any(|known| ratios::short_name(&known) == name);
        return ratio(name, report).map(|ratio| Some(ratio.median)).or(known.then_some(None));
    }
    if let Some(name) = figure.strip_prefix("counts.") {
        let counts: Vec<_> = report.runs.iter().filter_map(|run| run.counts.get(name)).collect();
        return (!counts.is_empty()).then(|| Some(counts.into_iter().sum::<u64>() as f64));
    }
    if let Some(name) = figure.strip_prefix("findings.") {
        let cause: Cause = serde_json::from_value(Value::String(name.to_owned())).ok()?;
        let found = report.findings.iter().find(|finding| finding.cause == cause);
        return Some(Some(found.map_or(0.0, |finding| finding.count as f64)));
    }
    let (tag, key) = figure.rsplit_once('.')?;
    let of = of_percentiles(key)?;
    let reported = report.distributions.iter().find(|distribution| distribution.name == tag);
    let known = || kinds::place(tag) != usize::MAX;
    reported.map(|reported| of(&reported.percentiles_ns)).or_else(|| known().then_some(None))
}

fn of_percentiles(key: &str) -> Option<fn(&PercentilesNs) -> Option<f64>> {
    Some(match key {
        "p50_ns" => |reported| reported.p50.map(|ns| ns as f64),
        "p90_ns" => |reported| reported.p90.map(|ns| ns as f64),
        "p99_ns" => |reported| reported.p99.map(|ns| ns as f64),
        "p999_ns" => |reported| reported.p999.map(|ns| ns as f64),
        "p9999_ns" => |reported| reported.p9999.map(|ns| ns as f64),
        "max_ns" => |reported| reported.max.map(|ns| ns as f64),
        "count" => |reported| Some(reported.count as f64),
        _ => return None,
    })
}

/// Names what there is, what looks most like the figure first.
fn unknown(figure: &str, report: &Report) -> String {
    const KEYS: [&str; 5] = ["p50_ns", "p99_ns", "p999_ns", "max_ns", "count"];
    let of_tag = |reported: &Distribution| KEYS.map(|key| format!("{}.{key}", reported.name));
    let mut known: Vec<_> = report.distributions.iter().flat_map(of_tag).collect();
    known.extend(ratios::names().map(|name| format!("ratio.{}", ratios::short_name(&name))));
    known.extend(report.runs.iter().flat_map(|run| run.counts.keys().map(|key| format!("counts.{key}"))));
    known.push("findings.frame-loss".into());
    known.sort_unstable();
    known.dedup();
    let alike = |name: &String| name.chars().zip(figure.chars()).take_while(|(a, b)| a == b).count();
    known.sort_by_key(|name| std::cmp::Reverse(alike(name)));
    let more = known.len().saturating_sub(NAMED);
    known.truncate(NAMED);
    let more = if more > 0 { format!(" and {more} more; report.json holds them all") } else { String::new() };
    format!("{figure}: no such figure; there are {}{more}", known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;
    use crate::tests::report_of;

    fn judged(text: &str) -> Result<Vec<BoundResult>, SettingsError> {
        judge(text, Path::new("bounds.toml"), &report_of(vec![made_up::run(2000)]))
    }

    #[test]
    fn bounds_are_kept_or_broken_and_what_was_not_measured_breaks() {
        let text = "[bounds]\n\"emulator-wakeup.p99_ns\" = { max = 50000 }\n\"emulator-wakeup.max_ns\" = { max = 11000 }\n\
                    \"counts.skipped\" = { max = 0 }\n\"counts.cycles\" = { min = 2000, max = 2000 }\n\
                    \"ratio.emulator-wakeup.p50\" = { max = 1.1 }\n\"cyclictest.p50_ns\" = { max = 1e9 }\n\
                    \"findings.frame-loss\" = { max = 0 }\n\"emulator-wakeup.p9999_ns\" = { max = 1e9 }";
        let judged = judged(text).unwrap();
        assert_eq!(judged.len(), 8);
        let broken = judged.iter().filter(|bound| !bound.kept).map(|bound| bound.figure.as_str());
        let mut broken: Vec<_> = broken.collect();
        broken.sort_unstable();
        let expected = [
            "cyclictest.p50_ns",
            "emulator-wakeup.max_ns",
            "emulator-wakeup.p9999_ns",
            "ratio.emulator-wakeup.p50",
        ];
        assert_eq!(broken, expected);
    }

    #[test]
    fn a_ratio_is_judged_by_its_interval() {
        let mut report = report_of(vec![made_up::run(2000)]);
        let name = "emulator-wakeup p99 / cyclictest p99";
        let mut judged = |factors: [u64; 10]| {
            let pairs_ns = factors.map(|factor| (factor * 100, 10_000)).into();
            report.ratios = vec![ratios::ratio(name.into(), pairs_ns).unwrap()];
            let text = "[bounds]\n\"ratio.emulator-wakeup.p99\" = { max = 1.1 }";
            judge(text, Path::new(""), &report).unwrap().remove(0)
        };
        let bound = judged([20, 27, 60, 80, 105, 105, 200, 300, 495, 600]);
        assert_eq!((bound.value, bound.interval), (Some(1.05), Some((0.27, 4.95))));
        assert_eq!(bound.verdict(), Verdict::NotResolved { pairs: Some(11_111) });
        assert!(!bound.kept && !bound.resolved);
        assert_eq!(judged([99; 10]).verdict(), Verdict::Kept);
        assert_eq!(judged([124; 10]).verdict(), Verdict::Broken);
        let text = serde_json::to_string(&bound).unwrap();
        let reported =
            "\"kept\":false,\"interval\":[0.27,4.95],\"resolved\":false,\"pairs_to_resolve\":11111";
        assert!(text.contains(reported), "{text}");
        // A report of before says nothing of it.
        let before = "{\"figure\":\"a\",\"value\":null,\"min\":null,\"max\":1,\"kept\":false}";
        let before: BoundResult = serde_json::from_str(before).unwrap();
        assert_eq!(before.verdict(), Verdict::Broken);
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_what_would() {
        let unknown = judged("[bounds]\n\"emulator-wakeup.p98_ns\" = { max = 1 }").unwrap_err().to_string();
        assert!(unknown.contains("no such figure; there are emulator-wakeup."), "{unknown}");
        assert!(judged("[bounds]\n\"counts.nothing\" = { max = 1 }").is_err());
        for (text, words) in [
            ("[bounds]\n\"counts.skipped\" = 3", "bounds.toml:2: bounds.counts.skipped = 3 must be a table"),
            (
                "[bounds]\n\"counts.skipped\" = { most = 3 }",
                "unknown key bounds.counts.skipped.most; allowed is min, max",
            ),
            ("[bounds]\n\"counts.skipped\" = { max = nan }", "max = nan; allowed is a finite number"),
            ("[bounds]\n\"counts.skipped\" = {}", "bounds.toml:2: bounds.counts.skipped = {}; write"),
            ("max = 3", "[bounds] is missing"),
            ("max = 3\n[bounds]", "bounds.toml:1: unknown key max; allowed is bounds"),
            ("[bounds", "bounds.toml:1: not TOML"),
        ] {
            let problem = judged(text).unwrap_err().to_string();
            assert!(problem.contains(words), "{text}: {problem}");
        }
    }
}
