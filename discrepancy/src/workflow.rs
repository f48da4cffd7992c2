//! The whole workflow, from records and rig file to report, page and extended rig file.
//!
//! ```text
//!   records ─► check ─► grid ─► name (with calibration) ─► locate ─► extend ─┬─► report, page, rig.toml
//!                 └─ cannot be used: bad-data     alike ──► next             └─► held_out: opens that record; verify judges
//! ```
//!
//! All but [`Report::misfit`] and [`Report::verification`] is computed before the held-out record is opened.

mod explained;
mod findings;
mod proposal;

use crate::check::{Checked, check};
use crate::discrepancy_term::{ReferenceModel, located_term};
use crate::engine::Engine;
use crate::extend::{Addition, ExtendError, add_tables, add_terms, extend};
use crate::gridded_record::{GriddedRecord, searched_share};
use crate::locate::{UnknownSeries, locate};
use crate::name::{SelectionResult, on_all};
use crate::outside::outside;
use crate::page::Pictures;
use crate::parameters::{COUNT, with_factors};
use crate::refit::{FittedModel, rig_of};
use crate::report::{self, DeclaredSuspect, InputFiles, LocatedTerm, NamedEffect, Report, Verdict};
use crate::suspects::Suspect;
use crate::tabulate::{tables, tabulate};
use crate::verify::{drawn, verify};
pub use explained::explained;
use explained::searched_for;
pub(crate) use findings::empty;
use findings::{report_of, summary};
use model_fit::is_model_file;
use plant::{Axis, ParameterError, RigParameters};
pub(crate) use proposal::proposal;
use proposal::proposal_for;
use records::{ReadError, ReadOptions};
use std::path::{Path, PathBuf};

/// Files and options of `close`.
#[derive(Clone, Debug, Default)]
pub struct Task {
    /// Rig file: the baseline.
    pub rig: PathBuf,
    /// Training records; the axes that all of them show are fitted.
    pub train: Vec<PathBuf>,
    /// The held-out record.
    pub test: Option<PathBuf>,
    /// How records are read.
    pub options: ReadOptions,
    /// Effects excluded from the candidates.
    pub without: Vec<String>,
    /// Candidates beside the catalogue.
    pub suspects: Vec<&'static Suspect>,
    /// Whether explanations get their marginal likelihoods, which decide nothing.
    pub marginal_likelihoods: bool,
}

/// Report, extended rig file, series for the page, and proposed experiment.
#[derive(Debug)]
pub struct Outcome {
    /// Content of `report.json`.
    pub report: Report,
    /// The extended rig file; `None` when a record cannot be used.
    pub extended: Option<String>,
    /// Series for the page.
    pub(crate) pictures: Pictures,
    /// File of the proposed experiment.
    pub(crate) experiment: Option<String>,
    /// Why a given held-out record was not judged.
    pub(crate) not_judged: Option<String>,
}

/// Why the workflow did not run.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum WorkflowError {
    #[error("{file}: {why}")]
    Rig { file: String, why: std::io::Error },
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    #[error(
        "{file}: a model file: only close, name, check, extend, explain and simulate take one; give a rig file here"
    )]
    ModelFile { file: String },
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("{file}: cannot be used: {why}")]
    Unusable { file: String, why: String },
    #[error(
        "{first} and {other} do not show the same axes: records are judged on what all of them show, and of linked rods that \
         must be both"
    )]
    Mixed { first: String, other: String },
    #[error(transparent)]
    Extend(#[from] ExtendError),
}

/// A rig file that was read: its text, and the rig in it.
#[derive(Clone, Debug)]
pub struct RigFile {
    pub(crate) file: String,
    pub(crate) text: String,
    /// Checked against the ranges of all keys.
    pub rig: RigParameters,
}

