//! Runs what is missing: makes a draw's records, lets the program loose on copies, keeps what it wrote.
//!
//! Several draws at once; each is done when its folder has its name, so a study may be killed at any instant and is started again
//! with the same command. A program that crashes, hangs or writes nonsense is a result. A disk that fills up is none: the
//! study stops before it, since a report that found no room would tell nothing about the program.

use crate::record_maker::{Experiment, Recipe};
use crate::study::SCHEMA_VERSION;
use crate::study::draws::{Draw, Kind};
use crate::study::folder::{FolderError, Study, make_whole, read};
use crate::study::leave_out;
use crate::study::program::{Identity, Interrupted, Program, Start, Taken};
use crate::study::report::{self, Report};
use discrepancy::records::{self, ReadError, ReadOptions, Unknown};
use plant::RigParameters;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Names of the folders of a draw's records.
pub const EXPERIMENTS: [(Experiment, &str); 3] = [
    (Experiment::Train, "train"),
    (Experiment::HeldOut(0), "held-out-0"),
    (Experiment::HeldOut(1), "held-out-1"),
];

/// Largest report that is kept.
const LARGEST_REPORT: u64 = 64 << 20;
/// Largest experiment that is kept.
const LARGEST_EXPERIMENT: u64 = 1 << 20;
/// Most that is kept of what a program says.
const MOST_SAID: u64 = 1 << 20;

/// Makes a record: measurement into the first folder, truth into the second; says why it cannot.
pub type Make<'a> = &'a (dyn Fn(&Recipe, &RigParameters, &Path, &Path) -> Result<(), String> + Sync);

/// Effects that a program has to do without on a draw.
pub type Without<'a> = &'a (dyn Fn(&Draw) -> Vec<String> + Sync);

/// Makes a record with the record maker.
///
/// # Errors
/// What it says.
pub fn make_record(
    recipe: &Recipe,
    rig: &RigParameters,
    measurement: &Path,
    truth: &Path,
) -> Result<(), String> {
    crate::record_maker::make(recipe, rig, measurement, truth).map_err(|error| error.to_string())
}

/// How a campaign runs.
pub struct Campaign<'a> {
    /// Study and folder.
    pub study: &'a Study,
    /// The program under study; without one, only records are made.
    pub program: Option<&'a Program>,
    /// What its results are called.
    pub label: &'a str,
    /// Makes records.
    pub make: Make<'a>,
    /// What is left out of the program's catalogue; then only draws of one effect are run.
    pub without: Option<Without<'a>>,
    /// Numbers of draws that are run again; nothing: all that are missing.
    pub only: &'a [usize],
    /// Draws that run at once.
    pub jobs: usize,
    /// Whether truth.csv is kept, 17 MB each.
    pub keep_truth: bool,
    /// Whether records are deleted once a program has seen them.
    pub drop_records: bool,
    /// Free space below which it stops, MiB.
    pub least_free_mib: u64,
    /// Set to stop.
    pub stop: &'a AtomicBool,
    /// Told a line for each draw.
    pub say: &'a (dyn Fn(&str) + Sync),
}

/// How a campaign ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CampaignEnd {
    /// All draws are done.
    Complete,
    /// It was told to stop; so many are missing.
    Stopped(usize),
}

/// Why a campaign cannot go on; what is done stays.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The study's own files.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file could not be copied or read.
    #[error("draw {number}: {error}")]
    Files {
        /// Which draw.
        number: usize,
        /// What the system says.
        error: io::Error,
    },
    /// A record could not be made.
    #[error("draw {number}: its record cannot be made: {reason}")]
    Make {
        /// Which draw.
        number: usize,
        /// What the maker says.
        reason: String,
    },
    /// A record is none, or holds what could tell what is hidden.
    #[error("draw {number}: {error}")]
    Record {
        /// Which draw.
        number: usize,
        /// What the reader says.
        error: ReadError,
    },
    /// The disk is nearly full.
    #[error(
        "{free_mib} MiB are left on the disk, {least_free_mib} are wanted: free some and start again, nothing is lost"
    )]
    Disk {
        /// What is left.
        free_mib: u64,
        /// What is wanted.
        least_free_mib: u64,
    },
}

/// What a run leaves as `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    /// Of [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Number of the draw.
    pub number: usize,
    /// Which program.
    pub program: Identity,
    /// How it ended, time, memory.
    pub taken: Taken,
    /// Effects that were left out of its catalogue; absent in a file when none was.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
}

