//! Command lines and files that cannot be used: a message that a person can act on, the documented exit code, no hang.

use std::path::Path;
use system_tests::exit::{BAD_INPUT, BUS_FAILED};
use system_tests::{CompletedProcess, Launch, PROGRAM, Pace, Program, Running, SHORT, Scene};

/// A key of the rig file made wrong: text, its replacement, and what the message must hold besides file and line.
const WRONG_RIGS: [(&str, &str, &[&str]); 7] = [
    (
        "pressure_bar = 7.0",
        "pressure_baar = 7.0",
        &["unknown key supply.pressure_baar", "did you mean pressure_bar?"],
    ),
    ("pressure_bar = 7.0", "pressure_bar = 70.0", &["supply.pressure_bar = 70.0", "3 to 12 bar"]),
    ("pressure_bar = 7.0", "pressure_bar = nan", &["supply.pressure_bar = nan", "3 to 12 bar"]),
    ("pressure_bar = 7.0", "pressure_bar = inf", &["supply.pressure_bar = inf", "3 to 12 bar"]),
    ("pressure_bar = 7.0", "pressure_bar = \"high\"", &["supply.pressure_bar = \"high\"", "3 to 12 bar"]),
    ("pressure_bar = 7.0", "", &["supply.pressure_bar is missing", "3 to 12 bar"]),
    ("pressure_bar = 7.0", "pressure_bar = = 7", &["not TOML"]),
];

fn both(scene: &Scene) -> [Launch; 2] {
    [scene.emulator(Pace::Real).with("--seconds 1"), scene.controller(Pace::Real).with("--bus-grace 1")]
}

/// Runs to the end, which must come with this code, these words, and no trace in the output folder.
#[track_caller]
fn refused(scene: &Scene, launch: &Launch, code: i32, words: &[&str]) -> CompletedProcess {
    let ended = launch.start().wait().expect_code(code).expect_stderr(words);
    for report in ["emulator/summary.json", "controller/controller.json"] {
        assert!(!scene.path(report).exists(), "{report} tells of a run that never was");
    }
    ended
}

fn line_of(path: &Path, text: &str) -> String {
    let content = std::fs::read_to_string(path).expect("the file was written");
    let line = 1 + content.lines().position(|line| line.contains(text)).expect("the text is in the file");
    format!("{}:{line}:", path.display())
}

#[test]
fn a_wrong_rig_file_is_refused_with_file_line_key_value_and_range() {
    let scene = Scene::new(SHORT);
    for (from, to, words) in WRONG_RIGS {
        let rig = scene.rig_with("wrong.toml", from, to);
        let place = line_of(&rig, if to.is_empty() { "[supply]" } else { to });
        for launch in both(&scene) {
            refused(&scene, &launch.rig(&rig), BAD_INPUT, &[&[place.as_str()], words].concat());
        }
    }
}

#[test]
fn a_wrong_experiment_is_refused_with_file_line_key_value_and_range() {
    let scene = Scene::new(SHORT);
    let [emulator, controller] = both(&scene);
    let wrong: [(&str, &str, &Launch, &[&str]); 7] = [
        (
            "carriage_position_m = 0.1",
            "carriage_position_m = 0.9",
            &emulator,
            &["carriage_position_m = 0.9", "0 to 0.5 m"],
        ),
        (
            "carriage_position_m = 0.1",
            "carriage_position_m = nan",
            &emulator,
            &["rig.carriage_position_m = NaN", "0 to 0.5 m"],
        ),
        ("carriage_position_m = 0.1", "added_mass_kg = 500.0", &emulator, &["added_mass_kg = 500", "0 to"]),
        (
            "carriage_position_m = 0.1",
            "carriage_m = 0.1",
            &emulator,
            &["unknown key rig.carriage_m", "carriage_position_m"],
        ),
        ("start_m = 0.1", "start_m = 0.6", &controller, &["drive.start_m = 0.6 m", "0 to 0.5 m"]),
        ("settling_s = 0.2", "settling = 0.2", &controller, &["unknown key run.settling", "settling_s"]),
        ("law = \"bestehorn\"", "law = \"jerk\"", &controller, &["jerk", "bestehorn"]),
    ];
    let mut without_place = Vec::new();
    for (from, to, launch, words) in wrong {
        assert!(SHORT.contains(from), "'{from}' is not in the experiment");
        let experiment = scene.write("wrong-experiment.toml", &SHORT.replacen(from, to, 1));
        let ended = refused(&scene, &launch.clone().experiment(&experiment), BAD_INPUT, words);
        let file = experiment.display().to_string();
        // Either FILE:LINE: or, for what the TOML reader refuses, FILE with line and column.
        let placed = ended.stderr.contains(&line_of(&experiment, to))
            || ended.stderr.contains(&file) && ended.stderr.contains(" line ");
        if !placed {
            without_place.push(ended.stderr);
        }
    }
    assert!(without_place.is_empty(), "refused without file and line:\n{}", without_place.concat());
}

