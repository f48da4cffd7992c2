//! The workflow for a plant that its user wrote as a model file: fit, suspects, held-out records.
//!
//! ```text
//!   model file, training records ─► fit of the model ─► suspects one by one ─► named ─► held-out records, frozen ─► verdict
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `begin` | a first model file from the columns of a record |
//! | `record` | a record as the model reads it |
//! | `unit_row` | a row of units under its head |
//! | `processing` | even grid, smoothed inputs, rates, rows |
//! | `look` | what a record looks like: holes, spikes, saturation, sign, columns |
//! | `filter` | zero-phase low passes |
//! | `fit` | output-error fit by the one Gauss-Newton |
//! | `bounds` | numbers at the end of their range, or hardly determined |
//! | `simulate` | the model with the values of its file beside a record |
//! | `samples` | measured samples, what the model says of them, derivatives |
//! | `normal` | normal equations, steps, standard errors |
//! | `covariance` | standard errors with autocorrelated residuals and an approximate law |
//! | `cuts` | rows in blocks of time, and in bands |
//! | `folds` | leave-one-block-out cross-validation |
//! | `starts` | starting points of a fit |
//! | `select` | which suspects are taken |
//! | `judge` | whether a suspect passes |
//! | `pairs` | two suspects that pay together where neither does alone |
//! | `discover` | a search for what no suspect describes |
//! | `held_out` | both models on records that were not used |
//! | `structure` | which suspects can be told apart, before any fit |
//! | `sensors` | which state, measured, would tell suspects apart |
//! | `adequacy` | whether residuals are noise |
//! | `progress` | progress of work that takes long |
//! | `report` | the report |
//! | `explain`, `explain_page` | equations, units, suspects in words; on a page |
//! | `page` | the page |
//! | `typeset` | equations of the extended model as MathML |
//! | `term_curves` | a term over the variable that it depends on most |
//! | `declared` | what a model file declares beside its equations, by which its versions are told apart |
//! | `extended` | the model file with what was found |
//! | [`estimator`] | Gauss-Newton of every nonlinear fit, that of the rig too: options, globalisation, outcome |
//! | [`parallel`] | independent computations on all cores |
//! | [`stats`], [`quantum`], [`equal_runs`] | order statistics and means; rounding and stuck values of a column |
//!
//! Held-out records are read and checked before a fit starts, and no value of theirs enters one: they wait until the terms are
//! chosen and fitted. Keys: `docs/model-files.md`; figures: `docs/model-records.md`.

#![warn(missing_docs)] // an interface of other crates

pub mod equal_runs;
pub mod estimator;
pub mod parallel;
pub mod quantum;
pub mod stats;

mod adequacy;
mod begin;
mod bounds;
mod covariance;
mod cuts;
mod declared;
mod discover;
mod explain;
mod explain_page;
mod extended;
mod filter;
mod fit;
mod folds;
mod held_out;
mod judge;
mod look;
mod normal;
mod page;
mod pairs;
mod processing;
mod progress;
mod record;
mod report;
mod samples;
mod select;
mod sensors;
mod simulate;
mod starts;
mod structure;
mod term_curves;
mod typeset;
mod unit_row;

pub use adequacy::Residual;
pub use begin::{NewError, NewModel, Roles, new_model};
pub use discover::{DiscoveredTerm, Located, Place};
pub use explain::{Explanation, explain, explained};
pub use extended::{ExtendError, extended};
pub use held_out::{JudgeError, WORSE};
pub use processing::SPARSEST;
pub use record::RecordError;
pub use report::{AlternativeResidual, ModelReport, ParameterEstimate, ResidualComparison};
pub use runlog::discrepancy_report::Verdict;
pub use simulate::{SimulatedOutput, SimulatedRecord, simulate};

use held_out::Traces;
use model::{Failure, Model};
use record::MeasuredRecord;
use std::path::{Path, PathBuf};

/// Why a model file cannot be closed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum ModelError {
    #[error("{}: {why}", file.display())]
    Open { file: PathBuf, why: std::io::Error },
    #[error(transparent)]
    File(#[from] settings::SettingsError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    HeldOut(#[from] JudgeError),
    #[error("the model cannot be simulated with its first values: {0}")]
    Failure(#[from] Failure),
}

/// Whether a text is a model file: TOML with outputs at its top, or of the former form. A rig file has neither.
#[must_use]
pub fn is_model_file(text: &str) -> bool {
    let has = |table: &toml::Table| table.contains_key("outputs") || table.contains_key("kind");
    text.parse::<toml::Table>().is_ok_and(|table| has(&table))
}

/// The shipped model file that stands for a model of one balance, as files were written until 0.1.0: TOML with a `kind`.
#[must_use]
pub fn successor(text: &str) -> Option<&'static str> {
    let table: toml::Table = text.parse().ok()?;
    if table.contains_key("outputs") {
        return None;
    }
    match table.get("kind")?.as_str()? {
        "mass" => Some("emps.toml"),
        "friction" => Some("cylinder-friction.toml"),
        "chamber" => Some("chamber.toml"),
        _ => None,
    }
}

