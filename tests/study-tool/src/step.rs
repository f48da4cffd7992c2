//! One step of a study: the records of a draw, the run of the program on copies of them, its output.
//!
//! A draw is done when its folder has its final name, so that a step can be killed at any time and repeated. A campaign decides
//! which draws are run, where, and how many at a time (`campaign/docs/campaigns.md`); its command is `study one`. A program
//! that crashes, hangs or writes an invalid report is a result. A full disk is not: the step is not started then, since a
//! report that did not fit says nothing about the program.

use crate::SCHEMA_VERSION;
use crate::draws::Draw;
use crate::folder::{FolderError, Study, make_whole, read_versioned};
use crate::leave_out;
use crate::program::{Execution, Identity, Interrupted, Program, ProgramInputs};
use crate::report::{self, Report};
use plant::RigParameters;
use record_maker::{Experiment, Recipe};
use records::{ReadError, ReadOptions, UnlistedColumns};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Folder names of the records of a draw.
pub(crate) const EXPERIMENTS: [(Experiment, &str); 3] = [
    (Experiment::Train, "train"),
    (Experiment::HeldOut(0), "held-out-0"),
    (Experiment::HeldOut(1), "held-out-1"),
];

const LARGEST_REPORT: u64 = 64 << 20;
const LARGEST_EXPERIMENT: u64 = 1 << 20;
/// Largest part of the program's standard error that is kept, bytes.
const LARGEST_STDERR: u64 = 1 << 20;

/// Makes a record: measurement into the first folder, truth into the second; the error says why it cannot.
pub type Make<'a> = &'a (dyn Fn(&Recipe, &RigParameters, &Path, &Path) -> Result<(), String> + Sync);

/// Makes a record with the record maker, as [`Make`].
///
/// # Errors
/// Why the record cannot be made.
pub fn make_record(
    recipe: &Recipe,
    rig: &RigParameters,
    measurement: &Path,
    truth: &Path,
) -> Result<(), String> {
    record_maker::make(recipe, rig, measurement, truth).map_err(|error| error.to_string())
}

/// How the steps of a study are run.
pub struct Step<'a> {
    pub study: &'a Study,
    pub label: &'a str,
    /// Makes the records of a draw: [`make_record`], but for twins.
    pub make: Make<'a>,
    /// Effects that are left out of the program's catalogue; `None` for the whole catalogue.
    pub without: Option<Vec<String>>,
    /// Whether truth.csv is kept, 17 MB each.
    pub keep_truth: bool,
    /// Whether records are deleted after the run of the program.
    pub drop_records: bool,
    /// Whether finished runs are repeated.
    pub again: bool,
    /// Free space below which no step is started, MiB.
    pub least_free_mib: u64,
    /// Interrupts a running step when set.
    pub stop: &'a AtomicBool,
}

#[derive(Debug, thiserror::Error)]
pub enum StepError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("draw {number}: {error}")]
    Files { number: usize, error: io::Error },
    #[error("draw {number}: its record cannot be made: {reason}")]
    Make { number: usize, reason: String },
    #[error("draw {number}: {error}")]
    Record { number: usize, error: ReadError },
    #[error(
        "{free_mib} MiB are left on the disk, {least_free_mib} are wanted: free some and start again, nothing is lost"
    )]
    Disk { free_mib: u64, least_free_mib: u64 },
}

/// Result of a run, as `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    pub(crate) schema_version: u32,
    pub(crate) number: usize,
    pub(crate) program: Identity,
    pub(crate) taken: Execution,
    /// Effects that were left out of the program's catalogue; absent in a file when there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) without: Vec<String>,
}

impl<'a> Step<'a> {
    /// A step of the whole catalogue that repeats nothing, keeps the records without truth.csv, and asks for no free space.
    pub fn new(study: &'a Study, label: &'a str, make: Make<'a>, stop: &'a AtomicBool) -> Self {
        Step {
            study,
            label,
            make,
            without: None,
            keep_truth: false,
            drop_records: false,
            again: false,
            least_free_mib: 0,
            stop,
        }
    }

