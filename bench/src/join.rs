//! Joins what emulator and controllers left in a run's folder: `summary.json` and `run.json` become whole.
//!
//! The emulator writes both with what the rig knows; `controller.json` holds what only the controller knows (position errors,
//! sensor frames that never came, its command line and gains). Joining twice gives the same as joining once. A key that is
//! missing, since another version or a foreign controller wrote the file, counts as not known: null.
//!
//! A run has passed when emulator and controller ended well, the bounds of its experiment were kept, no record was dropped,
//! and no second rig spoke: what stands against it is listed in `not_passed_because`.

use crate::{SummaryError, thresholds};
use protocol::run_folder::write_json;
use serde_json::{Map, Value, json};
use std::path::Path;

/// A run's summary, joined and judged.
#[derive(Clone, Debug)]
pub struct Joined {
    /// `summary.json` as written.
    pub summary: Map<String, Value>,
    /// `run.json` as written.
    pub run: Map<String, Value>,
    /// Whether a controller of ours left its part.
    pub has_controller: bool,
}

impl Joined {
    /// Whether the run ended well and kept all its bounds.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.figure("passed") == &Value::Bool(true)
    }

    /// The value under a key of the summary; null when it is not there.
    #[must_use]
    pub fn figure(&self, key: &str) -> &Value {
        known(&self.summary, key)
    }
}

/// Joins the files of `folder` and writes them back.
///
/// # Errors
/// [`SummaryError`]: no summary, unreadable files, a threshold that makes no sense.
pub fn join(folder: &Path) -> Result<Joined, SummaryError> {
    let summary_path = folder.join("summary.json");
    if !summary_path.exists() {
        return Err(SummaryError::NoSummary(folder.into()));
    }
    let mut summary = read_object(&summary_path)?;
    let mut run = read_object(&folder.join("run.json"))?;
    let controller_path = folder.join("controller.json");
    let has_controller = controller_path.exists();
    if has_controller {
        add_controller(&mut summary, &mut run, &read_object(&controller_path)?);
    }
    let judged = thresholds::judge(&passed_section(&run)?, &summary)?;
    // `passed` of the emulator speaks of its own end, and is kept apart so that joining again starts from it.
    let ended_well =
        summary.get("ended_well").or(summary.get("passed")).cloned().unwrap_or(Value::Bool(false));
    summary.insert("ended_well".into(), ended_well);
    let against = against(&summary, &judged);
    summary.insert("passed".into(), json!(against.is_empty()));
    summary.insert("not_passed_because".into(), json!(against));
    summary.insert("thresholds".into(), Value::Object(judged));
    for (name, value) in [("summary.json", &summary), ("run.json", &run)] {
        let path = folder.join(name);
        write_json(&path, value).map_err(|error| SummaryError::write(&path, error))?;
    }
    Ok(Joined { summary, run, has_controller })
}

fn add_controller(
    summary: &mut Map<String, Value>,
    run: &mut Map<String, Value>,
    controller: &Map<String, Value>,
) {
    let take = |key: &str| known(controller, key).clone();
    for key in ["position_error_dynamic_m", "position_error_static_m"] {
        summary.insert(key.into(), take(key));
    }
    let lost = known(controller, "sensors_lost");
    let at_controller = sum_of_known([&lost["drive"], &lost["load"]]);
    let at_rig = known(summary, "frames_lost_at_rig");
    let lost = sum_of_known([at_rig, &json!(at_controller)]);
    summary.insert("frames_lost_at_controller".into(), json!(at_controller));
    summary.insert("frames_lost".into(), json!(lost));
    let figures = [
        "wakeup_ns",
        "execution_ns",
        "period_error_ns",
        "allocations_in_cycle",
        "records_dropped",
        "ended_because",
        "ended_well",
    ];
    let figures: Map<_, _> = figures.iter().map(|key| ((*key).to_owned(), take(key))).collect();
    summary.insert("controller".into(), Value::Object(figures));
    let used = ["command_line", "version", "title", "position_p", "realtime_granted", "realtime_refused"];
    let used: Map<_, _> = used.iter().map(|key| ((*key).to_owned(), take(key))).collect();
    run.insert("controller".into(), Value::Object(used));
}

/// What stands against the run, in a few words each; empty when it has passed.
fn against(summary: &Map<String, Value>, judged: &Map<String, Value>) -> Vec<String> {
    let mut against = Vec::new();
    if known(summary, "ended_well") != &Value::Bool(true) {
        against.push("the emulator did not end well".into());
    }
    // Null: the controller is of an earlier version that does not say, or is not ours.
    if known(summary, "controller").get("ended_well").is_some_and(|well| well == &Value::Bool(false)) {
        against.push("the controller did not end well".into());
    }
    let broken = judged.iter().filter(|(_, entry)| !thresholds::is_kept(entry));
    against.extend(broken.map(|(name, _)| format!("bound broken: {name}")));
    let dropped = known(summary, "records_dropped");
    if dropped.as_u64().is_some_and(|count| count > 0) {
        against.push(format!("{dropped} records did not reach the files"));
    }
    let second_rig = &known(summary, "frames_ignored")["second_rig"];
    if second_rig.as_u64().is_some_and(|count| count > 0) {
        against.push(format!("{second_rig} frames came from a second rig"));
    }
    against
}

