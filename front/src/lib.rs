//! The command `airbench`: commands that use several programs, and a way to each program.
//!
//! ```text
//!   airbench run, latency, find-effect ──► children: emulator, controller, bench, discrepancy, load generators …
//!   airbench can, close, test, bench … ──► executes the program, whose exit code is then its own
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`cli`] | the command line |
//! | `places` | where the programs and the rig's files are: installed, in a wheel, in a checkout |
//! | `children` | child processes, and signals, which are passed on |
//! | `private` | a folder for sockets |
//! | `run` | `airbench run` |
//! | `find_effect` | `airbench find-effect`; `find_effect::judge` compares with the sealed file |
//! | `latency` | `airbench latency`; `latency::slices` has the single measurements |
//! | `pair` | emulator and controller for one run, with their output in one file |
//! | `become_program` | the commands that are another program |
//!
//! It knows the programs by their command lines, files and exit codes alone; `figures` checks and sums up a run. Started as
//! `scripts/NAME`, as by the scripts of a checkout, it uses that name in its messages.

#![warn(missing_docs)] // an interface of other crates

mod become_program;
mod children;
pub mod cli;
mod find_effect;
mod latency;
mod pair;
mod places;
mod private;
mod run;

use clap::FromArgMatches;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use places::Places;
use protocol::exit::Exit;
use std::error::Error;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FrontError {
    /// Usage, bad input, or an output that cannot be written.
    #[error("{0}")]
    Input(String),
    /// A process that cannot be started.
    #[error("cannot start {program}: {reason}")]
    Start { program: String, reason: io::Error },
    /// A process that failed, or left too few files.
    #[error("{0}")]
    Process(String),
    /// A signal; every process has saved its files.
    #[error("interrupted")]
    Interrupted,
}

impl FrontError {
    fn input(file: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |reason| Self::Input(format!("cannot read {}: {reason}", file.display()))
    }

    fn output(file: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |reason| Self::Input(format!("cannot write {}: {reason}", file.display()))
    }

    fn exit(&self) -> Exit {
        match self {
            Self::Input(_) | Self::Start { .. } => Exit::BadInput,
            Self::Process(_) => Exit::BusFailed,
            Self::Interrupted => Exit::Interrupted,
        }
    }
}

/// Context of every command: places of files, and the name by which it was started.
pub(crate) struct Front {
    pub(crate) places: Places,
    /// `scripts/run` or `airbench run`.
    pub(crate) name: String,
    /// The whole command line as typed.
    pub(crate) typed: String,
}