    /// Makes the records of a draw, unless they exist.
    ///
    /// # Errors
    /// [`StepError`] when the disk is full, a record cannot be made, or a file cannot be written.
    pub fn records(&self, draw: &Draw) -> Result<(), StepError> {
        if self.study.records(draw.number).exists() {
            return Ok(());
        }
        self.check_disk()?;
        self.make_records(draw)
    }

    /// Runs the program on a draw, unless it has a result; `None` when interrupted.
    ///
    /// # Errors
    /// [`StepError`] for whatever is not a result of the program.
    pub fn run(&self, draw: &Draw, program: &Program) -> Result<Option<RunResult>, StepError> {
        let number = draw.number;
        let path = self.study.run(self.label, number);
        if path.exists() && !self.again {
            let path = path.join("result.json");
            let result = read_result(&path)?;
            // Results of another program under the same label are never mixed.
            check_program(&path, &result.program, &self.identity(program), "give another --label")?;
            return Ok(Some(result));
        }
        self.check_disk()?;
        self.records(draw)?;
        let result = whole_run(&path, |folder| self.run_program(draw, program, folder))?;
        if self.drop_records && result.is_some() {
            fs::remove_dir_all(self.study.records(number))
                .map_err(|error| StepError::Files { number, error })?;
        }
        Ok(result)
    }

    fn identity(&self, program: &Program) -> Identity {
        Identity { leave_out: self.without.is_some(), ..program.identity.clone() }
    }

    pub(crate) fn check_disk(&self) -> Result<(), StepError> {
        // A system that does not report its free space is no reason to stop.
        let Ok(reported) = rustix::fs::statvfs(&self.study.root) else { return Ok(()) };
        let free_mib = reported.f_bavail.saturating_mul(reported.f_frsize) >> 20;
        let least_free_mib = self.least_free_mib;
        if free_mib < least_free_mib { Err(StepError::Disk { free_mib, least_free_mib }) } else { Ok(()) }
    }

    /// The truth first: records without it would be useless, truth without records is made again.
    fn make_records(&self, draw: &Draw) -> Result<(), StepError> {
        let (number, rig) = (draw.number, RigParameters::baseline());
        make_whole(&self.study.records(number), |records| {
            make_whole(&self.study.truth(number), |truth| {
                for (experiment, name) in EXPERIMENTS {
                    let (record, truth) = (records.join(name), truth.join(name));
                    let folders = fs::create_dir_all(&record).and_then(|()| fs::create_dir_all(&truth));
                    folders.map_err(|error| StepError::Files { number, error })?;
                    (self.make)(&draw.recipe(experiment), &rig, &record, &truth)
                        .map_err(|reason| StepError::Make { number, reason })?;
                    if !self.keep_truth {
                        // It can be made again from the recipe.
                        let _ = fs::remove_file(truth.join("truth.csv"));
                    }
                }
                Ok(())
            })
        })
    }

    fn run_program(
        &self,
        draw: &Draw,
        program: &Program,
        folder: &Path,
    ) -> Result<Option<RunResult>, StepError> {
        let number = draw.number;
        let files = |error| StepError::Files { number, error };
        let empty = tempfile::tempdir().map_err(files)?;
        self.copy_inputs(draw, empty.path())?;
        let without = self.without.clone().unwrap_or_default();
        let arguments = leave_out::arguments(&without);
        let start = ProgramInputs { folder: empty.path(), train: &["train.csv"], arguments: &arguments };
        let Some(taken) = self.start(number, program, &start, folder)? else { return Ok(None) };
        let program = self.identity(program);
        let result = RunResult { schema_version: SCHEMA_VERSION, number, program, taken, without };
        fs::write(folder.join("result.json"), format!("{:#}\n", json!(result))).map_err(files)?;
        Ok(Some(result))
    }

