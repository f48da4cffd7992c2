//! Scripts of faults: the same bytes from the same one, refused when wrong, and a table of which no row is forgotten.

use std::collections::BTreeSet;
use system_tests::broken::{FaultRun, FaultRunPlan};
use system_tests::{Pace, Program, SHORT, Scene, expect_same, same, workspace};

#[test]
fn the_same_script_gives_the_same_bytes_and_none_gives_those_of_a_run_without() {
    let script = "seed = 3\n[[fault]]\nname = \"position-sensor-noise\"\nat = \"drive\"\n\
                  [[fault]]\nname = \"bus-loss\"\nprobability = 0.1\n\
                  [[fault]]\nname = \"chamber-leak\"\nat = \"load.b\"\nleakage_nl_per_min = 50\n";
    let run =
        |faults: &str| FaultRunPlan { faults, act: |_| Some([0.3, 0.2]), ..FaultRunPlan::default() }.run();
    let [one, other] = [run(script), run(script)];
    let folder = |outcome: &FaultRun| outcome.scene.path("emulator");
    let files = ["measurement.csv", "truth.csv", "bus.log", "faults.csv"];
    expect_same(&folder(&one), &folder(&other), &files, "differs");
    let drawn_anew = run(&script.replace("seed = 3", "seed = 4"));
    for name in ["measurement.csv", "bus.log"] {
        let is_same = same(&folder(&one).join(name), &folder(&drawn_anew).join(name));
        assert!(!is_same, "{name}: another seed, other draws");
    }
    let later = "[[fault]]\nname = \"valve-dead\"\nat = \"drive\"\nfrom_s = 50\n";
    let [without, waiting] = [run(""), run(later)];
    let [one, other] = [&without, &waiting].map(|outcome| folder(outcome).join("measurement.csv"));
    assert!(same(&one, &other), "a fault that waits changes nothing");
    assert!(!without.scene.path("emulator/faults.csv").exists());
}

fn listing(arguments: &[&str]) -> String {
    let output = Program::Emulator.command().arg("faults").args(arguments).output();
    let output = output.expect("the emulator starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// What `faults_table.rs` and `faults_bus_table.rs` assert, by name.
#[test]
fn every_row_of_the_table_has_its_effect_asserted() {
    let json: serde_json::Value = serde_json::from_str(&listing(&["--json"])).expect("JSON");
    let text = |file: &str| std::fs::read_to_string(workspace().join("tests/tests").join(file)).expect(file);
    let sources = text("faults_table.rs") + &text("faults_bus_table.rs");
    let (plain, faults) = (listing(&[]), json["faults"].as_array().expect("faults"));
    let mut groups = BTreeSet::new();
    for fault in faults {
        let name = fault["fault"].as_str().expect("a name");
        groups.insert(fault["group"].as_str().expect("a group"));
        // Sensors are asserted by their kinds, for all quantities at once.
        let asserted = name.split_once("-sensor-").map_or(name, |(_, kind)| kind);
        assert!(sources.contains(&format!("\"{asserted}\"")), "{name}: no effect is asserted");
        assert!(plain.contains(name) && fault["about"].as_str().is_some_and(|about| plain.contains(about)));
        for key in fault["keys"].as_array().expect("keys") {
            assert!(
                key["min"].is_number() && key["max"].is_number() && key["unit"].is_string(),
                "{name}: {key}"
            );
        }
    }
    assert_eq!(groups, BTreeSet::from(["air", "bus", "mechanics", "sensor", "supply", "valve"]));
}

#[test]
fn the_page_has_the_table() {
    let page = std::fs::read_to_string(workspace().join("emulator/docs/faults.md")).expect("the page");
    let table = listing(&["--markdown"]);
    assert!(page.contains(table.trim()), "put the output of 'emulator faults --markdown' into faults.md");
}

#[test]
fn a_script_that_is_wrong_is_refused_with_line_key_value_and_range_before_anything_is_touched() {
    let stuck = "[[fault]]\nname = \"valve-offset\"\nat = \"drive\"\n";
    for (script, hints) in [
        (
            "[[fault]]\nname = \"valve-stick\"\n".to_owned(),
            vec![":2:", "'valve-stick' is unknown", "emulator faults"],
        ),
        (format!("{stuck}offset = 1.5\n"), vec![":4: offset = 1.5", "allowed: -1 to 1"]),
        (format!("{stuck}offset = nan\n"), vec![":4: offset = nan", "allowed: -1 to 1"]),
        (format!("{stuck}ofset = 0.1\n"), vec![":4:", "ofset = 0.1", "valve-offset has offset"]),
        ("[[fault]\n".to_owned(), vec![":1: not TOML"]),
    ] {
        let scene = Scene::new(SHORT);
        let path = scene.write("faults.toml", &script);
        let emulator = scene.emulator(Pace::Real).with(&format!("--faults {}", path.display())).start();
        emulator.wait().expect_code(2).expect_stderr(&[path.to_str().expect("UTF-8")]).expect_stderr(&hints);
        assert!(!scene.path("emulator").exists(), "no folder before the script is good");
    }
    let scene = Scene::new(SHORT);
    let missing = scene.emulator(Pace::Real).with("--faults /nowhere/faults.toml").start();
    missing.wait().expect_code(2).expect_stderr(&["cannot read /nowhere/faults.toml"]);
    let path = scene.write("faults.toml", "\n[[fault]]\nname = \"bus-loss\"\n");
    let emulator =
        scene.emulator(Pace::Real).bus("can://vcan0").with(&format!("--faults {}", path.display()));
    emulator
        .start()
        .wait()
        .expect_code(2)
        .expect_stderr(&[":2: bus-loss: only the embedded bus", "unix:///PATH"]);
}
