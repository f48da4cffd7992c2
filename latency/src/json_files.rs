//! The JSON files of a run: each is deserialised once, and kept as it stands for the tables of all counts and all machine facts.
//!
//! A file of another version or of a foreign program may not be as its type has it. Then the type is empty, and `misfit` says
//! why. The parts beside it are views of the same keys, field by field: damage elsewhere in the file does not hide them.

use super::frame_faults::{FramesAtController, FramesAtRig};
use super::model::FrameFaultCounts;
use realtime::Grant;
use realtime::machine::Hypervisor;
use runlog::controller_report::ControllerReport;
use runlog::summary::{ProcessReport, RunDescription, Summary};
use runlog::timing_recorder::CommandAges;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};
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
    pub facts: RunFacts,
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

/// Facts of `run.json` that a report shows as they stand. [`RunDescription`] makes a default of one that an older file lacks.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct RunFacts {
    pub emulator_version: Option<Value>,
    pub counts_allocations: Option<Value>,
    pub bus: Option<Value>,
    pub pace: Option<Value>,
}

/// View of `run.json`.
#[derive(Default, Deserialize)]
#[serde(default)]
struct MachineOfRun {
    #[serde(deserialize_with = "lenient")]
    machine: MachineView,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct MachineView {
    #[serde(deserialize_with = "lenient")]
    hypervisor: Hypervisor,
}

/// View of `run.json` and `controller*.json`.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Granted {
    #[serde(deserialize_with = "grants")]
    realtime_granted: Vec<Grant>,
}

/// View of `summary.json`.
#[derive(Default, Deserialize)]
#[serde(default)]
struct AgesInSummary {
    #[serde(deserialize_with = "lenient")]
    command_age_cycles: CommandAges,
}

impl SummaryFile {
    pub(crate) fn of(json: Value) -> Option<Self> {
        let (summary, misfit) = typed(&json)?;
        Some(Self {
            summary,
            misfit,
            process: part(&json),
            frame_faults: part::<FramesAtRig>(&json).into(),
            command_ages: part::<AgesInSummary>(&json).command_age_cycles,
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
            hypervisor: part::<MachineOfRun>(&json).machine.hypervisor,
            facts: part(&json),
            granted: part::<Granted>(&json).realtime_granted,
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
            granted: part::<Granted>(&json).realtime_granted,
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

/// A field of a view; empty where it is not as its type has it.
fn lenient<'de, D: Deserializer<'de>, T: DeserializeOwned + Default>(field: D) -> Result<T, D::Error> {
    Value::deserialize(field).map(|value| part(&value))
}

/// Grants, one by one: a line that is no text hides no other.
fn grants<'de, D: Deserializer<'de>>(field: D) -> Result<Vec<Grant>, D::Error> {
    let lines: Vec<Value> = lenient(field)?;
    Ok(lines.iter().filter_map(Value::as_str).map(Grant::from).collect())
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
            "bus": 1, "pace": "real",
        }))
        .unwrap();
        assert!(run.misfit.is_some() && run.hypervisor.is_present());
        assert_eq!(run.granted, [Grant::Cpu(3)]);
        assert_eq!((run.facts.bus, run.facts.pace), (Some(json!(1)), Some(json!("real"))), "as they stand");

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
    fn the_views_read_what_the_types_write() {
        let mut description = RunDescription::<Value> {
            emulator_version: "1.2".into(),
            counts_allocations: true,
            bus: "unix:///x".into(),
            pace: "real".into(),
            realtime_granted: [Grant::Cpu(3)].into(),
            ..RunDescription::default()
        };
        description.machine.hypervisor = serde_json::from_value(json!("KVM")).unwrap();
        let run = RunFile::of(json!(description)).unwrap();
        let facts = run.facts;
        assert_eq!(
            (facts.emulator_version, facts.counts_allocations),
            (Some("1.2".into()), Some(true.into()))
        );
        assert_eq!((facts.bus, facts.pace), (Some("unix:///x".into()), Some("real".into())));
        assert_eq!(run.granted, [Grant::Cpu(3)]);
        assert!(run.hypervisor.is_present());

        let ages = CommandAges { drive: [(2, 5)].into(), ..CommandAges::default() };
        let summary: Summary = Summary { command_age_cycles: ages.clone(), ..Summary::default() };
        assert_eq!(SummaryFile::of(json!(summary)).unwrap().command_ages, ages);
        let report = ControllerReport::<Value, Value> {
            realtime_granted: [Grant::Cpu(1)].into(),
            ..ControllerReport::default()
        };
        assert_eq!(ControllerFile::of(json!(report)).unwrap().granted, [Grant::Cpu(1)]);
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
