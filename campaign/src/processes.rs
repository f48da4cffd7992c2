//! A run as two processes in lockstep on a private embedded bus, with all the files of a run.
//!
//! It is slower than a rehearsal, and needed for faults and lost frames, which the emulator simulates.

use crate::child::{ChildProcess, TimeLimit, WaitError};
use crate::condition::{Condition, ConditionError};
use crate::edits;
use crate::factor::Value;
use crate::inputs::CampaignInputs;
use crate::outcome::{EndState, Outcome};
use axis_control::experiment::Experiment;
use figures::top::POSITIONS;
use figures::{SummaryError, join};
use protocol::exit::Exit;
use protocol::periods::CYCLE_S;
use runlog::run_folder::FileError;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[derive(Debug, thiserror::Error)]
pub(crate) enum ProcessesError {
    #[error("stopped")]
    Stopped,
    /// Values that a file's reader rejects.
    #[error(transparent)]
    Condition(#[from] ConditionError),
    #[error("run {run}: {what}: {error}")]
    System { run: u64, what: String, error: io::Error },
}

/// Makes a run by emulator and controller of the folder `programs`, of at most `seconds` of the rig's time, with its files in
/// `folder`.
///
/// # Errors
/// [`ProcessesError`]; a failure of emulator or controller is a result.
pub(crate) fn run(
    condition: &Condition<'_>,
    inputs: &CampaignInputs,
    (run, seconds): (u64, f64),
    programs: &Path,
    folder: &Path,
    limit: TimeLimit<'_>,
) -> Result<Outcome, ProcessesError> {
    let system = |what: &str| system(run, what);
    let files = Files::write(condition, inputs, run, folder)?;
    // In a temporary folder: the path of a socket is limited to 107 bytes.
    let private =
        tempfile::Builder::new().prefix("airbench-").tempdir().map_err(system("a folder for the bus"))?;
    let bus = format!("unix://{}/bus", private.path().display());
    let start = |name: &str, add: &dyn Fn(&mut Command)| {
        let mut command = Command::new(programs.join(name));
        command.args(["run", "--pace", "lockstep", "--bus", &bus, "--out"]).arg(folder);
        command.arg("--experiment").arg(&files.experiment);
        add(&mut command);
        let log = fs::File::create(folder.join(format!("{name}.txt"))).map_err(system(name))?;
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        ChildProcess::start(&mut command).map_err(system(name))
    };
    let mut emulator = start("emulator", &|command| {
        command.arg("--rig").arg(&files.rig);
        command.args(["--seed", &condition.seed.to_string(), "--seconds", &seconds.to_string()]);
        if let Some(faults) = &files.faults {
            command.arg("--faults").arg(faults);
        }
    })?;
    let mut controller = start("controller", &|command| {
        command.arg("--rig").arg(&files.nominal);
        for (name, path) in ["--drive-program", "--load-program"].into_iter().zip(&files.programs) {
            if let Some(path) = path {
                command.arg(name).arg(path);
            }
        }
        for set in &condition.set {
            command.args(["--set", set]);
        }
    })?;
    let mut codes = Vec::new();
    for (name, process) in [("emulator", &mut emulator), ("controller", &mut controller)] {
        match process.wait(limit) {
            Ok(status) => codes.push((name, status.code())),
            Err(WaitError::Stopped) => return Err(ProcessesError::Stopped),
            Err(WaitError::System(error)) => return Err(system(name)(error)),
            Err(cut @ WaitError::TooLong(_)) => return Ok(Outcome::failed(format!("{name}: {cut}"))),
        }
    }
    if let Some((name, _)) = codes.iter().find(|(_, code)| *code == Some(Exit::BadInput as i32)) {
        let message = last_line(&folder.join(format!("{name}.txt")));
        return Err(ConditionError { run, message }.into());
    }
    outcome(folder, &codes).map_err(|error| system("its folder")(io::Error::other(error)))
}

/// The outcome from the files of a run's folder and the exit codes.
fn outcome(folder: &Path, codes: &[(&str, Option<i32>)]) -> Result<Outcome, SummaryError> {
    let joined = match join::join(folder) {
        Ok(joined) => joined,
        Err(error @ SummaryError::File(FileError::Write(..))) => return Err(error),
        Err(error) => return Ok(Outcome::failed(error.to_string())),
    };
    let summary = &joined.summary;
    let of_table = summary.figures.iter().map(|(name, value)| (name.clone(), *value));
    let errors = [summary.position_error_dynamic_m, summary.position_error_static_m];
    let at_top =
        POSITIONS.into_iter().zip(errors).filter_map(|(name, error_m)| Some((name.to_owned(), error_m?)));
    let figures: BTreeMap<_, _> =
        at_top.chain(of_table).map(|(name, value)| (name, Value::Number(value))).collect();
    let controller = summary.by_controllers.as_ref().and_then(|all| all.controller.as_ref());
    let why = || controller.and_then(|controller| controller.ended_because.clone()).unwrap_or_default();
    let code = |name: &str| codes.iter().find(|(program, _)| *program == name).and_then(|(_, code)| *code);
    let (ended, because) = match (code("emulator"), code("controller")) {
        (Some(0), Some(0)) => (EndState::Done, String::new()),
        (Some(0), Some(3)) => (EndState::TimeOver, why()),
        (Some(0 | 1), Some(0 | 1)) => (EndState::Stopped, why()),
        (emulator, controller) => {
            let reported =
                |code: Option<i32>| code.map_or("a signal".to_owned(), |code| format!("code {code}"));
            let (emulator, controller) = (reported(emulator), reported(controller));
            (
                EndState::Failed,
                format!("the emulator ended with {emulator}, the controller with {controller}"),
            )
        }
    };
    let passed = (!summary.thresholds.is_empty()).then(|| joined.passed());
    let simulated_s = summary.cycles.unwrap_or(0) as f64 * CYCLE_S;
    Ok(Outcome { ended, because, simulated_s, passed, figures })
}

fn system(run: u64, what: &str) -> impl FnOnce(io::Error) -> ProcessesError + use<> {
    let what = what.to_owned();
    move |error| ProcessesError::System { run, what, error }
}

/// The files that both programs read.
struct Files {
    rig: PathBuf,
    nominal: PathBuf,
    experiment: PathBuf,
    faults: Option<PathBuf>,
    programs: [Option<PathBuf>; 2],
}

impl Files {
    fn write(
        condition: &Condition<'_>,
        inputs: &CampaignInputs,
        run: u64,
        folder: &Path,
    ) -> Result<Self, ProcessesError> {
        let put = |name: &str, text: &str| {
            let path = folder.join(name);
            fs::write(&path, text).map_err(system(run, &path.display().to_string()))?;
            Ok::<_, ProcessesError>(path)
        };
        let experiment = condition.experiment;
        let unchanged = condition.experiment_toml == experiment.text;
        let refused = |message: String| ConditionError { run, message };
        let stroke_m = condition.nominal.nominal.cylinder().stroke_m;
        let read = Experiment::from_toml(&condition.experiment_toml, &experiment.path, stroke_m)
            .map_err(|error| refused(error.to_string()))?;
        let program = |axis, section: Option<&axis_control::experiment::AxisExperiment>| {
            let source = condition.program(inputs, axis, &section?.program.written)?;
            Some(fs::canonicalize(&source.path).unwrap_or(source.path))
        };
        Ok(Self {
            rig: put("simulated-rig.toml", &condition.rig_toml)?,
            nominal: put("nominal-rig.toml", &condition.nominal.file.text)?,
            experiment: if unchanged {
                experiment.path.clone()
            } else {
                let moved = edits::moved(&condition.experiment_toml, &experiment.path);
                put("experiment.toml", &moved.map_err(|error| refused(error.to_string()))?)?
            },
            faults: match condition.faults_toml.as_str() {
                "" => None,
                text => Some(put("faults.toml", text)?),
            },
            programs: [
                program(plant::Axis::Drive, read.drive.as_ref()),
                program(plant::Axis::Load, read.load.as_ref()),
            ],
        })
    }
}

/// The last line of a program's output: why it refused its input.
fn last_line(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap_or_default();
    text.trim_end().lines().next_back().unwrap_or("a program refused its input").to_owned()
}
