//! Commands that are another program: `airbench` executes it in its place, so that signals and the exit code are those of the
//! program.

use crate::{Front, FrontError};
use std::ffi::{OsStr, OsString};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A command that is a program, with its first arguments.
pub(crate) struct Program {
    command: &'static str,
    program: &'static str,
    first: &'static [&'static str],
}

const PROGRAMS: [Program; 7] = [
    Program { command: "emulator", program: "emulator", first: &[] },
    Program { command: "controller", program: "controller", first: &[] },
    Program { command: "bench", program: "bench", first: &[] },
    Program { command: "discrepancy", program: "discrepancy", first: &[] },
    Program { command: "campaign", program: "campaign", first: &[] },
    Program { command: "can", program: "bench", first: &["can"] },
    Program { command: "close", program: "discrepancy", first: &["close"] },
];

pub(crate) fn named(command: &str) -> Option<&'static Program> {
    PROGRAMS.iter().find(|program| program.command == command)
}

impl Program {
    /// Executes the program in place of this one; returns only on failure.
    pub(crate) fn become_it(&self, front: &Front, arguments: Vec<OsString>) -> Result<u8, FrontError> {
        let mut command = Command::new(front.places.program(self.program)?);
        command.args(self.first);
        if self.command == "close" && !names_a_model(&arguments) {
            command.arg("--rig").arg(front.places.data("rig.toml")?);
        }
        Err(replaced_by(command.args(arguments)))
    }
}

/// Whether the command line names a rig file or a model file, or asks for help.
fn names_a_model(arguments: &[OsString]) -> bool {
    arguments.iter().map(|argument| argument.to_string_lossy()).any(|word| {
        let option = word.split('=').next().unwrap_or(&word);
        ["--rig", "--model", "--help", "-h"].contains(&option)
    })
}

fn replaced_by(command: &mut Command) -> FrontError {
    let program = command.get_program().display().to_string();
    FrontError::Start { program, reason: command.exec() }
}

/// `airbench test`: executes pytest, whose plugin starts the programs that this command finds.
pub(crate) fn test(front: &Front, arguments: Vec<OsString>) -> Result<u8, FrontError> {
    let emulator = front.places.program("emulator")?;
    let python = interpreter();
    let mut look = Command::new(&python);
    let look = look.args(["-c", "import airbench_hil.pytest_plugin"]).stdin(Stdio::null()).output();
    let look = look.map_err(|reason| FrontError::Start { program: python.display().to_string(), reason })?;
    if !look.status.success() {
        let output = String::from_utf8_lossy(&look.stderr);
        return Err(FrontError::Input(format!(
            "{} has no airbench_hil with pytest ({}): pip install both, the wheel of a release or \
             python/ of a checkout, and pytest, or name another interpreter with AIRBENCH_PYTHON",
            python.display(),
            output.lines().last().unwrap_or("it said nothing")
        )));
    }
    let mut command = Command::new(python);
    command.args(["-m", "pytest"]).args(arguments);
    command.env("AIRBENCH_BIN", emulator.parent().unwrap_or(Path::new("")));
    Err(replaced_by(&mut command))
}

/// The named interpreter, that of the virtual environment, or that of the system.
fn interpreter() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let of_environment = || set("VIRTUAL_ENV").map(|folder| PathBuf::from(folder).join("bin/python"));
    set("AIRBENCH_PYTHON")
        .map(PathBuf::from)
        .or_else(of_environment)
        .unwrap_or_else(|| OsStr::new("python3").into())
}

#[cfg(test)]
mod tests {
    use super::names_a_model;
    use std::ffi::OsString;

    #[test]
    fn close_gets_the_shipped_rig_only_where_no_model_is_named() {
        let is_named = |line: &str| names_a_model(&line.split(' ').map(OsString::from).collect::<Vec<_>>());
        for line in
            ["--rig r.toml", "--rig=r.toml", "--train a.csv --model m.toml", "--model=m.toml", "--help", "-h"]
        {
            assert!(is_named(line), "{line}");
        }
        for line in ["--train rig.csv", "--train a.csv --test model.csv", "--models m.toml"] {
            assert!(!is_named(line), "{line}");
        }
    }
}
