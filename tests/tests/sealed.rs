//! Sealed rigs: what a sealed file switches on stands in truth.csv, and nothing else that leaves a run reveals it.
//!
//! Each run with a sealed file is held against one with an empty one: a word that is a key of the rig file as well, as
//! `gap_mm`, may stand where it stood before, and nowhere besides.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use memchr::memmem;
use plant::effects::draw::as_toml;
use plant::effects::sheet::ActiveEffect;
use plant::effects::{SHEETS, sheet};
use protocol::frames::{DRIVE_SENSORS, MESSAGES};
use system_tests::hidden::{Extreme, LIVELY, drawn, everything, rig_with};
use system_tests::{Pace, Program, Scene, Table, both_good, bus_log, expect_same, json, run_both, turn};

const SEALED_RUNS: u64 = 20;
/// Shorter texts of numbers stand anywhere by chance.
const TELLING_DIGITS: usize = 12;

/// A run with a sealed file: its folder, and the output of its programs.
struct SealedRun {
    scene: Scene,
    output: String,
}

impl SealedRun {
    fn path(&self, name: &str) -> PathBuf {
        self.scene.path("run").join(name)
    }
}

/// A run of both programs with this sealed file, summed up as `scripts/run` does.
fn run(sealed: &str, pace: Pace, options: &str) -> SealedRun {
    let scene = Scene::new(LIVELY);
    scene.write("sealed.toml", sealed);
    let folder = scene.path("run");
    let sealed = format!("--sealed {}", scene.path("sealed.toml").display());
    let ended = run_both(
        &scene.emulator(pace).out(&folder).with("--seconds 1.3").with(&sealed).with(options),
        &scene.controller(pace).out(&folder).with("--repeat"),
    );
    let summary = Program::Bench.start(&[&"summary", &folder]).wait().expect_code(0);
    let output =
        ended.iter().chain([&summary]).map(|ended| format!("{}{}", ended.stdout, ended.stderr)).collect();
    SealedRun { scene, output }
}

/// Every file of the folder and of those in it, but truth.csv, by the path in the folder; and what was said.
fn outputs(run: &SealedRun) -> BTreeMap<String, String> {
    let mut texts = BTreeMap::from([("(said)".to_owned(), run.output.clone())]);
    let (root, mut folders) = (run.scene.path("run"), vec![run.scene.path("run")]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a run's folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(&root).expect("below the run's folder").display().to_string();
            let bytes = fs::read(&path).expect("a file of the run");
            // The path of the file would reveal it too: a name could be in it.
            texts.insert(name.clone(), format!("{name}\n{}", String::from_utf8_lossy(&bytes)));
        }
    }
    assert!(texts.remove("truth.csv").is_some(), "a run leaves its truth");
    texts
}

/// Names of effects as files, modules and types have them, and names of their numbers.
fn words() -> BTreeSet<String> {
    let camel = |name: &str| -> String {
        name.split('-').map(|part| part[..1].to_uppercase() + &part[1..]).collect()
    };
    let names = SHEETS.iter().map(|sheet| sheet.name);
    let forms =
        names.flat_map(|name| [name.to_owned(), name.replace('-', "_"), camel(name), name.replace('-', " ")]);
    forms.chain(SHEETS.iter().flat_map(|sheet| sheet.keys.iter().map(|key| key.name.to_owned()))).collect()
}

/// How often each word stands in each output: what must be the same with every seal.
fn census(outputs: &BTreeMap<String, String>, words: &BTreeSet<String>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for (name, text) in outputs {
        for word in words {
            // Dumps are as many as there were late wake-ups: those of a process count as one output.
            let name = name.split('/').next().unwrap_or_default();
            let count = memmem::find_iter(text.as_bytes(), word.as_bytes()).count();
            if count > 0 {
                *counts.entry(format!("{word} in {name}")).or_default() += count;
            }
        }
    }
    counts
}

/// The beginnings of the texts of its numbers, in the file's unit and in SI, that do not stand anywhere by chance.
fn telling_numbers(effects: &[ActiveEffect]) -> Vec<String> {
    let mut texts = Vec::new();
    for effect in effects {
        let keys = sheet(effect.name).expect("it was drawn from the sheets").keys;
        for (key, number) in keys.iter().zip(&effect.numbers) {
            for value in [*number, key.unit.to_si(*number)] {
                let text = format!("{:?}", value.abs());
                if text.len() >= TELLING_DIGITS {
                    texts.push(text[..TELLING_DIGITS].to_owned());
                }
            }
        }
    }
    texts
}

/// Identifier and length of a frame.
type Kind = (u16, usize);

