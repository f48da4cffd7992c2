//! Joins what emulator and controllers left in a run's folder: `summary.json` and `run.json` become whole.
//!
//! The emulator writes both with what the rig knows. `controller.json` (one process for both axes), or
//! `controller-drive.json` and `controller-load.json` (a process each), hold what only the controllers know; the tables give the
//! figures. Joining twice gives the same as joining once. A key that is missing, since another version or a foreign controller
//! wrote the file, counts as not known: null.
//!
//! A run has passed when emulator and controllers ended well, the bounds of its experiment were kept, no record was dropped,
//! and no second rig spoke: what stands against it is listed in `not_passed_because`.

use crate::experiment::Experiment;
use crate::families::{self, Figures, position};
use crate::record::{self, Record};
use crate::reports::{self, ControllerReports};
use crate::{SummaryError, thresholds};
use runlog::controller_report::{ControllerFigures, reported_of_axis};
use runlog::run_folder::{FileError, RUN_JSON, SUMMARY_JSON, in_order, read_json, write_json};
use runlog::summary::{JoinedRun, JoinedSummary, ReportedByControllers};
use std::path::Path;

/// A run's summary, joined and judged.
#[derive(Clone, Debug)]
pub struct Joined {
    /// `summary.json` as written.
    pub summary: JoinedSummary,
    /// `run.json` as written.
    pub run: JoinedRun,
    /// The tables that the figures are measured on.
    pub record: Record,
}

impl Joined {
    /// Whether the run ended well and kept all its bounds.
    pub fn passed(&self) -> bool {
        self.summary.passed == Some(true)
    }

    /// Whether there was no bus.
    pub fn is_rehearsal(&self) -> bool {
        self.run.is_rehearsal()
    }
}

/// A run's `summary.json` and `run.json` as they stand, joined or not.
///
/// # Errors
/// [`SummaryError`]: no summary, unreadable files.
pub fn read(folder: &Path) -> Result<(JoinedSummary, JoinedRun), SummaryError> {
    let summary_path = folder.join(SUMMARY_JSON);
    if !summary_path.exists() {
        return Err(SummaryError::NoSummary(folder.into()));
    }
    Ok((JoinedSummary::read(&summary_path)?, read_json(&folder.join(RUN_JSON))?))
}

/// Joins the files of `folder` and writes them back.
///
/// # Errors
/// [`SummaryError`]: no summary, unreadable files, a threshold that makes no sense.
pub fn join(folder: &Path) -> Result<Joined, SummaryError> {
    let (mut summary, mut run) = read(folder)?;
    add_controllers(&mut summary, &mut run, reports::read(folder)?);
    let record = record::read(folder, experiment(&run)?)?;
    make_up_errors(&mut summary, &record);
    add_figures(&mut summary, &families::of(&record));
    let passed = record.experiment.bounds().unwrap_or_default();
    // `passed` of the emulator speaks of its own end, and is kept apart so that joining again starts from it.
    summary.ended_well = Some(summary.ended_well.or(summary.passed).unwrap_or(false));
    summary.thresholds = thresholds::judge_summary(&passed, &summary)?;
    summary.not_passed_because = against(&summary, run.is_rehearsal());
    summary.passed = Some(summary.not_passed_because.is_empty());
    for (name, file) in [(SUMMARY_JSON, in_order(&summary)), (RUN_JSON, in_order(&run))] {
        let path = folder.join(name);
        write_json(&path, &file).map_err(|error| FileError::write(&path, error))?;
    }
    Ok(Joined { summary, run, record })
}

/// The controllers' reports as far as they are there: one for both axes, or one each.
fn add_controllers(summary: &mut JoinedSummary, run: &mut JoinedRun, reports: ControllerReports) {
    let axes = reports.axes();
    let mut by_controllers = ReportedByControllers::default();
    match reports {
        ControllerReports::None => return,
        ControllerReports::Both(reported) => {
            by_controllers.controller = Some(reported.figures);
            run.controller = Some(reported.used);
        }
        ControllerReports::Each(each) => {
            let parted = each.into_iter().map(|(axis, report)| {
                let named = |axis: &str| axis.to_owned();
                ((named(axis), report.figures), (named(axis), report.used))
            });
            let (figures, used) = parted.unzip();
            by_controllers.controllers = Some(figures);
            run.controllers = Some(used);
        }
    }
    let sum = |counts: &mut dyn Iterator<Item = u64>| counts.reduce(|sum, count| sum + count);
    by_controllers.frames_lost_at_controller =
        sum(&mut axes.values().filter_map(|axis| reported_of_axis(axis).sensors_lost));
    let lost = [summary.frames_lost_at_rig, by_controllers.frames_lost_at_controller];
    summary.frames_lost = sum(&mut lost.into_iter().flatten());
    let drive = axes.get("drive").map(reported_of_axis).unwrap_or_default();
    summary.position_error_dynamic_m = drive.position_error_dynamic_m;
    summary.position_error_static_m = drive.position_error_static_m;
    by_controllers.axes = axes;
    summary.by_controllers = Some(by_controllers);
}

/// The drive's controller reports its errors as it goes; those that it did not are computed from its table.
pub fn make_up_errors(summary: &mut JoinedSummary, record: &Record) {
    let JoinedSummary { position_error_dynamic_m, position_error_static_m, .. } = summary;
    *position_error_dynamic_m = position_error_dynamic_m.or_else(|| position::error_dynamic_m(record));
    *position_error_static_m = position_error_static_m.or_else(|| position::error_static_m(record));
}

