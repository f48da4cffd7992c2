//! The short table at the end of a run.

use crate::families::{self, Definition};
use crate::join::Joined;
use crate::thresholds;
use pagekit::number::{in_use, short, without_unit};
use serde_json::Value;
use std::fmt::Write as _;

/// The summary for a terminal: figures in the units that people use, bounds with whether they were kept.
pub fn table(joined: &Joined) -> String {
    let figure = |key: &str| joined.figure(key);
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    row("position error, dynamic", millimetres(figure("position_error_dynamic_m")));
    row("position error, static", millimetres(figure("position_error_static_m")));
    for Definition { name, unit, .. } in families::definitions() {
        if let Some(value) = figure("figures")[*name].as_f64() {
            row(&without_unit(name), in_use(value, unit));
        }
    }
    let repetitions = joined.record.repetitions().len();
    if repetitions > 1 {
        row("repetitions", format!("{repetitions} (the figures are the worst)"));
    }
    row("cycles", format!("{} ({} skipped)", count(figure("cycles")), count(figure("skipped"))));
    if joined.is_rehearsal() {
        row("frames and latencies", "none: rehearsal, no bus".into());
    } else {
        row("overruns", count(figure("overruns")));
        row("frames lost", count(figure("frames_lost")));
        row("wake-up latency p50 / p99 / max", latency(figure("wakeup_ns")));
        row("round trip p50 / p99 / max", latency(figure("round_trip_ns")));
    }
    for (name, entry) in figure("thresholds").as_object().into_iter().flatten() {
        let kept = if thresholds::is_kept(entry) { "kept" } else { "BROKEN" };
        let value = entry["value"].as_f64().map_or_else(|| "not measured".to_owned(), short);
        row(&format!("bound: {name}"), format!("{}, is {value}: {kept}", thresholds::in_words(entry)));
    }
    row("ended", text(figure("ended_because")));
    for reason in figure("not_passed_because").as_array().into_iter().flatten() {
        row("not passed because", text(reason));
    }
    row("passed", if joined.passed() { "yes" } else { "NO" }.to_owned());
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    rows.iter().fold(String::new(), |mut out, (name, value)| {
        let _ = writeln!(out, "  {name:width$}  {value}"); // writing to a string cannot fail
        out
    })
}

fn count(value: &Value) -> String {
    value.as_u64().map_or_else(|| "unknown".to_owned(), |count| count.to_string())
}

fn millimetres(value: &Value) -> String {
    value.as_f64().map_or_else(|| "not measured".to_owned(), |metres| format!("{:.3} mm", metres * 1e3))
}

fn latency(percentiles: &Value) -> String {
    let microseconds = |key: &str| percentiles[key].as_f64().map(|ns| ns * 1e-3);
    match (microseconds("p50"), microseconds("p99"), microseconds("max")) {
        (Some(p50), Some(p99), Some(max)) => format!("{p50:.1} / {p99:.1} / {max:.1} us"),
        _ => "none: simulated time".to_owned(),
    }
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or("unknown").to_owned()
}
