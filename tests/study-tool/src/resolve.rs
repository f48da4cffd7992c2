//! Whether the experiment that a program proposes distinguishes what its first record could not.
//!
//! ```text
//! runs/LABEL/0007/report.json ── ambiguous, the truth among the names ──► next.experiment ──► none: "no experiment can"
//!                                                                                │
//!    the same hidden draw under that experiment, with new noise ◄────────────────┘
//!       │
//!       └─► PROGRAM close --train train.csv next.csv --test test.csv … in an empty folder ──► runs/LABEL-resolve/0007/
//! ```
//!
//! The experiment is the file that the program wrote beside its report. Where a run did not keep it, the program is run again
//! on the same records, which gives the same report. The record maker makes the new record as it made the first: same rig, same
//! wrong parameters, same kind and level of noise.
//!
//! - *Resolved*: one name, the true one, at its place, and no other alternative.
//! - *Still ambiguous*: the truth is among several names and alternatives.
//! - *Wrong*: the truth is not among them.
//! - *Error*: no good report, an experiment that cannot be run, or one that the program does not propose again.
//!
//! Only draws of one effect are considered: with several, an ambiguity between two has no single truth.

pub mod tables;

use crate::SCHEMA_VERSION;
use crate::draws::{Draw, Kind};
use crate::folder::{FolderError, read, read_versioned};
use crate::program::{Execution, Identity, Program, ProgramEnd, ProgramInputs};
use crate::report::{self, Named, Report, Verdict};
use crate::step::{Step, StepError, check_blind, check_program, read_result, whole_run};
use plant::RigParameters;
use record_maker::{self, Hidden, Recipe};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs;
use std::path::Path;

pub use tables::Table;

/// Changes the noise of the new record; below 2^53, as seeds are.
const NOISE_SEED_MASK: u64 = 0x4e_4558_5400;

/// Judgement of the report on both records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    Resolved,
    StillAmbiguous,
    Wrong,
    Error,
}

/// Result of running the proposed experiment of a draw, as `resolution.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resolution {
    pub(crate) schema_version: u32,
    pub(crate) number: usize,
    pub(crate) program: Identity,
    pub(crate) experiment: String,
    /// Why the experiment was not run, or not given to the program.
    pub(crate) problem: Option<String>,
    /// The run of the program on both records; `None` when there was a problem.
    pub taken: Option<Execution>,
}

/// The label of the resolutions of a label.
pub fn label(label: &str) -> String {
    format!("{label}-resolve")
}

/// The entry of a report that leaves the truth ambiguous: it or one of its alternatives is the truth.
pub(crate) fn ambiguous<'a>(draw: &Draw, report: &'a Report) -> Option<&'a Named> {
    let [hidden] = draw.recipe.hidden.as_slice() else { return None };
    let open = report.named.iter().filter(|entry| !entry.alternatives.is_empty());
    open.into_iter().find(|entry| names(entry).any(|name| is_truth(name, hidden)))
}

pub(crate) fn leaves_open(report: &Report) -> bool {
    report.verdict == Verdict::Ambiguous || report.named.iter().any(|entry| !entry.alternatives.is_empty())
}

/// Judges the report on both records.
pub fn judge(hidden: &Hidden, taken: &Execution, report: &Result<Report, String>) -> Outcome {
    let report = match (taken.ended, report) {
        (ProgramEnd::Exited(_), Ok(report)) if report.verdict != Verdict::BadData => report,
        _ => return Outcome::Error,
    };
    let mut all = report.named.iter().flat_map(names).peekable();
    let any = all.peek().is_some();
    let right: Vec<bool> = all.map(|name| is_truth(name, hidden)).collect();
    let alone = report.named.len() == 1 && report.verdict != Verdict::OutsideCatalogue;
    if any && alone && right.iter().all(|right| *right) {
        Outcome::Resolved
    } else if right.contains(&true) {
        Outcome::StillAmbiguous
    } else {
        Outcome::Wrong
    }
}

/// An entry and its alternatives.
pub(crate) fn names(entry: &Named) -> impl Iterator<Item = &Named> {
    std::iter::once(entry).chain(&entry.alternatives)
}

fn is_truth(name: &Named, hidden: &Hidden) -> bool {
    name.sheet.name == hidden.name && name.place == hidden.place
}

/// The recipe of a draw's new record: the same rig with other noise.
pub(crate) fn recipe(draw: &Draw) -> Recipe {
    Recipe { seed: draw.recipe.seed ^ NOISE_SEED_MASK, ..draw.recipe.clone() }
}

/// What became of the experiment that a program proposes for a draw.
#[derive(Debug, Clone, PartialEq)]
pub enum ProposalState {
    /// Not considered: no result yet, several effects, or the truth is not left ambiguous.
    NotOpen,
    /// The program proposes no experiment.
    NothingProposed,
    /// The experiment was run, now or before.
    Measured(Resolution),
}

