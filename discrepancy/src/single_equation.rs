//! A model that is one balance alone: one mass with a measured force, slow strokes of a cylinder, one chamber.
//!
//! ```text
//!   model file ─► records as rows ─► baseline by least squares ─► candidates on folds of the training records ─► named
//!                                                                                   held-out record, frozen ─► both residuals
//! ```
//!
//! Foreign records seldom hold a whole rig. One balance needs no simulation: each term is a column, and selection is that of
//! `select`. Nothing of the held-out record is read before the terms are chosen and fitted.
//!
//! | file | holds |
//! |---|---|
//! | `model` | the model file |
//! | `filter` | zero-phase low passes |
//! | `runs` | a record as rows |
//! | `terms` | columns of baseline, candidates and decoys |
//! | `fit` | least squares, folds, clustered errors |
//! | `select` | which terms are taken |
//! | `record_checks` | whether the records can be used |
//! | `report` | the report |
//! | `extended` | the model file with what was found |
//!
//! Keys, processing and figures on real records: `discrepancy/docs/one-balance.md`.

mod extended;
mod filter;
mod fit;
pub(crate) mod model;
mod pictures;
mod record_checks;
mod report;
mod runs;
mod select;
mod terms;

pub use extended::extended_model_text;
pub(crate) use fit::clustered_t;
pub(crate) use model::Model;
pub(crate) use select::{GAIN_APART, SHARE_FLOOR, T_TIME};

use crate::check::FEWEST_ROWS;
use crate::page::Pictures;
use crate::report::{Report, Verdict};
use crate::stats::order_statistic;
use fit::{Columns, Cut, Fit, Rows, residual, rms};
use plant::RigParameters;
use records::description_error::DescriptionError;
use records::{ReadError, ReadOptions, Record};
use runs::Run;
use select::{Cuts, Prepared, SearchResult};
use std::path::{Path, PathBuf};

/// Ratio of the deciles of speed below which folds over speed would ask for another experiment.
const SPEEDS_APART: f64 = 3.0;

/// Why a balance cannot be closed.
#[derive(Debug, thiserror::Error)]
pub enum BalanceError {
    #[error(transparent)]
    File(#[from] DescriptionError),
    #[error("this kind of model has no term '{effect}' of form '{form}', or its shape lacks a number")]
    Term { effect: String, form: String },
    #[error("{name}: a chamber needs rig = \"…/rig.toml\" for its area, volume, valve tables and lags")]
    NoRig { name: String },
    #[error("the model's rig: {reason}")]
    Rig { reason: String },
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("{file}: no values of {column}, which the model's balance needs: see [channels] of the model")]
    Missing { file: String, column: String },
    #[error("{file}:{line}: time does not grow: sort the rows, or split the record there")]
    Time { file: String, line: u64 },
    #[error(
        "{file}: {rows} rows pass the model's [processing], {FEWEST_ROWS} are needed: are position_mm, speed_above_mm_per_s right?"
    )]
    Few { file: String, rows: usize },
    #[error("{why}")]
    Unusable { why: String },
    #[error(
        "{file}:{line}: {time_s} s: {rows} rows cannot reach as far at a period of {period_s} s: mend the time, or \
             processing.period_s of the model"
    )]
    Far { file: String, line: u64, time_s: f64, rows: usize, period_s: f64 },
    #[error("a balance needs one training record at least")]
    NoRecord,
    #[error(
        "the training records cannot tell {columns} apart: add one in which they differ, or switch one off under [baseline]"
    )]
    NotExcited { columns: String },
}

/// Whether a text is a model file: TOML with a `kind` at its top. A rig file has none.
pub(crate) fn is_model_file(text: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("kind"))
}

/// What came out, and why held-out records were not judged, where they were given and were not.
#[derive(Clone, Debug)]
pub struct Closed {
    /// What was found.
    pub report: Report,
    /// Why the held-out records were not judged.
    pub not_judged: Option<String>,
    /// Series for the page.
    pub pictures: Pictures,
}

/// What both models leave of some rows, the baseline's first.
struct Fitted {
    rows: Rows,
    residuals: [Vec<f64>; 2],
}

