//! One draw: its records made, the program let loose on copies of them, what it wrote kept.
//!
//! A draw is done when its folder has its name, so that a step may be killed at any instant and is taken again. Which draws are
//! taken, by whom and how many at once is the affair of a campaign (`campaign/docs/campaigns.md`), whose command is
//! `study one`. A program that crashes, hangs or writes nonsense is a result. A disk that fills up is none: the step is not taken
//! then, since a report that found no room would tell nothing about the program.

use crate::SCHEMA_VERSION;
use crate::draws::Draw;
use crate::folder::{FolderError, Study, make_whole, read_left};
use crate::leave_out;
use crate::program::{Identity, Interrupted, Program, Start, Taken};
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

/// Names of the folders of a draw's records.
pub const EXPERIMENTS: [(Experiment, &str); 3] = [
    (Experiment::Train, "train"),
    (Experiment::HeldOut(0), "held-out-0"),
    (Experiment::HeldOut(1), "held-out-1"),
];

const LARGEST_REPORT: u64 = 64 << 20;
const LARGEST_EXPERIMENT: u64 = 1 << 20;
/// Most that is kept of what a program says.
const MOST_SAID: u64 = 1 << 20;

/// Makes a record: measurement into the first folder, truth into the second; says why it cannot.
pub type Make<'a> = &'a (dyn Fn(&Recipe, &RigParameters, &Path, &Path) -> Result<(), String> + Sync);

pub fn make_record(
    recipe: &Recipe,
    rig: &RigParameters,
    measurement: &Path,
    truth: &Path,
) -> Result<(), String> {
    record_maker::make(recipe, rig, measurement, truth).map_err(|error| error.to_string())
}

pub struct Step<'a> {
    pub study: &'a Study,
    pub label: &'a str,
    pub make: Make<'a>,
    /// Effects that are left out of the program's catalogue.
    pub without: Option<Vec<String>>,
    /// Whether truth.csv is kept, 17 MB each.
    pub keep_truth: bool,
    /// Whether records are deleted once a program has seen them.
    pub drop_records: bool,
    /// Whether what is done is done again.
    pub again: bool,
    /// Free space below which nothing is begun, MiB.
    pub least_free_mib: u64,
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

/// What a run leaves as `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    pub schema_version: u32,
    pub number: usize,
    pub program: Identity,
    pub taken: Taken,
    /// Effects that were left out of its catalogue; absent in a file when none was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
}

