//! A soak test: emulator and controllers over hours, in segments, each accounted for to the last frame.
//!
//! ```text
//!   plan ──► segment: controllers, load, emulator ──► judge: account, gaps, memory, … ──► soak.json, JUnit, soak.hlog, soak.md
//!    ▲            watched once a second                                                        │ whole after each segment
//!    └────────────────────────── by the segment's number alone ────────────────────────────────┘
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`plan`] | the properties of each segment |
//! | [`segment`], [`processes`], [`procfs`] | one segment while it runs |
//! | [`segment_files`], [`frame_log`] | reading what it left |
//! | [`account`], [`memory`] | sent = received + lost, to the frame; whether memory is flat |
//! | [`judge`] | every check of a segment |
//! | [`model`], [`keeping`], [`merged`], [`junit`], [`verdict`] | results of all segments, and their files |
//! | [`rotate`] | removal of the large files of older segments |
//!
//! It uses emulator and controller as programs and reads their files.

mod account;
pub(crate) mod cli;
mod frame_log;
mod judge;
mod junit;
mod keeping;
mod memory;
mod merged;
pub(crate) mod model;
mod plan;
pub(crate) mod processes;
mod procfs;
mod rotate;
mod segment;
mod segment_files;
mod verdict;

use cli::{SoakArguments, YesNo};
use keeping::{SoakFolder, unix_s};
use model::{Segment, Settings};
use plan::Plan;
use protocol::bus::BusUrl;
use protocol::exit::Exit;
use realtime::Interrupt;
use runlog::conditions::Conditions;
use runlog::process::Process;
use runlog::run_folder::{CONDITIONS_JSON, FileError, SCHEMA_VERSION, write_json};
use segment::{Outcome, SegmentContext, SegmentEnd};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Name of the rig among the processes of a segment.
const EMULATOR: &str = Process::Emulator.name();
/// Time between two lines of progress, s.
const PROGRESS_S: f64 = 10.0;
/// Consecutive segments that end early, after which the soak gives up: the fault is permanent.
const GIVE_UP_AFTER: usize = 3;

/// Why a soak cannot go on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SoakError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot write {file}: {reason}; choose another folder with --out")]
    Output { file: PathBuf, reason: String },
    #[error("cannot start {program}: {reason}; build it, or say where it is with --bin-dir")]
    Program { program: PathBuf, reason: String },
    #[error("{0}: another soak is at work in this folder; choose another --out")]
    Busy(PathBuf),
    #[error(
        "{out} holds a soak with other settings: {differences}; choose another --out, or go on with --anyway"
    )]
    OtherSettings { out: PathBuf, differences: String },
    #[error("cannot watch for Ctrl-C: {0}")]
    Signals(io::Error),
}

impl SoakError {
    pub(crate) fn output(file: &Path, error: &io::Error) -> Self {
        Self::Output { file: file.into(), reason: error.to_string() }
    }
}

/// Runs the soak.
///
/// # Errors
/// [`SoakError`] when it cannot begin or its results cannot be written; the result is the exit code.
pub(crate) fn run(arguments: &SoakArguments) -> Result<Exit, SoakError> {
    let bin_dir = bin_dir(arguments)?;
    let (load, load_missing_because) = load(arguments);
    let planned_s = arguments.planned_s();
    let loss = (arguments.loss_segments == YesNo::Yes && matches!(arguments.bus, BusUrl::Unix { .. }))
        .then_some(arguments.loss);
    let settings = Settings {
        bus: arguments.bus.to_string(),
        experiments: arguments.experiments.clone(),
        segment_s: plan::segment_s(arguments.segment_seconds, planned_s),
        load: (arguments.load != "none").then(|| arguments.load.clone()),
        loss,
        emulator_options: arguments.emulator_options.clone(),
        controller_options: arguments.controller_options.clone(),
        rig: arguments.rig.display().to_string(),
        positions_judged: arguments.judge_positions == YesNo::Yes,
    };
    let mut keeping = SoakFolder::open(&arguments.out, settings, planned_s, arguments.anyway)?;
    keeping.soak.load_missing_because = load_missing_because;
    let soaking = SoakRun {
        plan: Plan { experiments: arguments.experiments.clone(), load: load.is_some(), loss },
        context: SegmentContext { arguments, bin_dir, load: load.unwrap_or_default() },
        interrupt: Interrupt::install().map_err(SoakError::Signals)?,
    };
    let (exit, because) = soaking.run(&mut keeping)?;
    keeping.soak.ended_because = Some(because.clone());
    keeping.write()?;
    eprintln!("soak: {because}");
    eprintln!("soak: {}", keeping.soak.verdict);
    eprintln!("soak: results in {}: soak.json, soak-junit.xml, soak.hlog, soak.md", arguments.out.display());
    Ok(exit)
}