/// Closes a balance: names what it lacks by the training records, and compares both models on the held-out ones, their residuals
/// those over all of them.
///
/// # Errors
/// [`BalanceError`] for a model or record that cannot be used.
pub fn close(
    model_file: &Path,
    train: &[PathBuf],
    tests: &[&Path],
    progress: &mut dyn FnMut(&str),
) -> Result<Closed, BalanceError> {
    let study = Study::of(model_file, train, progress)?;
    let mut report = study.report(model_file);
    // What was found stays, whatever the held-out records are like.
    let (pictures, not_judged) = match study.judge(tests, &mut report, progress) {
        Ok(pictures) => (pictures, None),
        Err(error) => (study.trained_pictures(), Some(error.to_string())),
    };
    Ok(Closed { report, not_judged, pictures })
}

/// The training records with all that was found in them.
struct Study {
    model: Model,
    rig: Option<RigParameters>,
    records: Vec<Record>,
    runs: Vec<Run>,
    rows: Rows,
    /// Columns of the baseline, terms of the model file among them.
    base: Columns,
    base_fit: Fit,
    time: Cut,
    families: Vec<Prepared>,
    found: SearchResult,
    /// Columns of the baseline and of the selected terms.
    extended: Columns,
    extended_fit: Fit,
}

impl Study {
    fn of(
        model_file: &Path,
        train: &[PathBuf],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Self, BalanceError> {
        let model = Model::read(model_file)?;
        let rig = model.rig.as_ref().map(|file| read_rig(file)).transpose()?;
        let (mut records, mut runs) = (Vec::new(), Vec::new());
        for file in train {
            progress(&format!("reads {}", file.display()));
            let (record, run) = read(&model, rig.as_ref(), file)?;
            records.push(record);
            runs.push(run);
        }
        if runs.is_empty() {
            return Err(BalanceError::NoRecord);
        }
        let rows = rows_of(&runs);
        let base = base_columns(&model, &runs)?;
        let plain = base[..terms::baseline(&model).len()].to_vec();
        let base_fit = rows.fit(&base).ok_or_else(|| BalanceError::NotExcited {
            columns: terms::baseline(&model).iter().map(|column| column.name).collect::<Vec<_>>().join(", "),
        })?;
        let at_rows = |of: &dyn Fn(&Run) -> &Vec<f64>| -> Vec<f64> {
            runs.iter().flat_map(|run| run.kept.iter().map(|at| of(run)[*at])).collect()
        };
        let positions = at_rows(&|run| &run.x_m);
        let speeds: Vec<f64> = at_rows(&|run| &run.v_m_per_s).iter().map(|v| v.abs()).collect();
        let selection = model.selection.clone();
        let time = rows.in_time(selection.blocks);
        let cuts = Cuts {
            time: time.clone(),
            position: rows.in_bands("bands of position", &positions, selection.bands),
            speed: speeds_apart(&speeds)
                .then(|| rows.in_bands("bands of speed", &speeds, (selection.bands / 2).max(2))),
        };
        let span = positions
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| [x.min(least), x.max(most)]);
        progress("columns of the candidates");
        let known = |family: &terms::Family| {
            let variant = &family.variants[0];
            model.terms.iter().any(|term| term.effect == variant.effect && term.form == variant.form)
        };
        let mut families = Vec::new();
        let searched = model.selection.most > 0;
        for family in terms::families(&model, span).into_iter().filter(|family| searched && !known(family)) {
            let columns = family.variants.iter().map(|variant| term_columns(&model, variant, &runs));
            families.push(Prepared { columns: columns.collect::<Result<_, _>>()?, family });
        }
        let found = select::search(&rows, &cuts, [&plain, &base], &families, &selection, progress);
        let mut extended = base.clone();
        for taken in &found.taken {
            extended
                .extend(families[taken.evaluation.place].columns[taken.evaluation.variant].iter().cloned());
        }
        let extended_fit = rows.fit(&extended).unwrap_or_else(|| base_fit.clone());
        Ok(Self {
            model,
            rig,
            records,
            runs,
            rows,
            base,
            base_fit,
            time,
            families,
            found,
            extended,
            extended_fit,
        })
    }