/// Kinds of the frames that the rig sends, in their order, and of all frames.
fn frames(run: &SealedRun) -> (Vec<Kind>, BTreeSet<Kind>) {
    let of_rig =
        |id: u16| MESSAGES.iter().any(|message| message.id == id && message.sender == DRIVE_SENSORS.sender);
    let frames = bus_log(&run.path("bus.log"));
    let kinds =
        frames.iter().map(|frame| (frame.standard_id().expect("rig.dbc has no other"), frame.data().len()));
    (kinds.clone().filter(|(id, _)| of_rig(*id)).collect(), kinds.collect())
}

fn columns(run: &SealedRun, file: &str) -> Vec<String> {
    Table::read(&run.path(file)).names().to_vec()
}

#[test]
fn the_search_finds_what_is_planted() {
    let words = words();
    for reported in ["piston-leakage", "piston_leakage", "PistonLeakage", "leakage_nl_per_min"] {
        let outputs = BTreeMap::from([(
            "flight/emulator-7-late/event.json".to_owned(),
            format!("{{\"{reported}\": 1}}"),
        )]);
        assert_eq!(census(&outputs, &words).get(&format!("{reported} in flight")), Some(&1), "{reported}");
    }
    let effects = drawn(1, 1);
    let digits = telling_numbers(&effects);
    assert!(!digits.is_empty() && format!("{:?}", effects[0].numbers).contains(&digits[0]), "{digits:?}");
}

#[test]
fn twenty_sealed_runs_tell_what_is_sealed_in_truth_csv_alone() {
    let words = words();
    let open = run("", Pace::Lockstep, "");
    let open_census = census(&outputs(&open), &words);
    for seed in 1..=SEALED_RUNS {
        let effects = drawn(seed, 1 + (seed % 3) as usize);
        let sealed = run(&as_toml(&effects), Pace::Lockstep, "");
        let what = format!("seed {seed}: {effects:?}");
        let outputs = outputs(&sealed);
        assert_eq!(census(&outputs, &words), open_census, "{what}");
        for number in telling_numbers(&effects) {
            let reported = outputs.iter().find(|(_, text)| text.contains(&number));
            assert!(reported.is_none(), "{number} stands in {:?}, {what}", reported.map(|(name, _)| name));
        }
        assert_eq!(frames(&sealed), frames(&open), "{what}");
        assert_eq!(columns(&sealed, "measurement.csv"), columns(&open, "measurement.csv"));
        assert_eq!(json(&sealed.path("run.json"))["sealed"], true);
        // The one place that reveals it, and an effect that acts: else the test would be of nothing.
        let head = columns(&sealed, "truth.csv").join(",");
        for effect in &effects {
            assert!(head.contains(&effect.name.replace('-', "_")), "{what}: {head}");
        }
    }
}

#[test]
fn what_only_real_time_leaves_tells_nothing_of_it_either() {
    let _machine = turn::take();
    let words = words();
    // Late by the least lateness that there is: the flight recorder has dumps to write.
    let options = "--full-timing --flight-late-us 1";
    let open = run("", Pace::Real, options);
    let sealed = run(&as_toml(&everything(Extreme::Drawn)), Pace::Real, options);
    let (outputs, open) = (outputs(&sealed), outputs(&open));
    for part in ["emulator.hlog", "emulator-timing.csv", "flight/"] {
        assert!(outputs.keys().any(|name| name.starts_with(part)), "{part} is among {:?}", outputs.keys());
    }
    assert_eq!(census(&outputs, &words), census(&open, &words));
}

#[test]
fn an_empty_seal_changes_no_byte() {
    let sealed = run("# nothing\n", Pace::Lockstep, "");
    let scene = Scene::new(LIVELY);
    let (emulator, controller) = scene.start(Pace::Lockstep, "--seconds 1.3", "--repeat");
    both_good(emulator, controller);
    let files = ["bus.log", "measurement.csv", "truth.csv"];
    expect_same(&scene.path("emulator"), &sealed.path(""), &files, "differs");
    assert_eq!(scene.run_description()["sealed"], false);
}

