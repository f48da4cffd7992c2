//! Counts that a reader looks for first: how old commands were in cycles, and which frames did not come as they should.

use super::model::{FrameFaultCounts, RunPart};
use pagekit::grid::Grid;
use std::collections::BTreeMap;

/// Command age in cycles over all runs: a row for each age, a column for each axis; nothing when it was not counted.
pub(crate) fn command_ages(runs: &[RunPart]) -> Option<Grid> {
    let mut ages: BTreeMap<u64, [u64; 2]> = BTreeMap::new();
    for run in runs {
        for (column, of_axis) in [&run.command_ages.drive, &run.command_ages.load].into_iter().enumerate() {
            for (age, count) in of_axis {
                ages.entry(*age).or_default()[column] += count;
            }
        }
    }
    let row = |(age, counts): (&u64, &[u64; 2])| {
        std::iter::once(age.to_string()).chain(counts.map(|count| count.to_string())).collect()
    };
    let head = ["age in cycles", "drive commands", "load commands"];
    (!ages.is_empty()).then(|| Grid::new(head, ages.iter().map(row)))
}

/// Frames of each run that were lost, late, came twice or made no sense, at the rig and at the controllers.
pub(crate) fn frames(runs: &[RunPart]) -> Option<Grid> {
    let mut rows = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        rows.push(row(format!("{place} at the rig"), run.frame_faults.rig));
        rows.push(row(format!("{place} at the controllers"), run.frame_faults.controllers));
    }
    (!rows.is_empty()).then(|| Grid::new(["run, receiver", "lost", "late", "duplicate", "malformed"], rows))
}

fn row(name: String, counts: FrameFaultCounts) -> Vec<String> {
    let FrameFaultCounts { lost, late, duplicate, malformed } = counts;
    let reported = [lost, late, duplicate, malformed]
        .map(|count| count.map_or_else(|| "-".to_owned(), |count| count.to_string()));
    std::iter::once(name).chain(reported).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json_files::{ControllerFile, SummaryFile};
    use crate::{made_up, parts};
    use runlog::controller_report::ControllerReport;
    use runlog::summary::Summary;
    use serde_json::{Value, json};

    #[test]
    fn ages_and_frames_are_gathered_from_the_counts() {
        let mut run = made_up::run(10);
        made_up::edit_summary(&mut run, |summary| {
            summary["command_age_cycles"] =
                json!({ "drive": { "1": 7, "10": 1, "2": 3 }, "load": { "1": 11 } });
            summary["frames_late"] = json!(5);
        });
        made_up::edit_controller(&mut run, |controller| {
            controller["axes"]["load"]["sensors_lost"] = json!(4);
            controller["frames_duplicate"] = json!(6);
        });
        let reported = [parts::part(&run, None, BTreeMap::new()), parts::part(&run, None, BTreeMap::new())];
        let ages = command_ages(&reported).unwrap();
        assert_eq!(ages.rows, [["1", "14", "22"], ["2", "6", "0"], ["10", "2", "0"]]);
        let frames = frames(&reported).unwrap();
        assert_eq!(frames.rows[0], ["0 at the rig", "0", "5", "-", "-"]);
        assert_eq!(frames.rows[3], ["1 at the controllers", "4", "-", "6", "-"]);
        assert!(command_ages(&[]).is_none());
    }

    #[test]
    fn only_the_fields_of_the_reports_are_frame_counts() {
        let rig = |json: Value| SummaryFile::of(json).unwrap().frame_faults;
        let controller = |json: Value| ControllerFile::of(json).unwrap().frame_faults;
        let none = FrameFaultCounts::default();
        let lost = FrameFaultCounts { lost: Some(1), ..none };
        let late = FrameFaultCounts { late: Some(1), ..none };
        let malformed = FrameFaultCounts { malformed: Some(1), ..none };
        for (faults, expected) in [
            (rig(json!({ "frames_late": 1 })), late),
            (controller(json!({ "frames_late": 1 })), late),
            (controller(json!({ "axes": { "load": { "sensors_lost": 1 } } })), lost),
            (controller(json!({ "axes": { "load": { "sensors_lost": { "drive": 1 } } } })), lost),
            (controller(json!({ "bus": { "malformed": 1 } })), malformed),
            (controller(json!({ "frames_ignored": { "malformed": 1 } })), malformed),
            (controller(json!({ "axes": { "drive": { "sensors_lost_before": 1 } } })), none),
            (controller(json!({ "other": { "frames_late": 1 } })), none),
            (rig(json!({ "bus": { "malformed": 1 } })), none),
            (rig(json!({ "emulator": { "frames_late": 1 } })), none),
        ] {
            assert_eq!(faults, expected);
        }
    }

    #[test]
    fn counts_of_a_controllers_report_reach_their_columns() {
        let mut report: ControllerReport =
            ControllerReport { frames_late: 1, frames_duplicate: 2, ..ControllerReport::default() };
        report.frames_ignored.malformed = 3;
        report.bus.malformed = 4;
        report.axes.entry("drive".into()).or_default().sensors_lost = Some(5);
        let mut run = made_up::run(10);
        made_up::edit_controller(&mut run, |controller| *controller = json!(report));
        let frames = frames(&[parts::part(&run, None, BTreeMap::new())]).unwrap();
        assert_eq!(frames.rows[1], ["0 at the controllers", "5", "1", "2", "7"]);
    }

    #[test]
    fn counts_of_a_summary_reach_their_columns() {
        let summary: Summary = Summary {
            frames_lost_at_rig: Some(1),
            frames_late: 2,
            frames_duplicate: 3,
            frames_malformed: 4,
            ..Summary::default()
        };
        let mut run = made_up::run(10);
        made_up::edit_summary(&mut run, |written| *written = json!(summary));
        let frames = frames(&[parts::part(&run, None, BTreeMap::new())]).unwrap();
        assert_eq!(frames.rows[0], ["0 at the rig", "1", "2", "3", "4"]);
    }

    #[test]
    fn frames_of_a_process_for_each_axis_are_added_up() {
        let mut run = made_up::run(10);
        run.controllers.clear();
        for (process, json) in [
            ("controller-drive", json!({ "frames_late": 1, "axes": { "drive": { "sensors_lost": 2 } } })),
            ("controller-load", json!({ "frames_late": 3, "axes": { "load": {} } })),
        ] {
            run.controllers.insert(process.into(), ControllerFile::of(json).unwrap());
        }
        let frames = frames(&[parts::part(&run, None, BTreeMap::new())]).unwrap();
        assert_eq!(frames.rows[1], ["0 at the controllers", "2", "4", "-", "-"]);
    }
}
