//! A report in words and tables: `report.md`, which a merge request takes as it stands, and the short table of a terminal.

use super::explain::rules::in_words;
use super::kinds::WAKE_UP;
use super::model::{BoundResult, Comparison, Distribution, Event, PercentilesNs, Ratio, Report};
use super::report_cause::in_kebab;
use super::resolution::{self, Verdict};
use super::samples::PERCENTILES;
use super::tallies;
use pagekit::grid::Grid;
use std::fmt::Write as _;

/// The report in Markdown, for a merge request.
pub(crate) fn summary(report: &Report) -> String {
    let mut out = String::new();
    let mut section = |heading: &str, text: &str| {
        if !text.trim().is_empty() {
            let level = if out.is_empty() { "#" } else { "##" };
            let _ = write!(out, "{level} {heading}\n\n{}\n\n", text.trim_end()); // writing to a string cannot fail
        }
    };
    section(&report.title, &claim(report));
    section("Bounds", &bounds(&report.bounds));
    section("Percentiles in us", &percentiles(&report.distributions).markdown());
    section("Beside the reference", &ratios(&report.ratios));
    section("Groups", &report.comparison.as_ref().map_or_else(String::new, comparison));
    section("What disturbed the runs", &findings(report));
    section("Worst events", &worst(&report.worst));
    section("Runs", &runs(report));
    let grid = |grid: Option<Grid>| grid.map_or_else(String::new, |grid| grid.markdown());
    section("Lost, late, duplicate, malformed frames", &grid(tallies::frames(&report.runs)));
    section("Command age in cycles", &grid(tallies::command_ages(&report.runs)));
    section("Frames", &frames(report));
    section("Conditions", &conditions(report));
    out.trim_end().to_owned() + "\n"
}

/// The report in short, for a terminal: percentiles, then what a person must know of them.
pub fn table(report: &Report) -> String {
    let mut out = percentiles(&report.distributions).markdown();
    let mut add = |text: &str| {
        if !text.trim().is_empty() {
            let _ = write!(out, "\n{}\n", text.trim_end());
        }
    };
    add(&ratios(&report.ratios));
    add(&report.comparison.as_ref().map_or_else(String::new, comparison));
    add(&findings(report));
    add(&bounds(&report.bounds));
    add(&report.claim.sentence);
    out
}

fn list<'a>(lines: impl IntoIterator<Item = &'a String>) -> String {
    lines.into_iter().fold(String::new(), |mut out, line| {
        let _ = writeln!(out, "- {line}");
        out
    })
}

fn claim(report: &Report) -> String {
    let claim = &report.claim;
    let mut out = format!("**{}**\n", claim.sentence);
    if !claim.reasons.is_empty() {
        let _ = write!(out, "\n{}", list(&claim.reasons));
    }
    if !claim.not_controlled.is_empty() {
        let _ = write!(out, "\nNot controlled:\n\n{}", list(&claim.not_controlled));
    }
    out
}

fn us(ns: Option<u64>) -> String {
    ns.map_or_else(|| "-".into(), |ns| format!("{:.1}", ns as f64 * 1e-3))
}

fn percentiles(distributions: &[Distribution]) -> Grid {
    let row = |distribution: &Distribution| {
        let PercentilesNs { p50, p90, p99, p999, p9999, max, count } = distribution.percentiles_ns;
        let cells = [p50, p90, p99, p999, p9999, max].map(us).into_iter().chain([count.to_string()]);
        std::iter::once(distribution.shown_name()).chain(cells).collect()
    };
    Grid::new(["us"].into_iter().chain(PERCENTILES), distributions.iter().map(row))
}

fn ratios(ratios: &[Ratio]) -> String {
    let row = |ratio: &Ratio| {
        let interval = ratio.interval.map_or_else(
            || "too few pairs".into(),
            |(low, high)| {
                format!("{low:.3} to {high:.3} ({:.1} %)", ratio.confidence.unwrap_or_default() * 100.0)
            },
        );
        vec![ratio.name.clone(), format!("{:.3}", ratio.median), interval, ratio.pairs_ns.len().to_string()]
    };
    if ratios.is_empty() {
        return String::new();
    }
    Grid::new(["ratio", "median", "interval of the median", "pairs"], ratios.iter().map(row)).markdown()
}

fn bounds(bounds: &[BoundResult]) -> String {
    if bounds.is_empty() {
        return String::new();
    }
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value}"));
    let row = |bound: &BoundResult| {
        let value = bound.value.map_or_else(|| "not measured".into(), |value| format!("{value}"));
        let verdict = match bound.verdict() {
            Verdict::Kept => "kept",
            Verdict::Broken => "BROKEN",
            Verdict::NotResolved { .. } => "not resolved",
        };
        vec![bound.figure.clone(), value, number(bound.min), number(bound.max), verdict.into()]
    };
    let grid = Grid::new(["bound", "value", "min", "max", ""], bounds.iter().map(row));
    let open: Vec<_> = bounds.iter().filter_map(not_resolved).collect();
    let gap = if open.is_empty() { "" } else { "\n" };
    format!("{}{gap}{}", grid.markdown(), list(&open))
}

