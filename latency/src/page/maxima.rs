//! The largest value of each second over time: what a histogram hides, whether the tail came all at once.
//!
//! A strip for each distribution, all of a family on the same axes; runs stand one after another. Where seconds share a column of
//! pixels the largest of them is drawn.

use super::families::Family;
use super::histograms::{FOOT, LEFT, RIGHT, Size, charts, figure};
use crate::model::{Distribution, Report};
use pagekit::number;
use pagekit::svg::{CurveStyle, Drawing, Point, Scale, line, stroke, text, whole_decades};

/// Height of a strip's heading and of its plot, in pixels.
const HEADING: f64 = 30.0;
const PLOT: f64 = 64.0;
const TOP: f64 = 16.0;
/// Labels nearer than this would touch.
const LABEL: f64 = 16.0;

/// Where each run begins on the time axis.
struct RunStarts {
    starts_s: Vec<u64>,
    length_s: u64,
}

impl RunStarts {
    fn of(report: &Report) -> Self {
        let mut lengths_s: Vec<_> =
            report.runs.iter().map(|run| run.duration_s.ceil().max(0.0) as u64).collect();
        for maximum in report.distributions.iter().flat_map(|one| &one.maxima) {
            if let Some(length) = lengths_s.get_mut(maximum.run) {
                *length = (*length).max(maximum.second.saturating_add(1));
            }
        }
        let mut length_s: u64 = 0;
        for length in &mut lengths_s {
            (*length, length_s) = (length_s, length_s.saturating_add(*length));
        }
        Self { starts_s: lengths_s, length_s }
    }

    fn are_several(&self) -> bool {
        self.starts_s.len() > 1
    }
}

