//! Joins what emulator and controllers left in a run's folder: `summary.json` and `run.json` become whole.
//!
//! The emulator writes both with what the rig knows; `controller.json` holds what only the controller knows (position errors,
//! sensor frames that never came, its command line and gains). Joining twice gives the same as joining once.

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
        self.summary["passed"] == Value::Bool(true)
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
    let passed = ended_well == Value::Bool(true) && thresholds::all_kept(&judged);
    summary.insert("ended_well".into(), ended_well);
    summary.insert("passed".into(), json!(passed));
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
    let take = |key: &str| controller.get(key).cloned().unwrap_or(Value::Null);
    for key in ["position_error_dynamic_m", "position_error_static_m"] {
        summary.insert(key.into(), take(key));
    }
    let lost = &controller["sensors_lost"];
    let at_controller = lost["drive"].as_u64().unwrap_or(0) + lost["load"].as_u64().unwrap_or(0);
    let at_rig = summary["frames_lost_at_rig"].as_u64().unwrap_or(0);
    summary.insert("frames_lost_at_controller".into(), json!(at_controller));
    summary.insert("frames_lost".into(), json!(at_rig + at_controller));
    let figures = [
        "wakeup_ns",
        "execution_ns",
        "period_error_ns",
        "allocations_in_cycle",
        "records_dropped",
        "ended_because",
    ];
    let figures: Map<_, _> = figures.iter().map(|key| ((*key).to_owned(), take(key))).collect();
    summary.insert("controller".into(), Value::Object(figures));
    let used = ["command_line", "version", "title", "position_p", "realtime_granted", "realtime_refused"];
    let used: Map<_, _> = used.iter().map(|key| ((*key).to_owned(), take(key))).collect();
    run.insert("controller".into(), Value::Object(used));
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