/// The value under `key`; null when it is not there.
fn known<'a>(map: &'a Map<String, Value>, key: &str) -> &'a Value {
    map.get(key).unwrap_or(&Value::Null)
}

/// The sum of those counts that are known; `None` when none is.
fn sum_of_known(counts: [&Value; 2]) -> Option<u64> {
    counts.into_iter().filter_map(Value::as_u64).reduce(|sum, count| sum + count)
}

/// `[passed]` of the experiment that the run used; empty without one.
fn passed_section(run: &Map<String, Value>) -> Result<toml::Table, SummaryError> {
    let Some(text) = run.get("experiment_toml").and_then(Value::as_str) else {
        return Ok(toml::Table::new());
    };
    let experiment: toml::Table =
        text.parse().map_err(|error| SummaryError::read(Path::new("run.json: experiment_toml"), error))?;
    Ok(experiment.get("passed").and_then(toml::Value::as_table).cloned().unwrap_or_default())
}

fn read_object(path: &Path) -> Result<Map<String, Value>, SummaryError> {
    let text = std::fs::read_to_string(path).map_err(|error| SummaryError::read(path, error))?;
    serde_json::from_str(&text).map_err(|error| SummaryError::read(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(with_controller: bool) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, value: Value| std::fs::write(folder.path().join(name), value.to_string()).unwrap();
        write(
            "run.json",
            json!({ "experiment_toml": "[passed]\nposition_error_dynamic_m = 0.005\nframes_lost = 2\n" }),
        );
        write(
            "summary.json",
            json!({ "passed": true, "frames_lost": 1, "frames_lost_at_rig": 1, "position_error_dynamic_m": null }),
        );
        if with_controller {
            let lost = json!({ "drive": 1, "load": 0 });
            write("controller.json", json!({ "position_error_dynamic_m": 0.002, "sensors_lost": lost }));
        }
        folder
    }

    #[test]
    fn both_parts_become_one_and_joining_again_changes_nothing() {
        let folder = folder(true);
        let joined = join(folder.path()).unwrap();
        assert!(joined.passed());
        assert_eq!(joined.summary["frames_lost"], 2);
        assert_eq!(joined.summary["position_error_dynamic_m"], 0.002);
        assert_eq!(join(folder.path()).unwrap().summary, joined.summary);
    }

    /// Summed up with these keys in place of, or besides, those of [`folder`].
    fn joined_with(summary: Value, controller: Value) -> Joined {
        let folder = folder(true);
        for (name, changes) in [("summary.json", summary), ("controller.json", controller)] {
            let path = folder.path().join(name);
            let mut object = read_object(&path).unwrap();
            for (key, value) in changes.as_object().unwrap() {
                object.insert(key.clone(), value.clone());
            }
            write_json(&path, &object).unwrap();
        }
        join(folder.path()).unwrap()
    }

    #[test]
    fn what_stands_against_a_run_is_named() {
        let nothing = json!({});
        let good = json!({ "records_dropped": 0, "frames_ignored": { "second_rig": 0 } });
        let well = |well: bool| json!({ "ended_well": well });
        for (summary, controller, against) in [
            (good, well(true), json!([])),
            (nothing.clone(), well(false), json!(["the controller did not end well"])),
            (json!({ "passed": false }), nothing.clone(), json!(["the emulator did not end well"])),
            (json!({ "records_dropped": 3 }), nothing.clone(), json!(["3 records did not reach the files"])),
            (
                json!({ "frames_ignored": { "second_rig": 2 } }),
                nothing.clone(),
                json!(["2 frames came from a second rig"]),
            ),
            (json!({ "frames_lost_at_rig": 9 }), nothing, json!(["bound broken: frames_lost"])),
        ] {
            let joined = joined_with(summary, controller);
            assert_eq!(joined.summary["not_passed_because"], against);
            assert_eq!(joined.passed(), against == json!([]), "{against}");
        }
    }

    #[test]
    fn what_a_controller_or_a_rig_does_not_tell_is_not_known() {
        let folder = folder(true);
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        for (summary, controller, at_controller, in_all) in [
            (r#"{"frames_lost_at_rig": 1}"#, "{}", Value::Null, json!(1)),
            (r#"{"frames_lost_at_rig": 1}"#, r#"{"sensors_lost": {"drive": 2}}"#, json!(2), json!(3)),
            ("{}", r#"{"sensors_lost": 7}"#, Value::Null, Value::Null),
        ] {
            write("summary.json", summary);
            write("controller.json", controller);
            write("run.json", "{}");
            let joined = join(folder.path()).unwrap();
            assert_eq!(joined.figure("frames_lost_at_controller"), &at_controller, "{summary} {controller}");
            assert_eq!(joined.figure("frames_lost"), &in_all, "{summary} {controller}");
            assert!(!joined.passed());
            assert!(crate::table::table(&joined).contains("frames lost"));
        }
    }

    #[test]
    fn without_a_controller_a_bound_on_its_figure_is_not_kept() {
        let folder = folder(false);
        let joined = join(folder.path()).unwrap();
        assert!(!joined.passed());
        assert_eq!(joined.summary["thresholds"]["position_error_dynamic_m"]["value"], Value::Null);
    }

    #[test]
    fn a_folder_without_a_summary_says_what_happened() {
        let folder = tempfile::tempdir().unwrap();
        assert!(join(folder.path()).unwrap_err().to_string().contains("killed or is still running"));
    }
}
