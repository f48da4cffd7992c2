//! One step with one draw, run by a campaign.
//!
//! ```text
//! stdin   {"run": 17, "draw": 17, …}; with "again": true a finished step is repeated
//! stdout  {"kind": "single", "hidden": "valve-offset", "called": "valve-offset", "right": true, …}
//! exit    0; 1 a record cannot be made; 75 nothing was tried, and the campaign ends; 130 interrupted
//! ```

use crate::cli::{Action, OneArguments};
use crate::{EXPECTED, INTERRUPTED, LIMITS, admit, committed, known_classes, read_if_there};
use campaign::command::NOT_TRIED;
use plant::RigParameters;
use record_maker::Recipe;
use serde_json::{Value, json};
use std::error::Error;
use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use study::classes::read_draw;
use study::draws::{Draw, Kind};
use study::folder::Study;
use study::leave_out::{Expectations, left_out};
use study::limits::Limits;
use study::program::Program;
use study::resolve::{self, ProposalState};
use study::score::{self, ScoreInputs};
use study::step::{Make, Step, StepError, make_record};
use study::twins::Twins;
use study::{answer, report};

/// Exit code when the record of a draw cannot be made: the run fails, and the campaign continues with the others.
const RECORD_FAILED: u8 = 1;

pub(crate) fn one(arguments: &OneArguments, stop: &AtomicBool) -> ExitCode {
    match run_step(arguments, stop) {
        Ok(Some(answer)) => match writeln!(io::stdout(), "{answer}") {
            Ok(()) => ExitCode::SUCCESS,
            // The reader of the answer is gone.
            Err(_) => ExitCode::from(INTERRUPTED),
        },
        Ok(None) => ExitCode::from(INTERRUPTED),
        Err(error) => {
            eprintln!("study: {error}");
            let unmade =
                error.downcast_ref().is_some_and(|step_error| matches!(step_error, StepError::Make { .. }));
            ExitCode::from(if unmade { RECORD_FAILED } else { NOT_TRIED as u8 })
        }
    }
}

/// Runs the step; `None` when interrupted.
fn run_step(arguments: &OneArguments, stop: &AtomicBool) -> Result<Option<Value>, Box<dyn Error>> {
    if arguments.action == Action::Twins {
        return twin(arguments, stop);
    }
    admit(arguments.plan.seed)?;
    let study = Study::begin(&arguments.out, &arguments.plan.plan())?;
    let (number, again) = arguments.draw.map_or_else(requested_draw, |draw| Ok((draw, true)))?;
    let draw = draw_of(&study, number)?;
    let classes = known_classes(std::slice::from_ref(draw))?;
    let mut step = step(arguments, &study, &make_record, (again, stop));
    if arguments.action == Action::Records {
        step.records(draw)?;
        return Ok(Some(json!({"kind": draw.kind})));
    }
    let program = program(arguments)?;
    if arguments.action == Action::Resolve {
        let found = resolve::run(&step, &program, draw)?;
        return Ok(found.map(|found| answer::of_proposal(&found, outcome(&step, draw, &found))));
    }
    if arguments.action == Action::LeaveOut {
        if draw.kind != Kind::Single {
            return Ok(Some(json!({"kind": draw.kind})));
        }
        let path = study.class(number);
        let computed = if path.exists() { Some(read_draw(&path, number)?) } else { None };
        step.without = Some(left_out(draw, classes.get(&number).or(computed.as_ref())));
    }
    if step.run(draw, &program)?.is_none() {
        return Ok(None);
    }
    let limits: Option<Limits> = read_if_there(&committed(LIMITS))?;
    let expectations: Option<Expectations> = read_if_there(&committed(EXPECTED))?;
    let known = ScoreInputs {
        limits: limits.as_ref(),
        classes: Some(&classes),
        expectations: expectations.as_ref(),
        partly: false,
    };
    Ok(Some(answer::of_case(&score::one(&study, draw, &arguments.label, known)?)))
}

/// Runs both steps of a twin: on its record, and on that of the experiment that the program proposes for it.
fn twin(arguments: &OneArguments, stop: &AtomicBool) -> Result<Option<Value>, Box<dyn Error>> {
    let twins = Twins::open(&arguments.out)?;
    admit(twins.seed)?;
    let study = twins.study(&arguments.out);
    let (number, again) = arguments.draw.map_or_else(requested_draw, |draw| Ok((draw, true)))?;
    let draw = draw_of(&study, number)?;
    let make = |recipe: &Recipe, rig: &RigParameters, measurement: &Path, truth: &Path| {
        twins.make(number, recipe, rig, [measurement, truth])
    };
    let step = step(arguments, &study, &make, (again, stop));
    let program = program(arguments)?;
    if step.run(draw, &program)?.is_none() {
        return Ok(None);
    }
    let found = resolve::run(&step, &program, draw)?;
    Ok(found.map(|found| answer::of_proposal(&found, outcome(&step, draw, &found))))
}

fn draw_of(study: &Study, number: usize) -> Result<&Draw, String> {
    study.draws.get(number).ok_or_else(|| {
        let all = study.draws.len();
        format!("draw {number}: this study has {all}, from 0; its campaign file needs draws = {all}")
    })
}

fn step<'a>(
    arguments: &'a OneArguments,
    study: &'a Study,
    make: Make<'a>,
    (again, stop): (bool, &'a AtomicBool),
) -> Step<'a> {
    Step {
        keep_truth: arguments.keep_truth,
        drop_records: arguments.drop_records,
        again,
        least_free_mib: arguments.least_free,
        ..Step::new(study, &arguments.label, make, stop)
    }
}

/// The draw that the campaign requests, and whether it is to be repeated.
fn requested_draw() -> Result<(usize, bool), Box<dyn Error>> {
    let mut line = String::new();
    io::stdin().lock().read_line(&mut line)?;
    let question: Value = serde_json::from_str(&line).map_err(|error| {
        format!("standard input: {error}; a campaign tells its run there, or give --draw")
    })?;
    let draw = question["draw"].as_u64().ok_or("standard input: no draw in it")?;
    Ok((usize::try_from(draw)?, question["again"] == true))
}

fn program(arguments: &OneArguments) -> Result<Program, Box<dyn Error>> {
    let name = arguments.program.as_ref().ok_or("--program is missing: the program that is judged")?;
    let limit = Duration::from_secs_f64(arguments.time_limit.max(0.001));
    let program = Program::new(&executable(name), arguments.arguments.clone(), limit);
    Ok(program.map_err(|error| format!("--program {}: {error}", name.display()))?)
}

/// Searches PATH for a plain name, as a shell does.
fn executable(name: &Path) -> PathBuf {
    let path = std::env::var_os("PATH").filter(|_| name.components().count() == 1).unwrap_or_default();
    let mut places = std::env::split_paths(&path).map(|folder| folder.join(name));
    places.find(|place| place.is_file()).unwrap_or_else(|| name.to_owned())
}

fn outcome(step: &Step<'_>, draw: &Draw, found: &ProposalState) -> Option<resolve::Outcome> {
    let ProposalState::Measured(resolution) = found else { return None };
    let folder = step.study.run(&resolve::label(step.label), draw.number);
    let report = report::read(&folder.join("report.json"));
    let judged = resolution.taken.map(|taken| resolve::judge(&draw.recipe.hidden[0], &taken, &report));
    Some(judged.unwrap_or(resolve::Outcome::Error))
}