impl RigFile {
    /// Reads a rig file.
    ///
    /// # Errors
    /// [`WorkflowError`] with file, line, key and what is allowed.
    pub fn read(path: &Path) -> Result<Self, WorkflowError> {
        let file = path.display().to_string();
        let text =
            std::fs::read_to_string(path).map_err(|why| WorkflowError::Rig { file: file.clone(), why })?;
        if is_model_file(&text) {
            return Err(WorkflowError::ModelFile { file });
        }
        let rig = RigParameters::from_toml(&text, &file)?;
        Ok(RigFile { file, text, rig })
    }
}

/// A checked record, gridded when it can be used.
#[derive(Debug)]
pub struct CheckedRecord {
    pub(crate) checked: Checked,
    /// The gridded record; `None` when it cannot be used.
    pub gridded: Option<GriddedRecord>,
}

/// Reads and checks a record.
///
/// # Errors
/// [`WorkflowError`] when it cannot be read.
pub fn open(path: &Path, options: &ReadOptions, rig: &RigParameters) -> Result<CheckedRecord, WorkflowError> {
    let record = records::read(path, options)?;
    let mut checked = check(&record, rig);
    if !checked.report.usable {
        return Ok(CheckedRecord { checked, gridded: None });
    }
    let gridded = match GriddedRecord::of(&record, &checked, rig) {
        Ok(gridded) => Some(gridded),
        Err(why) => {
            checked.refuse(why.column(), why.to_string());
            None
        }
    };
    Ok(CheckedRecord { checked, gridded })
}

/// Checks the records, selects effects, locates the discrepancy, extends the rig file, then judges on the held-out record.
///
/// # Errors
/// [`WorkflowError`]; a record that cannot be used is a verdict, not an error.
pub fn close(task: &Task, progress: &mut dyn FnMut(&str)) -> Result<Outcome, WorkflowError> {
    let rig_file = RigFile::read(&task.rig)?;
    let rig = &rig_file.rig;
    let opened = open_all(task, rig, progress)?;
    let checks = opened.iter().map(|opened| opened.checked.report.clone()).collect();
    let mut inputs = InputFiles {
        rig: rig_file.file.clone(),
        train: task.train.iter().map(|path| path.display().to_string()).collect(),
        ..InputFiles::default()
    };
    let mut records: Vec<GriddedRecord> = opened.into_iter().filter_map(|opened| opened.gridded).collect();
    if records.len() < task.train.len() {
        return Ok(bad_data(inputs, checks));
    }
    on_shared_axes(&mut records)?;
    let shown = Axis::ALL.into_iter().filter(|axis| records[0].measured[axis.index()]);
    inputs.axes = shown.map(|axis| axis.name().to_owned()).collect();

    inputs.searched_share = searched_share(&records);
    let part: Option<Vec<GriddedRecord>> =
        (inputs.searched_share < 1.0).then(|| parts(&records, inputs.searched_share));
    if part.is_some() {
        progress(&format!("searching {:.0} % of the records", 1e2 * inputs.searched_share));
    }
    let engine = Engine::for_search(part.as_ref().unwrap_or(&records), rig);
    let linked = records.iter().any(|record| record.linked);
    let mut found = searched_for(&engine, &records, task, progress);
    if part.is_some() || !engine.is_exact() {
        progress("fitting what was found on all of the records");
        on_all(&Engine::new(&records, rig), &mut found);
    }
    let mut report = report_of(&engine, &found);
    report.inputs = inputs;
    report.checks = checks;
    report.suspects = task.suspects.iter().map(|suspect| suspect.reported()).collect();
    progress("locating");
    // Under the rig file's own values, whatever the verdict: parameters that were fitted without the effect absorb it.
    let located = locate(rig, &records, progress);
    let mut location = located.location;
    location.dependence = term_of_rig_file(&engine, &located.unknowns, progress);
    report.location = Some(location);
    if report.verdict == Verdict::OutsideCatalogue {
        // Under the calibrated rig, so that a wrong mass is not an unknown force.
        let calibrated = with_factors(rig, &found.calibrated.factors);
        let unknowns = locate(&calibrated, &records, progress).unknowns;
        let located = report.location.as_ref().and_then(|location| location.dependence.as_ref());
        report.outside = outside(&unknowns, located, progress);
        if let Some(reported) = &mut report.outside {
            match tabulate(&engine, &found.calibrated, &found.reported, reported, &unknowns, progress) {
                Ok(found) => {
                    reported.added = true;
                    reported.tables = found.terms;
                    reported.share_explained = Some(found.share_explained);
                    report.insignificant = found.parameters;
                }
                Err(why_not) => reported.why_not = Some(why_not),
            }
        }
    }
    if report.adequate == Some(false)
        && let Some(model) = remaining_beside(&report, &found)
    {
        let reference = ReferenceModel { effects: &model.effects, factors: model.factors };
        let rig = rig_of(rig, &model.effects, &model.factors);
        let unknowns = rig.filter(|_| linked).map(|rig| locate(&rig, &records, progress).unknowns);
        report.remaining = term_beside(&engine, &reference, &unknowns.unwrap_or_default(), progress);
    }
    let mut experiment = None;
    if report.verdict == Verdict::Ambiguous
        && let Some(proposal) = proposal_for(&rig_file, &report, Some(&engine), progress)
    {
        experiment = proposal.experiment_toml;
        report.next = Some(proposal.next);
    }
    report.summary = summary(&report);
    let text = extended(&rig_file, &report)?;
    let after = RigParameters::from_toml(&text, "extended rig.toml")?;
    // The findings stand whatever the held-out record is like.
    let (pictures, not_judged) = match held_out(task, rig, &after, &records, &mut report, progress) {
        Ok(pictures) => (pictures, None),
        Err(error) => (Pictures::default(), Some(error.to_string())),
    };
    Ok(Outcome { report, extended: Some(text), pictures, experiment, not_judged })
}

