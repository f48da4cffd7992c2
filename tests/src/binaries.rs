//! Where the programs under test are: given by the environment, else built once as they ship.
//!
//! `AIRBENCH_BIN_DIR` names a folder that holds `emulator`, `controller`, `bench`, `discrepancy`, `campaign` and `airbench`, and
//! `counting-emulator` and `counting-controller` of `tests/counting/`; a script that has built them sets it. Without it cargo
//! builds the release profile, and says itself where the results are.

use crate::process::{CompletedProcess, Running};
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    Emulator,
    Controller,
    Bench,
    Discrepancy,
    Campaign,
    Airbench,
}

impl Program {
    pub fn name(self) -> &'static str {
        match self {
            Self::Emulator => "emulator",
            Self::Controller => "controller",
            Self::Bench => "bench",
            Self::Discrepancy => "discrepancy",
            Self::Campaign => "campaign",
            Self::Airbench => "airbench",
        }
    }

    pub fn command(self) -> Command {
        Command::new(executable(self, Build::Shipped))
    }

    pub fn start(self, arguments: &[&dyn AsRef<OsStr>]) -> Running {
        let name = format!("{} {}", self.name(), arguments[0].as_ref().display());
        Running::start(&name, self.command().args(arguments.iter().map(|argument| argument.as_ref())))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Build {
    Shipped,
    CountingAllocations,
}

/// Writes an executable file, and does so in another process. A descriptor that is open for writing here would be inherited by
/// what another test starts at that moment, and Linux executes no file that any process has open for writing (ETXTBSY).
pub fn install(contents: &[u8], path: &Path) {
    let mut install = Command::new("install");
    let mut install =
        install.args(["-m", "755", "/dev/stdin"]).arg(path).stdin(Stdio::piped()).spawn().expect("coreutils");
    let written = install.stdin.take().expect("stdin is piped").write_all(contents);
    let status = install.wait().expect("a child that can be waited for");
    assert!(
        written.is_ok() && status.success(),
        "{} cannot be written: {written:?}, {status}",
        path.display()
    );
}

/// The executable of `program` in `build`, which is made if nobody has.
pub fn executable(program: Program, build: Build) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder =
        FOLDER.get_or_init(|| std::env::var_os("AIRBENCH_BIN_DIR").map_or_else(self::build, PathBuf::from));
    let path = match build {
        Build::Shipped => folder.join(program.name()),
        Build::CountingAllocations => folder.join(format!("counting-{}", program.name())),
    };
    assert!(path.is_file(), "{} is no program; build it, or unset AIRBENCH_BIN_DIR", path.display());
    path
}

/// The folder of the shipped programs, as `AIRBENCH_BIN_DIR` gives it to a script.
pub fn shipped_programs() -> PathBuf {
    executable(Program::Bench, Build::Shipped).parent().expect("a program lies in a folder").to_owned()
}

/// The checkout that is tested.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the workspace").to_owned()
}

/// The shipped experiments: name and file, by name.
pub fn shipped_experiments() -> Vec<(String, PathBuf)> {
    let folder = workspace().join("controller/experiments");
    let entries = std::fs::read_dir(&folder).expect("the folder of experiments");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut named: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .map(|path| (path.file_stem().expect("a name").to_string_lossy().into_owned(), path))
        .collect();
    named.sort();
    assert!(named.iter().any(|(name, _)| name == "point-to-point"), "{named:?}");
    named
}

/// Runs one of `scripts` on the shipped build, for so long at most.
pub fn script(name: &str, arguments: &[&str], limit: Duration) -> CompletedProcess {
    let mut command = Command::new(workspace().join("scripts").join(name));
    command.args(arguments).env("AIRBENCH_BIN_DIR", shipped_programs());
    Running::start(&format!("scripts/{name}"), &mut command).wait_within(limit)
}

/// Builds the programs and asks cargo where it put them.
fn build() -> PathBuf {
    let mut cargo = Command::new(option_env!("CARGO").unwrap_or("cargo"));
    cargo.current_dir(workspace()).args(["build", "--release", "--message-format=json-render-diagnostics"]);
    // `plant-fmu` is what `bench export-fmu` packs.
    for package in
        ["emulator", "controller", "bench", "discrepancy", "campaign", "front", "counting", "plant-fmu"]
    {
        cargo.args(["--package", package]);
    }
    let built = cargo.stderr(Stdio::inherit()).output().expect("cargo starts");
    assert!(built.status.success(), "the programs do not build: {}", built.status);
    let messages = String::from_utf8_lossy(&built.stdout);
    let executable = messages.lines().find_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        message["executable"].as_str().map(PathBuf::from)
    });
    executable
        .expect("cargo names an executable")
        .parent()
        .expect("an executable lies in a folder")
        .to_owned()
}
