//! What a file may say, and the message when it says something else.

use super::*;
use algorithms::algorithm::Quantity;

const GOOD: &str = r#"title = "t"
number = 9
[rig]
carriage_position_m = 0.1
[run]
repetitions = 3
start = "on-start"
after_emergency_stop = "restart"
[drive]
program = "position-p"
start_m = 0.1
[[drive.set-point]]
law = "modified-sine"
to_m = 0.4
duration_s = 3
[[drive.change]]
at_s = 2.0
parameter = "algorithm.gain_per_s"
value = 30.0
[[drive.change]]
at_s = 1.0
parameter = "algorithm.gain_per_s"
value = 20.0
[load]
program = "mine/force.toml"
prepare = ["match", "relieve"]
initial_force_n = 100.0
during = "manual"
set-point = [{ law = "step", to_n = 300.0, duration_s = 5.0 }]
[recording]
every_cycles = 10
[passed]
anything = { least = 1 }
"#;

/// `[run]` when nothing is said.
const USUAL: RunSection = RunSection {
    numbers: RunNumbers { repetitions: 1.0, settling_s: 0.5, settling_timeout_s: 10.0 },
    start: Start::ByItself,
    after_emergency_stop: AfterStop::End,
};

fn read(text: &str) -> Result<Experiment, String> {
    Experiment::from_toml(text, Path::new("folder/e.toml"), 0.5).map_err(|error| error.to_string())
}

#[test]
fn a_good_file_is_read() {
    let experiment = read(GOOD).unwrap();
    assert_eq!((experiment.number, experiment.about.as_str(), experiment.duration_s()), (9, "", 5.0));
    let expected = RunSection {
        numbers: RunNumbers { repetitions: 3.0, ..USUAL.numbers },
        start: Start::OnStart,
        after_emergency_stop: AfterStop::Restart,
    };
    assert_eq!(experiment.run, expected);
    assert_eq!(experiment.record_every_cycles, 10);
    assert!(experiment.rig.contains_key("carriage_position_m") && experiment.passed["anything"].is_table());
    let (drive, load) = (experiment.drive.unwrap(), experiment.load.unwrap());
    assert_eq!(
        [drive.set_points.quantity(), load.set_points.quantity()],
        [Quantity::Position, Quantity::Force]
    );
    assert_eq!((drive.start_m, load.start_m), (Some(0.1), None));
    assert_eq!(load.prepare, [Prepare::Match, Prepare::Relieve]);
    assert_eq!((load.manual, load.initial_force_n(), load.force.initial_ramp_s), (true, 100.0, 1.0));
    let changes: Vec<_> =
        drive.changes.iter().map(|change| (change.at_s, change.value, change.line)).collect();
    assert_eq!(changes, [(1.0, 20.0, 22), (2.0, 30.0, 18)], "in the order of their times");
}

#[test]
fn a_program_is_a_name_beside_the_experiments_or_a_path_from_them() {
    let experiment = read(GOOD).unwrap();
    let file = Path::new("folder/e.toml");
    let paths = [experiment.drive, experiment.load].map(|axis| axis.unwrap().program_path(file));
    assert_eq!(
        paths,
        ["folder/../programs/position-p.toml", "folder/mine/force.toml"].map(std::path::PathBuf::from)
    );
}

#[test]
fn a_file_with_little_in_it_has_its_defaults() {
    let experiment = read("title = \"t\"\n[drive]\nprogram = \"p\"\nstart_m = 0.1\n").unwrap();
    assert_eq!((experiment.run, experiment.record_every_cycles), (USUAL, 1));
    assert!(experiment.load.is_none() && experiment.rig.is_empty());
    assert_eq!((experiment.number, experiment.duration_s()), (1, 0.0));
}

#[test]
fn what_a_row_is_of_follows_from_its_laws_and_their_keys() {
    let quantity = |axis: &str, segments: &str| {
        let text =
            format!("title = \"t\"\n[{axis}]\nprogram = \"p\"\nstart_m = 0.1\nset-point = [{segments}]\n");
        let experiment = read(&text).unwrap_or_else(|error| panic!("{error}"));
        experiment.drive.or(experiment.load).unwrap().set_points.quantity()
    };
    let rest = "{ law = 'rest', duration_s = 1 }";
    assert_eq!([quantity("drive", rest), quantity("load", rest)], [Quantity::Position, Quantity::Force]);
    assert_eq!(quantity("drive", "{ law = 'ramp', to_n = 1, duration_s = 1 }"), Quantity::Force);
    assert_eq!(
        quantity("load", &format!("{rest}, {{ law = 'ramp', to_m = 0.2, duration_s = 1 }}")),
        Quantity::Position
    );
    assert_eq!(quantity("drive", "{ law = 'mass', mass_kg = 1, duration_s = 1 }"), Quantity::Force);
}

