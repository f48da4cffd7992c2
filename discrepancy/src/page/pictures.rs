//! The disagreement as a picture, and the picture after: the second in which they differ most, and the difference over all of it.
//!
//! The difference is drawn in units of the sensor's noise, since a gap that nobody would see beside the whole stroke may be a
//! hundred times the sensor noise. Before and after share their axes.

use super::{Pictures, Trace, words};
use crate::report::{Report, Verdict};
use pagekit::markup::{charts, folded, paragraph};
use pagekit::plot::{COLUMNS, Plot, Sample, columns, figure, range};
use std::ops::Range;

/// Length of the stretch that is looked at closely, s.
const CLOSE_S: f64 = 1.0;

#[derive(Clone, Copy, PartialEq)]
enum Model {
    Before,
    After,
}

pub(super) fn before(report: &Report, pictures: &Pictures) -> String {
    if report.verdict == Verdict::BadData {
        return String::new();
    }
    let mut lead =
        "One picture is of the second in which record and simulation differ most, the other of their difference over \
         the whole record"
            .to_owned();
    if pictures.traces.iter().any(|trace| trace.noise > 0.0) {
        lead += ", in units of the sensor's noise";
    }
    lead += if report.is_rig_file_enough() { ": it stays within it." } else { "." };
    all(report, pictures, Model::Before, &lead)
}

pub(super) fn after(report: &Report, pictures: &Pictures) -> String {
    let is_there = pictures.traces.iter().any(|trace| !trace.after.is_empty());
    if report.verdict == Verdict::BadData || !is_there {
        return String::new();
    }
    all(report, pictures, Model::After, "The same with what was found added to the model, on the same axes.")
}

fn all(report: &Report, pictures: &Pictures, model: Model, lead: &str) -> String {
    let mut traces: Vec<&Trace> = pictures.traces.iter().filter(|trace| !trace.time_s.is_empty()).collect();
    if model == Model::After {
        traces.retain(|trace| !trace.after.is_empty());
    }
    // The largest disagreement first; equal ones by name.
    traces.sort_by(|one, other| {
        let size = |trace: &Trace| rms(&trace.before_residual) * difference(trace).1;
        size(other).total_cmp(&size(one)).then_with(|| one.signal.cmp(&other.signal))
    });
    let Some((first, others)) = traces.split_first() else { return String::new() };
    let record = if pictures.held_out {
        format!("{}, a held-out record.", pictures.record)
    } else {
        format!("{}, on which the models were fitted.", pictures.record)
    };
    let more: String = others.iter().map(|trace| pair(report, trace, model)).collect();
    let count = others.len();
    let summary =
        if count == 1 { "The other signal".to_owned() } else { format!("The other {count} signals") };
    paragraph(&format!("{lead} Record: {record}")) + &pair(report, first, model) + &folded(&summary, &more)
}

fn pair(report: &Report, trace: &Trace, model: Model) -> String {
    charts(&[close(report, trace, model), residual_plot(report, trace, model)])
}

