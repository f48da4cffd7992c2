//! Joins what emulator and controllers left in a run's folder: `summary.json` and `run.json` become whole.
//!
//! The emulator writes both with what the rig knows. `controller.json` (one process for both axes), or
//! `controller-drive.json` and `controller-load.json` (a process each), hold what only the controllers know; the tables give the
//! figures. Joining twice gives the same as joining once. A key that is missing, since another version or a foreign controller
//! wrote the file, counts as not known: null.
//!
//! A run has passed when emulator and controllers ended well, the bounds of its experiment were kept, no record was dropped,
//! and no second rig spoke: what stands against it is listed in `not_passed_because`.

use crate::families::{self, Figures, position};
use crate::record::{self, Record};
use crate::reports::{self, Reports};
use crate::{SummaryError, thresholds};
use runlog::run_folder::{FileError, read_json, write_json};
use serde_json::{Map, Value, json};
use std::path::Path;

/// What a controller process tells of itself at the end, and the summary takes.
const PROCESS_FIGURES: &[&str] = &[
    "wakeup_ns",
    "execution_ns",
    "period_error_ns",
    "allocations_in_cycle",
    "records_dropped",
    "ended_because",
    "ended_well",
];

/// A run's summary, joined and judged.
#[derive(Clone, Debug)]
pub struct Joined {
    /// `summary.json` as written.
    pub summary: Map<String, Value>,
    /// `run.json` as written.
    pub run: Map<String, Value>,
    pub record: Record,
}

impl Joined {
    /// Whether the run ended well and kept all its bounds.
    pub fn passed(&self) -> bool {
        self.figure("passed") == &Value::Bool(true)
    }

    /// The value under a key of the summary; null when it is not there.
    pub fn figure(&self, key: &str) -> &Value {
        known(&self.summary, key)
    }