    /// Copies the inputs of the program for a draw into an empty folder.
    pub(crate) fn copy_inputs(&self, draw: &Draw, empty: &Path) -> Result<(), StepError> {
        let number = draw.number;
        let files = |error| StepError::Files { number, error };
        let folder_of_records = self.study.records(number);
        let test = EXPERIMENTS
            .iter()
            .find(|(experiment, _)| *experiment == draw.test())
            .map_or("train", |found| found.1);
        fs::write(empty.join("rig.toml"), RigParameters::BASELINE_TOML).map_err(files)?;
        for (name, copy) in [("train", "train.csv"), (test, "test.csv")] {
            let record = folder_of_records.join(name).join("measurement.csv");
            check_blind(number, &record)?;
            fs::copy(record, empty.join(copy)).map_err(files)?;
        }
        Ok(())
    }

    /// Runs the program, and keeps in `folder` its standard error, its report and the experiment that it proposes.
    pub(crate) fn start(
        &self,
        number: usize,
        program: &Program,
        start: &ProgramInputs<'_>,
        folder: &Path,
    ) -> Result<Option<Execution>, StepError> {
        let files = |error| StepError::Files { number, error };
        let said = folder.join("stderr.txt");
        let taken = match program.run(start, File::create(&said).map_err(files)?, self.stop) {
            Ok(taken) => taken,
            Err(Interrupted) => return Ok(None),
        };
        let reported = fs::metadata(&said).map_err(files)?.len();
        if reported > LARGEST_STDERR {
            File::options()
                .write(true)
                .open(&said)
                .and_then(|file| file.set_len(LARGEST_STDERR))
                .map_err(files)?;
        }
        let out = start.folder.join("out");
        keep(&out, folder, "report.json", LARGEST_REPORT).map_err(files)?;
        let report = report::read(&folder.join("report.json"));
        if let Some(experiment) = report.as_ref().ok().and_then(Report::proposed) {
            keep(&out, folder, experiment, LARGEST_EXPERIMENT).map_err(files)?;
        }
        Ok(Some(taken))
    }
}

/// Refuses a record with more columns than a measurement, which could reveal what is hidden.
pub(crate) fn check_blind(number: usize, record: &Path) -> Result<(), StepError> {
    let blind = ReadOptions { unknown: UnlistedColumns::Refused, ..ReadOptions::default() };
    records::read(record, &blind).map(drop).map_err(|error| StepError::Record { number, error })
}

/// Copies a file of a program's folder. A missing or too large file is skipped, which the judge reports.
fn keep(out: &Path, folder: &Path, name: &str, largest: u64) -> io::Result<()> {
    let file = out.join(name);
    if fs::metadata(&file).is_ok_and(|file| file.is_file() && file.len() <= largest) {
        fs::copy(&file, folder.join(name))?;
    }
    Ok(())
}

pub(crate) fn check_program(
    path: &Path,
    recorded: &Identity,
    identity: &Identity,
    advice: &str,
) -> Result<(), FolderError> {
    if recorded == identity {
        return Ok(());
    }
    let what = format!("is of another program ({recorded:?}) than this one ({identity:?}): {advice}");
    Err(FolderError::content(path, what))
}

/// Makes the folder of a run atomically; `None` when interrupted.
pub(crate) fn whole_run<T>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<Option<T>, StepError>,
) -> Result<Option<T>, StepError> {
    let ran = make_whole(path, |folder| fill(folder).map_err(StepEnd::Error)?.ok_or(StepEnd::Interrupted));
    match ran {
        Ok(left) => Ok(Some(left)),
        Err(StepEnd::Interrupted) => Ok(None),
        Err(StepEnd::Error(error)) => Err(error),
    }
}

enum StepEnd {
    Interrupted,
    Error(StepError),
}

impl From<FolderError> for StepEnd {
    fn from(error: FolderError) -> Self {
        StepEnd::Error(error.into())
    }
}

pub(crate) fn read_result(path: &Path) -> Result<RunResult, FolderError> {
    read_versioned(path, "result", |result: &RunResult| result.schema_version)
}

#[cfg(test)]
mod tests;