#[test]
fn a_wrong_program_is_refused_with_file_line_key_value_and_range() {
    let scene = Scene::new(SHORT);
    let wrong: [(&str, &str, &[&str]); 3] = [
        ("gain_per_s = 40.0", "gain_per_s = nan", &["gain_per_s = NaN", "0 to 200"]),
        ("gain_per_s = 40.0", "gain = 40.0", &["algorithm.gain", "gain_per_s"]),
        ("\"position-p\"", "\"position-q\"", &["position-q", "position-p"]),
    ];
    for (from, to, words) in wrong {
        assert!(PROGRAM.contains(from), "'{from}' is not in the program");
        let program = scene.write("program.toml", &PROGRAM.replacen(from, to, 1));
        let ended = refused(&scene, &scene.controller(Pace::Real), BAD_INPUT, words);
        assert!(ended.stderr.contains(&line_of(&program, to)), "{}", ended.stderr);
    }
    std::fs::remove_file(scene.path("program.toml")).expect("it is there");
    refused(&scene, &scene.controller(Pace::Real), BAD_INPUT, &["cannot read", "program.toml"]);
}

#[test]
fn a_missing_file_is_named() {
    let scene = Scene::new(SHORT);
    let missing = scene.path("no-such.toml");
    let words: &[&str] = &["cannot read", "no-such.toml", "No such file"];
    for launch in both(&scene) {
        refused(&scene, &launch.clone().rig(&missing), BAD_INPUT, words);
        refused(&scene, &launch.experiment(&missing), BAD_INPUT, words);
    }
}

#[test]
fn an_output_folder_that_cannot_be_written_is_named_with_the_remedy() {
    let scene = Scene::new(SHORT);
    scene.write("file", "not a folder");
    for folder in [scene.path("file/run"), "/proc/airbench-run".into()] {
        for launch in both(&scene) {
            let words = ["cannot write", folder.to_str().expect("a path in ASCII"), "--out"];
            refused(&scene, &launch.out(&folder), BAD_INPUT, &words);
        }
    }
}

#[test]
fn a_bus_that_cannot_be_opened_is_named_with_the_remedy() {
    let scene = Scene::new(SHORT);
    for launch in both(&scene) {
        let nope = launch.clone().bus("can://nope");
        // What the remedy is depends on the kernel; that there is one does not.
        refused(&scene, &nope, BUS_FAILED, &["cannot open bus can://nope: ", "; "]);
        for url in ["can://", "vcan0", "unix://relative", "unix:///tmp/b?loss=2"] {
            refused(&scene, &launch.clone().bus(url), BAD_INPUT, &["--bus", url]);
        }
    }
}

#[test]
fn lockstep_on_socketcan_is_refused_with_the_way_out() {
    let scene = Scene::new(SHORT);
    for launch in [scene.emulator(Pace::Lockstep), scene.controller(Pace::Lockstep)] {
        refused(
            &scene,
            &launch.bus("can://vcan0"),
            BAD_INPUT,
            &["can://vcan0", "lockstep", "--bus unix:///PATH"],
        );
    }
}

#[test]
fn a_path_that_is_taken_by_a_file_is_refused_and_the_file_stays() {
    let scene = Scene::new(SHORT);
    std::fs::write(scene.socket(), "precious").expect("the folder can be written");
    let emulator = scene.emulator(Pace::Real).with("--seconds 1");
    refused(
        &scene,
        &emulator,
        BUS_FAILED,
        &["cannot open bus", "taken by another file", "--bus unix:///PATH"],
    );
    assert_eq!(std::fs::read_to_string(scene.socket()).expect("still there"), "precious");
}

#[test]
fn a_controller_without_a_rig_gives_up_after_its_grace_and_says_what_to_start() {
    let scene = Scene::new(SHORT);
    for pace in [Pace::Real, Pace::Lockstep] {
        let controller = scene.controller(pace).with("--bus-grace 0.3").start();
        controller.wait().expect_code(BUS_FAILED).expect_stderr(&["emulator run", "--bus-grace"]);
    }
}

/// Usage errors of both programs, and what the message must hold.
#[test]
fn a_wrong_command_line_tells_what_is_allowed() {
    let emulator: [(&str, &str); 7] = [
        ("run", "--rig"),
        ("fly", "'fly'"),
        ("run --rig r --pace slow", "real, lockstep"),
        ("run --rig r --seconds=-1", "above 0"),
        ("run --rig r --seconds nan", "above 0"),
        ("run --rig r --fifo-priority 99", "1..=98"),
        ("bus --bus can://vcan0", "unix:///PATH"),
    ];
    let controller: [(&str, &str); 4] = [
        ("run --rig r", "--experiment"),
        ("run --rig r --experiment e --bus-grace 0", "0.1 to 86400"),
        ("run --rig r --experiment e --fifo-priority 100", "1..=99"),
        ("run --rig r --experiment e --pace slow", "lockstep"),
    ];
    let cases = emulator.map(|case| (Program::Emulator, case)).into_iter();
    for (program, (line, hint)) in cases.chain(controller.map(|case| (Program::Controller, case))) {
        let name = format!("{} {line}", program.name());
        let ended = Running::start(&name, program.command().args(line.split(' '))).wait();
        ended.expect_code(BAD_INPUT).expect_stderr(&[hint]);
    }
}

#[test]
fn help_tells_the_exit_codes_in_one_table() {
    for program in [Program::Emulator, Program::Controller] {
        let ended = program.start(&[&"--help"]).wait().expect_code(0);
        let parts = ["0 good", "1 a bound", "2 usage", "3 the bus", "4 lockstep", "130 interrupted"];
        ended.expect_stdout(&parts);
    }
}