    /// Whether there was no bus: the rehearsal runs the plant inside the controller.
    pub fn is_rehearsal(&self) -> bool {
        is_rehearsal(&self.run)
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
    let mut summary = read_json(&summary_path)?;
    let mut run = read_json(&folder.join("run.json"))?;
    add_controllers(&mut summary, &mut run, folder)?;
    let experiment = experiment(&run)?;
    let record = record::read(folder, experiment)?;
    add_figures(&mut summary, &record, &families::of(&record));
    let passed = record.experiment.get("passed").and_then(toml::Value::as_table).cloned().unwrap_or_default();
    let judged = thresholds::judge(&passed, &summary)?;
    // `passed` of the emulator speaks of its own end, and is kept apart so that joining again starts from it.
    let ended_well =
        summary.get("ended_well").or(summary.get("passed")).cloned().unwrap_or(Value::Bool(false));
    summary.insert("ended_well".into(), ended_well);
    let against = against(&summary, &judged, is_rehearsal(&run));
    summary.insert("passed".into(), json!(against.is_empty()));
    summary.insert("not_passed_because".into(), json!(against));
    summary.insert("thresholds".into(), Value::Object(judged));
    for (name, value) in [("summary.json", &summary), ("run.json", &run)] {
        let path = folder.join(name);
        write_json(&path, value).map_err(|error| FileError::write(&path, error))?;
    }
    Ok(Joined { summary, run, record })
}

/// The controllers' files as far as they are there: one for both axes, or one each.
fn add_controllers(
    summary: &mut Map<String, Value>,
    run: &mut Map<String, Value>,
    folder: &Path,
) -> Result<(), SummaryError> {
    let reports = reports::read(folder)?;
    let split = |reported: &Map<String, Value>| {
        let figures: Map<_, _> =
            PROCESS_FIGURES.iter().map(|key| ((*key).to_owned(), known(reported, key).clone())).collect();
        let apart = |key: &str| key != "axes" && !PROCESS_FIGURES.contains(&key);
        let used = reported.iter().filter(|(key, _)| apart(key));
        let used: Map<_, _> = used.map(|(key, value)| (key.clone(), value.clone())).collect();
        (Value::Object(figures), Value::Object(used))
    };
    match &reports {
        Reports::None => return Ok(()),
        Reports::Both(reported) => {
            let (figures, used) = split(reported);
            summary.insert("controller".into(), figures);
            run.insert("controller".into(), used);
        }
        Reports::Each(each) => {
            let (mut figures, mut used) = (Map::new(), Map::new());
            for (axis, reported) in each {
                let own = split(reported);
                figures.insert((*axis).into(), own.0);
                used.insert((*axis).into(), own.1);
            }
            summary.insert("controllers".into(), Value::Object(figures));
            run.insert("controllers".into(), Value::Object(used));
        }
    }
    let axes = reports.axes();
    let lost = axes.values().filter_map(|axis| total(&axis["sensors_lost"]));
    let at_controller = lost.reduce(|sum, count| sum + count);
    let at_rig = known(summary, "frames_lost_at_rig").as_u64();
    let lost = [at_rig, at_controller].into_iter().flatten().reduce(|sum, count| sum + count);
    summary.insert("frames_lost_at_controller".into(), json!(at_controller));
    summary.insert("frames_lost".into(), json!(lost));
    for key in ["position_error_dynamic_m", "position_error_static_m"] {
        summary.insert(key.into(), known(&axes, "drive")[key].clone());
    }
    summary.insert("axes".into(), Value::Object(axes));
    Ok(())
}

/// A count, or the sum of an object's counts; `None` when it holds none.
fn total(counts: &Value) -> Option<u64> {
    match counts {
        Value::Object(parts) => parts.values().filter_map(Value::as_u64).reduce(|sum, count| sum + count),
        count => count.as_u64(),
    }
}

fn add_figures(summary: &mut Map<String, Value>, record: &Record, figures: &Figures) {
    // The drive's controller has reported them as it went; one that did not is made up for.
    let made_up = [
        ("position_error_dynamic_m", position::error_dynamic_m as fn(&Record) -> _),
        ("position_error_static_m", position::error_static_m),
    ];
    for (key, compute) in made_up {
        if known(summary, key).is_null() {
            summary.insert(key.into(), json!(compute(record)));
        }
    }
    let values: Map<_, _> = figures.iter().map(|(name, value)| (name.to_owned(), json!(value))).collect();
    summary.insert("figures".into(), Value::Object(values));
    let each: Map<_, _> =
        figures.by_repetition().map(|(name, values)| (name.to_owned(), json!(values))).collect();
    summary.insert("figures_by_repetition".into(), Value::Object(each));
}

/// What stands against the run, in a few words each; empty when it has passed.
fn against(summary: &Map<String, Value>, judged: &Map<String, Value>, is_rehearsal: bool) -> Vec<String> {
    let mut against = Vec::new();
    if known(summary, "ended_well") != &Value::Bool(true) {
        let who = if is_rehearsal { "rehearsal" } else { "emulator" };
        against.push(format!("the {who} did not end well"));
    }
    // Null: the controller is of an earlier version that does not say, or is not ours.
    let ended_badly = |who: &str, reported: &Value| {
        let why = reported["ended_because"].as_str().map_or_else(String::new, |why| format!(": {why}"));
        (reported["ended_well"] == Value::Bool(false)).then(|| format!("the {who} did not end well{why}"))
    };
    against.extend(ended_badly("controller", known(summary, "controller")));
    for (axis, reported) in known(summary, "controllers").as_object().into_iter().flatten() {
        against.extend(ended_badly(&format!("{axis} controller"), reported));
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

fn is_rehearsal(run: &Map<String, Value>) -> bool {
    known(run, "pace") == "rehearsal"
}

/// The experiment that the run used; empty without one.
pub fn experiment(run: &Map<String, Value>) -> Result<toml::Table, SummaryError> {
    let text = run.get("experiment_toml").and_then(Value::as_str).unwrap_or_default();
    Ok(text.parse().map_err(|error| FileError::read(Path::new("run.json: experiment_toml"), error))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with these files besides what an emulator that ended well leaves.
    fn folder(files: &[(&str, Value)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, value: &Value| std::fs::write(folder.path().join(name), value.to_string()).unwrap();
        write(
            "run.json",
            &json!({ "experiment_toml": "[passed]\nposition_error_dynamic_m = 0.005\nframes_lost = 2\n" }),
        );
        write(
            "summary.json",
            &json!({ "passed": true, "frames_lost": 1, "frames_lost_at_rig": 1, "position_error_dynamic_m": null }),
        );
        files.iter().for_each(|(name, value)| write(name, value));
        folder
    }

    /// What a controller for both axes says.
    fn both(changes: &Value) -> Value {
        let mut reported = json!({
            "title": "position-p",
            "ended_well": true,
            "axes": { "drive": { "position_error_dynamic_m": 0.002, "sensors_lost": 1 }, "load": { "sensors_lost": 0 } },
        });
        for (key, value) in changes.as_object().unwrap() {
            reported[key] = value.clone();
        }
        reported
    }

    #[test]
    fn no_key_of_a_joined_summary_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["summary.json", "run.json", "controller.json"] {
            std::fs::write(folder.path().join(name), runlog::golden::text(name)).unwrap();
        }
        let joined = join(folder.path()).unwrap();
        runlog::golden::check("summary.keys", &runlog::golden::keys(&Value::Object(joined.summary)));
    }

    #[test]
    fn all_parts_become_one_and_joining_again_changes_nothing() {
        let folder = folder(&[("controller.json", both(&json!({})))]);
        let joined = join(folder.path()).unwrap();
        assert!(joined.passed());
        assert_eq!(joined.summary["frames_lost"], 2);
        assert_eq!(joined.summary["position_error_dynamic_m"], 0.002);
        assert_eq!(joined.run["controller"], json!({ "title": "position-p" }));
        assert_eq!(join(folder.path()).unwrap().summary, joined.summary);
    }

    #[test]
    fn a_process_for_each_axis_is_joined_as_one_for_both() {
        let drive = json!({ "ended_well": true, "axes": { "drive": {
            "position_error_dynamic_m": 0.002, "sensors_lost": { "drive": 1, "load": 2 } } } });
        let load = json!({ "ended_well": false, "axes": { "load": { "sensors_lost": 4 } } });
        let folder = folder(&[("controller-drive.json", drive), ("controller-load.json", load)]);
        let joined = join(folder.path()).unwrap();
        assert_eq!(joined.summary["frames_lost_at_controller"], 7);
        assert_eq!(joined.summary["position_error_dynamic_m"], 0.002);
        assert_eq!(joined.summary["controllers"]["load"]["ended_well"], false);
        let against = json!(["the load controller did not end well", "bound broken: frames_lost"]);
        assert_eq!(joined.summary["not_passed_because"], against);
    }

    #[test]
    fn what_stands_against_a_run_is_named() {
        let nothing = json!({});
        let good = json!({ "passed": true, "records_dropped": 0, "frames_ignored": { "second_rig": 0 } });
        let rig = |changes: Value| {
            let mut reported = json!({ "passed": true });
            reported.as_object_mut().unwrap().extend(changes.as_object().unwrap().clone());
            reported
        };
        for (summary, controller, against) in [
            (good, nothing.clone(), json!([])),
            (
                rig(json!({})),
                json!({ "ended_well": false, "ended_because": "stopped" }),
                json!(["the controller did not end well: stopped"]),
            ),
            (json!({ "passed": false }), nothing.clone(), json!(["the emulator did not end well"])),
            (
                rig(json!({ "records_dropped": 3 })),
                nothing.clone(),
                json!(["3 records did not reach the files"]),
            ),
            (
                rig(json!({ "frames_ignored": { "second_rig": 2 } })),
                nothing.clone(),
                json!(["2 frames came from a second rig"]),
            ),
            (rig(json!({ "frames_lost_at_rig": 9 })), nothing, json!(["bound broken: frames_lost"])),
        ] {
            let folder = folder(&[("summary.json", summary), ("controller.json", both(&controller))]);
            let joined = join(folder.path()).unwrap();
            assert_eq!(joined.summary["not_passed_because"], against);
            assert_eq!(joined.passed(), against == json!([]), "{against}");
        }
    }

    #[test]
    fn what_a_controller_or_a_rig_does_not_tell_is_not_known() {
        let axes = |drive: Value| json!({ "axes": { "drive": drive } });
        for (summary, controller, at_controller, in_all) in [
            (json!({ "frames_lost_at_rig": 1 }), json!({}), Value::Null, json!(1)),
            (json!({ "frames_lost_at_rig": 1 }), axes(json!({ "sensors_lost": 2 })), json!(2), json!(3)),
            (json!({}), axes(json!(7)), Value::Null, Value::Null),
            (json!({}), json!({ "axes": 7 }), Value::Null, Value::Null),
        ] {
            let at = format!("{summary} {controller}");
            let files = [("summary.json", summary), ("controller.json", controller), ("run.json", json!({}))];
            let joined = join(folder(&files).path()).unwrap();
            assert_eq!(joined.figure("frames_lost_at_controller"), &at_controller, "{at}");
            assert_eq!(joined.figure("frames_lost"), &in_all, "{at}");
            assert!(!joined.passed());
            assert!(crate::table::table(&joined).contains("frames lost"));
        }
    }

    #[test]
    fn an_error_that_no_controller_told_is_computed_from_its_table() {
        let folder = folder(&[("controller.json", json!({ "axes": { "drive": {} } }))]);
        let rows = "time_s,main_chain,set_position_m,position_m,moving\n0.0,experiment,0.2,0.197,1\n0.001,experiment,0.2,0.2,1\n";
        std::fs::write(folder.path().join("controller-drive.csv"), rows).unwrap();
        let joined = join(folder.path()).unwrap();
        assert!((joined.figure("position_error_dynamic_m").as_f64().unwrap() - 0.003).abs() < 1e-12);
        assert!(joined.passed());
    }

    #[test]
    fn a_table_of_an_axis_that_no_report_names_is_of_an_earlier_run() {
        let alone = json!({ "ended_well": true, "axes": { "drive": { "sensors_lost": 0 } } });
        let folder = folder(&[("controller-drive.json", alone)]);
        let rows = "time_s,main_chain,opening\n0.0,experiment,0.5\n0.001,experiment,0.5\n";
        for axis in ["drive", "load"] {
            std::fs::write(folder.path().join(format!("controller-{axis}.csv")), rows).unwrap();
        }
        let record = join(folder.path()).unwrap().record;
        assert!(!record.drive.numbers("opening").is_empty());
        assert!(record.load.numbers("opening").is_empty() && !record.load_acts());
    }

    #[test]
    fn without_a_controller_a_bound_on_its_figure_is_not_kept() {
        let joined = join(folder(&[]).path()).unwrap();
        assert!(!joined.passed());
        assert_eq!(joined.summary["thresholds"]["position_error_dynamic_m"]["value"], Value::Null);
    }

    #[test]
    fn a_rehearsal_has_no_bus_to_tell_of() {
        let run = json!({ "pace": "rehearsal" });
        let summary = json!({ "passed": false, "cycles": 5 });
        let joined = join(folder(&[("run.json", run), ("summary.json", summary)]).path()).unwrap();
        assert_eq!(joined.figure("not_passed_because"), &json!(["the rehearsal did not end well"]));
        let table = crate::table::table(&joined);
        assert!(table.contains("none: rehearsal, no bus"), "{table}");
    }

    #[test]
    fn a_folder_without_a_summary_says_what_happened() {
        let folder = tempfile::tempdir().unwrap();
        assert!(join(folder.path()).unwrap_err().to_string().contains("killed or is still running"));
    }
}
