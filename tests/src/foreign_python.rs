//! Python packages that the product is held against, in scripts of `tests/python`.

use crate::binaries::workspace;
use crate::process::Running;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The python that has them: `AIRBENCH_PYTHON`, else that of `target/tools/venv`, which `scripts/test` makes.
pub fn python() -> PathBuf {
    let python = std::env::var_os("AIRBENCH_PYTHON")
        .map_or_else(|| workspace().join("target/tools/venv/bin/python"), PathBuf::from);
    assert!(python.exists(), "{} is missing: run scripts/test, which makes it", python.display());
    python
}

/// The python of another environment beside it, as `scripts/tools.sh` names it.
pub fn of(environment: &str) -> PathBuf {
    let python = python();
    let tools = python.ancestors().nth(3).expect("an environment lies in the folder of tools");
    let other = tools.join(environment).join("bin/python");
    assert!(other.exists(), "{} is missing: run scripts/test, which makes it", other.display());
    other
}

/// Runs a script of `tests/python` and gives what it printed.
pub fn run_script(name: &str, arguments: &[impl AsRef<OsStr>]) -> String {
    run(&python(), name, arguments)
}

/// The same with the packages of another environment.
pub fn run_script_of(environment: &str, name: &str, arguments: &[impl AsRef<OsStr>]) -> String {
    run(&of(environment), name, arguments)
}

fn run(python: &Path, name: &str, arguments: &[impl AsRef<OsStr>]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python").join(name);
    let mut command = Command::new(python);
    let path = if name == "read_mdf4.py" { workspace().join("python").into() } else { light_path() };
    command.env("PYTHONPATH", path).env("PATH", tools_path());
    Running::start(name, command.arg(script).args(arguments)).wait().expect_code(0).stdout
}

/// The search path of modules for whoever needs no asammdf: `airbench_hil`, and python-can without it (`python/tests/light`).
pub fn light_path() -> OsString {
    let python = workspace().join("python");
    [python.as_path(), &python.join("tests/light")].map(Path::as_os_str).join(OsStr::new(":"))
}

/// The search path of programs with what `scripts/test` unpacks first, for tests that are started without it.
pub fn tools_path() -> OsString {
    let mut path = workspace().join("target/tools/bin").into_os_string();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    path
}