impl Step<'_> {
    /// Makes the records of a draw, unless they are there.
    pub fn records(&self, draw: &Draw) -> Result<(), StepError> {
        if self.study.records(draw.number).exists() {
            return Ok(());
        }
        self.check_disk()?;
        self.make_records(draw)
    }

    /// Lets the program loose on a draw, unless it was; `None` when it was asked to stop in its midst.
    ///
    /// # Errors
    /// [`StepError`] for what is no result of the program's.
    pub fn run(&self, draw: &Draw, program: &Program) -> Result<Option<RunResult>, StepError> {
        let number = draw.number;
        let path = self.study.run(self.label, number);
        if path.exists() && !self.again {
            return self.done(&path.join("result.json"), program).map(Some);
        }
        self.check_disk()?;
        self.records(draw)?;
        let result = whole_run(&path, |folder| self.let_loose(draw, program, folder))?;
        if self.drop_records && result.is_some() {
            fs::remove_dir_all(self.study.records(number))
                .map_err(|error| StepError::Files { number, error })?;
        }
        Ok(result)
    }

    fn identity(&self, program: &Program) -> Identity {
        Identity { leave_out: self.without.is_some(), ..program.identity().clone() }
    }

    /// Results of another program under the same label are never mixed with its own.
    fn done(&self, path: &Path, program: &Program) -> Result<RunResult, StepError> {
        let result = read_result(path)?;
        check_program(path, &result.program, &self.identity(program), "give another --label")?;
        Ok(result)
    }

    pub(crate) fn check_disk(&self) -> Result<(), StepError> {
        // A system that does not tell is no reason to stop.
        let Ok(reported) = rustix::fs::statvfs(&self.study.root) else { return Ok(()) };
        let free_mib = reported.f_bavail.saturating_mul(reported.f_frsize) >> 20;
        let least_free_mib = self.least_free_mib;
        if free_mib < least_free_mib { Err(StepError::Disk { free_mib, least_free_mib }) } else { Ok(()) }
    }

    /// The truth first: records without it would be of no use, the other way round they are made again.
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
                        // It follows from the recipe.
                        let _ = fs::remove_file(truth.join("truth.csv"));
                    }
                }
                Ok(())
            })
        })
    }

    fn let_loose(
        &self,
        draw: &Draw,
        program: &Program,
        folder: &Path,
    ) -> Result<Option<RunResult>, StepError> {
        let number = draw.number;
        let files = |error| StepError::Files { number, error };
        let empty = tempfile::tempdir().map_err(files)?;
        self.lay_out(draw, empty.path())?;
        let without = self.without.clone().unwrap_or_default();
        let own = leave_out::arguments(&without);
        let start = Start { folder: empty.path(), train: &["train.csv"], own: &own };
        let Some(taken) = self.start(number, program, &start, folder)? else { return Ok(None) };
        let program = self.identity(program);
        let result = RunResult { schema_version: SCHEMA_VERSION, number, program, taken, without };
        fs::write(folder.join("result.json"), format!("{:#}\n", json!(result))).map_err(files)?;
        Ok(Some(result))
    }

    /// Puts what a program may see of a draw into an empty folder.
    pub(crate) fn lay_out(&self, draw: &Draw, empty: &Path) -> Result<(), StepError> {
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

    /// Starts the program, and keeps in `folder` what it says, its report and the experiment that this proposes.
    pub(crate) fn start(
        &self,
        number: usize,
        program: &Program,
        start: &Start<'_>,
        folder: &Path,
    ) -> Result<Option<Taken>, StepError> {
        let files = |error| StepError::Files { number, error };
        let said = folder.join("stderr.txt");
        let taken = match program.run(start, File::create(&said).map_err(files)?, self.stop) {
            Ok(taken) => taken,
            Err(Interrupted) => return Ok(None),
        };
        let reported = fs::metadata(&said).map_err(files)?.len();
        if reported > MOST_SAID {
            File::options()
                .write(true)
                .open(&said)
                .and_then(|file| file.set_len(MOST_SAID))
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

/// A record that holds more than a measurement could tell what is hidden.
pub(crate) fn check_blind(number: usize, record: &Path) -> Result<(), StepError> {
    let blind = ReadOptions { unknown: UnlistedColumns::Refused, ..ReadOptions::default() };
    records::read(record, &blind).map(drop).map_err(|error| StepError::Record { number, error })
}

/// Copies a file of a program's folder. What cannot be copied was not written, or is no file: the judge says so.
fn keep(out: &Path, folder: &Path, name: &str, largest: u64) -> io::Result<()> {
    let file = out.join(name);
    if fs::metadata(&file).is_ok_and(|file| file.is_file() && file.len() <= largest) {
        fs::copy(&file, folder.join(name))?;
    }
    Ok(())
}

pub(crate) fn check_program(
    path: &Path,
    own: &Identity,
    identity: &Identity,
    advice: &str,
) -> Result<(), FolderError> {
    if own == identity {
        return Ok(());
    }
    let what = format!("is of another program ({own:?}) than this one ({identity:?}): {advice}");
    Err(FolderError::content(path, what))
}

/// Makes the folder of a run, whole or absent; `None` when the study was asked to stop in its midst.
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

/// The result of a run.
///
/// # Errors
/// [`FolderError`] when it is none of this version.
pub fn read_result(path: &Path) -> Result<RunResult, FolderError> {
    read_left(path, "result", |result: &RunResult| result.schema_version)
}

#[cfg(test)]
mod tests;