#[test]
fn a_sealed_effect_is_that_of_a_rig_file_and_wins_over_it_without_a_word() {
    let scene = Scene::new(LIVELY);
    let effects = drawn(5, 6);
    let open = lockstep(&scene, &rig_with(&scene, &effects), "open", "");
    scene.write("sealed.toml", &as_toml(&effects));
    let other = |effect: &ActiveEffect| ActiveEffect {
        numbers: sheet(effect.name).expect("a sheet").keys.iter().map(|key| key.drawn[0]).collect(),
        ..effect.clone()
    };
    let others: Vec<ActiveEffect> = effects.iter().map(other).collect();
    let option = format!("--sealed {}", scene.path("sealed.toml").display());
    for (folder, rig) in [("plain", scene.path("rig.toml")), ("over", rig_with(&scene, &others))] {
        let sealed = lockstep(&scene, &rig, folder, &option);
        let what = format!("differs, {folder}");
        expect_same(&open, &sealed, &["emulator/bus.log", "emulator/truth.csv"], &what);
    }
}

#[test]
fn an_experiment_may_name_the_sealed_file_and_no_controller_reads_it() {
    let scene = Scene::new(LIVELY);
    let effects = drawn(6, 3);
    scene.write("mine.toml", &as_toml(&effects));
    let open = lockstep(&scene, &rig_with(&scene, &effects), "open", "");
    let named = LIVELY.replacen("[rig]\n", "[rig]\nsealed = \"mine.toml\"\n", 1);
    scene.write("experiment.toml", &named);
    let sealed = lockstep(&scene, &scene.path("rig.toml"), "sealed", "");
    expect_same(&open, &sealed, &["emulator/bus.log"], "differs");
    // A file that is not there stops the rig and not the controllers, which end for want of a rig.
    scene.write("experiment.toml", &named.replacen("mine", "gone", 1));
    scene.emulator(Pace::Lockstep).start().wait().expect_code(2).expect_stderr(&["cannot read", "gone.toml"]);
    let refused = scene.rehearsal().start().wait().expect_code(2);
    refused.expect_stderr(&["rig.sealed", "must not read a sealed file", "emulator run"]);
}

#[test]
fn a_controller_takes_the_nominal_numbers_of_a_rig_file_with_effects() {
    let scene = Scene::new(LIVELY);
    let rig = rig_with(&scene, &everything(Extreme::Drawn));
    let both = lockstep(&scene, &rig, "both", "");
    let folder = scene.path("nominal");
    let start = |launch: system_tests::Launch, name: &str| launch.out(&folder.join(name)).start();
    let emulator = start(scene.emulator(Pace::Lockstep).rig(&rig).with("--seconds 1.3"), "emulator");
    let controller = start(scene.controller(Pace::Lockstep).with("--repeat"), "controller");
    both_good(emulator, controller);
    let files = ["emulator/bus.log", "controller/controller-drive.csv", "controller/controller-load.csv"];
    expect_same(&both, &folder, &files, "differs");
}

#[test]
fn emulator_and_rehearsal_write_the_same_truth() {
    let scene = Scene::new(LIVELY);
    let rig = rig_with(&scene, &drawn(3, 12));
    let run = lockstep(&scene, &rig, "run", "");
    scene.rehearsal().rig(&rig).with("--seconds 1.3 --repeat").start().wait().expect_code(0);
    let (run, rehearsed) = (run.join("emulator"), scene.path("controller"));
    expect_same(&run, &rehearsed, &["measurement.csv", "truth.csv"], "differs");
}

#[test]
fn a_wrong_seal_is_refused_before_the_run_with_file_line_and_key() {
    let scene = Scene::new(LIVELY);
    let wrong: [(&str, &str); 3] = [
        ("[supply]\npressure_bar = 6\n", ":1: unknown key supply; allowed is effects, tables, terms"),
        ("[effects.piston-leakage]\n", ":1: effects.piston-leakage ="),
        (
            "[effects.piston-leakage.drive]\nleakage_nl_per_min = 51\n",
            ":2: effects.piston-leakage.drive.leakage_nl_per_min = 51",
        ),
    ];
    for (text, words) in wrong {
        let file = scene.write("wrong.toml", text);
        let launch = scene.emulator(Pace::Real).with(&format!("--sealed {}", file.display()));
        launch.start().wait().expect_code(2).expect_stderr(&[&format!("{}{words}", file.display())]);
        assert!(!scene.path("emulator").exists(), "nothing is left of a run that never was");
    }
}

/// A run of both programs; the controller has the shipped rig file or, as the emulator, the one given. Returns its folder.
fn lockstep(scene: &Scene, rig: &Path, folder: &str, options: &str) -> PathBuf {
    let folder = scene.path(folder);
    let emulator = scene.emulator(Pace::Lockstep).rig(rig).out(&folder.join("emulator"));
    run_both(
        &emulator.with("--seconds 1.3").with(options),
        &scene.controller(Pace::Lockstep).rig(rig).out(&folder.join("controller")).with("--repeat"),
    );
    folder
}