fn rms(values: &[f64]) -> f64 {
    let (sum, count) = values
        .iter()
        .filter(|value| value.is_finite())
        .fold((0.0, 0usize), |(sum, count), value| (sum + value * value, count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// Samples of the second in which the baseline differs most.
fn worst(trace: &Trace) -> Range<usize> {
    let count = trace.time_s.len();
    let length_s = trace.time_s[count - 1] - trace.time_s[0];
    if length_s <= CLOSE_S {
        return 0..count;
    }
    let length = ((CLOSE_S / length_s * count as f64) as usize).clamp(1, count);
    let power = |at: usize| {
        let value = trace.before_residual.get(at).copied().unwrap_or(0.0);
        if value.is_finite() { value * value } else { 0.0 }
    };
    let mut sum: f64 = (0..length).map(power).sum();
    let (mut best, mut start) = (sum, 0);
    for from in 1..=count - length {
        sum += power(from + length - 1) - power(from - 1);
        if sum > best {
            (best, start) = (sum, from);
        }
    }
    start..start + length
}

fn close(report: &Report, trace: &Trace, model: Model) -> String {
    let part = worst(trace);
    let (unit, factor) = words::display_unit(&trace.unit);
    let cut = |values: &[f64]| -> Vec<f64> {
        values.get(part.clone()).unwrap_or_default().iter().map(|value| value * factor).collect()
    };
    let time_s = &trace.time_s[part.clone()];
    let [measured, before, after] = [&trace.measured, &trace.before, &trace.after].map(|values| cut(values));
    // Of all three, so that both pictures have the same axes.
    let values = measured.iter().chain(&before).chain(&after).copied();
    let y = range(values).unwrap_or((0.0, 1.0));
    let mut plot = Plot::new(
        (time_s[0], time_s[time_s.len() - 1]),
        y,
        "time, s",
        &format!("{}, {unit}", words::signal(&trace.signal)),
    );
    let simulated = if model == Model::Before { &before } else { &after };
    let (class, area, name) = match model {
        Model::Before if report.is_rig_file_enough() => ("line s1", "trace s1", "simulated"),
        Model::Before => ("line s1", "trace s1", "simulated, the rig file as it was"),
        Model::After => ("line s2", "trace s2", "simulated, with what was found"),
    };
    plot.series("line s0", "trace s0", &columns(time_s, &measured, COLUMNS));
    plot.series(class, area, &columns(time_s, simulated, COLUMNS));
    let id = identifier(trace, model, "close");
    let title = format!("{}: measured and {name}", words::signal(&trace.signal));
    let range =
        format!("From {} to {} s.", words::fixed(time_s[0], 2), words::fixed(time_s[time_s.len() - 1], 2));
    figure(
        &format!("{}, where they differ most", words::signal(&trace.signal)),
        &range,
        &[(Sample::Line("line s0"), "measured"), (Sample::Line(class), name)],
        &plot.drawn(&id, &title, &range),
    )
}

/// Unit of a difference and its factor: the sensor's noise, or the signal's unit where the noise is unknown.
fn difference(trace: &Trace) -> (String, f64) {
    if trace.noise > 0.0 {
        return ("times the noise".to_owned(), 1.0 / trace.noise);
    }
    words::display_unit(&trace.unit)
}

fn residual_plot(report: &Report, trace: &Trace, model: Model) -> String {
    let (unit, factor) = difference(trace);
    let has_noise = trace.noise > 0.0;
    let scaled = |values: &[f64]| -> Vec<f64> { values.iter().map(|value| value * factor).collect() };
    let first = if report.is_rig_file_enough() { "measured minus simulated" } else { "before" };
    let (before, after) = (scaled(&trace.before_residual), scaled(&trace.after_residual));
    let (low, high) = range(before.iter().chain(&after).copied()).unwrap_or((-1.0, 1.0));
    let reach = low.abs().max(high.abs()).max(if has_noise { 4.0 } else { f64::MIN_POSITIVE });
    let x = (trace.time_s[0], trace.time_s[trace.time_s.len() - 1]);
    let over = if has_noise {
        "difference over the sensor's noise".to_owned()
    } else {
        format!("difference, {unit}")
    };
    let mut plot = Plot::new(x, (-reach, reach), "time, s", &over);
    let part = worst(trace);
    plot.stretch(trace.time_s[part.start], trace.time_s[part.end - 1]);
    if has_noise {
        plot.between(-2.0, 2.0);
    }
    plot.series("line s1", "trace s1", &columns(&trace.time_s, &before, COLUMNS));
    let mut legend = vec![(Sample::Area("trace s1"), first)];
    if model == Model::After {
        plot.series("line s2", "trace s2", &columns(&trace.time_s, &after, COLUMNS));
        legend.push((Sample::Area("trace s2"), "after"));
    }
    if has_noise {
        legend.push((Sample::Area("area"), "noise, \u{b1} 2 standard deviations"));
    }
    let sizes = format!("rms {} {unit}", words::short(rms(&before)));
    let sizes = if model == Model::After {
        format!("{sizes} before, {} after", words::short(rms(&after)))
    } else {
        sizes
    };
    figure(
        &format!("{}, difference", words::signal(&trace.signal)),
        &sizes,
        &legend,
        &plot.drawn(
            &identifier(trace, model, "whole"),
            &format!("{}: difference, {sizes}", words::signal(&trace.signal)),
            &sizes,
        ),
    )
}

/// Unique on the page, and a name that XML allows.
fn identifier(trace: &Trace, model: Model, what: &str) -> String {
    let signal: String = trace
        .signal
        .chars()
        .map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' })
        .collect();
    format!("p-{signal}-{what}-{}", if model == Model::Before { "before" } else { "after" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_second_is_found() {
        let time_s: Vec<f64> = (0..5000).map(|ms| f64::from(ms) * 1e-3).collect();
        let mut trace = Trace { before_residual: vec![0.0; 5000], time_s, noise: 1.0, ..Trace::default() };
        trace.before_residual[3000..3900].fill(2.0);
        trace.before_residual[10] = f64::NAN;
        let part = worst(&trace);
        assert!(part.contains(&3000) && part.contains(&3899) && part.len() == 1000, "{part:?}");
        assert!((rms(&trace.before_residual) - (3600.0_f64 / 4999.0).sqrt()).abs() < 1e-12);
    }
}
