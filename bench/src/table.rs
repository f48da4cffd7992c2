//! The short table at the end of a run.

use crate::figures::{self, Definition};
use crate::join::Joined;
use crate::thresholds;
use serde_json::Value;
use std::fmt::Write as _;

/// The summary for a terminal: figures in the units that people use, bounds with whether they were kept.
#[must_use]
pub fn table(joined: &Joined) -> String {
    let figure = |key: &str| joined.figure(key);
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    row("position error, dynamic", millimetres(figure("position_error_dynamic_m")));
    row("position error, static", millimetres(figure("position_error_static_m")));
    for Definition { name, unit, .. } in figures::definitions() {
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

/// A figure's name for people: words instead of underscores, no unit.
#[must_use]
pub fn without_unit(name: &str) -> String {
    let units = ["_m_per_s", "_m", "_s", "_n"];
    let bare = units.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name);
    bare.replace('_', " ")
}

/// A value in the unit that people use for it.
#[must_use]
pub fn in_use(value: f64, unit: &str) -> String {
    match unit {
        "m" => format!("{} mm", short(value * 1e3)),
        "s" => format!("{} ms", short(value * 1e3)),
        "1" => short(value),
        unit => format!("{} {unit}", short(value)),
    }
}

/// Four digits that count; very small and very large numbers with an exponent.
#[must_use]
pub fn short(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || value.fract() == 0.0 && size < 1e6 {
        return format!("{value}");
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 7) as usize;
    format!("{value:.digits$}")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_told_in_the_units_of_people() {
        for (value, unit, expected) in [
            (0.002_147_3, "m", "2.147 mm"),
            (0.0871, "s", "87.10 ms"),
            (-203.456, "N", "-203.5 N"),
            (2.0, "1", "2"),
            (0.0, "m", "0 mm"),
            (1.2e-9, "1", "1.200e-9"),
        ] {
            assert_eq!(in_use(value, unit), expected);
        }
        assert_eq!(without_unit("stop_speed_m_per_s"), "stop speed");
        assert_eq!(without_unit("force_aperiodic"), "force aperiodic");
    }
}