/// Folder of the programs; checks that they and all files exist before the start.
fn bin_dir(arguments: &SoakArguments) -> Result<PathBuf, SoakError> {
    let experiment = |name: &String| arguments.experiment_folder.join(format!("{name}.toml"));
    for file in arguments.experiments.iter().map(experiment).chain([arguments.rig.clone()]) {
        std::fs::metadata(&file).map_err(|error| FileError::read(&file, error))?;
    }
    let beside_us = || std::env::current_exe().ok().and_then(|path| Some(path.parent()?.to_owned()));
    let bin_dir = arguments.bin_dir.clone().or_else(beside_us).unwrap_or_default();
    for program in ["emulator", "controller"] {
        let path = bin_dir.join(program);
        std::fs::metadata(&path)
            .map_err(|error| SoakError::Program { program: path.clone(), reason: error.to_string() })?;
    }
    Ok(bin_dir)
}

/// The load generator's command line with the program's path, or why it is missing although it was asked for.
fn load(arguments: &SoakArguments) -> (Option<Vec<String>>, Option<String>) {
    let mut words: Vec<_> = arguments.load.split_whitespace().map(str::to_owned).collect();
    let Some(program) = words.first().filter(|program| *program != "none") else { return (None, None) };
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let here = program.contains('/').then(|| PathBuf::from(program));
    let found = here.into_iter().chain(std::env::split_paths(&folders).map(|folder| folder.join(program)));
    match found.into_iter().find(|path| path.is_file()) {
        Some(path) => {
            words[0] = path.display().to_string();
            (Some(words), None)
        }
        None => {
            let why = format!("{program} is not installed; scripts/soak installs it, or say --load none");
            eprintln!("soak: warning: {why}");
            (None, Some(why))
        }
    }
}

struct SoakRun<'a> {
    plan: Plan,
    context: SegmentContext<'a>,
    interrupt: Interrupt,
}

impl SoakRun<'_> {
    /// Runs segments until the time is up; returns why it ended.
    fn run(&self, keeping: &mut SoakFolder) -> Result<(Exit, String), SoakError> {
        let mut early_in_a_row = 0;
        loop {
            if self.interrupt.came() {
                return Ok((
                    Exit::Interrupted,
                    "interrupted; everything is saved, the same command goes on".into(),
                ));
            }
            let left_s = keeping.soak.planned_s - keeping.soak.elapsed_s;
            let Some(rig_s) = plan::rig_s(keeping.soak.settings.segment_s, left_s) else {
                let exit = if keeping.soak.totals.failed > 0 { Exit::BoundBroken } else { Exit::Good };
                return Ok((exit, "the time asked for is up".into()));
            };
            let (end, codes) = self.segment(keeping, rig_s)?;
            match end {
                SegmentEnd::DiskFull(free_bytes) => {
                    let (free, out) = (free_bytes / 1_000_000, keeping.out.display());
                    let why = format!(
                        "the disk of {out} is nearly full, {free} MB are free: make room, or see --min-free-mb"
                    );
                    return Ok((Exit::BadInput, why));
                }
                SegmentEnd::ProgramFailure(_) => early_in_a_row += 1,
                SegmentEnd::TimeUp | SegmentEnd::Interrupted => early_in_a_row = 0,
            }
            if early_in_a_row >= GIVE_UP_AFTER {
                let why = format!(
                    "{GIVE_UP_AFTER} segments in a row ended before their time; see emulator.txt and controller.txt in them"
                );
                let refused = codes.contains(&Some(Exit::BadInput as i32));
                return Ok((if refused { Exit::BadInput } else { Exit::BusFailed }, why));
            }
        }
    }

    /// Runs, judges and records one segment; returns how it ended and the exit codes of its programs.
    fn segment(
        &self,
        keeping: &mut SoakFolder,
        rig_s: f64,
    ) -> Result<(SegmentEnd, Vec<Option<i32>>), SoakError> {
        let spec = self.plan.segment(keeping.next_number());
        let folder = keeping.out.join("segments").join(spec.folder());
        let (started_unix_s, began) = (unix_s(), Instant::now());
        let (planned_s, elapsed_s) = (keeping.soak.planned_s, keeping.soak.elapsed_s);
        let failed = keeping.soak.totals.failed;
        let mut reported_s = -PROGRESS_S;
        let mut progress = |at_s: f64| {
            if at_s - reported_s >= PROGRESS_S {
                reported_s = at_s;
                let left_min = (planned_s - elapsed_s - at_s).max(0.0) / 60.0;
                eprintln!(
                    "soak: segment {} ({}): {at_s:.0} of {rig_s:.0} s; {failed} failed so far; {left_min:.1} min left",
                    spec.folder(),
                    spec.description(),
                );
            }
        };
        let outcome = segment::run(&self.context, &spec, rig_s, &folder, &self.interrupt, &mut progress)?;
        let load = spec.load.then(|| self.context.load.join(" "));
        write_conditions(&folder, &spec, load.as_deref())?;
        let judged = judge::judge(&spec, &folder, &outcome, keeping.soak.settings.positions_judged);
        keeping.merged.add_segment(&folder).iter().for_each(|line| eprintln!("soak: warning: {line}"));
        if keeping.soak.machine.is_null() {
            keeping.soak.machine = judged.machine;
        }
        let file_bytes = procfs::folder_bytes(&folder);
        let segment = Segment {
            folder: spec.folder(),
            started_unix_s,
            length_s: began.elapsed().as_secs_f64(),
            rig_s,
            finished: true,
            ended: end_text(&outcome),
            load,
            checks: judged.checks,
            figures: judged.figures,
            account: judged.account.rows,
            memory: judged.memory,
            file_bytes,
            file_bytes_per_s: (file_bytes as f64 / rig_s) as u64,
            rotated: false,
            spec,
        };
        for check in segment.broken() {
            eprintln!("soak: segment {} failed: {}: {}", segment.folder, check.name, check.detail);
        }
        keeping.soak.segments.push(segment);
        let out = keeping.out.clone();
        let SoakArguments { keep, keep_failed, .. } = self.context.arguments;
        rotate::rotate(&out, &mut keeping.soak.segments, *keep, *keep_failed)
            .map_err(|error| SoakError::output(&out, &error))?;
        keeping.soak.elapsed_s += began.elapsed().as_secs_f64();
        keeping.write()?;
        Ok((outcome.end, outcome.exits.values().map(|(_, code, _)| *code).collect()))
    }
}

