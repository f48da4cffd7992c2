//! `airbench`, the one command: as it is installed, with its programs and files below a prefix and no checkout around it.

use rustix::fs::OFlags;
use rustix::process::Signal;
use std::fs::{self, File};
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::foreign_python::{of, tools_path};
use system_tests::process_table::with_command_line;
use system_tests::{
    Build, CompletedProcess, Program, Running, executable, install, turn, wait_until, workspace,
};

/// PREFIX/bin/airbench, PREFIX/lib/airbench with the programs, PREFIX/share/airbench with the files, and a working directory.
struct Prefix(tempfile::TempDir);

impl Prefix {
    fn made() -> Self {
        let prefix = Self(tempfile::tempdir().expect("a folder"));
        for folder in ["bin", "lib/airbench", "share/airbench", "work"] {
            fs::create_dir_all(prefix.path(folder)).expect("a folder of our own");
        }
        let airbench = executable(Program::Airbench, Build::Shipped);
        // A link would lead back into the checkout.
        install(&fs::read(airbench).expect("our own program"), &prefix.path("bin/airbench"));
        let programs =
            [Program::Emulator, Program::Controller, Program::Bench, Program::Discrepancy, Program::Campaign];
        for program in programs {
            let path = executable(program, Build::Shipped);
            symlink(path, prefix.path("lib/airbench").join(program.name())).expect("a link");
        }
        let files = ["plant/rig.toml", "protocol/rig.dbc", "controller/experiments", "controller/programs"];
        for file in files.map(|file| workspace().join(file)) {
            let name = file.file_name().expect("a name");
            symlink(&file, prefix.path("share/airbench").join(name)).expect("a link");
        }
        prefix
    }

    fn path(&self, below: &str) -> PathBuf {
        self.0.path().join(below)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(self.path("bin/airbench"));
        command.args(arguments).current_dir(self.path("work"));
        for variable in ["AIRBENCH_BIN", "AIRBENCH_BIN_DIR", "AIRBENCH_SHARE", "VIRTUAL_ENV"] {
            command.env_remove(variable);
        }
        command
    }

    fn run(&self, arguments: &[&str]) -> CompletedProcess {
        Running::start("airbench", &mut self.command(arguments)).wait()
    }
}

#[test]
fn an_unknown_command_is_answered_with_the_commands_that_there_are() {
    let prefix = Prefix::made();
    let known =
        "run, latency, find-effect, close, can, test, emulator, controller, bench, discrepancy, campaign";
    prefix.run(&["fly"]).expect_code(2).expect_stderr(&["unknown command 'fly'", known]);
    prefix.run(&[]).expect_code(2).expect_stderr(&["Usage: airbench <COMMAND>", "discrepancy"]);
    prefix
        .run(&["run", "--help"])
        .expect_code(0)
        .expect_stdout(&["Usage: airbench run [OPTIONS]", "--lockstep"]);
}

#[test]
fn find_effect_hides_at_most_as_many_effects_as_the_catalogue_has() {
    let all = plant::effects::SHEETS.len();
    let one_more = (all + 1).to_string();
    let refused =
        Prefix::made().run(&["find-effect", "--held-out", "identification", "--effects", &one_more]);
    refused.expect_code(2).expect_stderr(&[&format!("allowed are 0 to {all} here")]);
}

#[test]
fn a_program_or_file_that_is_missing_is_named_with_every_path_looked_at() {
    let prefix = Prefix::made();
    fs::remove_file(prefix.path("lib/airbench/bench")).expect("a link of our own");
    let paths = ["bin/bench", "lib/airbench/bench"].map(|path| prefix.path(path).display().to_string());
    for arguments in
        [&["bench", "figures"][..], &["can", "--", "true"], &["run", "--watch"], &["run", "--gateway"]]
    {
        let ended = prefix.run(arguments).expect_code(2);
        ended.expect_stderr(&["the program 'bench' is not there", &paths[0], &paths[1], "AIRBENCH_BIN=DIR"]);
    }
    // A run without page and gateway needs no bench.
    let _ = prefix.run(&["run", "--lockstep"]).expect_code(0);
    fs::remove_file(prefix.path("share/airbench/rig.toml")).expect("a link of our own");
    let path = prefix.path("share/airbench/rig.toml").display().to_string();
    let _ = prefix
        .run(&["close", "--train", "a.csv"])
        .expect_code(2)
        .expect_stderr(&[&path, "AIRBENCH_SHARE=DIR"]);
}

