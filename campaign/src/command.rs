//! A run by an external program: it reads a request as a line of JSON and prints its answer as one.
//!
//! ```text
//! stdin    {"run": 17, "draw": 2, "seed": 93, "values": {"hidden": "valve-offset", "noise": 0.5}, "again": false}
//! stdout   anything, and as the last line a JSON object; its keys that the campaign collects become columns
//! ```
//!
//! An exit code other than 0, a time-out and an invalid answer are results: `failed`, with the last line of the program. A crash
//! in one of ten thousand runs costs one run. Exit code 75 reports that nothing was tried, because of a full disk or another
//! cause outside the run: the start ends, and the run stays missing.
//!
//! Programs run in the folder of the campaign's file, so that relative paths do not depend on the folder of the start.

use crate::child::{ChildProcess, TimeLimit, WaitError};
use crate::factor::{Factor, Value};
use crate::outcome::{EndState, Outcome};
use crate::points::Point;
use serde_json::{Map, Value as Json, json};
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;

/// Least number of bytes kept from the end of a program's output.
const KEPT_OUTPUT_BYTES: usize = 1 << 20;
/// Most characters of a program's last line that a result keeps as the reason of a failure.
const MAX_REASON_CHARS: usize = 400;
/// Exit code by which a command reports that it could not try the run and that the run must stay missing: `EX_TEMPFAIL` of
/// sysexits.h.
pub const NOT_TRIED: i32 = 75;