/// The inadequate model, or the effect nearest to what is outside the catalogue, beside which more is missing; `None` where
/// [`Report::outside`] has it already.
fn remaining_beside<'a>(report: &Report, found: &'a SelectionResult) -> Option<&'a FittedModel> {
    match report.verdict {
        Verdict::OutsideCatalogue if report.nearest.is_none() => None,
        Verdict::OutsideCatalogue => Some(&found.model),
        _ => Some(&found.reported),
    }
}

/// Which balance disagrees under the rig file's own values, and on what it depends.
pub(crate) fn term_of_rig_file(
    engine: &Engine<'_>,
    unknowns: &[UnknownSeries],
    progress: &mut dyn FnMut(&str),
) -> Option<LocatedTerm> {
    term_beside(engine, &ReferenceModel { effects: &[], factors: [1.0; COUNT] }, unknowns, progress)
}

/// Which balance disagrees beside a model, and on what it depends. The contact of linked rods is no input of an axis: the unknown
/// inputs of short windows show it.
fn term_beside(
    engine: &Engine<'_>,
    reference: &ReferenceModel<'_>,
    unknowns: &[UnknownSeries],
    progress: &mut dyn FnMut(&str),
) -> Option<LocatedTerm> {
    if engine.is_linked()
        && let Some(outside) = outside(unknowns, None, progress)
        && outside.balance == "linkage"
    {
        return Some(LocatedTerm::from(outside));
    }
    progress("what the disagreement depends on");
    located_term(engine, reference)
}

/// Subsamples each record.
fn parts(records: &[GriddedRecord], share: f64) -> Vec<GriddedRecord> {
    records.iter().map(|record| record.thinned(share).unwrap_or_else(|| record.clone())).collect()
}