/// Reads a model file.
///
/// # Errors
/// [`ModelError`] with file, line and column.
pub fn read(file: &Path) -> Result<Model, ModelError> {
    let text =
        std::fs::read_to_string(file).map_err(|why| ModelError::Open { file: file.to_owned(), why })?;
    Ok(Model::parse(&text, file)?)
}

/// A closed model: its report, and the texts of the other files.
#[derive(Clone, Debug)]
pub struct ClosedModel {
    /// Content of `report.json`.
    pub report: ModelReport,
    /// Why the held-out records were not judged.
    pub not_judged: Option<String>,
    /// `report.html`, self-contained.
    pub page: String,
    /// The model file with what was named; `None` where nothing was, or a held-out record takes it back.
    pub extended: Option<String>,
}

/// Where a formula is searched for what no suspect describes. None is where a suspect is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Where a residual is more than noise.
    MoreThanNoise,
    /// Wherever nothing is named.
    NothingNamed,
    /// Nowhere.
    Never,
}

/// Most steps of a simulation with which a formula is searched that nobody asked for: at a microsecond each, and hundreds of
/// simulations, some minutes.
const MOST_STEPS_UNASKED: usize = 100_000;

/// Closes a model: names what it lacks by the training records, and compares both models on the held-out ones. A formula is
/// searched where `search` says.
///
/// # Errors
/// [`ModelError`] for a model or a record that cannot be used.
pub fn close(
    file: &Path,
    (train, tests): (&[PathBuf], &[PathBuf]),
    search: Search,
    progress: &mut dyn FnMut(&str),
) -> Result<ClosedModel, ModelError> {
    let model = read(file)?;
    let records = read_with_notes(&model, train)?;
    // Before the fit, which may take minutes.
    for record in &records {
        record.notes.iter().for_each(|note| progress(&format!("{}: {note}", record.name)));
    }
    let waiting = read_all(&model, tests)?;
    held_out::check(&model, &waiting)?;
    let found = select::search(&model, &records, progress)?;
    progress("structure");
    let structure = structure::structure(&found.baseline, &found.extended);
    let with_terms = is_searched(&found, search)?.then(|| match (search, found.baseline.point.steps) {
        (Search::MoreThanNoise, steps) if steps > MOST_STEPS_UNASKED => Err(format!(
            "a simulation has {steps} steps, and a search makes hundreds: --discover asks for one"
        )),
        _ => discover::with_terms(&found.baseline),
    });
    let located = progress::with_progress(progress, ("where it comes from: steps", 1), |_| {
        discover::located(&found.baseline)
    });
    let (found, mut report) = match &with_terms {
        None => {
            let report = report::report(file, &found, &structure);
            (found, report)
        }
        Some(Err(why)) => {
            let mut report = report::report(file, &found, &structure);
            report.notes.push(format!("nothing was searched: {why}"));
            (found, report)
        }
        Some(Ok(with_terms)) => {
            let discovery = discover::search(with_terms, &records, found, progress)?;
            let mut report = report::report(file, &discovery.found, &structure);
            report.describe(&discovery);
            (discovery.found, report)
        }
    };
    report.located = located;
    let rivals = found.rivals(progress);
    let held_out = judged(&model, (&found, &rivals), waiting, progress);
    let (traces, not_judged): (Vec<Traces>, _) = match held_out {
        Ok(None) => (held_out::trained(&found)?, None),
        Ok(Some((judged, alternatives, traces, notes))) => {
            report.judge(&model, (&judged, &alternatives), &traces);
            report.notes.extend(notes);
            report.notes.extend(report.much_worse());
            (traces, None)
        }
        // What was found stays, whatever the held-out records are like.
        Err(why) => (held_out::trained(&found)?, Some(why)),
    };
    report.equations = report::equations(&model);
    report.declared = declared::declared(&model);
    report.rate(adequacy::residuals(&found.extended)?);
    let curves = term_curves::curves(&found, &rivals);
    let models = (&model, found.extended.fitting.model);
    let page = page::page(models, &report, (&traces, &curves), not_judged.as_deref());
    let folder = file.parent().unwrap_or(Path::new(""));
    let is_named = (!report.named.is_empty() || !report.discovered.is_empty()) && !report.taken_back;
    let extended = is_named.then(|| extended(&model.text, folder, &report).ok()).flatten();
    Ok(ClosedModel { report, not_judged, page, extended })
}

