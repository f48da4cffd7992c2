//! Counts that a reader looks for first: how old commands were in cycles, and which frames did not come as they should.

use super::files::PROCESSES;
use super::model::RunPart;
use pagekit::grid::Grid;
use std::collections::BTreeMap;

/// Command age in cycles over all runs: a row for each age, a column for each axis; nothing when it was not counted.
pub(crate) fn command_ages(runs: &[RunPart]) -> Option<Grid> {
    const AXES: [&str; 2] = ["drive", "load"];
    // Ages are sorted as numbers; what is no number, such as "more", comes last.
    let mut ages: BTreeMap<(u64, String), [u64; 2]> = BTreeMap::new();
    for (name, count) in runs.iter().flat_map(|run| &run.counts) {
        let Some((axis, age)) =
            name.strip_prefix("command_age_cycles.").and_then(|name| name.split_once('.'))
        else {
            continue;
        };
        if let Some(place) = AXES.iter().position(|known| *known == axis) {
            let key = (age.parse().unwrap_or(u64::MAX), age.to_owned());
            ages.entry(key).or_default()[place] += count;
        }
    }
    let row = |((_, age), counts): (&(u64, String), &[u64; 2])| {
        std::iter::once(age.clone()).chain(counts.map(|count| count.to_string())).collect()
    };
    let head = ["age in cycles", "drive commands", "load commands"];
    (!ages.is_empty()).then(|| Grid::new(head, ages.iter().map(row)))
}

/// Frames of each run that were lost, late, came twice or made no sense, at the rig and at the controllers.
pub(crate) fn frames(runs: &[RunPart]) -> Option<Grid> {
    let mut rows = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        for (receiver, words) in
            [(Receiver::Rig, "at the rig"), (Receiver::Controllers, "at the controllers")]
        {
            let counts = FrameFault::ALL.map(|fault| sum(run, receiver, fault));
            rows.push(row(format!("{place} {words}"), counts));
        }
    }
    let head = ["run, receiver", "lost", "late", "duplicate", "malformed"];
    (!rows.is_empty()).then(|| Grid::new(head, rows))
}

/// Who received frames, or missed them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Receiver {
    Rig,
    Controllers,
}

/// What was wrong with frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FrameFault {
    Lost,
    Late,
    Duplicate,
    Malformed,
}

impl FrameFault {
    const ALL: [Self; 4] = [Self::Lost, Self::Late, Self::Duplicate, Self::Malformed];

    /// Receiver and fault of a count in [`RunPart::counts`], by its exact path: fields of [`runlog::summary::Summary`], and after
    /// the name of a process those of [`runlog::controller_report::ControllerReport`].
    fn of_count(name: &str) -> Option<(Receiver, Self)> {
        let path: Vec<&str> = name.split('.').collect();
        match path.as_slice() {
            ["frames_lost_at_rig"] => Some((Receiver::Rig, Self::Lost)),
            ["frames_late"] => Some((Receiver::Rig, Self::Late)),
            ["frames_duplicate"] => Some((Receiver::Rig, Self::Duplicate)),
            ["frames_malformed"] => Some((Receiver::Rig, Self::Malformed)),
            [process, fields @ ..] if *process != "emulator" && PROCESSES.contains(process) => {
                let fault = match fields {
                    // Earlier versions wrote a count for each axis, whose name stands behind.
                    ["axes", _, "sensors_lost"] | ["axes", _, "sensors_lost", _] => Self::Lost,
                    ["frames_late"] => Self::Late,
                    ["frames_duplicate"] => Self::Duplicate,
                    ["frames_ignored" | "bus", "malformed"] => Self::Malformed,
                    _ => return None,
                };
                Some((Receiver::Controllers, fault))
            }
            _ => None,
        }
    }
}

/// The sum of a receiver's counts of a fault; nothing when there is none.
fn sum(run: &RunPart, receiver: Receiver, fault: FrameFault) -> Option<u64> {
    let wanted = run.counts.iter().filter(|(name, _)| FrameFault::of_count(name) == Some((receiver, fault)));
    wanted.map(|(_, count)| *count).reduce(u64::saturating_add)
}

fn row(name: String, counts: [Option<u64>; 4]) -> Vec<String> {
    let reported = counts.map(|count| count.map_or_else(|| "-".to_owned(), |count| count.to_string()));
    std::iter::once(name).chain(reported).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{made_up, parts};
    use runlog::controller_report::ControllerReport;
    use serde_json::json;

    #[test]
    fn ages_and_frames_are_gathered_from_the_counts() {
        let mut run = made_up::run(10);
        run.summary["command_age_cycles"] =
            json!({ "drive": { "1": 7, "10": 1, "2": 3 }, "load": { "1": 11 } });
        run.summary["frames_late"] = json!(5);
        let controller = run.controllers.get_mut("controller").unwrap();
        controller["axes"]["load"]["sensors_lost"] = json!(4);
        controller["frames_duplicate"] = json!(6);
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
        let controllers = |fault| Some((Receiver::Controllers, fault));
        for (name, count) in [
            ("frames_late", Some((Receiver::Rig, FrameFault::Late))),
            ("controller.frames_late", controllers(FrameFault::Late)),
            ("controller-load.axes.load.sensors_lost", controllers(FrameFault::Lost)),
            ("controller.axes.load.sensors_lost.drive", controllers(FrameFault::Lost)),
            ("controller-drive.bus.malformed", controllers(FrameFault::Malformed)),
            ("controller.frames_ignored.malformed", controllers(FrameFault::Malformed)),
            ("controller.axes.drive.sensors_lost_before", None),
            ("controller.other.frames_late", None),
            ("bus.malformed", None),
            ("emulator.frames_late", None),
        ] {
            assert_eq!(FrameFault::of_count(name), count, "{name}");
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
        run.controllers.insert("controller".into(), json!(report));
        let frames = frames(&[parts::part(&run, None, BTreeMap::new())]).unwrap();
        assert_eq!(frames.rows[1], ["0 at the controllers", "5", "1", "2", "7"]);
    }
}
