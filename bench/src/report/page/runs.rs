//! The runs one by one: how regularly frames came, what was counted, each run's percentiles.

use super::figures::{PERCENTILES, percentiles};
use super::markup::{Cell, Table, folded, number, words as text};
use super::words;
use crate::report::model::{ArrivalRow, PercentilesNs, RunPart};
use std::collections::{BTreeMap, BTreeSet};

/// What came of one frame at one receiver over all runs.
#[derive(Default)]
struct Arrivals {
    period_ms: u64,
    count: u64,
    gaps: u64,
    bursts: u64,
    /// The largest of any run; percentiles of runs cannot be added up.
    p99: Option<u64>,
    p999: Option<u64>,
    max: Option<u64>,
}

impl Arrivals {
    fn add(&mut self, row: &ArrivalRow) {
        let of = &row.interval_ns;
        self.period_ms = row.period_ms;
        self.count += row.count;
        self.gaps += row.gaps;
        self.bursts += row.bursts;
        self.p99 = self.p99.max(of.p99);
        self.p999 = self.p999.max(of.p999);
        self.max = self.max.max(of.max);
    }
}

/// Gaps and bursts of each cyclic frame, over all runs and for each.
pub(super) fn arrivals(runs: &[RunPart]) -> String {
    let mut sums: BTreeMap<(&str, &str), Arrivals> = BTreeMap::new();
    let head = ["receiver", "frame", "period, ms", "came", "gaps", "bursts"];
    let intervals = ["interval p99, µs", "p99.9, µs", "longest, µs"];
    let mut each = Table::new("Arrivals of each run", ["run"].into_iter().chain(head).chain(intervals));
    for (run, part) in runs.iter().enumerate() {
        for row in &part.arrivals {
            sums.entry((&row.receiver, &row.frame)).or_default().add(row);
            let mut one = Arrivals::default();
            one.add(row);
            let names = [text(format!("{run}")), text(&row.receiver)];
            each.row(names.into_iter().chain(arrival_cells(&row.frame, &one)));
        }
    }
    let mut table = Table::new("Arrivals over all runs", head.into_iter().chain(intervals));
    for ((receiver, frame), sum) in &sums {
        table.row([text(*receiver)].into_iter().chain(arrival_cells(frame, sum)));
    }
    let said = "Over all runs; of the percentiles the largest of any run. A gap is an interval longer than one and a half \
                periods, a burst one shorter than half a period; cycles that the rig missed are gaps too.";
    let all = table.html_or("None was measured.");
    if sums.is_empty() || runs.len() < 2 {
        return format!("{}{all}", super::markup::paragraph(said));
    }
    format!(
        "{}{all}{}",
        super::markup::paragraph(said),
        folded("Each run", &each.html_or("None was measured."))
    )
}

/// A frame and what came of it.
fn arrival_cells(frame: &str, of: &Arrivals) -> Vec<Cell> {
    let counts = [of.period_ms, of.count, of.gaps, of.bursts].map(|value| number(words::count(value)));
    let lengths = [of.p99, of.p999, of.max].map(|ns| number(words::maybe_us(ns)));
    [text(frame)].into_iter().chain(counts).chain(lengths).collect()
}

/// The runs, what each counted, and each one's percentiles.
pub(super) fn counts(runs: &[RunPart]) -> String {
    let mut table =
        Table::new("Runs", ["run", "folder", "group", "started", "length, s", "the rig's verdict"]);
    for (run, part) in runs.iter().enumerate() {
        let verdict = if part.passed { "passed" } else { "not passed" };
        table.row([
            text(format!("{run}")),
            text(&part.folder),
            text(&part.group),
            text(words::instant(part.started_unix_s)),
            number(words::decimal(part.duration_s, 1)),
            Cell::Judged(part.passed, verdict.into()),
        ]);
    }
    format!("{}{}{}", table.html_or("No run was given."), counted(runs), each_percentiles(runs))
}

/// A row for each count, its sum first.
fn counted(runs: &[RunPart]) -> String {
    let names: BTreeSet<&str> = runs.iter().flat_map(|run| run.counts.keys().map(String::as_str)).collect();
    let several = runs.len() > 1;
    let columns = (0..runs.len()).map(|run| format!("run {run}"));
    let sum = several.then(|| "all".to_owned());
    let mut table = Table::new("Counts", ["count".to_owned()].into_iter().chain(sum).chain(columns));
    for name in names {
        let value = |run: &RunPart| run.counts.get(name).copied();
        let sum: u64 = runs.iter().filter_map(value).fold(0, u64::saturating_add);
        let told = |run: &RunPart| number(value(run).map_or_else(|| words::NOTHING.into(), words::count));
        let sum = several.then(|| number(words::count(sum)));
        let cells: Vec<_> = [text(name)].into_iter().chain(sum).chain(runs.iter().map(told)).collect();
        table.row(cells);
    }
    table.html_or("Nothing was counted.")
}

fn each_percentiles(runs: &[RunPart]) -> String {
    let mut by_name: BTreeMap<&str, Vec<(usize, &PercentilesNs)>> = BTreeMap::new();
    for (run, part) in runs.iter().enumerate() {
        for (name, of) in &part.percentiles_ns {
            by_name.entry(name).or_default().push((run, of));
        }
    }
    if by_name.is_empty() {
        return String::new();
    }
    let mut table = Table::new("Percentiles of each run in µs", ["all in µs"].into_iter().chain(PERCENTILES));
    for (name, of_runs) in by_name {
        table.group(name);
        for (run, of) in of_runs {
            table.row([text(format!("run {run}"))].into_iter().chain(percentiles(of)));
        }
    }
    folded("Percentiles of each run", &table.html_or(""))
}
