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

use crate::experiment::Experiment;
use crate::top;
use crate::{SummaryError, families};
use runlog::run_folder::{FileError, in_order, read_text};
use runlog::summary::{JoinedSummary, JudgedBound};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Keys at the top of the summary that have parts of their own, such as `wakeup_ns.p99`.
const WITH_PARTS: &[&str] = &[
    "wakeup_ns",
    "execution_ns",
    "period_error_ns",
    "round_trip_ns",
    "drive_commands",
    "load_commands",
    "frames_ignored",
    "bus",
    "bus_host",
    "controller",
    "controllers",
    "axes",
];

/// Value of a key of a run's summary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FigureValue {
    /// A number, in the key's unit.
    Number(f64),
    /// Null: the run had nothing to measure.
    NotMeasured,
    /// No number, so that it has no bounds.
    NonNumeric,
}

impl FigureValue {
    fn of(value: &Value) -> Self {
        match value {
            Value::Null => Self::NotMeasured,
            value => value.as_f64().map_or(Self::NonNumeric, Self::Number),
        }
    }
}

/// Values of each repetition, by figure.
pub type ByRepetition = BTreeMap<String, Vec<Option<f64>>>;

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

/// Compares the bounds of `passed` with the values that `value_of` returns for their keys; gives for each figure its bounds, its
/// value and whether the bounds were kept.
///
/// # Errors
/// [`SummaryError::Threshold`]: a bound that makes no sense, or of a figure that no run has.
pub fn judge(
    passed: &toml::Table,
    value_of: impl Fn(&str) -> Option<FigureValue>,
    by_repetition: &ByRepetition,
) -> Result<BTreeMap<String, JudgedBound>, SummaryError> {
    let judged = passed.iter().map(|(key, bound)| {
        let refused = |problem: &str| refusal(key, bound, problem);
        let bounds = Bounds::read(bound).map_err(refused)?;
        let value = match value_of(key) {
            None if !is_known(key) => return Err(refused(NO_SUCH)),
            None | Some(FigureValue::NotMeasured) => None,
            Some(FigureValue::NonNumeric) => return Err(refused("that key of summary.json is no number")),
            Some(FigureValue::Number(value)) => Some(value),
        };
        let value = value.map(|worst| {
            let values = by_repetition.get(key).into_iter().flatten().flatten();
            values
                .fold(worst, |one, other| if bounds.slack(*other) < bounds.slack(one) { *other } else { one })
        });
        let kept = value.is_some_and(|value| bounds.hold(value));
        let Bounds { least, most } = bounds;
        Ok((key.clone(), JudgedBound { least, most, value, kept }))
    });
    judged.collect()
}

/// As [`judge`], against a summary.
///
/// # Errors
/// As [`judge`].
pub(crate) fn judge_summary(
    passed: &toml::Table,
    summary: &JoinedSummary,
) -> Result<BTreeMap<String, JudgedBound>, SummaryError> {
    // A bound's key is a path in the file.
    let written = in_order(summary);
    let value_of = |key: &str| {
        let of_family = || summary.figures.get(key).copied().map(FigureValue::Number);
        at(&written, key).map(FigureValue::of).or_else(of_family)
    };
    judge(passed, value_of, &summary.figures_by_repetition)
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

/// The same for `[passed]` of the experiment in `file`.
///
/// # Errors
///
/// A file that cannot be read, or a bound that makes no sense.
pub fn check_file(file: &Path) -> Result<(), SummaryError> {
    let experiment: Experiment = read_text(file)?.parse().map_err(|error| FileError::read(file, error))?;
    check(&experiment.bounds().map_err(|error| FileError::read(file, error))?)
}

fn refusal(key: &str, bound: &toml::Value, problem: &str) -> SummaryError {
    SummaryError::Threshold { key: key.into(), value: bound.to_string(), problem: problem.into() }
}

/// Whether a run may have a figure of this key.
fn is_known(key: &str) -> bool {
    let with_parts = || key.split_once('.').is_some_and(|(first, _)| WITH_PARTS.contains(&first));
    top::find(key).is_some() || with_parts() || families::definition(key).is_some()
}

/// The bounds, for a person.
pub fn in_words(bound: &JudgedBound) -> String {
    match (bound.least, bound.most) {
        (Some(least), Some(most)) => format!("from {least} to {most}"),
        (Some(least), None) => format!("at least {least}"),
        (None, Some(most)) => format!("at most {most}"),
        (None, None) => "unknown".into(),
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64)).filter(|n| n.is_finite())
}

/// The value under a key such as `frames_lost` or `wakeup_ns.p99`.
fn at<'a>(file: &'a Value, key: &str) -> Option<&'a Value> {
    key.split('.').try_fold(file, |value, part| value.get(part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn judged_of(passed: &str, summary: Value) -> Result<BTreeMap<String, JudgedBound>, SummaryError> {
        judge_summary(&passed.parse().unwrap(), &serde_json::from_value(summary).unwrap())
    }

    fn judged(passed: &str) -> Result<BTreeMap<String, JudgedBound>, SummaryError> {
        let summary = json!({
            "frames_lost": 3, "wakeup_ns": { "p99": 1000, "count": 5 }, "position_error_static_m": null,
            "figures": { "force_settling_s": 0.1 },
        });
        judged_of(passed, summary)
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
            assert_eq!(judged(passed).unwrap().values().all(|bound| bound.kept), kept, "{passed}");
        }
    }

    #[test]
    fn every_repetition_must_keep_a_bound_and_the_one_that_keeps_it_least_is_reported() {
        let summary = json!({
            "figures": { "force_settling_s": 0.12 },
            "figures_by_repetition": { "force_settling_s": [0.12, 0.08, null] },
        });
        for (bound, kept, value) in [
            ("{ least = 0.06, most = 0.13 }", true, 0.12),
            ("{ least = 0.075, most = 0.13 }", true, 0.08),
            ("{ least = 0.09, most = 0.13 }", false, 0.08),
            ("0.11", false, 0.12),
        ] {
            let judged = judged_of(&format!("force_settling_s = {bound}"), summary.clone()).unwrap();
            let entry = &judged["force_settling_s"];
            assert_eq!((entry.kept, entry.value), (kept, Some(value)), "{bound}");
        }
    }

    #[test]
    fn bounds_are_put_in_words() {
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
            assert!(!judged(passed).unwrap().values().all(|bound| bound.kept), "{passed}");
        }
    }

    #[test]
    fn a_wrong_key_or_bound_is_refused_after_a_run_and_before() {
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