#[test]
fn a_command_that_is_a_program_has_its_words_and_its_exit_codes() {
    let prefix = Prefix::made();
    let faults = Program::Emulator.start(&[&"faults"]).wait().expect_code(0);
    assert_eq!(prefix.run(&["emulator", "faults"]).expect_code(0).stdout, faults.stdout);
    let refused = Program::Bench.start(&[&"summary", &"/nowhere"]).wait().expect_code(2);
    assert_eq!(prefix.run(&["bench", "summary", "/nowhere"]).expect_code(2).stderr, refused.stderr);
    prefix.run(&["can", "--pair", "--", "sh", "-c", "exit 7"]).expect_code(7);
    prefix.run(&["close", "--help"]).expect_code(0).expect_stdout(&["Usage: discrepancy close"]);
    // The shipped rig file is read before the record.
    prefix
        .run(&["close", "--train", "/nowhere.csv"])
        .expect_code(2)
        .expect_stderr(&["cannot read /nowhere.csv"]);
}

#[test]
fn an_installed_run_needs_its_prefix_alone_and_leaves_its_folder_where_it_was_started() {
    let prefix = Prefix::made();
    prefix.run(&["run", "--lockstep"]).expect_code(0).expect_stdout(&[
        "running point-to-point on unix://",
        "passed                                        yes",
    ]);
    assert!(prefix.path("work/runs/latest/measurement.csv").is_file());
    prefix.run(&["run", "--list"]).expect_code(0).expect_stdout(&["\nload-step "]);
    prefix.run(&["run", "loadstep"]).expect_code(2).expect_stderr(&["airbench run --list names them"]);
    let typo = prefix.path("typo.toml");
    fs::write(&typo, "[passed]\nposition_eror_m = 1\n").expect("a folder of our own");
    let refused = prefix.run(&["run", "--lockstep", &typo.to_string_lossy()]).expect_code(2);
    refused.expect_stderr(&["airbench run: [passed] position_eror_m = 1: no such figure"]);
}

/// With shell scripts in place of both programs; that of the emulator begins with the folder of the run in `$2`.
fn in_place_of_both(emulator: &str, controller: &str) -> Prefix {
    let prefix = Prefix::made();
    let emulator = format!("while [ \"$1\" != --out ]; do shift; done\n{emulator}");
    for (name, script) in [("emulator", emulator.as_str()), ("controller", controller)] {
        let path = prefix.path("lib/airbench").join(name);
        fs::remove_file(&path).expect("a link of our own");
        install(format!("#!/bin/sh\n{script}\n").as_bytes(), &path);
    }
    prefix
}

#[test]
fn a_failed_run_that_cannot_be_summed_up_keeps_its_exit_code() {
    let prefix = in_place_of_both("echo '{' >\"$2/summary.json\"\nexit 3", "exec sleep 60");
    prefix.run(&["run", "--lockstep"]).expect_code(3).expect_stderr(&["airbench run: ", "summary.json"]);
}

#[test]
fn ctrl_c_ends_a_summary_that_takes_long() {
    let prefix = in_place_of_both("echo '{}' >\"$2/summary.json\"\nmkfifo \"$2/run.json\"", "exit 0");
    let run = Running::start("airbench", &mut prefix.command(&["run", "--lockstep", "--out", "run"]));
    let mut fifo = File::options();
    fifo.write(true).custom_flags(OFlags::NONBLOCK.bits() as i32);
    let mut opened = None;
    // Whoever opens it for writing is refused until the summary reads it; held open, it never ends.
    wait_until("the summary reads run.json", || {
        opened = fifo.open(prefix.path("work/run/run.json")).ok();
        opened.is_some()
    });
    let _ = run.interrupt();
}

