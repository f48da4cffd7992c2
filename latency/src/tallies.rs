//! Counts that a reader looks for first: how old commands were in cycles, and which frames did not come as they should.

use super::model::RunPart;
use pagekit::grid::Grid;
use std::collections::BTreeMap;

/// Command age in cycles over all runs: a row for each age, a column for each axis; nothing when it was not counted.
pub fn command_ages(runs: &[RunPart]) -> Option<Grid> {
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
pub fn frames(runs: &[RunPart]) -> Option<Grid> {
    let mut rows = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        let rig = ["frames_lost_at_rig", "frames_late", "frames_duplicate", "frames_malformed"];
        rows.push(row(format!("{place} at the rig"), rig.map(|key| run.counts.get(key).copied())));
        let controllers = [
            sum(run, |name| name.contains(".sensors_lost")),
            sum(run, |name| name.ends_with(".frames_late")),
            sum(run, |name| name.ends_with(".frames_duplicate")),
            sum(run, |name| name.ends_with(".frames_ignored.malformed") || name.ends_with(".bus.malformed")),
        ];
        rows.push(row(format!("{place} at the controllers"), controllers));
    }
    let head = ["run, receiver", "lost", "late", "duplicate", "malformed"];
    (!rows.is_empty()).then(|| Grid::new(head, rows))
}

/// The sum of the controllers' counts of these names; nothing when there is none.
fn sum(run: &RunPart, is_wanted: impl Fn(&str) -> bool) -> Option<u64> {
    let of_controllers = run.counts.iter().filter(|(name, _)| name.starts_with("controller"));
    of_controllers.filter(|(name, _)| is_wanted(name)).map(|(_, count)| *count).reduce(u64::saturating_add)
}

fn row(name: String, counts: [Option<u64>; 4]) -> Vec<String> {
    let reported = counts.map(|count| count.map_or_else(|| "-".to_owned(), |count| count.to_string()));
    std::iter::once(name).chain(reported).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{made_up, parts};
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
}
