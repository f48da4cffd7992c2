//! The largest value of each second over time: what a histogram hides, whether the tail came all at once.
//!
//! Runs stand one after another on the time axis. Where seconds share a column of pixels the largest of them is drawn.

use super::families::Family;
use super::figures::name;
use super::histograms::{FOOT, FULL, HALF, LEFT, RIGHT, Size, TOP, figure, upright_label};
use super::markup::none;
use super::svg::{
    Drawing, Look, Place, Scale, curve_sample, legend_entry, line, stroke, text, time_axis, whole_decades,
};
use super::words;
use crate::report::model::{Distribution, Maximum, Report};
use std::collections::BTreeMap;

/// Where each run begins on the time axis.
struct Runs {
    starts_s: BTreeMap<usize, u64>,
    length_s: u64,
}

impl Runs {
    fn of(report: &Report) -> Self {
        let mut lengths_s: BTreeMap<usize, u64> = BTreeMap::new();
        for (run, part) in report.runs.iter().enumerate() {
            lengths_s.insert(run, part.duration_s.ceil().max(0.0) as u64);
        }
        for maximum in report.distributions.iter().flat_map(|one| &one.maxima) {
            let length = lengths_s.entry(maximum.run).or_default();
            *length = (*length).max(maximum.second.saturating_add(1));
        }
        let mut length_s = 0;
        let starts_s = lengths_s.into_iter().map(|(run, length)| {
            let start = length_s;
            length_s += length;
            (run, start)
        });
        let starts_s = starts_s.collect();
        Self { starts_s, length_s }
    }

    fn at_s(&self, maximum: &Maximum) -> u64 {
        self.starts_s.get(&maximum.run).copied().unwrap_or(0) + maximum.second
    }
}

/// A chart for each family that was watched over time.
pub(super) fn maxima(report: &Report, families: &[Family<'_>]) -> String {
    let runs = Runs::of(report);
    let charts = families
        .iter()
        .enumerate()
        .map(|(place, family)| chart(family, &runs, if place == 0 { &FULL } else { &HALF }));
    let charts: String = charts.collect();
    if charts.is_empty() {
        return none("No time series: no maxima of single seconds were measured.");
    }
    format!("<div class=\"charts\">\n{charts}</div>\n")
}

fn chart(family: &Family<'_>, runs: &Runs, size: &Size) -> String {
    let members: Vec<_> = family.members.iter().filter(|(_, one)| !one.maxima.is_empty()).collect();
    let values = || members.iter().flat_map(|(_, one)| one.maxima.iter().map(|maximum| maximum.max_ns));
    let (Some(low), Some(high)) = (values().min(), values().max()) else {
        return String::new();
    };
    let bottom = size.height - FOOT;
    let x = Scale::linear((0.0, runs.length_s.max(1) as f64), (LEFT, size.width - RIGHT));
    let y = Scale::logarithmic(whole_decades((low as f64).max(10.0), high as f64), (bottom, TOP));
    let mut drawn = axes(&x, &y, size, runs);
    let curves = members.iter().rev().map(|(look, one)| curve(*look, one, &x, &y, runs));
    drawn.extend(curves);
    let legend: String =
        members.iter().map(|(look, one)| legend_entry(&curve_sample(*look), &name(one))).collect();
    let largest = members.iter().filter_map(|(_, one)| {
        let largest = one.maxima.iter().max_by_key(|maximum| maximum.max_ns)?;
        let (run, second) = (largest.run, largest.second);
        Some(format!(
            "{}: longest {} in second {second} of run {run}.",
            name(one),
            words::length(largest.max_ns)
        ))
    });
    let drawing = Drawing {
        identifier: &format!("{}-maxima", family.identifier),
        size: (size.width, size.height),
        title: &format!("1-s maxima: {}", family.title),
        description: &largest.collect::<Vec<_>>().join(" "),
    };
    figure(size, (&family.title, "Largest value of each second."), &legend, &drawing.with(&drawn))
}

fn axes(x: &Scale, y: &Scale, size: &Size, runs: &Runs) -> String {
    let (right, bottom) = (size.width - RIGHT, size.height - FOOT);
    let mut drawn = time_axis(y, false, (right, LEFT));
    for value in x.round_values(size.width / 90.0) {
        drawn += &stroke("edge", (x.at(value), bottom), (x.at(value), bottom + 4.0));
        drawn += &text("middle", (x.at(value), bottom + 18.0), &words::decimal(value, 0));
    }
    let several = runs.starts_s.len() > 1;
    let mut free = f64::NEG_INFINITY;
    for (run, start) in runs.starts_s.iter().filter(|_| several) {
        let at = x.at(*start as f64);
        drawn += &stroke("cut", (at, TOP), (at, bottom));
        if at > free {
            drawn += &text("", (at + 3.0, TOP + 11.0), &format!("{run}"));
            free = at + 24.0;
        }
    }
    drawn += &stroke("edge", (LEFT, bottom), (right, bottom));
    drawn += &stroke("edge", (LEFT, TOP), (LEFT, bottom));
    let label = if several { "s, runs one after another (numbers above: run)" } else { "s of the run" };
    drawn += &text("middle", (0.5 * (LEFT + right), size.height - 6.0), label);
    drawn + &upright_label("largest of a second, logarithmic", (TOP, bottom))
}

/// A line for each run, and a marker on its largest value.
fn curve(look: Look, distribution: &Distribution, x: &Scale, y: &Scale, runs: &Runs) -> String {
    let mut by_run: BTreeMap<usize, Vec<&Maximum>> = BTreeMap::new();
    for maximum in &distribution.maxima {
        by_run.entry(maximum.run).or_default().push(maximum);
    }
    let mut drawn = String::new();
    for maxima in by_run.values_mut() {
        maxima.sort_unstable_by_key(|maximum| maximum.second);
        let places = maxima.iter().map(|maximum| {
            // In the middle of its second.
            (x.at(runs.at_s(maximum) as f64 + 0.5), y.at(maximum.max_ns as f64))
        });
        let places = thinned(&places.collect::<Vec<_>>());
        drawn += &line(&format!("line {}", look.class()), &places);
        // The pixel rows count downwards.
        if let Some(top) = places.iter().min_by(|one, other| one.1.total_cmp(&other.1)) {
            drawn += &look.marker(*top, false);
            drawn.push('\n');
        }
    }
    drawn
}

/// Of each column of pixels the largest value alone.
fn thinned(places: &[Place]) -> Vec<Place> {
    let columns = places.chunk_by(|one, other| one.0.floor() == other.0.floor());
    let top = |column: &[Place]| column.iter().copied().min_by(|one, other| one.1.total_cmp(&other.1));
    columns.filter_map(top).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_largest_of_a_column() {
        let places = [(1.1, 50.0), (1.5, 3.0), (1.9, 40.0), (2.0, 60.0)];
        assert_eq!(thinned(&places), [(1.5, 3.0), (2.0, 60.0)]);
    }
}