    /// Opens the held-out records, and compares both models on them; without one, draws the training record.
    fn judge(
        &self,
        tests: &[&Path],
        report: &mut Report,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Pictures, BalanceError> {
        if report.verdict == Verdict::BadData {
            return Ok(Pictures::default());
        }
        let mut held_out = Vec::new();
        for test in tests {
            progress(&format!("held out: {}", test.display()));
            let (record, run) = read(&self.model, self.rig.as_ref(), test)?;
            let checked = self.check(&record);
            if let Some(fatal) = checked.findings.iter().find(|finding| finding.fatal) {
                return Err(BalanceError::Unusable { why: fatal.text.clone() });
            }
            held_out.push(run);
        }
        if held_out.is_empty() {
            return Ok(self.trained_pictures());
        }
        let fitted = self.fitted(&held_out)?;
        self.verify(&held_out, &fitted, report);
        Ok(self.pictures(&held_out, &fitted, true))
    }

    fn trained_pictures(&self) -> Pictures {
        let residuals = [self.base_fit.residual.clone(), self.extended_fit.residual.clone()];
        self.pictures(&self.runs, &Fitted { rows: self.rows.clone(), residuals }, false)
    }

    /// Both models, frozen, on records that were not used.
    fn fitted(&self, runs: &[Run]) -> Result<Fitted, BalanceError> {
        let mut columns = base_columns(&self.model, runs)?;
        let rows = rows_of(runs);
        let before = residual(&rows.target, &columns, &self.base_fit.numbers);
        for taken in &self.found.taken {
            let entry = &self.families[taken.evaluation.place].family.variants[taken.evaluation.variant];
            columns.extend(term_columns(&self.model, entry, runs)?);
        }
        let after = residual(&rows.target, &columns, &self.extended_fit.numbers);
        Ok(Fitted { rows, residuals: [before, after] })
    }

    /// rms of the residual of baseline and extended model on the training records, ends included.
    fn trained_rms(&self) -> [f64; 2] {
        [rms(&self.base_fit.residual), rms(&self.extended_fit.residual)]
    }
}

/// The rows of runs, one after the other.
fn rows_of(runs: &[Run]) -> Rows {
    let mut records: Vec<std::ops::Range<usize>> = Vec::new();
    for run in runs {
        let start = records.last().map_or(0, |range| range.end);
        records.push(start..start + run.kept.len());
    }
    Rows {
        target: runs.iter().flat_map(|run| run.rows(&run.target)).collect(),
        in_score: runs.iter().flat_map(|run| run.in_score.iter().copied()).collect(),
        records,
    }
}

/// Whether folds in bands of speed are identifiable from the others.
fn speeds_apart(speeds: &[f64]) -> bool {
    let mut speeds = speeds.to_vec();
    let count = speeds.len();
    let mut decile = |tenths: usize| order_statistic(&mut speeds, count * tenths / 10).unwrap_or(0.0);
    decile(9) > SPEEDS_APART * decile(1)
}

fn base_columns(model: &Model, runs: &[Run]) -> Result<Columns, BalanceError> {
    let mut columns: Columns = terms::baseline(model)
        .iter()
        .map(|column| runs.iter().flat_map(|run| run.rows(&(column.of)(run))).collect())
        .collect();
    for term in &model.terms {
        columns.extend(term_columns(model, term, runs)?);
    }
    Ok(columns)
}

/// The columns of a term over the rows of all runs.
fn term_columns(model: &Model, term: &model::TermEntry, runs: &[Run]) -> Result<Columns, BalanceError> {
    let mut all: Columns = Vec::new();
    for run in runs {
        for (place, column) in terms::columns(model, term, run)?.iter().enumerate() {
            if all.len() <= place {
                all.push(Vec::new());
            }
            all[place].extend(run.rows(column));
        }
    }
    Ok(all)
}

fn read(model: &Model, rig: Option<&RigParameters>, file: &Path) -> Result<(Record, Run), BalanceError> {
    let record =
        records::read(file, &ReadOptions { mapping: model.mapping.clone(), ..ReadOptions::default() })?;
    let run = Run::of(&record, model, rig)?;
    Ok((record, run))
}

fn read_rig(file: &Path) -> Result<RigParameters, BalanceError> {
    let text = DescriptionError::read("model", file)?;
    RigParameters::from_toml(&text, &file.display().to_string())
        .map_err(|error| BalanceError::Rig { reason: error.to_string() })
}

#[cfg(test)]
mod tests;