impl Front {
    /// The file of an experiment: a path, or the name of a shipped one; `refusal` is of a name that is neither.
    pub(crate) fn experiment(
        &self,
        name: &Path,
        refusal: impl FnOnce(std::path::Display<'_>) -> String,
    ) -> Result<PathBuf, FrontError> {
        if name.is_file() {
            return Ok(name.into());
        }
        let mut file = name.as_os_str().to_owned();
        file.push(".toml");
        let list =
            if self.name.starts_with("scripts/") { "scripts/run --list" } else { "airbench run --list" };
        let shipped = Some(self.places.data("experiments")?.join(file)).filter(|file| file.is_file());
        shipped.ok_or_else(|| FrontError::Input(format!("{}; {list} names them", refusal(name.display()))))
    }

    /// The folder of a new run, named by the time of day and `what`; `runs/latest` is up to the caller.
    pub(crate) fn run_folder(&self, what: &str) -> Result<PathBuf, FrontError> {
        let failed = |reason| FrontError::Start { program: "date".into(), reason };
        let time = Command::new("date").arg("+%Y%m%d-%H%M%S").output().map_err(failed)?.stdout;
        Ok(self.places.runs().join(format!("{}-{what}", String::from_utf8_lossy(&time).trim_end())))
    }

    /// Creates the folder of a command's results, the requested or a new one; returns its absolute path without links. A folder
    /// with an earlier result of this kind, which begins with `first`, is refused.
    pub(crate) fn results(
        &self,
        asked: Option<&Path>,
        what: &str,
        (kind, first): (&str, &str),
    ) -> Result<PathBuf, FrontError> {
        let out = asked.map_or_else(|| self.run_folder(what), |out| Ok(out.into()))?;
        make_folder(&out)?;
        let out = out.canonicalize().map_err(FrontError::output(&out))?;
        if out.join(first).exists() {
            let out = out.display();
            let why = format!("{out} holds an earlier {kind}; choose another folder with --out");
            return Err(FrontError::Input(why));
        }
        Ok(out)
    }

    pub(crate) fn warn(&self, text: &str) {
        let _ = writeln!(io::stderr(), "{}: {text}", self.name);
    }
}

/// Prints a line; a closed pipe, as of `| head`, is no error.
pub(crate) fn say(line: &str) {
    let _ = writeln!(io::stdout(), "{line}");
}

pub(crate) fn last_lines(file: &Path, count: usize) -> String {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let lines: Vec<_> = text.lines().collect();
    lines[lines.len().saturating_sub(count)..].join("\n")
}

/// A file for both outputs of a process.
pub(crate) fn logs(opened: io::Result<File>, file: &Path) -> Result<(File, File), FrontError> {
    let both = opened.and_then(|out| Ok((out.try_clone()?, out)));
    both.map_err(FrontError::output(file))
}

/// Creates a folder of results if it is missing.
pub(crate) fn make_folder(out: &Path) -> Result<(), FrontError> {
    std::fs::create_dir_all(out).map_err(|reason| {
        let out = out.display();
        FrontError::Input(format!("cannot make the folder {out} ({reason}); choose another with --out"))
    })
}

/// Runs the command of the command line. `arguments` are those of the process, with its name first; returns the exit code of
/// the process.
pub fn main(mut arguments: Vec<OsString>) -> ExitCode {
    let called = arguments.first().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let word = arguments.get(1).map(|word| word.to_string_lossy().into_owned()).unwrap_or_default();
    let name = if called.starts_with("scripts/") { called } else { format!("airbench {word}") };
    let ended = Places::find().map_err(FrontError::Input).and_then(|places| {
        let rest = arguments.iter().skip(2).map(|word| word.to_string_lossy().into_owned());
        let typed = std::iter::once(name.clone()).chain(rest).collect::<Vec<_>>().join(" ");
        let front = Front { places, name: name.clone(), typed };
        match become_program::named(&word) {
            Some(program) => program.become_it(&front, arguments.split_off(2)),
            None => parse(&arguments, &name).map_or_else(Ok, |cli| dispatch(cli, &front)),
        }
    });
    ExitCode::from(ended.unwrap_or_else(|error| {
        if !matches!(error, FrontError::Interrupted) {
            let _ = writeln!(io::stderr(), "{name}: {error}");
        }
        error.exit() as u8
    }))
}

fn dispatch(cli: cli::Cli, front: &Front) -> Result<u8, FrontError> {
    match cli.command {
        cli::Command::Run(arguments) => run::run(&arguments, front),
        cli::Command::Latency(arguments) => latency::latency(&arguments, front),
        cli::Command::FindEffect(arguments) => find_effect::find_effect(&arguments, front),
        cli::Command::Test(arguments) => become_program::test(front, arguments.arguments),
        // Executed by name before the command line is parsed.
        _ => unreachable!("a command that is another program"),
    }
}

/// The parsed command line, or the exit code after help or a refusal. Help names the command as typed.
fn parse(arguments: &[OsString], name: &str) -> Result<cli::Cli, u8> {
    let mut command = cli::command();
    let typed =
        std::iter::once(OsStr::new("airbench")).chain(arguments.iter().skip(1).map(OsString::as_os_str));
    let parsed = command.try_get_matches_from_mut(typed).and_then(|found| cli::Cli::from_arg_matches(&found));
    parsed.map_err(|error| {
        let help = || match name.strip_prefix("scripts/") {
            Some(word) => error.to_string().replace(&format!("airbench {word}"), name),
            None => error.to_string(),
        };
        if !error.use_stderr() {
            say(help().trim_end());
            return Exit::Good as u8;
        }
        let message = match error.kind() {
            ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => help(),
            _ => refusal(&error, name, &command),
        };
        let _ = writeln!(io::stderr(), "{}", message.trim_end());
        Exit::BadInput as u8
    })
}

/// What is wrong with a command line, in one sentence.
fn refusal(error: &clap::Error, name: &str, command: &clap::Command) -> String {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.as_str(),
        _ => "",
    };
    // An option as typed, without the name of its value.
    let (argument, value) = (context(ContextKind::InvalidArg), context(ContextKind::InvalidValue));
    let option = argument.split(' ').next().unwrap_or_default();
    let reason = match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let known = command.get_subcommands().map(clap::Command::get_name);
            let known: Vec<_> = known.filter(|known| *known != "help").collect();
            let word = context(ContextKind::InvalidSubcommand);
            return format!("airbench: unknown command '{word}'; there are {}", known.join(", "));
        }
        ErrorKind::UnknownArgument => format!("unknown argument {argument}"),
        ErrorKind::InvalidValue if value.is_empty() => format!("{option} needs a value"),
        ErrorKind::InvalidValue => {
            let known = match error.get(ContextKind::ValidValue) {
                Some(ContextValue::Strings(known)) => known.as_slice(),
                _ => &[],
            };
            format!("{option} {value}: none of {}", known.join(", "))
        }
        ErrorKind::ValueValidation => {
            let reason = error.source().map(ToString::to_string).unwrap_or_default();
            format!("{option} {value}: {reason}")
        }
        _ => error.to_string().trim_start_matches("error: ").lines().next().unwrap_or_default().to_owned(),
    };
    format!("{name}: {reason}; see --help")
}
