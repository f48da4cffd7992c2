//! What counts as passed: `[passed]` of the experiment file, upper bounds on figures of `summary.json`.
//!
//! ```toml
//! [passed]
//! position_error_dynamic_m = 0.005
//! frames_lost = 0
//! "wakeup_ns.p99" = 1e6
//! ```
//!
//! A figure that was not measured does not keep its bound: absence is no proof.

use crate::SummaryError;
use serde_json::{Map, Value, json};

/// Holds the bounds of `passed` against `summary`: for each figure its bound, value and whether it was kept.
///
/// # Errors
/// [`SummaryError::Threshold`] when a key is no figure of the summary, or a bound is no finite number.
pub fn judge(passed: &toml::Table, summary: &Map<String, Value>) -> Result<Map<String, Value>, SummaryError> {
    let judged = passed.iter().map(|(key, bound)| {
        let refused = |problem: &str| SummaryError::Threshold {
            key: key.clone(),
            value: bound.to_string(),
            problem: problem.into(),
        };
        let bound = number(bound).ok_or_else(|| refused("a bound is a finite number"))?;
        let figure = figure(summary, key).ok_or_else(|| {
            refused(
                "no such figure; summary.json has position_error_dynamic_m, frames_lost, wakeup_ns.p99, …",
            )
        })?;
        let value = match figure {
            Value::Null => None,
            value => Some(value.as_f64().ok_or_else(|| refused("that key of summary.json is no number"))?),
        };
        let kept = value.is_some_and(|value| value <= bound);
        Ok((key.clone(), json!({ "bound": bound, "value": value, "kept": kept })))
    });
    judged.collect()
}

/// Whether a judged bound was kept.
#[must_use]
pub fn is_kept(entry: &Value) -> bool {
    entry["kept"] == Value::Bool(true)
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64)).filter(|n| n.is_finite())
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

    fn all_kept(judged: &Map<String, Value>) -> bool {
        judged.values().all(is_kept)
    }

    fn judged(passed: &str) -> Result<Map<String, Value>, SummaryError> {
        let summary =
            json!({ "frames_lost": 3, "wakeup_ns": { "p99": 1000 }, "position_error_static_m": null });
        let Value::Object(summary) = summary else { unreachable!("the literal above is an object") };
        judge(&passed.parse().unwrap(), &summary)
    }

    #[test]
    fn a_bound_is_kept_up_to_its_value() {
        for (passed, kept) in [
            ("frames_lost = 3", true),
            ("frames_lost = 2", false),
            ("\"wakeup_ns.p99\" = 1e6", true),
            ("\"wakeup_ns.p99\" = 999", false),
        ] {
            assert_eq!(all_kept(&judged(passed).unwrap()), kept, "{passed}");
        }
    }

    #[test]
    fn a_figure_that_was_not_measured_keeps_no_bound() {
        assert!(!all_kept(&judged("position_error_static_m = 1.0").unwrap()));
    }

    #[test]
    fn a_wrong_key_or_bound_is_told() {
        for (passed, hint) in [
            ("frames_lots = 0", "no such figure"),
            ("frames_lost = \"few\"", "finite number"),
            ("frames_lost = nan", "finite number"),
            ("wakeup_ns = 1", "no number"),
        ] {
            let message = judged(passed).unwrap_err().to_string();
            assert!(message.contains(hint), "{passed}: {message}");
        }
    }
}