/// Measures the proposed experiment of a draw, unless that was done, and runs the program on both records; `None` when
/// interrupted.
///
/// # Errors
/// [`StepError`] when a file of the study cannot be used, or the results are of another program.
pub fn run(step: &Step<'_>, program: &Program, draw: &Draw) -> Result<Option<ProposalState>, StepError> {
    let folder = step.study.run(step.label, draw.number);
    if draw.kind != Kind::Single || !folder.exists() {
        return Ok(Some(ProposalState::NotOpen));
    }
    let report = report::read(&folder.join("report.json")).ok();
    let Some(report) = report.filter(|report| ambiguous(draw, report).is_some()) else {
        return Ok(Some(ProposalState::NotOpen));
    };
    let path = folder.join("result.json");
    check_program(&path, &read_result(&path)?.program, &program.identity, SAME_PROGRAM)?;
    let done = step.study.run(&label(step.label), draw.number);
    if done.exists() {
        let path = done.join("resolution.json");
        let resolution = read_resolution(&path)?;
        check_program(&path, &resolution.program, &program.identity, SAME_PROGRAM)?;
        if !step.again {
            return Ok(Some(ProposalState::Measured(resolution)));
        }
    }
    if report.proposed().is_none() {
        return Ok(Some(ProposalState::NothingProposed));
    }
    step.check_disk()?;
    step.records(draw)?;
    let resolution = whole_run(&done, |folder| resolve(step, program, draw, folder))?;
    Ok(resolution.map(ProposalState::Measured))
}

/// Advice for results of another program.
const SAME_PROGRAM: &str = "give the one that was run, with its arguments";

/// Fills the folder of a draw; `None` when interrupted.
fn resolve(
    step: &Step<'_>,
    program: &Program,
    draw: &Draw,
    folder: &Path,
) -> Result<Option<Resolution>, StepError> {
    let number = draw.number;
    let files = |error| StepError::Files { number, error };
    let first = report::read(&step.study.run(step.label, number).join("report.json"));
    let experiment = first.as_ref().ok().and_then(Report::proposed).unwrap_or_default().to_owned();
    let empty = tempfile::tempdir().map_err(files)?;
    step.copy_inputs(draw, empty.path())?;
    let mut resolution = Resolution {
        schema_version: SCHEMA_VERSION,
        number,
        program: program.identity.clone(),
        experiment,
        problem: None,
        taken: None,
    };
    let Some(text) = proposal(step, program, draw, &resolution.experiment)? else { return Ok(None) };
    match text.and_then(|text| measure(draw, &resolution.experiment, &text, empty.path(), folder)) {
        Err(problem) => resolution.problem = Some(problem),
        Ok(()) => {
            check_blind(number, &empty.path().join("next.csv"))?;
            let start =
                ProgramInputs { folder: empty.path(), train: &["train.csv", "next.csv"], arguments: &[] };
            let Some(taken) = step.start(number, program, &start, folder)? else { return Ok(None) };
            resolution.taken = Some(taken);
        }
    }
    fs::write(folder.join("resolution.json"), format!("{:#}\n", json!(resolution))).map_err(files)?;
    Ok(Some(resolution))
}

/// Text of the proposed experiment, or why there is none; `None` when interrupted.
fn proposal(
    step: &Step<'_>,
    program: &Program,
    draw: &Draw,
    experiment: &str,
) -> Result<Option<Result<String, String>>, StepError> {
    let number = draw.number;
    let files = |error| StepError::Files { number, error };
    let kept = step.study.run(step.label, number).join(experiment);
    if kept.is_file() {
        return Ok(Some(Ok(read(&kept)?)));
    }
    // It was not kept: equal records give an equal report with the same experiment file.
    let [empty, folder] = [tempfile::tempdir().map_err(files)?, tempfile::tempdir().map_err(files)?];
    step.copy_inputs(draw, empty.path())?;
    let start = ProgramInputs { folder: empty.path(), train: &["train.csv"], arguments: &[] };
    if step.start(number, program, &start, folder.path())?.is_none() {
        return Ok(None);
    }
    let again = fs::read_to_string(folder.path().join(experiment));
    Ok(Some(again.map_err(|_| format!("run again, the program did not write {experiment}"))))
}

/// Makes the record of a draw under an experiment as `next.csv`, and keeps the experiment.
fn measure(draw: &Draw, name: &str, toml: &str, empty: &Path, folder: &Path) -> Result<(), String> {
    fs::write(folder.join("next.toml"), toml).map_err(|error| error.to_string())?;
    let record = record_maker::simulate_proposed(&recipe(draw), &RigParameters::baseline(), (name, toml));
    record
        .and_then(|record| record_maker::write_measurement(&record, empty, "next.csv"))
        .map_err(|error| format!("the experiment cannot be run: {error}"))
}

pub(crate) fn read_resolution(path: &Path) -> Result<Resolution, FolderError> {
    read_versioned(path, "resolution", |resolution: &Resolution| resolution.schema_version)
}

#[cfg(test)]
mod tests;
