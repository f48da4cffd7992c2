//! What counts as passed: `[passed]` of the experiment file, bounds on figures of `summary.json`.
//!
//! ```toml
//! [passed]
//! position_error_dynamic_m = 0.005                     # at most
//! force_settling_s = { least = 0.07, most = 0.13 }     # either may be left out
//! frames_lost = 0
//! "wakeup_ns.p99" = 1e6
//! ```
//!
//! A key is looked up at the top of the summary, then under `figures`. A figure that was not measured does not keep its bounds:
//! absence is no proof. Of a figure that each repetition has (`figures_by_repetition`) every value must keep them; the one that
//! keeps them least is judged.

use crate::{SummaryError, families};
use serde_json::{Map, Value, json};

/// Figures at the top of the summary, besides those of [`families`](crate::families); a name that ends with a dot has parts of
/// its own.
const TOP: &[&str] = &[
    "position_error_dynamic_m",
    "position_error_static_m",
    "cycles",
    "skipped",
    "overruns",
    "late_completions",
    "frames_sent",
    "frames_received",
    "frames_lost",
    "frames_lost_at_rig",
    "frames_lost_at_controller",
    "frames_malformed",
    "stale_commands",
    "allocations_in_cycle",
    "records_dropped",
    "event_count",
    "wakeup_ns.",
    "execution_ns.",
    "period_error_ns.",
    "round_trip_ns.",
    "drive_commands.",
    "load_commands.",
    "frames_ignored.",
    "bus.",
    "bus_host.",
    "controller.",
    "controllers.",
    "axes.",
];

/// What a figure must keep to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    least: Option<f64>,
    most: Option<f64>,
}

impl Bounds {
    /// Reads a number (at most so much), or a table of `least` and `most`.
    fn read(bound: &toml::Value) -> Result<Self, &'static str> {
        if let Some(most) = number(bound) {
            return Ok(Self { least: None, most: Some(most) });
        }
        let wanted =
            "a bound is a finite number, or { least = number, most = number } with at least one of them";
        let table = bound.as_table().filter(|table| !table.is_empty()).ok_or(wanted)?;
        if table.keys().any(|key| key != "least" && key != "most") {
            return Err(wanted);
        }
        let part = |key: &str| table.get(key).map(|value| number(value).ok_or(wanted)).transpose();
        let bounds = Self { least: part("least")?, most: part("most")? };
        if bounds.least.zip(bounds.most).is_some_and(|(least, most)| least > most) {
            return Err("least is above most: nothing keeps both");
        }
        Ok(bounds)
    }

    /// How far inside a value is; negative outside.
    fn slack(&self, value: f64) -> f64 {
        let below = self.most.map_or(f64::INFINITY, |most| most - value);
        below.min(self.least.map_or(f64::INFINITY, |least| value - least))
    }

    fn hold(&self, value: f64) -> bool {
        self.least.is_none_or(|least| value >= least) && self.most.is_none_or(|most| value <= most)
    }
}

/// Holds the bounds of `passed` against `summary`: for each figure its bounds, value and whether they were kept.
pub fn judge(passed: &toml::Table, summary: &Map<String, Value>) -> Result<Map<String, Value>, SummaryError> {
    let judged = passed.iter().map(|(key, bound)| {
        let refused = |problem: &str| refusal(key, bound, problem);
        let bounds = Bounds::read(bound).map_err(refused)?;
        let found = figure(summary, key).or(figure(known_figures(summary), key));
        let value = match found {
            None if !is_known(key) => return Err(refused(NO_SUCH)),
            None | Some(Value::Null) => None,
            Some(value) => {
                Some(value.as_f64().ok_or_else(|| refused("that key of summary.json is no number"))?)
            }
        };
        let value = value.map(|worst| {
            let each = summary.get("figures_by_repetition").and_then(|each| each.get(key)?.as_array());
            let values = each.into_iter().flatten().filter_map(Value::as_f64);
            values.fold(worst, |one, other| if bounds.slack(other) < bounds.slack(one) { other } else { one })
        });
        let kept = value.is_some_and(|value| bounds.hold(value));
        let Bounds { least, most } = bounds;
        Ok((key.clone(), json!({ "least": least, "most": most, "value": value, "kept": kept })))
    });
    judged.collect()
}

const NO_SUCH: &str =
    "no such figure; `bench figures` lists them, and summary.json has frames_lost, wakeup_ns.p99, …";

/// Finds what is wrong with the bounds of `passed` before there is a run.
pub fn check(passed: &toml::Table) -> Result<(), SummaryError> {
    for (key, bound) in passed {
        Bounds::read(bound).map_err(|problem| refusal(key, bound, problem))?;
        if !is_known(key) {
            return Err(refusal(key, bound, NO_SUCH));
        }
    }
    Ok(())
}

fn refusal(key: &str, bound: &toml::Value, problem: &str) -> SummaryError {
    SummaryError::Threshold { key: key.into(), value: bound.to_string(), problem: problem.into() }
}

/// Whether a run may have a figure of this key.
fn is_known(key: &str) -> bool {
    let at_top = |name: &&str| if name.ends_with('.') { key.starts_with(*name) } else { key == *name };
    TOP.iter().any(at_top) || families::definition(key).is_some()
}