/// How a program is started.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Invocation<'a> {
    /// The program and its arguments.
    pub(crate) command: &'a [String],
    /// The folder that it runs in.
    pub(crate) folder: &'a Path,
    /// Whether this is a repetition for inspection, so that the program must not answer from its cache.
    pub(crate) again: bool,
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum CommandError {
    /// The program cannot be started, or not be waited for.
    #[error(transparent)]
    System(#[from] io::Error),
    #[error("the command did not run (exit code {NOT_TRIED}): {0}; finished parts are kept")]
    NotTried(String),
}

/// Runs the program; `None` when the campaign was asked to stop.
pub(crate) fn run(
    Invocation { command, folder, again }: Invocation<'_>,
    factors: &[Factor],
    point: &Point,
    limit: TimeLimit<'_>,
) -> Result<Option<Outcome>, CommandError> {
    let mut process = ChildProcess::start(
        Command::new(&command[0])
            .args(&command[1..])
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    )?;
    let child = &mut process.child;
    if let Some(mut stdin) = child.stdin.take() {
        // Fails where the program does not read its input.
        let _ = writeln!(stdin, "{}", request(factors, point, again));
    }
    let (out, err) = (child.stdout.take().map(collect_output), child.stderr.take().map(collect_output));
    let status = match process.wait(limit) {
        Ok(status) => status,
        Err(WaitError::Stopped) => return Ok(None),
        Err(WaitError::System(error)) => return Err(error.into()),
        Err(cut @ WaitError::TooLong(_)) => return Ok(Some(Outcome::failed(format!("the program {cut}")))),
    };
    let output = |listener: Option<thread::JoinHandle<String>>| {
        listener.and_then(|listener| listener.join().ok()).unwrap_or_default()
    };
    let (out, err) = (output(out), output(err));
    if status.code() == Some(NOT_TRIED) {
        return Err(CommandError::NotTried(last_line(&err)));
    }
    if !status.success() {
        return Ok(Some(Outcome::failed(format!("{status}: {}", last_line(&err)))));
    }
    let line = out.trim_end().lines().next_back().unwrap_or_default();
    Ok(Some(match serde_json::from_str::<Map<String, Json>>(line) {
        Ok(answer) => outcome_of(&answer),
        Err(error) => Outcome::failed(format!("its answer is no JSON object ({error}): {}", last_line(&out))),
    }))
}

fn request(factors: &[Factor], point: &Point, again: bool) -> Json {
    let reported = |value: &Value| match value {
        Value::Number(number) => json!(number),
        Value::Text(text) => json!(text),
    };
    let values: Map<_, _> = factors
        .iter()
        .zip(&point.values)
        .map(|(factor, value)| (factor.name.clone(), reported(value)))
        .collect();
    json!({ "run": point.run, "draw": point.draw, "seed": point.seed, "values": values, "again": again })
}

fn outcome_of(answer: &Map<String, Json>) -> Outcome {
    let value = |value: &Json| match value {
        Json::Number(number) => number.as_f64().map(Value::Number),
        Json::String(text) => Some(Value::Text(text.clone())),
        Json::Bool(yes) => Some(Value::Number(f64::from(u8::from(*yes)))),
        Json::Null | Json::Array(_) | Json::Object(_) => None,
    };
    let figures = answer.iter().filter_map(|(name, reported)| Some((name.clone(), value(reported)?)));
    Outcome {
        ended: EndState::Done,
        because: String::new(),
        simulated_s: answer.get("simulated_s").and_then(Json::as_f64).unwrap_or(0.0),
        passed: answer.get("passed").and_then(Json::as_bool),
        figures: figures.collect(),
    }
}

/// The last line, at most [`MAX_REASON_CHARS`] of it.
fn last_line(text: &str) -> String {
    text.trim_end().lines().next_back().unwrap_or_default().chars().take(MAX_REASON_CHARS).collect()
}

/// Reads a pipe in a thread, so that the program never blocks on it, and returns the end of the output.
fn collect_output(mut pipe: impl Read + Send + 'static) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut output = Vec::new();
        let mut piece = [0; 1 << 16];
        // A read error ends the output.
        while let Ok(length @ 1..) = pipe.read(&mut piece) {
            output.extend_from_slice(&piece[..length]);
            if output.len() > 2 * KEPT_OUTPUT_BYTES {
                output.drain(..output.len() - KEPT_OUTPUT_BYTES);
            }
        }
        String::from_utf8_lossy(&output).into_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::factor::{Changes, Values};
    use std::sync::atomic::AtomicBool;

    fn ask(script: &str, longest_s: f64) -> Result<Option<Outcome>, CommandError> {
        let factor = Factor {
            name: "hidden".into(),
            changes: Changes::CommandValue,
            values: Values::List(vec![Value::Text("x".into())]),
        };
        let point = Point { run: 3, draw: 1, seed: 7, hidden_seed: 0, values: vec![Value::Text("x".into())] };
        let command: Vec<_> = ["sh", "-c", script].map(str::to_owned).into();
        let stop = AtomicBool::new(false);
        let invocation = Invocation { command: &command, folder: Path::new("/"), again: false };
        run(invocation, &[factor], &point, TimeLimit::of(longest_s, &stop))
    }

    fn answer(script: &str, longest_s: f64) -> Outcome {
        ask(script, longest_s).unwrap().unwrap()
    }

    #[test]
    fn the_program_is_given_its_run_and_its_last_line_counts() {
        let script = "read line; echo hello; echo \"{\\\"line\\\": \\\"$(echo $line | tr -d '\\\"')\\\", \\\"n\\\": 2}\"";
        let outcome = answer(script, 60.0);
        assert_eq!(outcome.ended, EndState::Done, "{outcome:?}");
        assert_eq!(outcome.figures["n"], Value::Number(2.0));
        let Value::Text(reported) = &outcome.figures["line"] else { panic!("a text") };
        assert_eq!(reported, "{again:false,draw:1,run:3,seed:7,values:{hidden:x}}");
    }

    #[test]
    fn it_runs_in_the_folder_that_it_is_given() {
        assert_eq!(answer("echo \"{\\\"n\\\": $(pwd | wc -c)}\"", 60.0).figures["n"], Value::Number(2.0));
    }

    #[test]
    fn what_was_not_tried_is_no_result() {
        let error = ask("echo the disk is full >&2; exit 75", 60.0).unwrap_err().to_string();
        assert!(error.contains("the disk is full"), "{error}");
    }

    #[test]
    fn a_program_that_takes_too_long_is_asked_to_end_with_all_that_it_started() {
        let folder = tempfile::tempdir().unwrap();
        let reported = folder.path().join("reported");
        let script = format!("trap 'echo asked >{}; exit' TERM; sleep 60 & wait", reported.display());
        assert_eq!(answer(&script, 0.3).ended, EndState::Failed);
        assert_eq!(std::fs::read_to_string(reported).unwrap(), "asked\n");
    }

    #[test]
    fn a_crash_a_hang_and_nonsense_are_results() {
        for (script, longest_s, words) in [
            ("echo first >&2; echo no luck >&2; exit 4", 60.0, "no luck"),
            ("sleep 60", 0.05, "longer than"),
            ("echo nonsense", 60.0, "no JSON object"),
            ("true", 60.0, "no JSON object"),
            ("kill -SEGV $$", 60.0, "signal"),
        ] {
            let outcome = answer(script, longest_s);
            assert_eq!(outcome.ended, EndState::Failed, "{script}");
            assert!(outcome.because.contains(words), "{script}: {}", outcome.because);
        }
    }

    #[test]
    fn a_program_that_says_much_does_not_wait_for_its_listener() {
        let outcome = answer("yes | head -c 5000000; echo; echo '{\"a\": 1}'", 60.0);
        assert_eq!(outcome.ended, EndState::Done, "{outcome:?}");
    }
}