#[test]
fn a_bad_value_is_refused_with_file_line_key_value_and_range() {
    let bad: [(&str, &str, &[&str]); 22] = [
        ("start_m = 0.1", "start_m = 0.6", &["e.toml:11: drive.start_m = 0.6 m", "0 to 0.5 m"]),
        ("start_m = 0.1", "start = 0.1", &["e.toml:9: drive.start_m is missing", "0 to 0.5 m", "start"]),
        ("to_m = 0.4", "to_m = -1.0", &["e.toml:14: drive.set-point[1].to_m = -1 m", "0 to 0.5 m"]),
        ("duration_s = 3\n", "duration_s = 0\n", &["e.toml:15", "duration_s = 0 s", "0.01 to 86400 s"]),
        (
            "duration_s = 3\n",
            "duration_s = 3\nextra = 1\n",
            &["e.toml:16", "unknown key drive.set-point[1].extra"],
        ),
        (
            "law = \"modified-sine\"",
            "law = \"jerk\"",
            &["e.toml:13", "law = \"jerk\"", "bestehorn, modified-sine"],
        ),
        ("law = \"modified-sine\"", "law = 3", &["e.toml:13", "law = 3", "text in quotes"]),
        ("number = 9", "number = 0", &["e.toml:2: number = 0", "1 to 255"]),
        ("number = 9", "number = 1.5", &["e.toml:2: number = 1.5", "whole"]),
        ("number = 9", "nummer = 9", &["e.toml:2: unknown key nummer", "number"]),
        ("repetitions = 3", "repetitions = 0", &["e.toml:6: run.repetitions = 0", "1 to 1000000"]),
        ("repetitions = 3", "settling_s = 61", &["e.toml:6: run.settling_s = 61 s", "0 to 60 s"]),
        ("repetitions = 3", "settling_timeout_s = 0.3", &["e.toml:6", "settling_timeout_s = 0.3 s", "0.5 s"]),
        ("\"on-start\"", "\"later\"", &["e.toml:7: run.start = \"later\"", "by-itself, on-start"]),
        ("\"restart\"", "\"go\"", &["e.toml:8: run.after_emergency_stop = \"go\"", "end, restart, on-start"]),
        ("\"position-p\"", "\"../p\"", &["e.toml:10: drive.program = \"../p\"", "ending in .toml"]),
        ("[\"match\"", "[\"mix\"", &["e.toml:26: load.prepare = \"mix\"", "relieve, match"]),
        ("[\"match\", \"relieve\"]", "\"match\"", &["e.toml:26: load.prepare = \"match\"", "list"]),
        (
            "initial_force_n = 100.0",
            "initial_force_n = nan",
            &["e.toml:27", "initial_force_n = NaN N", "0 to 1000 N"],
        ),
        ("value = 30.0", "value = true", &["e.toml:19: drive.change[1].value = true", "number"]),
        ("every_cycles = 10", "every_cycles = 0", &["recording.every_cycles = 0", "1 to 1000"]),
        ("title = \"t\"", "title = = \"t\"", &["e.toml", "line 1"]),
    ];
    for (from, to, hints) in bad {
        assert!(GOOD.contains(from), "'{from}' is not in the file");
        let message = read(&GOOD.replacen(from, to, 1)).unwrap_err();
        hints.iter().for_each(|hint| assert!(message.contains(hint), "'{hint}' is missing in: {message}"));
    }
}

#[test]
fn a_row_mixes_no_positions_and_forces() {
    let mixed =
        GOOD.replacen("duration_s = 3\n", "duration_s = 3\n[[drive.set-point]]\nlaw = \"damper\"\n", 1);
    let message = read(&mixed).unwrap_err();
    assert!(message.contains("e.toml:17: drive.set-point[2].law") && message.contains("mixes"), "{message}");
    let message = read(&GOOD.replacen("start_m = 0.1", "start_m = 0.1\ninitial_force_n = 1", 1)).unwrap_err();
    assert!(message.contains("e.toml:12: drive.initial_force_n is for set-points of force"), "{message}");
}

#[test]
fn nothing_moves_without_an_axis() {
    let message = read("title = \"t\"\n").unwrap_err();
    assert!(message.contains("[drive] or [load] is needed"), "{message}");
}

fn experiments_folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../controller/experiments")
}

/// The experiments that come with airbench: name of the file, text, what was read.
fn shipped() -> Vec<(String, String, Experiment)> {
    let files = std::fs::read_dir(experiments_folder()).unwrap().map(|entry| entry.unwrap().path());
    let shipped = files.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).map(|path| {
        let text = std::fs::read_to_string(&path).unwrap();
        let experiment = Experiment::from_toml(&text, &path, 0.5).unwrap_or_else(|error| panic!("{error}"));
        (path.file_stem().unwrap().to_str().unwrap().to_owned(), text, experiment)
    });
    shipped.collect()
}

#[test]
fn a_shipped_experiment_is_named_as_its_file_and_says_what_it_is_about_on_one_line() {
    for (name, text, experiment) in shipped() {
        assert_eq!(experiment.title, name);
        // scripts/run --list reads that line.
        let line = format!("about = \"{}\"", experiment.about);
        assert!(!experiment.about.is_empty() && text.lines().any(|other| other == line), "{name}: {line}");
        assert!(text.contains("\nnumber = "), "{name} has a number of its own");
    }
}

#[test]
fn a_shipped_experiment_has_a_number_that_no_other_has_and_bounds_to_pass() {
    let mut numbers = std::collections::BTreeMap::new();
    for (name, _, experiment) in shipped() {
        assert!(!experiment.passed.is_empty(), "{name} can fail");
        let before = numbers.insert(experiment.number, name.clone());
        assert_eq!(before, None, "number {} of {name}", experiment.number);
    }
    assert!(numbers.len() >= 12, "{numbers:?}");
}

#[test]
fn the_shipped_experiments_are_read() {
    let experiments = shipped();
    for (name, _, experiment) in &experiments {
        for axis in [&experiment.drive, &experiment.load].into_iter().flatten() {
            let file = experiments_folder().join(format!("{name}.toml"));
            assert!(axis.program_path(&file).exists(), "{}: no program {:?}", file.display(), axis.program);
        }
    }
    assert!(!experiments.is_empty());
}

#[test]
fn the_programs_of_the_shipped_experiments_are_shipped() {
    for (name, _, experiment) in shipped() {
        for axis in [&experiment.drive, &experiment.load].into_iter().flatten() {
            let path = axis.program_path(&experiments_folder().join("e.toml"));
            assert!(path.is_file(), "{name}: {}", path.display());
        }
    }
}