/// Whether a judged bound was kept.
pub fn is_kept(entry: &Value) -> bool {
    entry["kept"] == Value::Bool(true)
}

pub fn in_words(entry: &Value) -> String {
    match (entry["least"].as_f64(), entry["most"].as_f64()) {
        (Some(least), Some(most)) => format!("from {least} to {most}"),
        (Some(least), None) => format!("at least {least}"),
        (None, Some(most)) => format!("at most {most}"),
        (None, None) => "unknown".into(),
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64)).filter(|n| n.is_finite())
}

/// `figures` of the summary; empty when there are none.
fn known_figures(summary: &Map<String, Value>) -> &Map<String, Value> {
    static NONE: std::sync::LazyLock<Map<String, Value>> = std::sync::LazyLock::new(Map::new);
    summary.get("figures").and_then(Value::as_object).unwrap_or(&NONE)
}

/// The figure under a key such as `frames_lost` or `wakeup_ns.p99`.
fn figure<'a>(summary: &'a Map<String, Value>, key: &str) -> Option<&'a Value> {
    let mut parts = key.split('.');
    let first = summary.get(parts.next()?)?;
    parts.try_fold(first, |value, part| value.get(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(passed: &str) -> Result<Map<String, Value>, SummaryError> {
        let summary = json!({
            "frames_lost": 3, "wakeup_ns": { "p99": 1000 }, "position_error_static_m": null,
            "figures": { "force_settling_s": 0.1 },
        });
        let Value::Object(summary) = summary else { unreachable!("the literal above is an object") };
        judge(&passed.parse().unwrap(), &summary)
    }

    #[test]
    fn a_bound_is_kept_up_to_its_value() {
        for (passed, kept) in [
            ("frames_lost = 3", true),
            ("frames_lost = 2", false),
            ("frames_lost = { least = 3 }", true),
            ("frames_lost = { least = 4 }", false),
            ("\"wakeup_ns.p99\" = 1e6", true),
            ("\"wakeup_ns.p99\" = 999", false),
            ("force_settling_s = { least = 0.07, most = 0.13 }", true),
            ("force_settling_s = { least = 0.11, most = 0.13 }", false),
            ("force_settling_s = { least = 0.07, most = 0.09 }", false),
        ] {
            assert_eq!(judged(passed).unwrap().values().all(is_kept), kept, "{passed}");
        }
    }

    #[test]
    fn every_repetition_must_keep_a_bound_and_the_one_that_keeps_it_least_is_told() {
        let summary = json!({
            "figures": { "force_settling_s": 0.12 },
            "figures_by_repetition": { "force_settling_s": [0.12, 0.08, null] },
        });
        let Value::Object(summary) = summary else { unreachable!("the literal above is an object") };
        for (bound, kept, value) in [
            ("{ least = 0.06, most = 0.13 }", true, 0.12),
            ("{ least = 0.075, most = 0.13 }", true, 0.08),
            ("{ least = 0.09, most = 0.13 }", false, 0.08),
            ("0.11", false, 0.12),
        ] {
            let judged = judge(&format!("force_settling_s = {bound}").parse().unwrap(), &summary).unwrap();
            let entry = &judged["force_settling_s"];
            assert_eq!((is_kept(entry), entry["value"].as_f64()), (kept, Some(value)), "{bound}");
        }
    }

    #[test]
    fn bounds_are_told_in_words() {
        for (passed, words) in [
            ("frames_lost = 3", "at most 3"),
            ("frames_lost = { least = 1 }", "at least 1"),
            ("frames_lost = { least = 1, most = 2.5 }", "from 1 to 2.5"),
        ] {
            assert_eq!(in_words(&judged(passed).unwrap()["frames_lost"]), words);
        }
    }

    #[test]
    fn a_figure_that_was_not_measured_keeps_no_bound() {
        for passed in ["position_error_static_m = 1.0", "force_rise_s = 1.0", "force_rise_s = { least = 0 }"]
        {
            assert!(!judged(passed).unwrap().values().all(is_kept), "{passed}");
        }
    }

    #[test]
    fn a_wrong_key_or_bound_is_told_after_a_run_and_before() {
        for (passed, hint) in [
            ("frames_lots = 0", "no such figure"),
            ("force_setling_s = 0", "no such figure"),
            ("frames_lost = \"few\"", "finite number"),
            ("frames_lost = nan", "finite number"),
            ("frames_lost = {}", "finite number"),
            ("frames_lost = { lest = 1 }", "finite number"),
            ("frames_lost = { least = 2, most = 1 }", "least is above most"),
        ] {
            let before = check(&passed.parse().unwrap()).unwrap_err().to_string();
            let after = judged(passed).unwrap_err().to_string();
            assert!(before.contains(hint) && after == before, "{passed}: {before}, {after}");
        }
        assert!(judged("wakeup_ns = 1").unwrap_err().to_string().contains("no number"));
        assert!(check(&"force_settling_s = 1\n\"wakeup_ns.p99\" = 1".parse().unwrap()).is_ok());
    }
}
