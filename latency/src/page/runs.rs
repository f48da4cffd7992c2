//! The runs one by one: how regularly frames came, what was counted, each run's percentiles.

use super::figures::percentiles;
use crate::model::{ArrivalRow, PercentilesNs, RunPart};
use crate::samples::PERCENTILES;
use crate::tallies;
use pagekit::grid::Grid;
use pagekit::markup::{Cell, Table, folded, list, number, words as text};
use pagekit::number;
use realtime::ArrivalFigures;
use std::collections::{BTreeMap, BTreeSet};

/// Adds a row to the sum over all runs; of the percentiles the largest, since those of runs cannot be added up.
fn add(sum: &mut ArrivalFigures, row: &ArrivalFigures) {
    sum.period_ms = row.period_ms;
    sum.count += row.count;
    sum.gaps += row.gaps;
    sum.bursts = row.bursts.map(|bursts| bursts + sum.bursts.unwrap_or(0)).or(sum.bursts);
    let (largest, of) = (&mut sum.interval_ns, &row.interval_ns);
    largest.p99 = largest.p99.max(of.p99);
    largest.p999 = largest.p999.max(of.p999);
    largest.max = largest.max.max(of.max);
}

/// Gaps and bursts of each cyclic frame, over all runs and for each.
pub(super) fn arrivals(runs: &[RunPart]) -> String {
    let mut sums: BTreeMap<(&str, &str), ArrivalRow> = BTreeMap::new();
    let head = ["receiver", "frame", "period, ms", "came", "gaps", "bursts"];
    let intervals = ["interval p99, µs", "p99.9, µs", "longest, µs"];
    let mut each = Table::new("Arrivals of each run", ["run"].into_iter().chain(head).chain(intervals));
    for (run, part) in runs.iter().enumerate() {
        for row in &part.arrivals {
            let key = (row.receiver.as_str(), &*row.figures.frame);
            sums.entry(key)
                .and_modify(|sum| add(&mut sum.figures, &row.figures))
                .or_insert_with(|| row.clone());
            each.row([text(format!("{run}"))].into_iter().chain(arrival_cells(row)));
        }
    }
    let mut table = Table::new("Arrivals over all runs", head.into_iter().chain(intervals));
    sums.values().for_each(|sum| table.row(arrival_cells(sum)));
    let lead = "Over all runs; of the percentiles the largest of any run. A gap is an interval longer than one and a half \
                periods, a burst one shorter than half a period; cycles that the rig missed are gaps too.";
    let all = table.html_or("None was measured.");
    let is_sum = !sums.is_empty() && runs.len() > 1;
    let each = if is_sum { folded("Each run", &each.html_or("None was measured.")) } else { String::new() };
    format!("{}{all}{each}", pagekit::markup::paragraph(lead))
}

/// Receiver and frame, and what came of it.
fn arrival_cells(row: &ArrivalRow) -> Vec<Cell> {
    let of = &row.figures;
    let counts = [of.period_ms, of.count, of.gaps].map(|value| number(number::count(value)));
    let bursts = of.bursts.map_or_else(|| text("sent on change too"), |bursts| number(number::count(bursts)));
    let PercentilesNs { p99, p999, max, .. } = of.interval_ns;
    let lengths = [p99, p999, max].map(|ns| number(number::us_or_not_measured(ns)));
    [text(&row.receiver), text(&*of.frame)].into_iter().chain(counts).chain([bursts]).chain(lengths).collect()
}

pub(super) fn counts(runs: &[RunPart]) -> String {
    let mut table =
        Table::new("Runs", ["run", "folder", "group", "started", "length, s", "the rig's verdict"]);
    for (run, part) in runs.iter().enumerate() {
        let verdict = if part.passed { "passed" } else { "not passed" };
        table.row([
            text(format!("{run}")),
            text(&part.folder),
            text(&part.group),
            text(number::instant(part.started_unix_s)),
            number(number::decimal(part.duration_s, 1)),
            Cell::Judged(part.passed, verdict.into()),
        ]);
    }
    format!(
        "{}{}{}{}{}{}",
        table.html_or("No run was given."),
        lacking(runs),
        count_table("Lost, late, duplicate, malformed frames", tallies::frames(runs)),
        count_table("Command age in cycles", tallies::command_ages(runs)),
        counted(runs),
        each_percentiles(runs)
    )
}

/// A table of counts under its heading.
fn count_table(title: &str, grid: Option<Grid>) -> String {
    let Some(grid) = grid else { return String::new() };
    let mut table = Table::new(title, grid.head);
    for mut row in grid.rows {
        let counts = row.split_off(1);
        table.row(row.into_iter().map(text).chain(counts.into_iter().map(number)));
    }
    format!("<h3>{title}</h3>\n{}", table.html_or("Nothing was counted."))
}

/// What folders do not hold, and the page therefore does not say.
fn lacking(runs: &[RunPart]) -> String {
    let sections = runs.iter().enumerate().filter(|(_, part)| !part.lacks.is_empty());
    let sections = sections.map(|(run, part)| format!("<h3>Run {run} lacks</h3>\n{}", list(&part.lacks, "")));
    sections.collect()
}

/// A row for each count, its sum first. Counts of parts that are 0 throughout are folded away; those of the whole always stand.
fn counted(runs: &[RunPart]) -> String {
    let names: BTreeSet<&String> = runs.iter().flat_map(|run| run.counts.keys()).collect();
    let value = |run: &RunPart, name: &str| run.counts.get(name).copied();
    let is_shown = |name: &&String| !name.contains('.') || runs.iter().any(|run| value(run, name) > Some(0));
    let (shown, zero): (Vec<_>, Vec<_>) = names.into_iter().partition(is_shown);
    let table = |names: &[&String]| {
        let sum = (runs.len() > 1).then(|| "all".to_owned());
        let columns = (0..runs.len()).map(|run| format!("run {run}"));
        let mut table = Table::new("Counts", ["count".to_owned()].into_iter().chain(sum).chain(columns));
        for name in names {
            let sum = runs.iter().filter_map(|run| value(run, name)).fold(0, u64::saturating_add);
            let sum = (runs.len() > 1).then(|| number(number::count(sum)));
            let reported =
                |run| number(value(run, name).map_or_else(|| number::NOT_MEASURED.into(), number::count));
            table.row([text(*name)].into_iter().chain(sum).chain(runs.iter().map(reported)));
        }
        table.html_or("Nothing was counted.")
    };
    if zero.is_empty() {
        return table(&shown);
    }
    let summary =
        format!("{} that are 0 in every run", number::counted(zero.len() as u64, "count", "counts"));
    table(&shown) + &folded(&summary, &table(&zero))
}

fn each_percentiles(runs: &[RunPart]) -> String {
    let names: BTreeSet<&String> = runs.iter().flat_map(|run| run.percentiles_ns.keys()).collect();
    if names.is_empty() {
        return String::new();
    }
    let mut table = Table::new("Percentiles of each run in µs", ["all in µs"].into_iter().chain(PERCENTILES));
    for name in names {
        table.group(name);
        for (run, of) in
            runs.iter().enumerate().filter_map(|(run, part)| Some((run, part.percentiles_ns.get(name)?)))
        {
            table.row([text(format!("run {run}"))].into_iter().chain(percentiles(of)));
        }
    }
    folded("Percentiles of each run", &table.html_or(""))
}
