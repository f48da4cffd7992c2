//! `airbench-hil` as tests in Python use it: its own tests, and the suite of `docs/examples/pytest` on two workers.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;
use system_tests::foreign_python::{light_path, of, tools_path};
use system_tests::{Build, CompletedProcess, Program, Running, executable, firmware, turn, workspace};

/// pytest in the environment of `python/`, with the programs as they ship. Tests that need asammdf bring it back.
fn pytest() -> Command {
    let programs =
        [Program::Emulator, Program::Controller, Program::Bench, Program::Discrepancy, Program::Campaign];
    let [emulator, ..] = programs.map(|program| executable(program, Build::Shipped));
    let mut pytest = Command::new(of("hil"));
    // A line for each test: which one hangs is seen, and that none does.
    pytest.args(["-m", "pytest", "-v", "-p", "no:cacheprovider", "--color=no"]);
    pytest
        .env("AIRBENCH_BIN", emulator.parent().expect("a program lies in a folder"))
        .env("PATH", tools_path())
        .env("PYTHONPATH", light_path());
    pytest
}

fn on_two_workers() -> Command {
    let mut pytest = pytest();
    pytest.args(["-n", "2", "--dist", "loadgroup"]);
    pytest
}

/// The files of `python/tests/rig` that have a test of their own here; another one has all others.
const RIG: [&str; 4] = ["test_rig.py", "test_conditions.py", "test_guard.py", "test_types.py"];
const PLUGIN: [&str; 4] = ["test_pytest_plugin.py", "test_mutations.py", "test_ci.py", "test_foxglove.py"];

fn in_lockstep(files: &[&str], least: usize) {
    let mut tests = on_two_workers();
    tests.args(["-m", "not airbench_realtime"]).args(files.iter().map(|file| folder().join(file)));
    expect_all_passed(Running::start("pytest", &mut tests).wait(), least);
}

fn folder() -> PathBuf {
    workspace().join("python/tests/rig")
}

fn expect_all_passed(ended: CompletedProcess, least: usize) {
    // pytest reports on standard output.
    eprint!("{}", ended.stdout);
    let ended = ended.expect_code(0);
    let last = ended.stdout.lines().last().expect("pytest says how it ended");
    assert!(!["failed", "skipped", "xfailed", "error"].iter().any(|word| last.contains(word)), "{last}");
    let passed = last.split_whitespace().find_map(|word| word.parse::<usize>().ok());
    assert!(passed >= Some(least), "{last}");
}

#[test]
fn the_rig_for_python_does_what_it_says() {
    in_lockstep(&RIG, 57);
}

#[test]
fn the_plugin_for_pytest_its_mutants_and_its_bridge_do_what_they_say() {
    in_lockstep(&PLUGIN, 32);
}

#[test]
fn reports_campaigns_robot_and_the_wheel_for_python_do_what_they_say() {
    let mut tests = on_two_workers();
    tests.args(["-m", "not airbench_realtime"]).arg(folder());
    tests.args(
        [RIG, PLUGIN].concat().iter().map(|file| format!("--ignore={}", folder().join(file).display())),
    );
    expect_all_passed(Running::start("pytest", &mut tests).wait(), 35);
}

#[test]
fn the_rig_for_python_does_in_real_time_what_it_says() {
    // Who has the turn waits for nobody's tests in lockstep.
    let lock = tempfile::NamedTempFile::new().expect("a lock of its own");
    let _machine = turn::take();
    let mut tests = pytest();
    tests.args(["-m", "airbench_realtime"]).arg(folder()).env("AIRBENCH_PYTEST_LOCK", lock.path());
    expect_all_passed(Running::start("pytest", &mut tests).wait(), 7);
}

#[test]
fn the_example_suite_holds_our_controller_and_the_firmware_against_their_requirements() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    firmware::build(&folder.path().join("firmware"), &[]);
    let mut suite = on_two_workers();
    // Most of it is in lockstep: it takes its turn for each test in real time, not for the minutes of all.
    let plugins = workspace().join("tests/python");
    suite
        .args(["-p", "machine_turn"])
        .current_dir(workspace().join("docs/examples/pytest"))
        .env("PYTHONPATH", [light_path(), plugins.into_os_string()].join(OsStr::new(":")))
        .env("AIRBENCH_TURN_LOCK", turn::path())
        .env("AIRBENCH_PYTEST_LOCK", folder.path().join("pytest.lock"))
        .env("AIRBENCH_FIRMWARE", folder.path().join("firmware"));
    for (option, place) in [("runs", "runs"), ("traceability", "traceability")] {
        suite.arg(format!("--airbench-{option}={}", folder.path().join(place).display()));
    }
    expect_all_passed(Running::start("pytest", &mut suite).wait(), 40);
    let table = folder.path().join("traceability/requirements.md");
    let table = std::fs::read_to_string(table).expect("the table of requirements");
    let rows = table.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| requirement"));
    let open: Vec<_> = rows.filter(|row| !row.contains("| passed |")).collect();
    assert!(open.is_empty() && table.contains("28 requirements: 28 passed"), "{open:?}");
}