/// A chart for each family that was watched over time.
pub(super) fn maxima(report: &Report, families: &[Family<'_>]) -> String {
    let runs = RunStarts::of(report);
    let without = "No time series: no maxima of single seconds were measured.";
    charts(families, |family, size| chart(family, &runs, size), without)
}

fn chart(family: &Family<'_>, runs: &RunStarts, size: &Size) -> String {
    let members: Vec<_> = family.members.iter().filter(|(_, one)| !one.maxima.is_empty()).collect();
    let values = || members.iter().flat_map(|(_, one)| one.maxima.iter().map(|maximum| maximum.max_ns));
    let (Some(low), Some(high)) = (values().min(), values().max()) else {
        return String::new();
    };
    let range = whole_decades((low as f64).max(10.0), high as f64);
    let x = Scale::linear((0.0, runs.length_s.max(1) as f64), (LEFT, size.width - RIGHT));
    let bottom = TOP + (HEADING + PLOT) * members.len() as f64;
    let mut drawn = time(&x, size, runs, bottom);
    let mut reported = Vec::new();
    for (place, (style, one)) in members.iter().enumerate() {
        let top = TOP + (HEADING + PLOT) * place as f64 + HEADING;
        let y = Scale::logarithmic(range, (top + PLOT, top));
        let heading = heading(one, runs);
        drawn += &text("name", (LEFT, top - 10.0), &heading);
        drawn += &levels(&y, (LEFT, size.width - RIGHT));
        drawn += &trace(*style, one, &x, &y, runs);
        drawn += &stroke("edge", (LEFT, top + PLOT), (size.width - RIGHT, top + PLOT));
        reported.push(heading + ".");
    }
    let drawing = Drawing {
        identifier: &format!("{}-maxima", family.identifier),
        size: (size.width, bottom + FOOT),
        title: &format!("1-s maxima: {}", family.title),
        description: &reported.join(" "),
    };
    let heading = (family.title.as_str(), "Largest value of each second, logarithmic.");
    figure(size, heading, "", &drawing.with(&drawn))
}

/// What stands above a strip: whose it is, and when the largest was.
fn heading(distribution: &Distribution, runs: &RunStarts) -> String {
    let name = distribution.shown_name();
    let Some(largest) = distribution.maxima.iter().max_by_key(|maximum| maximum.max_ns) else { return name };
    let run = if runs.are_several() { format!(" of run {}", largest.run) } else { String::new() };
    format!("{name}: longest {} in second {}{run}", number::length(largest.max_ns), largest.second)
}

/// The time axis and where each run begins.
fn time(x: &Scale, size: &Size, runs: &RunStarts, bottom: f64) -> String {
    let mut drawn = String::new();
    for value in x.round_values(size.width / 90.0) {
        drawn += &stroke("edge", (x.at(value), bottom), (x.at(value), bottom + 4.0));
        drawn += &text("middle", (x.at(value), bottom + 18.0), &number::decimal(value, 0));
    }
    let mut free = f64::NEG_INFINITY;
    for (run, start) in runs.starts_s.iter().enumerate().filter(|_| runs.are_several()) {
        let at = x.at(*start as f64);
        drawn += &stroke("cut", (at, TOP + 4.0), (at, bottom));
        if at > free {
            let label = format!("run {run}");
            free = at + 8.0 * label.len() as f64 + 6.0;
            drawn += &text("", (at, TOP - 3.0), &label);
        }
    }
    let label = if runs.are_several() { "s, runs one after another" } else { "s of the run" };
    drawn + &text("middle", (0.5 * (LEFT + size.width - RIGHT), bottom + 38.0), label)
}

/// Decades of a strip, as many named as there is room for.
fn levels(y: &Scale, across: (f64, f64)) -> String {
    let mut drawn = String::new();
    let mut free = f64::INFINITY;
    for value in y.decades() {
        let at = y.at(value);
        drawn += &stroke("grid", (across.0, at), (across.1, at));
        if at < free {
            drawn += &text("end", (across.0 - 7.0, at + 4.5), &number::tick_ns(value));
            free = at - LABEL;
        }
    }
    drawn
}

/// Steps over the seconds of each run, and a marker on its largest.
fn trace(style: CurveStyle, distribution: &Distribution, x: &Scale, y: &Scale, runs: &RunStarts) -> String {
    let base = y.at(0.0);
    let mut drawn = String::new();
    for maxima in distribution.maxima.chunk_by(|one, next| one.run == next.run) {
        let seconds = maxima.iter().map(|maximum| {
            let run_s = runs.starts_s.get(maximum.run).copied().unwrap_or(0);
            let start_s = run_s as f64 + maximum.second as f64;
            PlottedSecond { from: x.at(start_s), to: x.at(start_s + 1.0), y: y.at(maximum.max_ns as f64) }
        });
        let seconds = thinned(&seconds.collect::<Vec<_>>());
        let mut places: Vec<Point> = seconds.first().map(|first| (first.from, base)).into_iter().collect();
        places.extend(seconds.iter().flat_map(|second| [(second.from, second.y), (second.to, second.y)]));
        places.extend(seconds.last().map(|last| (last.to, base)));
        drawn += &line(&format!("trace {}", style.class()), &places);
        // The pixel rows count downwards.
        if let Some(top) = seconds.iter().min_by(|one, other| one.y.total_cmp(&other.y)) {
            drawn += &style.marker((0.5 * (top.from + top.to), top.y), false);
            drawn.push('\n');
        }
    }
    drawn
}

/// A second, or several that share a column, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PlottedSecond {
    from: f64,
    to: f64,
    y: f64,
}

/// Of each column of pixels the largest value alone.
fn thinned(seconds: &[PlottedSecond]) -> Vec<PlottedSecond> {
    let columns = seconds.chunk_by(|one, other| one.from.floor() == other.from.floor());
    let merged = columns.filter_map(|column| {
        let (first, last) = (column.first()?, column.last()?);
        let y = column.iter().map(|second| second.y).fold(f64::INFINITY, f64::min);
        Some(PlottedSecond { from: first.from, to: last.to, y })
    });
    merged.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_largest_of_a_column() {
        let second = |from, to, y| PlottedSecond { from, to, y };
        let seconds =
            [second(1.1, 1.5, 50.0), second(1.5, 1.9, 3.0), second(1.9, 2.3, 40.0), second(2.3, 2.7, 60.0)];
        assert_eq!(thinned(&seconds), [second(1.1, 2.3, 3.0), second(2.3, 2.7, 60.0)]);
    }
}
