//! The runs one by one: counts, arrivals, and where each came from.

use super::distributions::percentiles;
use super::files::{EMULATOR, RunFiles};
use super::findings;
use super::model::{ArrivalRow, FrameFaults, PercentilesNs, RunPart};
use realtime::ArrivalFigures;
use runlog::summary::ProcessReport;
use serde_json::Value;
use std::collections::BTreeMap;

/// Group of a run that says none.
const NO_GROUP: &str = "all";

pub(crate) fn part(
    run: &RunFiles,
    group: Option<&str>,
    percentiles_ns: BTreeMap<String, PercentilesNs>,
) -> RunPart {
    let reported_group = run.conditions.as_ref().and_then(|reported| reported.group.as_deref());
    RunPart {
        folder: run.folder.display().to_string(),
        group: group.or(reported_group).unwrap_or(NO_GROUP).to_owned(),
        started_unix_s: run.started_unix_s().unwrap_or_default(),
        duration_s: run.duration_s(),
        counts: counts(run),
        frame_faults: frame_faults(run),
        command_ages: run.summary.as_ref().map(|file| file.command_ages.clone()).unwrap_or_default(),
        percentiles_ns,
        arrivals: arrivals(run),
        passed: run.counted().and_then(|summary| summary.passed).unwrap_or_default(),
        lacks: run.lacks.clone(),
    }
}

/// Counts of the summary by their keys, nested ones joined by points; those of a controller begin with its name.
fn counts(run: &RunFiles) -> BTreeMap<String, u64> {
    const NO_COUNTS: [&str; 3] = ["schema_version", "thresholds", "figures"];
    let mut counts = BTreeMap::new();
    for (process, reported) in run.reports_as_they_stand() {
        let prefix = if process == EMULATOR { String::new() } else { format!("{process}.") };
        for (key, value) in reported.as_object().into_iter().flatten() {
            // Percentiles are no counts, and what joining copied from the controllers' own files stands there.
            let copied = process == EMULATOR && ["axes", "controller", "controllers"].contains(&key.as_str());
            // A sum in ns, such as the time that a thread waited for its CPU, is a count of its own.
            let is_distribution = key.ends_with("_ns") && !value.is_number();
            if !is_distribution && !NO_COUNTS.contains(&key.as_str()) && !copied {
                add(&mut counts, &format!("{prefix}{key}"), value);
            }
        }
    }
    if run.summary.is_some() || !run.controllers.is_empty() {
        counts.insert("frames_lost_by_gaps".into(), findings::lost_by_gaps(run));
    }
    counts
}

fn add(counts: &mut BTreeMap<String, u64>, name: &str, value: &Value) {
    match value {
        Value::Number(number) => counts.extend(number.as_u64().map(|count| (name.to_owned(), count))),
        Value::Object(parts) => parts
            .iter()
            .filter(|(key, value)| !key.ends_with("_ns") || value.is_number())
            .for_each(|(key, value)| add(counts, &format!("{name}.{key}"), value)),
        _ => {}
    }
}

fn frame_faults(run: &RunFiles) -> FrameFaults {
    FrameFaults {
        rig: run.summary.as_ref().map(|file| file.frame_faults).unwrap_or_default(),
        controllers: run.controllers.values().map(|file| file.frame_faults).sum(),
    }
}

fn arrivals(run: &RunFiles) -> Vec<ArrivalRow> {
    let of_process = |(receiver, report): (&str, &ProcessReport)| {
        let row = |reported: &ArrivalFigures| ArrivalRow {
            receiver: receiver.to_owned(),
            figures: ArrivalFigures {
                interval_ns: percentiles(&reported.interval_ns).unwrap_or_default(),
                ..reported.clone()
            },
        };
        report.timing.arrivals.iter().map(row).collect::<Vec<_>>()
    };
    run.process_reports().flat_map(of_process).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;
    use serde_json::json;

    #[test]
    fn counts_keep_their_keys_and_percentiles_are_none() {
        let mut run = made_up::run(50);
        made_up::edit_summary(&mut run, |summary| {
            summary["wakeup_ns"] = json!({ "p50": 3, "count": 50 });
            summary["vitals"] = json!({ "minor_faults": 4, "run_delay_ns": 5 });
        });
        let reported = part(&run, None, BTreeMap::new());
        assert_eq!(reported.counts["cycles"], 50);
        assert_eq!(reported.counts["vitals.minor_faults"], 4);
        assert_eq!(reported.counts["controller.axes.drive.sensors_lost"], 0);
        assert_eq!(reported.counts["vitals.run_delay_ns"], 5);
        assert!(!reported.counts.keys().any(|key| key.contains("wakeup_ns")));
        assert_eq!((reported.group.as_str(), reported.passed), ("a", true));
        assert_eq!(part(&run, Some("b"), BTreeMap::new()).group, "b");
    }

    #[test]
    fn arrivals_of_all_receivers_are_listed() {
        let mut run = made_up::run(50);
        let row = |frame: &str| {
            json!([{ "frame": frame, "period_ms": 1, "count": 49, "gaps": 2, "bursts": 1,
            "interval_ns": { "p50": 1_000_000, "max": 2_000_000, "count": 49 } }])
        };
        made_up::edit_summary(&mut run, |summary| {
            summary["arrivals"] = row("DriveValveCommand");
            summary["arrivals"][0]["bursts"] = json!(null);
        });
        made_up::edit_controller(&mut run, |controller| controller["arrivals"] = row("DriveSensors"));
        let reported = arrivals(&run);
        let names: Vec<_> = reported
            .iter()
            .map(|ArrivalRow { receiver, figures }| (receiver.as_str(), &*figures.frame, figures.gaps))
            .collect();
        assert_eq!(names, [("emulator", "DriveValveCommand", 2), ("controller", "DriveSensors", 2)]);
        assert_eq!(reported[0].figures.interval_ns.p50, Some(1_000_000));
        assert_eq!((reported[0].figures.bursts, reported[1].figures.bursts), (None, Some(1)));
    }
}