fn add_figures(summary: &mut JoinedSummary, figures: &Figures) {
    summary.figures = figures.iter().map(|(name, value)| (name.to_owned(), value)).collect();
    let each = figures.by_repetition();
    summary.figures_by_repetition = each.map(|(name, values)| (name.to_owned(), values.to_vec())).collect();
}

/// What stands against the run, in a few words each; empty when it has passed.
fn against(summary: &JoinedSummary, is_rehearsal: bool) -> Vec<String> {
    let mut against = Vec::new();
    if summary.ended_well != Some(true) {
        let who = if is_rehearsal { "rehearsal" } else { "emulator" };
        against.push(format!("the {who} did not end well"));
    }
    // Null: the controller is of an earlier version that does not say, or is not ours.
    let ended_badly = |who: &str, reported: &ControllerFigures| {
        let why = reported.ended_because.as_ref().map_or_else(String::new, |why| format!(": {why}"));
        (reported.ended_well == Some(false)).then(|| format!("the {who} did not end well{why}"))
    };
    if let Some(by_controllers) = &summary.by_controllers {
        against.extend(by_controllers.controller.iter().filter_map(|both| ended_badly("controller", both)));
        let each = by_controllers.controllers.iter().flatten();
        against.extend(each.filter_map(|(axis, report)| ended_badly(&format!("{axis} controller"), report)));
    }
    let broken = summary.thresholds.iter().filter(|(_, bound)| !bound.kept);
    against.extend(broken.map(|(name, _)| format!("bound broken: {name}")));
    if let Some(dropped) = summary.records_dropped.filter(|count| *count > 0) {
        against.push(format!("{dropped} records did not reach the files"));
    }
    let second_rig = summary.frames_ignored.map_or(0, |ignored| ignored.second_rig);
    if second_rig > 0 {
        against.push(format!("{second_rig} frames came from a second rig"));
    }
    against
}

/// The experiment that the run used; empty without one.
pub fn experiment(run: &JoinedRun) -> Result<Experiment, SummaryError> {
    let text = run.experiment_toml.as_deref().unwrap_or_default();
    Ok(text.parse().map_err(|error| FileError::read(Path::new("run.json: experiment_toml"), error))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

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
        runlog::golden::check("summary.keys", &runlog::golden::keys(&in_order(&joined.summary)));
    }

    #[test]
    fn all_parts_become_one_and_joining_again_changes_nothing() {
        let folder = folder(&[("controller.json", both(&json!({})))]);
        let joined = join(folder.path()).unwrap();
        assert!(joined.passed());
        assert_eq!(in_order(&joined.summary)["frames_lost"], 2);
        assert_eq!(in_order(&joined.summary)["position_error_dynamic_m"], 0.002);
        assert_eq!(in_order(&joined.run)["controller"], json!({ "title": "position-p" }));
        assert_eq!(in_order(&join(folder.path()).unwrap().summary), in_order(&joined.summary));
    }

    #[test]
    fn a_process_for_each_axis_is_joined_as_one_for_both() {
        let drive = json!({ "ended_well": true, "axes": { "drive": {
            "position_error_dynamic_m": 0.002, "sensors_lost": { "drive": 1, "load": 2 } } } });
        let load = json!({ "ended_well": false, "axes": { "load": { "sensors_lost": 4 } } });
        let folder = folder(&[("controller-drive.json", drive), ("controller-load.json", load)]);
        let joined = join(folder.path()).unwrap();
        assert_eq!(in_order(&joined.summary)["frames_lost_at_controller"], 7);
        assert_eq!(in_order(&joined.summary)["position_error_dynamic_m"], 0.002);
        assert_eq!(in_order(&joined.summary)["controllers"]["load"]["ended_well"], false);
        let against = json!(["the load controller did not end well", "bound broken: frames_lost"]);
        assert_eq!(in_order(&joined.summary)["not_passed_because"], against);
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
            assert_eq!(in_order(&joined.summary)["not_passed_because"], against);
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
            assert_eq!(in_order(&joined.summary)["frames_lost_at_controller"], at_controller, "{at}");
            assert_eq!(in_order(&joined.summary)["frames_lost"], in_all, "{at}");
            assert!(!joined.passed());
            assert!(crate::table::table(&joined).contains("frames lost"));
        }
    }

    #[test]
    fn an_error_that_no_controller_reported_is_computed_from_its_table() {
        let folder = folder(&[("controller.json", json!({ "axes": { "drive": {} } }))]);
        let rows = "time_s,main_chain,set_position_m,position_m,moving\n0.0,experiment,0.2,0.197,1\n0.001,experiment,0.2,0.2,1\n";
        std::fs::write(folder.path().join("controller-drive.csv"), rows).unwrap();
        let joined = join(folder.path()).unwrap();
        assert!((joined.summary.position_error_dynamic_m.unwrap() - 0.003).abs() < 1e-12);
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
        assert_eq!(in_order(&joined.summary)["thresholds"]["position_error_dynamic_m"]["value"], Value::Null);
    }

    #[test]
    fn a_rehearsal_has_no_bus_to_tell_of() {
        let run = json!({ "pace": "rehearsal" });
        let summary = json!({ "passed": false, "cycles": 5 });
        let joined = join(folder(&[("run.json", run), ("summary.json", summary)]).path()).unwrap();
        assert_eq!(
            in_order(&joined.summary)["not_passed_because"],
            json!(["the rehearsal did not end well"])
        );
        let table = crate::table::table(&joined);
        assert!(table.contains("none: rehearsal, no bus"), "{table}");
    }

    #[test]
    fn a_folder_without_a_summary_says_what_happened() {
        let folder = tempfile::tempdir().unwrap();
        assert!(join(folder.path()).unwrap_err().to_string().contains("killed or is still running"));
    }
}
