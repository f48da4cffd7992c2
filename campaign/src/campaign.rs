//! A campaign ready to run: its file, the files that this names, its runs, and their partition into parts.

use crate::child::TimeLimit;
use crate::command::{self, CommandError, Invocation};
use crate::condition::{self, Condition, ConditionError};
use crate::factor::Value;
use crate::file::{self, CampaignFile, ExperimentKind, Kind, Pace, RESERVED};
use crate::inputs::{CampaignInputs, InputsError};
use crate::outcome::{EndState, Outcome};
use crate::parts::{Parts, default_runs_per_part, hash};
use crate::points::{Point, Points, TooManyRuns};
use crate::processes::{self, ProcessesError};
use crate::rehearsed;
use figures::top::POSITIONS;
use settings::SettingsError;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

#[derive(Debug)]
pub(crate) struct Campaign {
    pub file: CampaignFile,
    pub points: Points,
    /// Partition of the runs.
    pub parts: Parts,
    /// The files that it names; none for a command.
    inputs: Option<CampaignInputs>,
    programs: PathBuf,
}

/// Folders that a campaign looks files up in.
#[derive(Clone, Debug)]
pub(crate) struct InstallPaths {
    /// Folder with the shipped `experiments` and `programs`.
    pub shipped: PathBuf,
    /// Folder of `emulator` and `controller`.
    pub programs: PathBuf,
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum CampaignError {
    #[error(transparent)]
    File(#[from] SettingsError),
    #[error(transparent)]
    Inputs(#[from] InputsError),
    #[error("{0}: {1}")]
    TooManyRuns(String, TooManyRuns),
    #[error("{0}: {1}")]
    Condition(String, ConditionError),
    #[error("{0}: {1}")]
    Program(String, io::Error),
    #[error("{0}: run {1}: {2}")]
    Command(String, u64, CommandError),
    #[error(transparent)]
    Processes(ProcessesError),
}

impl Campaign {
    /// Reads a campaign's file and all files that it names, and checks the first and last values of its lists.
    pub(crate) fn read(path: &Path, install_paths: &InstallPaths) -> Result<Self, CampaignError> {
        let mut file = CampaignFile::read(path)?;
        let folder = file.folder()?;
        if let Kind::Command(words) = &mut file.kind {
            words[0] = program(&words[0], &folder)?;
        }
        let inputs = match &file.kind {
            Kind::Experiment(kind) => Some(CampaignInputs::read(&file, kind, &install_paths.shipped)?),
            Kind::Command(_) => None,
        };
        let name = || path.display().to_string();
        let points = Points::new(&file.factors, file.draws, file.seed)
            .map_err(|error| CampaignError::TooManyRuns(name(), error))?;
        let runs = points.runs();
        let parts = Parts {
            campaign: campaign_hash(&file, inputs.as_ref()),
            program: program_hash(&file, install_paths)?,
            columns: columns(&file),
            runs,
            runs_per_part: file.runs_per_part.unwrap_or_else(|| default_runs_per_part(runs)),
        };
        let campaign = Self { file, points, parts, inputs, programs: install_paths.programs.clone() };
        if campaign.inputs.is_some() {
            for run in [0, runs - 1] {
                campaign.condition(&campaign.points.point(run))?;
            }
        }
        Ok(campaign)
    }

    /// The experiment of its runs; none for a command.
    pub(crate) fn experiment(&self) -> Option<&ExperimentKind> {
        match &self.file.kind {
            Kind::Experiment(kind) => Some(kind),
            Kind::Command(_) => None,
        }
    }

    fn condition(&self, point: &Point) -> Result<Condition<'_>, CampaignError> {
        let inputs = self.inputs.as_ref().expect("only campaigns of experiments have conditions");
        condition::condition(inputs, &self.points, point).map_err(|error| self.refused(error))
    }

    fn refused(&self, error: ConditionError) -> CampaignError {
        CampaignError::Condition(self.file.path.display().to_string(), error)
    }

    /// Makes a run; `None` when `stop` was set.
    ///
    /// # Errors
    /// [`CampaignError`] where there is no result: values that the files reject, programs that cannot be started.
    pub(crate) fn run(&self, point: &Point, stop: &AtomicBool) -> Result<Option<Outcome>, CampaignError> {
        let limit = TimeLimit::of(file::LONGEST_WALL_S, stop);
        let kind = match &self.file.kind {
            Kind::Experiment(kind) => kind,
            Kind::Command(command) => return self.run_command(command, point, false, limit),
        };
        match kind.pace {
            Pace::Rehearsal => {
                let condition = self.condition(point)?;
                let inputs = self.inputs.as_ref().expect("an experiment has its files");
                let outcome = rehearsed::rehearse(&condition, inputs, point.run, kind.longest_s);
                outcome.map(Some).map_err(|error| self.refused(error))
            }
            Pace::Lockstep => match self.run_in_temporary_folder(point, limit)? {
                // A busy machine may miss the barrier's time-out; a second failure is the run's.
                Some(outcome) if outcome.ended == EndState::Failed => {
                    self.run_in_temporary_folder(point, limit)
                }
                outcome => Ok(outcome),
            },
        }
    }

    /// Repeats a run for inspection: an experiment as processes that leave their files in `folder`.
    pub(crate) fn repeat(
        &self,
        point: &Point,
        folder: &Path,
        limit: TimeLimit<'_>,
    ) -> Result<Option<Outcome>, CampaignError> {
        match &self.file.kind {
            Kind::Experiment(_) => self.run_in(point, folder, limit),
            Kind::Command(command) => self.run_command(command, point, true, limit),
        }
    }

    fn run_command(
        &self,
        command: &[String],
        point: &Point,
        again: bool,
        limit: TimeLimit<'_>,
    ) -> Result<Option<Outcome>, CampaignError> {
        let invocation = Invocation { command, folder: &self.file.folder()?, again };
        command::run(invocation, &self.points.factors, point, limit)
            .map_err(|error| CampaignError::Command(command[0].clone(), point.run, error))
    }

    fn run_in_temporary_folder(
        &self,
        point: &Point,
        limit: TimeLimit<'_>,
    ) -> Result<Option<Outcome>, CampaignError> {
        let folder = tempfile::Builder::new().prefix("airbench-run-").tempdir();
        let folder = folder.map_err(|error| CampaignError::Program("a folder for the run".into(), error))?;
        self.run_in(point, folder.path(), limit)
    }

    /// A run of an experiment as processes, which leave their files in `folder`; `None` when it was stopped.
    fn run_in(
        &self,
        point: &Point,
        folder: &Path,
        limit: TimeLimit<'_>,
    ) -> Result<Option<Outcome>, CampaignError> {
        let condition = self.condition(point)?;
        let inputs = self.inputs.as_ref().expect("only campaigns of experiments run in folders");
        let seconds = self.experiment().map_or(0.0, |kind| kind.longest_s);
        match processes::run(&condition, inputs, (point.run, seconds), &self.programs, folder, limit) {
            Ok(outcome) => Ok(Some(outcome)),
            Err(ProcessesError::Stopped) => Ok(None),
            Err(ProcessesError::Condition(error)) => Err(self.refused(error)),
            Err(error) => Err(CampaignError::Processes(error)),
        }
    }

    pub(crate) fn row(&self, point: &Point, outcome: &Outcome) -> String {
        let passed = outcome.passed.map_or("", |passed| if passed { "1" } else { "0" });
        let mut row = format!("{},{},{}", point.run, point.draw, point.seed);
        for value in &point.values {
            push_cell(&mut row, &value.to_string());
        }
        push_cell(&mut row, outcome.ended.name());
        push_cell(&mut row, &outcome.because);
        push_cell(&mut row, &outcome.simulated_s.to_string());
        push_cell(&mut row, passed);
        for name in collected(&self.file) {
            push_cell(&mut row, &outcome.figures.get(&name).map_or_else(String::new, Value::to_string));
        }
        row.push('\n');
        row
    }
}

/// Appends a CSV cell, quoted if necessary.
fn push_cell(row: &mut String, text: &str) {
    row.push(',');
    if text.contains([',', '"', '\n', '\r']) {
        // Lines of a part are lines of its file.
        let text = text.replace(['\n', '\r'], " ").replace('"', "\"\"");
        let _ = write!(row, "\"{text}\"");
    } else {
        row.push_str(text);
    }
}

fn collected(file: &CampaignFile) -> Vec<String> {
    if !file.figures.is_empty() {
        return file.figures.clone();
    }
    let definitions = figures::definitions().map(|definition| definition.name);
    POSITIONS.into_iter().chain(definitions).map(str::to_owned).collect()
}

fn columns(file: &CampaignFile) -> Vec<String> {
    let (before, after) = RESERVED.split_at(3);
    let factors = file.factors.iter().map(|factor| factor.name.clone());
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    owned(before).into_iter().chain(factors).chain(owned(after)).chain(collected(file)).collect()
}

/// A command's program: a path is relative to the campaign's file, a name is looked up in PATH.
fn program(word: &str, folder: &Path) -> Result<String, CampaignError> {
    if word.contains('/') {
        return Ok(folder.join(word).display().to_string());
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|folder| folder.join(word)).find(|path| path.is_file());
    let missing = || io::Error::new(io::ErrorKind::NotFound, "is in no folder of PATH");
    let found = found.ok_or_else(|| CampaignError::Program(word.to_owned(), missing()))?;
    Ok(found.display().to_string())
}

/// Hash of everything that determines the results, besides the programs.
fn campaign_hash(file: &CampaignFile, inputs: Option<&CampaignInputs>) -> String {
    let mut all = String::new();
    let mut add = |name: &str, hash: &str| {
        let _ = writeln!(all, "{name} {hash}");
    };
    add("campaign", &hash(file.text.as_bytes()));
    inputs.into_iter().flat_map(CampaignInputs::hashes).for_each(|(name, hash)| add(&name, &hash));
    hash(all.as_bytes())[..16].to_owned()
}

/// Hash of the executables: this program, and those that it starts.
fn program_hash(file: &CampaignFile, install_paths: &InstallPaths) -> Result<String, CampaignError> {
    let executable =
        std::env::current_exe().map_err(|error| CampaignError::Program("this program".into(), error))?;
    let mut programs = vec![executable];
    if let Kind::Experiment(ExperimentKind { pace: Pace::Lockstep, .. }) = &file.kind {
        programs.extend(["emulator", "controller"].map(|name| install_paths.programs.join(name)));
    }
    if let Kind::Command(words) = &file.kind {
        // Those of its words that name files: scripts and programs.
        let folder = file.folder()?;
        programs.extend(words.iter().map(|word| folder.join(word)).filter(|path| path.is_file()));
        for word in &file.programs {
            programs.push(program(word, &folder)?.into());
        }
    }
    let mut all = Sha256::new();
    for path in programs {
        let bytes = std::fs::read(&path)
            .map_err(|error| CampaignError::Program(path.display().to_string(), error))?;
        all.update(Sha256::digest(&bytes));
    }
    Ok(hash(&all.finalize())[..16].to_owned())
}