fn is_searched(found: &select::SearchResult<'_>, search: Search) -> Result<bool, ModelError> {
    Ok(found.accepted.is_empty()
        && match search {
            Search::MoreThanNoise => {
                !adequacy::residuals(&found.extended)?.iter().all(|residual| residual.is_noise)
            }
            Search::NothingNamed => true,
            Search::Never => false,
        })
}

/// Size and notes of a record, before anything is fitted.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RecordPreview {
    /// Name of its file, without folders.
    pub record: String,
    /// Samples on which the model is compared.
    pub rows: usize,
    /// From the first sample to the last one, s.
    pub length_s: f64,
    /// Remarks on the record in sentences, as in a report.
    pub notes: Vec<String>,
}

/// Reads and checks records as [`close`] does, and fits nothing.
///
/// # Errors
/// [`ModelError`] for a model or a record that cannot be used.
pub fn preview_records(file: &Path, records: &[PathBuf]) -> Result<Vec<RecordPreview>, ModelError> {
    let all = read_with_notes(&read(file)?, records)?;
    let of = |record: MeasuredRecord| RecordPreview {
        rows: record.rows.len(),
        length_s: record.sampled_s.last().unwrap_or(&0.0) - record.sampled_s[0],
        record: record.name,
        notes: record.notes,
    };
    Ok(all.into_iter().map(of).collect())
}

/// Records with what they look like beside the model among their notes.
fn read_with_notes(model: &Model, files: &[PathBuf]) -> Result<Vec<MeasuredRecord>, ModelError> {
    let mut records = read_all(model, files)?;
    look::beside_model(model, &mut records);
    Ok(records)
}

fn read_all(model: &Model, files: &[PathBuf]) -> Result<Vec<MeasuredRecord>, RecordError> {
    files.iter().map(|path| MeasuredRecord::read(model, path)).collect()
}

/// Residuals of both models, those of alternatives, predictions of both models, and notes of the records.
type HeldOutJudgement =
    (Vec<held_out::HeldOutResidual>, Vec<held_out::Alternative>, Vec<Traces>, Vec<String>);

/// Both models on the held-out records; `None` where there is none.
fn judged(
    model: &Model,
    (found, rivals): (&select::SearchResult<'_>, &[select::Rival<'_>]),
    mut records: Vec<MeasuredRecord>,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<HeldOutJudgement>, String> {
    if records.is_empty() {
        return Ok(None);
    }
    records.iter().for_each(|record| progress(&format!("held out: {}", record.file.display())));
    look::beside_model(model, &mut records);
    let (judged, traces) = held_out::judge(found, &records).map_err(|error| error.to_string())?;
    let alternatives =
        held_out::alternatives(rivals, &records, &judged).map_err(|error| error.to_string())?;
    Ok(Some((judged, alternatives, traces, report::notes_of(&records))))
}

impl ClosedModel {
    /// Whether a residual is more than noise, and nothing was named for it.
    #[must_use]
    pub fn is_unexplained(&self) -> bool {
        !self.report.adequate && self.report.named.is_empty() && self.report.discovered.is_empty()
    }

    /// Whether the held-out records confirm what was found, or nothing was.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        self.report.verdict == Verdict::NothingMissing || self.report.confirmed == Some(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_file_is_distinguished_from_a_rig_file() {
        let rig =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../plant/rig.toml")).unwrap();
        assert!(
            is_model_file("[outputs.y]\nvalue = \"1\"\n")
                && !is_model_file(&rig)
                && !is_model_file("outputs =")
        );
    }

    #[test]
    fn a_model_of_one_balance_names_the_file_that_stands_for_it() {
        let of = |kind: &str| successor(&format!("kind = \"{kind}\"\n"));
        let shipped = ["mass", "friction", "chamber"].map(|kind| of(kind).unwrap());
        for name in shipped {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../discrepancy/models").join(name);
            assert!(read(&file).is_ok(), "{name}");
        }
        assert_eq!((of("spring"), successor("[outputs.y]\nvalue = \"1\"\n")), (None, None));
    }
}
