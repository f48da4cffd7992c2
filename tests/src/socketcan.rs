//! Programs of SocketCAN: what they answer on vcan, recorded in `tests/expected/socketcan`, and `bench can` as a process.

use crate::binaries::{Program, workspace};
use crate::foreign_python::{light_path, python, tools_path};
use crate::process::Running;
use crate::scene::Scene;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex};
use tempfile::TempDir;

/// Folder of what was recorded on vcan.
pub fn expected() -> PathBuf {
    workspace().join("tests/expected/socketcan")
}

/// Lines of the recorded answers that differ, in their order, each with the answer here. These calls are native, so that nobody
/// looks at them before they succeed; each is reported on standard error. docs/socketcan-without-kernel.md has them too.
pub const DIFFERENCES: [(&str, &str); 3] = [
    ("write 8: -1 EINVAL", "write 8: 8"),
    ("write 9 bytes of data: -1 EINVAL", "write 9 bytes of data: 16"),
    ("write not bound: -1 ENXIO", "write not bound: 16"),
];

/// The same when the bus goes. A descriptor of a Unix socket has no error to give to who does not ask `bench can`.
pub const DIFFERENCES_WHEN_DOWN: [(&str, &str); 4] = [
    ("read of CAN_RAW: -1 ENETDOWN", "read of CAN_RAW: 0"),
    ("read of CAN_ISOTP: -1 ENETDOWN", "read of CAN_ISOTP: 0"),
    ("poll of CAN_RAW: ERR", "poll of CAN_RAW: IN"),
    ("write of CAN_RAW: -1 ENETDOWN", "write of CAN_RAW: 16"),
];

/// The recorded answers, but for the differences.
pub fn expected_answers() -> String {
    recorded_except("answers.txt", &DIFFERENCES)
}

/// A recorded output with lines that differ in the place of those on vcan.
pub fn recorded_except(file: &str, differences: &[(&str, &str)]) -> String {
    let recorded = fs::read_to_string(expected().join(file)).expect("a recorded output");
    let mut differences = differences.iter().peekable();
    let mut expected = String::new();
    for line in recorded.lines() {
        let different = differences.next_if(|(on_vcan, _)| *on_vcan == line);
        expected.push_str(different.map_or(line, |(_, here)| here));
        expected.push('\n');
    }
    assert_eq!(differences.next(), None, "no such answer was recorded");
    expected
}

pub fn sources() -> PathBuf {
    workspace().join("tests/c/socketcan")
}

/// Builds a program of `tests/c/socketcan` into `folder`, statically linked, and gives its path. The compiler is that of a C
/// library: `gcc`, or `musl-gcc`.
pub fn build(folder: &Path, program: &str, compiler: &str) -> PathBuf {
    let path = folder.join(program);
    let mut make = Command::new("make");
    make.arg("-C").arg(sources()).arg(format!("BUILD={}", folder.display())).arg(&path);
    make.arg(format!("CC={compiler}")).env("PATH", tools_path());
    let built = make.output().expect("make is installed");
    assert!(built.status.success(), "{program} does not build:\n{}", String::from_utf8_lossy(&built.stderr));
    path
}

/// The folder that `tests/c/socketcan/payload.sh` fills, for the guest of `scripts/vcan-vm` and for this machine; filled once.
pub fn payload() -> &'static Path {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let folder = workspace().join("target/socketcan-payload");
        let mut payload = Command::new(sources().join("payload.sh"));
        payload.arg(&folder).env("PYTHON", python()).env("PATH", tools_path());
        payload.env("PYTHONPATH", light_path());
        let made = payload.output().expect("bash is installed");
        assert!(made.status.success(), "the payload is not made:\n{}", String::from_utf8_lossy(&made.stderr));
        folder
    });
    &FOLDER
}

/// A program that several tests start, built once.
pub fn built(program: &'static str) -> PathBuf {
    static FOLDER: LazyLock<Mutex<TempDir>> =
        LazyLock::new(|| Mutex::new(tempfile::tempdir().expect("a temporary folder")));
    // One at a time. A build that failed left nothing that another could take for good.
    let folder = FOLDER.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    build(folder.path(), program, "gcc")
}

/// `bench can` on the bus of a scene, with options separated by spaces, and a command.
pub fn guest(scene: &Scene, options: &str, command: &[impl AsRef<OsStr>]) -> Command {
    let mut can = Program::Bench.command();
    can.env("PYTHONPATH", light_path());
    can.args(["can", "--bus", &scene.url()]).args(options.split_whitespace()).arg("--").args(command);
    can
}

/// Starts a command so, whose words may be paths and texts.
pub fn start(scene: &Scene, options: &str, command: &[&dyn AsRef<OsStr>]) -> Running {
    Running::start(&command[0].as_ref().display().to_string(), &mut guest(scene, options, command))
}

/// The same with a line of shell.
pub fn shell(scene: &Scene, options: &str, line: &str) -> Running {
    start(scene, options, &[&"sh", &"-c", &line])
}

/// The same with a program in Python.
pub fn start_python(scene: &Scene, options: &str, program: &str) -> Running {
    start(scene, options, &[&python(), &"-c", &program])
}

/// All files of a folder by name.
pub fn texts(folder: &Path) -> BTreeMap<String, String> {
    let files = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let text = |entry: fs::DirEntry| {
        let text = fs::read_to_string(entry.path()).expect("a text");
        (entry.file_name().to_string_lossy().into_owned(), text)
    };
    files.map(|entry| text(entry.expect("an entry"))).collect()
}

/// The first line in which two outputs differ, by its number, so that a failing test shows it and not all of both.
pub fn first_difference(one: &str, other: &str) -> Option<(usize, String, String)> {
    let (mut one, mut other) = (one.lines(), other.lines());
    (1..)
        .map(|number| (number, one.next(), other.next()))
        .take_while(|(_, one, other)| one.is_some() || other.is_some())
        .find_map(|(number, one, other)| {
            let text = |line: Option<&str>| line.unwrap_or("the end").to_owned();
            (one != other).then(|| (number, text(one), text(other)))
        })
}
