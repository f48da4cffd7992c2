//! The short table at the end of a run.

use crate::families::{self, Definition};
use crate::join::Joined;
use crate::thresholds;
use pagekit::number::{in_use, short, without_unit};
use std::fmt::Write as _;

/// The summary for a terminal: figures in the units that people use, bounds with whether they were kept.
pub fn table(joined: &Joined) -> String {
    let summary = &joined.summary;
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    row("position error, dynamic", millimetres(summary.position_error_dynamic_m));
    row("position error, static", millimetres(summary.position_error_static_m));
    for Definition { name, unit, .. } in families::definitions() {
        if let Some(value) = summary.figures.get(*name) {
            row(&without_unit(name), in_use(*value, unit));
        }
    }
    let repetitions = joined.record.repetitions().len();
    if repetitions > 1 {
        row("repetitions", format!("{repetitions} (the figures are the worst)"));
    }
    row("cycles", format!("{} ({} skipped)", count(summary.cycles), count(summary.skipped)));
    if joined.is_rehearsal() {
        row("frames and latencies", "none: rehearsal, no bus".into());
    } else {
        row("overruns", count(summary.overruns));
        row("frames lost", count(summary.frames_lost));
        row("wake-up latency p50 / p99 / max", latency(summary.wakeup_ns.map(|ns| [ns.p50, ns.p99, ns.max])));
        row("round trip p50 / p99 / max", latency(summary.round_trip_ns.map(|ns| [ns.p50, ns.p99, ns.max])));
    }
    for (name, bound) in &summary.thresholds {
        let kept = if bound.kept { "kept" } else { "BROKEN" };
        let value = bound.value.map_or_else(|| "not measured".to_owned(), short);
        row(&format!("bound: {name}"), format!("{}, is {value}: {kept}", thresholds::in_words(bound)));
    }
    row("ended", summary.ended_because.clone().unwrap_or_else(|| "unknown".to_owned()));
    for reason in &summary.not_passed_because {
        row("not passed because", reason.clone());
    }
    row("passed", if joined.passed() { "yes" } else { "NO" }.to_owned());
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    rows.iter().fold(String::new(), |mut out, (name, value)| {
        let _ = writeln!(out, "  {name:width$}  {value}"); // writing to a string cannot fail
        out
    })
}

fn count(count: Option<u64>) -> String {
    count.map_or_else(|| "unknown".to_owned(), |count| count.to_string())
}

fn millimetres(metres: Option<f64>) -> String {
    metres.map_or_else(|| "not measured".to_owned(), |metres| format!("{:.3} mm", metres * 1e3))
}

/// The three percentiles of the row.
fn latency(percentiles_ns: Option<[Option<u64>; 3]>) -> String {
    match percentiles_ns {
        Some([Some(p50), Some(p99), Some(max)]) => {
            let [p50, p99, max] = [p50, p99, max].map(|ns| ns as f64 * 1e-3);
            format!("{p50:.1} / {p99:.1} / {max:.1} us")
        }
        _ => "none: simulated time".to_owned(),
    }
}
