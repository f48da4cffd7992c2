//! The JSON files of a run: each is deserialised once, and kept as it stands for the tables of all counts and all machine facts.
//!
//! A file of another version or of a foreign program may not be as its type has it. Then the type is empty, and `misfit` says
//! why. The parts beside it are deserialised by themselves: damage elsewhere in the file does not hide them.

use super::frame_faults::{FramesAtController, FramesAtRig};
use super::model::FrameFaultCounts;
use realtime::Grant;
use realtime::machine::Hypervisor;
use runlog::controller_report::ControllerReport;
use runlog::summary::{ProcessReport, RunDescription, Summary};
use runlog::timing_recorder::CommandAges;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// `summary.json`.
#[derive(Clone, Debug)]
pub(crate) struct SummaryFile {
    pub summary: Summary,
    /// Why `summary` is empty, if the file is not as its type has it.
    pub misfit: Option<String>,
    /// Figures that emulator and controllers report alike.
    pub process: ProcessReport,
    /// Frames that did not come as they should, at the rig.
    pub frame_faults: FrameFaultCounts,
    pub command_ages: CommandAges,
    /// The file as it stands.
    pub json: Value,
}

/// `run.json`.
#[derive(Clone, Debug)]
pub(crate) struct RunFile {
    pub description: RunDescription,
    /// Why `description` is empty, if the file is not as its type has it.
    pub misfit: Option<String>,
    pub hypervisor: Hypervisor,
    /// What the emulator was granted for real time.
    pub granted: Vec<Grant>,
    /// The file as it stands.
    pub json: Value,
}

/// `controller.json`, `controller-drive.json` or `controller-load.json`.
#[derive(Clone, Debug)]
pub(crate) struct ControllerFile {
    pub report: ControllerReport,
    /// Why `report` is empty, if the file is not as its type has it.
    pub misfit: Option<String>,
    /// Figures that emulator and controllers report alike.
    pub process: ProcessReport,
    /// What the process was granted for real time.
    pub granted: Vec<Grant>,
    /// Frames that did not come as they should, at this process.
    pub frame_faults: FrameFaultCounts,
    /// The file as it stands.
    pub json: Value,
}

impl SummaryFile {
    pub(crate) fn of(json: Value) -> Option<Self> {
        let (summary, misfit) = typed(&json)?;
        Some(Self {
            summary,
            misfit,
            process: part(&json),
            frame_faults: part::<FramesAtRig>(&json).into(),
            command_ages: part(&json["command_age_cycles"]),
            json,
        })
    }
}

impl RunFile {
    pub(crate) fn of(json: Value) -> Option<Self> {
        let (description, misfit) = typed(&json)?;
        Some(Self {
            description,
            misfit,
            hypervisor: part(&json["machine"]["hypervisor"]),
            granted: grants(&json),
            json,
        })
    }
}

impl ControllerFile {
    pub(crate) fn of(json: Value) -> Option<Self> {
        let (report, misfit) = typed(&json)?;
        Some(Self {
            report,
            misfit,
            process: part(&json),
            granted: grants(&json),
            frame_faults: part::<FramesAtController>(&json).into(),
            json,
        })
    }
}

/// A file as its type; the empty type with the reason where it does not fit, `None` for null, which counts as missing.
fn typed<T: DeserializeOwned + Default>(json: &Value) -> Option<(T, Option<String>)> {
    (!json.is_null()).then(|| match T::deserialize(json) {
        Ok(file) => (file, None),
        Err(error) => (T::default(), Some(error.to_string())),
    })
}

/// A part of a file; empty where it is missing or not as its type has it.
fn part<T: DeserializeOwned + Default>(json: &Value) -> T {
    T::deserialize(json).unwrap_or_default()
}

/// The grants of a report, one by one: a line that is no text hides no other.
fn grants(report: &Value) -> Vec<Grant> {
    let lines = report["realtime_granted"].as_array().into_iter().flatten().filter_map(Value::as_str);
    lines.map(Grant::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn damage_in_a_file_hides_no_other_part_of_it() {
        let summary = SummaryFile::of(json!({
            "cycles": "many", "records_dropped": 3, "frames_late": 2, "command_age_cycles": { "drive": { "1": 7 } },
        }))
        .unwrap();
        assert!(summary.misfit.is_some() && summary.summary == Summary::default());
        assert_eq!((summary.process.records_dropped, summary.frame_faults.late), (Some(3), Some(2)));
        assert_eq!(summary.command_ages.drive[&1], 7);

        let run = RunFile::of(json!({
            "seed": -1, "realtime_granted": ["pinned to CPU 3", 5], "machine": { "hypervisor": "KVM" },
        }))
        .unwrap();
        assert!(run.misfit.is_some() && run.hypervisor.is_present());
        assert_eq!(run.granted, [Grant::Cpu(3)]);

        let controller = ControllerFile::of(json!({
            "version": 1, "frames_duplicate": 4, "realtime_granted": ["pinned to CPU 1"], "records_dropped": 5,
        }))
        .unwrap();
        assert!(controller.misfit.is_some() && controller.report == ControllerReport::default());
        assert_eq!(
            (controller.process.records_dropped, controller.frame_faults.duplicate),
            (Some(5), Some(4))
        );
        assert_eq!(controller.granted, [Grant::Cpu(1)]);
    }

    #[test]
    fn null_counts_as_missing_and_an_empty_file_as_read() {
        assert!(SummaryFile::of(Value::Null).is_none() && RunFile::of(Value::Null).is_none());
        assert!(ControllerFile::of(Value::Null).is_none());
        assert_eq!(SummaryFile::of(json!({})).unwrap().misfit, None);
        assert_eq!(RunFile::of(json!({})).unwrap().misfit, None);
        assert_eq!(ControllerFile::of(json!({})).unwrap().misfit, None);
    }
}