/// Why a bound is neither kept nor broken, and how it could be decided.
fn not_resolved(bound: &BoundResult) -> Option<String> {
    let Verdict::NotResolved { pairs } = bound.verdict() else { return None };
    let interval = bound.interval.map_or_else(String::new, |(low, high)| {
        format!(" the interval of the median, {low:.3} to {high:.3}, crosses it;")
    });
    Some(format!(
        "{} is not resolved, neither kept nor broken:{interval} {}.",
        bound.figure,
        resolution::in_words(pairs)
    ))
}

fn comparison(comparison: &Comparison) -> String {
    let head = std::iter::once("median in us").chain(comparison.groups.iter().map(String::as_str));
    let rows = comparison.rows.iter().map(|row| {
        let cells = row.cells.iter().map(|cell| {
            let change = cell.change_percent.map_or_else(String::new, |change| {
                let noise = match cell.beyond_noise {
                    Some(true) => "beyond noise",
                    Some(false) => "noise",
                    None => "too few runs to tell",
                };
                format!(" ({change:+.1} %, {noise})")
            });
            format!("{}{change}", us(Some(cell.median_ns)))
        });
        std::iter::once(row.figure.clone()).chain(cells).collect()
    });
    Grid::new(head, rows).markdown()
}

fn findings(report: &Report) -> String {
    if report.findings.is_empty() {
        return "Nothing disturbed the runs.\n".into();
    }
    let lines =
        report.findings.iter().map(|finding| format!("{}: {}", in_kebab(finding.cause), finding.sentence));
    list(&lines.collect::<Vec<_>>())
}

fn worst(events: &[Event]) -> String {
    let mut out = String::new();
    for (place, event) in (1..).zip(events) {
        let (run, at_s, cycle) = (event.run, event.at_s, event.cycle);
        let _ = writeln!(out, "{place}. Run {run}, {at_s:.3} s, cycle {cycle}: {}", event.sentence);
        for line in &event.evidence {
            let _ = writeln!(out, "   - {line}");
        }
    }
    out
}

fn runs(report: &Report) -> String {
    const COUNTS: [&str; 5] = ["cycles", "skipped", "overruns", "frames_lost_by_gaps", "frames_malformed"];
    let row = |(place, run): (usize, &super::model::RunPart)| {
        let count = |key: &str| run.counts.get(key).map_or_else(|| "-".to_owned(), u64::to_string);
        let wakeup = run.percentiles_ns.get(WAKE_UP).copied().unwrap_or_default();
        let mut cells =
            vec![format!("{place} {}", run.folder), run.group.clone(), format!("{:.1}", run.duration_s)];
        cells.extend(COUNTS.map(count));
        cells.extend([us(wakeup.p50), us(wakeup.p99), us(wakeup.max)]);
        cells
    };
    let head =
        ["run", "group", "s", "cycles", "skipped", "overruns", "lost", "malformed", "wake-up p50", "p99"];
    let head = head.into_iter().chain(["max us"]);
    let mut out = Grid::new(head, report.runs.iter().enumerate().map(row)).markdown();
    for (place, run) in report.runs.iter().enumerate().filter(|(_, run)| !run.lacks.is_empty()) {
        let _ = write!(out, "\nRun {place} lacks:\n\n{}", list(&run.lacks));
    }
    out
}

fn frames(report: &Report) -> String {
    let mut rows = Vec::new();
    for (place, run) in report.runs.iter().enumerate() {
        for row in &run.arrivals {
            let figures = &row.figures;
            let reported = &figures.interval_ns;
            let name = format!("{place} {} at {}", figures.frame, row.receiver);
            let counts = [figures.period_ms, figures.count, figures.gaps].map(|count| count.to_string());
            let bursts =
                figures.bursts.map_or_else(|| "sent on change too".into(), |count| count.to_string());
            let ends =
                [reported.p50, reported.p99, reported.max].map(|ns| ns.map_or_else(|| "-".into(), in_words));
            rows.push(std::iter::once(name).chain(counts).chain([bursts]).chain(ends).collect());
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    let head = ["run, frame", "period ms", "came", "gaps", "bursts", "interval p50", "p99", "max"];
    Grid::new(head, rows).markdown()
}

fn conditions(report: &Report) -> String {
    let reported = &report.conditions;
    let mut lines: Vec<String> = Vec::new();
    // A list, because command lines would make a table of any width.
    let mut line = |name: &str, value: &str| lines.push(format!("{name}: {value}"));
    line("load generator", reported.load_generator.as_deref().unwrap_or("not reported"));
    line("reference", reported.reference.as_deref().unwrap_or("none"));
    if let Some(why) = &reported.reference_missing_because {
        line("no reference because", why);
    }
    line("spin-gap probe", if reported.probe { "on" } else { "off" });
    for fact in reported.command_lines.iter().chain(&reported.privileges).chain(&reported.machine) {
        line(&fact.name, &fact.value);
    }
    list(&lines)
}