impl Campaign<'_> {
    /// Runs all draws that are not done.
    ///
    /// # Errors
    /// [`CampaignError`] with the first draw that could not be run; those that ran at the same time are finished first. A draw
    /// whose record cannot be made is told in the end, after all others are done.
    pub fn run(&self) -> Result<CampaignEnd, CampaignError> {
        let wanted = |draw: &&Draw| {
            if self.only.is_empty() { !self.is_done(draw) } else { self.only.contains(&draw.number) }
        };
        let missing: Vec<&Draw> = self.draws().filter(wanted).collect();
        self.check_program()?;
        let all = self.draws().count();
        (self.say)(&format!("{} of {all} draws are to be done, {} at once", missing.len(), self.jobs));
        self.each(&missing, |draw| self.one(draw))
    }

    /// Does something with draws, several at once; `one` says what it did, or `None` when it was told to stop in its midst.
    ///
    /// # Errors
    /// As [`Campaign::run`].
    pub(crate) fn each(
        &self,
        missing: &[&Draw],
        one: impl Fn(&Draw) -> Result<Option<String>, CampaignError> + Sync,
    ) -> Result<CampaignEnd, CampaignError> {
        let began = Instant::now();
        let queue = Mutex::new(missing.iter());
        let finished = Mutex::new(0);
        let failed = Mutex::new(None);
        let unmade = Mutex::new(None);
        let worker = || {
            while !self.stop.load(Ordering::Relaxed) && failed.lock().expect("no holder panics").is_none() {
                let Some(draw) = queue.lock().expect("no holder panics").next() else { return };
                match one(draw) {
                    Err(error @ CampaignError::Make { .. }) => {
                        // Of this draw alone; the others need not wait for it.
                        (self.say)(&error.to_string());
                        unmade.lock().expect("no holder panics").get_or_insert(error);
                    }
                    Err(error) => *failed.lock().expect("no holder panics") = Some(error),
                    Ok(None) => {}
                    Ok(Some(told)) => {
                        let mut finished = finished.lock().expect("no holder panics");
                        *finished += 1;
                        let left = time_left(began.elapsed(), *finished, missing.len());
                        (self.say)(&format!(
                            "{finished}/{} draw {}: {told}; {left} left",
                            missing.len(),
                            draw.number
                        ));
                    }
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..self.jobs.max(1) {
                scope.spawn(worker);
            }
        });
        for error in [failed, unmade] {
            if let Some(error) = error.into_inner().expect("no holder panics") {
                return Err(error);
            }
        }
        match missing.len() - finished.into_inner().expect("no holder panics") {
            0 => Ok(CampaignEnd::Complete),
            left => Ok(CampaignEnd::Stopped(left)),
        }
    }

    /// The draws that this campaign is about.
    fn draws(&self) -> impl Iterator<Item = &Draw> {
        self.study.draws.iter().filter(|draw| self.without.is_none() || draw.kind == Kind::Single)
    }

    fn identity(&self, program: &Program) -> Identity {
        Identity { leave_out: self.without.is_some(), ..program.identity().clone() }
    }

    fn is_done(&self, draw: &Draw) -> bool {
        match self.program {
            Some(_) => self.study.run(self.label, draw.number).exists(),
            None => self.study.records(draw.number).exists(),
        }
    }

    /// Results of another program under the same label are never mixed with its own.
    fn check_program(&self) -> Result<(), CampaignError> {
        let Some(program) = self.program else { return Ok(()) };
        let identity = self.identity(program);
        // Of all kinds: a label may hold what another mode would not run.
        for draw in self.study.draws.iter().filter(|draw| self.is_done(draw)) {
            let path = self.study.run(self.label, draw.number).join("result.json");
            let result = read_result(&path)?;
            if result.program != identity {
                let what = format!(
                    "is of another program ({:?}) than this one ({identity:?}): give another --label",
                    result.program
                );
                return Err(FolderError::content(&path, what).into());
            }
        }
        Ok(())
    }

    /// One draw; `None` when the study was told to stop in its midst.
    fn one(&self, draw: &Draw) -> Result<Option<String>, CampaignError> {
        self.check_disk()?;
        let began = Instant::now();
        if !self.study.records(draw.number).exists() {
            self.make_records(draw)?;
        }
        let made_s = began.elapsed().as_secs_f64();
        let Some(program) = self.program else { return Ok(Some(format!("records {made_s:.1} s"))) };
        let number = draw.number;
        let ran = make_whole(&self.study.run(self.label, number), |folder| {
            self.let_loose(draw, program, folder)
                .map_err(CampaignEndOr::Error)?
                .ok_or(CampaignEndOr::Interrupted)
        });
        let taken = match ran {
            Ok(taken) => taken,
            Err(CampaignEndOr::Interrupted) => return Ok(None),
            Err(CampaignEndOr::Error(error)) => return Err(error),
        };
        if self.drop_records {
            fs::remove_dir_all(self.study.records(number))
                .map_err(|error| CampaignError::Files { number, error })?;
        }
        let Taken { ended, wall_s, memory_kib } = taken;
        Ok(Some(format!("records {made_s:.1} s, program {ended:?} {wall_s:.1} s {} MiB", memory_kib >> 10)))
    }

    pub(crate) fn check_disk(&self) -> Result<(), CampaignError> {
        // A system that does not tell is no reason to stop.
        let Ok(told) = rustix::fs::statvfs(&self.study.root) else { return Ok(()) };
        let free_mib = told.f_bavail.saturating_mul(told.f_frsize) >> 20;
        let least_free_mib = self.least_free_mib;
        if free_mib < least_free_mib { Err(CampaignError::Disk { free_mib, least_free_mib }) } else { Ok(()) }
    }

    /// The truth first: records without it would be of no use, the other way round they are made again.
    pub(crate) fn make_records(&self, draw: &Draw) -> Result<(), CampaignError> {
        let (number, rig) = (draw.number, RigParameters::baseline());
        make_whole(&self.study.records(number), |records| {
            make_whole(&self.study.truth(number), |truth| {
                for (experiment, name) in EXPERIMENTS {
                    let (record, truth) = (records.join(name), truth.join(name));
                    let folders = fs::create_dir_all(&record).and_then(|()| fs::create_dir_all(&truth));
                    folders.map_err(|error| CampaignError::Files { number, error })?;
                    (self.make)(&draw.recipe(experiment), &rig, &record, &truth)
                        .map_err(|reason| CampaignError::Make { number, reason })?;
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
    ) -> Result<Option<Taken>, CampaignError> {
        let number = draw.number;
        let files = |error| CampaignError::Files { number, error };
        let empty = tempfile::tempdir().map_err(files)?;
        self.lay_out(draw, empty.path())?;
        let without = self.without.map_or_else(Vec::new, |without| without(draw));
        let own = leave_out::arguments(&without);
        let start = Start { folder: empty.path(), train: &["train.csv"], own: &own };
        let Some(taken) = self.start(number, program, &start, folder)? else { return Ok(None) };
        let program = self.identity(program);
        let result = RunResult { schema_version: SCHEMA_VERSION, number, program, taken, without };
        fs::write(folder.join("result.json"), format!("{:#}\n", json!(result))).map_err(files)?;
        Ok(Some(taken))
    }

    /// Puts what a program may see of a draw into an empty folder.
    pub(crate) fn lay_out(&self, draw: &Draw, empty: &Path) -> Result<(), CampaignError> {
        let number = draw.number;
        let files = |error| CampaignError::Files { number, error };
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
    ) -> Result<Option<Taken>, CampaignError> {
        let files = |error| CampaignError::Files { number, error };
        let said = folder.join("stderr.txt");
        let taken = match program.run(start, File::create(&said).map_err(files)?, self.stop) {
            Ok(taken) => taken,
            Err(Interrupted) => return Ok(None),
        };
        let told = fs::metadata(&said).map_err(files)?.len();
        if told > MOST_SAID {
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
pub(crate) fn check_blind(number: usize, record: &Path) -> Result<(), CampaignError> {
    let blind = ReadOptions { unknown: Unknown::Refused, ..ReadOptions::default() };
    records::read(record, &blind).map(drop).map_err(|error| CampaignError::Record { number, error })
}

/// Copies a file of a program's folder. What cannot be copied was not written, or is no file: the judge says so.
fn keep(out: &Path, folder: &Path, name: &str, largest: u64) -> io::Result<()> {
    let file = out.join(name);
    if fs::metadata(&file).is_ok_and(|file| file.is_file() && file.len() <= largest) {
        fs::copy(&file, folder.join(name))?;
    }
    Ok(())
}

/// Why a run's folder is not finished.
pub(crate) enum CampaignEndOr {
    Interrupted,
    Error(CampaignError),
}

impl From<FolderError> for CampaignEndOr {
    fn from(error: FolderError) -> Self {
        CampaignEndOr::Error(error.into())
    }
}

/// The result of a run.
///
/// # Errors
/// [`FolderError`] when it is none of this version.
pub fn read_result(path: &Path) -> Result<RunResult, FolderError> {
    serde_json::from_str::<RunResult>(&read(path)?)
        .map_err(|error| error.to_string())
        .and_then(|result| {
            let good = result.schema_version == SCHEMA_VERSION;
            if good { Ok(result) } else { Err(format!("schema version {}", result.schema_version)) }
        })
        .map_err(|what| FolderError::content(path, format!("is no result of this version: {what}")))
}

/// Time left in words, as the draws so far took.
fn time_left(passed: Duration, finished: usize, all: usize) -> String {
    let left_s = passed.as_secs_f64() / finished as f64 * (all - finished) as f64;
    if left_s < 90.0 { format!("{left_s:.0} s") } else { format!("{:.0} min", left_s / 60.0) }
}

#[cfg(test)]
mod tests;