/// Judges the extended model on the held-out record, which is opened only here; without one, draws the training record.
fn held_out(
    task: &Task,
    rig: &RigParameters,
    after: &RigParameters,
    records: &[GriddedRecord],
    report: &mut Report,
    progress: &mut dyn FnMut(&str),
) -> Result<Pictures, WorkflowError> {
    let Some(test) = &task.test else {
        progress("training record, before and after");
        let traces = drawn(rig, after, &records[0]);
        return Ok(Pictures { record: records[0].name.clone(), held_out: false, traces });
    };
    progress(&format!("judging on {}", test.display()));
    let unusable = |why: String| WorkflowError::Unusable { file: test.display().to_string(), why };
    let opened = open(test, &task.options, rig)?;
    let Some(mut record) = opened.gridded else {
        return Err(unusable(fatal(std::slice::from_ref(&opened.checked.report))));
    };
    if let Some(train) = task.train.iter().find(|train| is_copy(train, test)) {
        let train = train.display();
        return Err(unusable(format!(
            "it is a copy of {train}: a model is judged on a record that it never saw"
        )));
    }
    record.measured = judged_axes(&record, records[0].measured).map_err(unusable)?;
    let verified = verify(rig, after, &record, progress);
    report.misfit = verified.misfit;
    report.verification = Some(verified.verification);
    Ok(Pictures { record: record.name.clone(), held_out: true, traces: verified.traces })
}

/// Axes that held-out and training records share.
fn judged_axes(record: &GriddedRecord, trained: [bool; 2]) -> Result<[bool; 2], String> {
    let shared = [0, 1].map(|axis| record.measured[axis] && trained[axis]);
    if shared == [false, false] {
        return Err("it shows no axis that the training records show".to_owned());
    }
    if record.linked && shared != record.measured {
        return Err("its rods are linked, and the training records show one of its axes alone".to_owned());
    }
    Ok(shared)
}

/// Whether two files have the same bytes.
fn is_copy(one: &Path, other: &Path) -> bool {
    let length = |file: &Path| std::fs::metadata(file).map(|metadata| metadata.len()).ok();
    length(one) == length(other)
        && matches!((std::fs::read(one), std::fs::read(other)), (Ok(one), Ok(other)) if one == other)
}

/// The rig file with what a report names.
///
/// # Errors
/// [`ExtendError`] when it names what a rig cannot have.
pub fn extended(rig_file: &RigFile, reported: &Report) -> Result<String, ExtendError> {
    let effects = || reported.named.iter().chain(&reported.small);
    let suspect = |effect: &NamedEffect| reported.suspects.iter().find(|suspect| suspect.is(effect));
    let of_catalogue = effects().filter(|effect| suspect(effect).is_none());
    let additions: Vec<Addition> = of_catalogue.map(addition).collect();
    let terms: Vec<(&NamedEffect, &DeclaredSuspect)> =
        effects().filter_map(|effect| Some((effect, suspect(effect)?))).collect();
    let changed = [&reported.parameters[..], &reported.insignificant].concat();
    let mass_axis = mass_axis(measured(reported));
    let text =
        extend(&rig_file.text, &rig_file.file, &additions, &changed, mass_axis, &reported.inputs.train)?;
    let text = add_terms(&text, &rig_file.file, &terms, &reported.inputs.train)?;
    let tables_of = reported.outside.as_ref().map_or(&[][..], |outside| &outside.tables);
    add_tables(&text, &rig_file.file, &tables(tables_of), &reported.inputs.train)
}