/// In two terminals, without a word on a bus in either.
#[test]
fn a_run_in_real_time_and_a_program_of_can_meet_on_the_users_bus_and_a_second_run_has_its_own() {
    let name = "a_run_in_real_time_and_a_program_of_can_meet_on_the_users_bus_and_a_second_run_has_its_own";
    if Path::new("/sys/class/net/vcan0").exists() {
        system_tests::skip::report(name, "the kernel has a vcan0, which a run takes");
        return;
    }
    let _machine = turn::take();
    let prefix = Prefix::made();
    let start = |out: &str, arguments: &[&str]| {
        let mut command = prefix.command(arguments);
        command.env("XDG_RUNTIME_DIR", prefix.path("")).env("PATH", tools_path());
        if !out.is_empty() {
            command.arg("--out").arg(prefix.path(out));
        }
        Running::start("airbench", &mut command)
    };
    let mut first = start("first", &["run", "--seconds", "600"]);
    first.wait_for_times("initial-positioning", 1);
    let mut second = start("second", &["run", "--seconds", "600"]);
    second.wait_for_times("initial-positioning", 1);
    let heard = start("", &["can", "--", "candump", "-n", "20", "vcan0,120:7FF"]).wait().expect_code(0);
    assert_eq!(heard.stdout.matches("vcan0  120   [8]").count(), 20, "{}", heard.stdout);
    for (run, on_the_users_bus) in [(second, false), (first, true)] {
        run.signal(Signal::TERM);
        let ended = run.wait().expect_code(130);
        assert_eq!(ended.stdout.contains("airbench/bus0"), on_the_users_bus, "{}", ended.stdout);
    }
}

/// Command lines of processes that hold this text.
fn processes_with(text: &str) -> Vec<String> {
    with_command_line(text).map(|(_, line)| line).collect()
}

#[test]
fn a_signal_to_the_command_alone_ends_all_its_processes_with_everything_saved() {
    let _machine = turn::take();
    let prefix = Prefix::made();
    let (bus, out) = (format!("unix://{}/bus", prefix.path("").display()), prefix.path("out"));
    let arguments =
        ["run", "--two", "--watch", "--http", "127.0.0.1:0", "--seconds", "600", "--bus", &bus, "--out"];
    let mut running = Running::start("airbench run", prefix.command(&arguments).arg(&out));
    running.wait_for_times("initial-positioning", 2);
    let out = out.to_str().expect("a path in ASCII");
    assert!(processes_with(&bus).len() >= 5, "airbench and four of its: {:?}", processes_with(&bus));
    running.signal(Signal::TERM);
    running.wait().expect_code(130);
    assert_eq!(processes_with(&bus), [""; 0]);
    assert!(Path::new(out).join("summary.json").is_file());
}

#[test]
fn a_suite_of_tests_is_run_by_the_interpreter_that_has_the_package() {
    let prefix = Prefix::made();
    let python = prefix.path("work/python");
    install(b"#!/bin/sh\necho \"No module named 'airbench_hil'\" >&2\nexit 1\n", &python);
    let ended =
        Running::start("airbench test", prefix.command(&["test"]).env("AIRBENCH_PYTHON", &python)).wait();
    ended.expect_code(2).expect_stderr(&["No module named 'airbench_hil'", "pip install", "AIRBENCH_PYTHON"]);

    let suite = "import os, airbench_hil.programs as programs\n\n\ndef test_programs():\n    \
                 assert programs.program('emulator').samefile(os.environ['EXPECTED'])\n\n\n\
                 def test_wrong():\n    assert not 'wrong'\n";
    fs::write(prefix.path("work/test_mine.py"), suite).expect("a folder of our own");
    let pytest = |only: &str| {
        let mut command = prefix.command(&["test", "-q", "-p", "no:cacheprovider", "-k", only]);
        command.env("AIRBENCH_PYTHON", of("hil")).env("EXPECTED", prefix.path("lib/airbench/emulator"));
        Running::start("airbench test", &mut command).wait()
    };
    pytest("programs").expect_code(0).expect_stdout(&["1 passed"]);
    pytest("wrong").expect_code(1).expect_stdout(&["1 failed"]);
}