/// Writes the conditions that a latency report reads.
fn write_conditions(folder: &Path, spec: &plan::SegmentSpec, load: Option<&str>) -> Result<(), SoakError> {
    let path = folder.join(CONDITIONS_JSON);
    let conditions = Conditions {
        schema_version: SCHEMA_VERSION,
        load_generator: Some(load.unwrap_or("none").into()),
        group: Some(format!("{}, {}", spec.experiment, spec.description())),
        pair: Some(spec.number.into()),
        reference_missing_because: Some("a soak measures no reference".into()),
        ..Conditions::default()
    };
    write_json(&path, &conditions).map_err(|error| SoakError::output(&path, &error))
}

fn end_text(outcome: &Outcome) -> String {
    match &outcome.end {
        SegmentEnd::TimeUp => "its time was up".into(),
        SegmentEnd::Interrupted => "interrupted".into(),
        SegmentEnd::DiskFull(free_bytes) => {
            format!("the disk was nearly full: {} MB free", free_bytes / 1_000_000)
        }
        SegmentEnd::ProgramFailure(why) => why.clone(),
    }
}

#[cfg(test)]
mod tests {
    //! A segment that tests of the parts share.

    use super::account::Row;
    use super::memory::Memory;
    use super::merged::StoredDistribution;
    use super::model::{Check, CheckResult, Figures, Segment, Soak};

    #[test]
    fn no_key_of_a_soak_is_lost() {
        let mut segment = segment(1, &[("account", CheckResult::Passed)]);
        segment.account = vec![Row::default()];
        segment.memory = [("emulator".into(), Memory::default())].into();
        let distributions = [("emulator-wakeup".into(), StoredDistribution::default())].into();
        let soak = Soak { distributions, segments: vec![segment], ..Soak::default() };
        let file = serde_json::to_value(soak).unwrap();
        runlog::golden::check("soak.keys", &runlog::golden::keys(&file));
    }

    /// A finished segment of experiment `e` with these checks.
    pub(super) fn segment(number: u32, checks: &[(&str, CheckResult)]) -> Segment {
        let check = |(name, result): &(&str, CheckResult)| Check::new(name, *result, "because");
        let mut segment = Segment::cut_off(number, "e", &format!("{number:04}-e"));
        segment.finished = true;
        segment.checks = checks.iter().map(check).collect();
        segment.figures = Figures { cycles: Some(1000), ..Figures::default() };
        assert_eq!(segment.spec.number, number);
        segment
    }
}