fn open_all(
    task: &Task,
    rig: &RigParameters,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<CheckedRecord>, WorkflowError> {
    task.train
        .iter()
        .map(|path| {
            progress(&format!("reading {}", path.display()));
            open(path, &task.options, rig)
        })
        .collect()
}

/// Which axes the training records of a report showed.
fn measured(reported: &Report) -> [bool; 2] {
    Axis::ALL.map(|axis| reported.inputs.axes.iter().any(|name| name == axis.name()))
}

/// Restricts records to their common axes. No axis of linked rods can be left out, since they move together.
pub(crate) fn on_shared_axes(records: &mut [GriddedRecord]) -> Result<(), WorkflowError> {
    let shared = [0, 1].map(|axis| records.iter().all(|record| record.measured[axis]));
    let lacks =
        |record: &&GriddedRecord| record.measured != shared && (record.linked || shared == [false, false]);
    if let Some(record) = records.iter().find(lacks) {
        let other = records.iter().find(|other| other.measured != record.measured).unwrap_or(record);
        return Err(WorkflowError::Mixed { first: record.name.clone(), other: other.name.clone() });
    }
    records.iter_mut().for_each(|record| record.measured = shared);
    Ok(())
}

/// The axis of a mass in kg; for both axes the mass is a common factor.
pub(crate) fn mass_axis(measured: [bool; 2]) -> Axis {
    if measured == [false, true] { Axis::Load } else { Axis::Drive }
}

/// Fatal findings of the records, in words.
fn fatal(checks: &[report::RecordCheck]) -> String {
    let findings = checks.iter().flat_map(|check| &check.findings).filter(|finding| finding.fatal);
    findings.map(|finding| finding.text.as_str()).collect::<Vec<_>>().join("; ")
}

/// The outcome of records that cannot be used.
fn bad_data(inputs: InputFiles, checks: Vec<report::RecordCheck>) -> Outcome {
    let summary = format!("A record cannot be used: {}", fatal(&checks));
    let report = Report { inputs, checks, ..empty(Verdict::BadData, summary) };
    Outcome { report, extended: None, pictures: Pictures::default(), experiment: None, not_judged: None }
}

fn addition(named: &NamedEffect) -> Addition {
    let numbers = named
        .parameters
        .iter()
        .map(|number| (number.name.clone(), number.value, number.standard_error))
        .collect();
    Addition { effect: named.effect.clone(), place: named.place.to_string(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(name: &str, measured: [bool; 2], linked: bool) -> GriddedRecord {
        GriddedRecord { name: name.to_owned(), linked, measured, ..GriddedRecord::default() }
    }

    const DRIVE: [bool; 2] = [true, false];
    const LOAD: [bool; 2] = [false, true];
    const BOTH: [bool; 2] = [true, true];

    #[test]
    fn records_are_judged_on_the_axes_that_all_of_them_show() {
        for (records, shared) in [
            ([(DRIVE, false), (DRIVE, false)], DRIVE),
            ([(LOAD, false), (BOTH, false)], LOAD),
            ([(BOTH, true), (BOTH, false)], BOTH),
        ] {
            let mut records = records.map(|(measured, linked)| record("a", measured, linked));
            on_shared_axes(&mut records).unwrap();
            assert!(records.iter().all(|record| record.measured == shared), "{records:?}");
        }
    }

    #[test]
    fn a_held_out_record_is_judged_on_what_was_trained() {
        let judged = |measured, linked, trained| judged_axes(&record("a", measured, linked), trained);
        assert_eq!(judged(BOTH, false, DRIVE), Ok(DRIVE));
        assert_eq!(judged(DRIVE, false, BOTH), Ok(DRIVE));
        assert_eq!(judged(BOTH, true, BOTH), Ok(BOTH));
        assert!(judged(LOAD, false, DRIVE).unwrap_err().contains("no axis"));
        assert!(judged(BOTH, true, DRIVE).unwrap_err().contains("linked"));
    }

    #[test]
    fn no_axis_of_linked_rods_is_left_out() {
        for records in [[(DRIVE, false), (LOAD, false)], [(DRIVE, false), (BOTH, true)]] {
            let [one, two] = records;
            let mut records = [record("one", one.0, one.1), record("two", two.0, two.1)];
            let error = on_shared_axes(&mut records).unwrap_err().to_string();
            assert!(error.contains("one") && error.contains("two"), "{error}");
        }
    }
}
