//! Selects the single cause that a report names: a disturbance that was applied to the runs, or `nothing`.
//!
//! It reads the report and nothing else. A machine that stood still, or a cycle that nothing explains, is what machines do
//! by themselves: alone, they count as nothing that was done to the runs. What was late and not recorded is `unknown`.

use super::model::{Cause, Finding, Report, SCHEMA, SCHEMA_VERSION};
use runlog::run_folder::{FileError, read_json};
use std::path::Path;

/// Reads a report.
///
/// # Errors
/// [`FileError::Read`]: no such file, or no report of this version.
pub fn read(file: &Path) -> Result<Report, FileError> {
    let report: Report = read_json(file)?;
    if (report.schema.as_str(), report.schema_version) != (SCHEMA, SCHEMA_VERSION) {
        let reported = format!(
            "{} version {}: this reads {SCHEMA} version {SCHEMA_VERSION}",
            report.schema, report.schema_version
        );
        return Err(FileError::read(file, reported));
    }
    Ok(report)
}

/// The cause by its name, `unknown` when something was late that was not recorded, or `nothing`, and the sentence behind it.
pub fn name(report: &Report) -> (String, String) {
    let by_itself = |finding: &&Finding| {
        finding.by_itself || matches!(finding.cause, Cause::MachineStoodStill | Cause::Unexplained)
    };
    let done = report.findings.iter().find(|finding| !by_itself(finding));
    let unknown = report.findings.iter().find(|finding| finding.cause == Cause::Unknown);
    if let (None, Some(finding)) = (done, unknown) {
        return (in_kebab(Cause::Unknown), finding.sentence.clone());
    }
    match (done, report.findings.first()) {
        (Some(finding), _) => (in_kebab(finding.cause), finding.sentence.clone()),
        (None, Some(finding)) => {
            ("nothing".into(), format!("Nothing was done to the runs. {}", finding.sentence))
        }
        (None, None) => ("nothing".into(), "Nothing disturbed the runs.".into()),
    }
}

/// A cause by its name in `report.json`.
pub(crate) fn in_kebab(cause: Cause) -> String {
    let name = serde_json::to_value(cause).ok();
    name.as_ref().and_then(serde_json::Value::as_str).unwrap_or("unexplained").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;
    use crate::tests::report_of;

    #[test]
    fn what_machines_do_by_themselves_is_nothing_that_was_done() {
        assert_eq!(name(&report_of(vec![made_up::run(2000)])).0, "nothing");
        let mut run = made_up::stalled(2000, "emulator", 100, 3_300_000);
        let (cause, sentence) = name(&report_of(vec![run.clone()]));
        assert_eq!(cause, "nothing");
        assert!(sentence.contains("the machine stood still"), "{sentence}");
        let mut unrecorded = run.clone();
        unrecorded.rows.clear();
        made_up::edit_summary(&mut unrecorded, |summary| summary["skipped"] = 3.into());
        assert_eq!(name(&report_of(vec![unrecorded])).0, "unknown");
        assert_eq!(name(&report_of(vec![crate::files::RunFiles::default()])).0, "unknown");
        made_up::stall(&mut run, "controller", 700, 5_300_000).vitals.continued = 1;
        assert_eq!(name(&report_of(vec![run])).0, "controller-stopped");
    }

    #[test]
    fn a_file_that_is_no_report_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("report.json");
        let mut report = report_of(vec![made_up::run(10)]);
        report.schema_version = 99;
        for text in ["{}".to_owned(), serde_json::to_string(&report).unwrap()] {
            std::fs::write(&file, text).unwrap();
            assert!(matches!(read(&file), Err(FileError::Read { .. })));
        }
    }
}
