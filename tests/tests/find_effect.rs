//! `scripts/find-effect`: help, arguments that cannot be used, and one sealed effect found in lockstep, from the draw to the
//! opened seal.

use std::fs;
use std::path::Path;
use system_tests::{CompletedProcess, PATIENCE, SHORT, Scene, install, json, script};

/// Draws a leakage of 5.9 Nl/min across the load's piston: far above its detection limit.
const SEED: &str = "9";
const HIDDEN: &str = "piston-leakage at load";

fn find_effect(arguments: &[&str]) -> CompletedProcess {
    script("find-effect", arguments, 6 * PATIENCE)
}

/// A program in place of the workflow's: finds nothing and leaves the rig as it is, or what `said` says.
fn stand_in(folder: &Path, said: &str) -> String {
    let (program, report) = (folder.join("stand-in"), folder.join("said.json"));
    fs::write(&report, said).expect("a folder that can be written");
    let text = format!(
        "#!/usr/bin/env bash\nset -eu\n[ \"$1 $2 $4 $6 $8\" = 'close --rig --train --test --out' ]\n\
         cp \"$3\" \"$9/rig.toml\"\ncp '{}' \"$9/report.json\"\n",
        report.display()
    );
    install(text.as_bytes(), &program);
    program.display().to_string()
}

#[test]
fn help_tells_options_files_and_exit_codes() {
    let ended = find_effect(&["--help"]).expect_code(0);
    let parts =
        ["--seed", "--lockstep", "--expect-right", "gap.html", "Exit codes: 0 done", "130 interrupted"];
    ended.expect_stdout(&parts);
}

#[test]
fn arguments_that_cannot_be_used_are_refused_before_anything_is_built() {
    let wrong: [(&[&str], &str); 11] = [
        (&["--fly"], "unknown argument --fly"),
        (&["--seed"], "--seed needs a value"),
        (&["--seed", "x"], "whole number"),
        (&["--count", "0"], "from 1 to 1000"),
        (&["--axis", "supply"], "drive, load, both"),
        (&["--bus", "vcan0"], "can://IFACE"),
        (&["--lockstep", "--bus", "can://vcan0"], "embedded"),
        (&["--experiment", "nothing-of-this-name"], "scripts/run --list"),
        (&["--discrepancy", "/nowhere"], "no program"),
        (&["--hidden", "/nowhere"], "/nowhere"),
        (&["--hidden", "x", "--effects", "2"], "--effects"),
    ];
    for (arguments, hint) in wrong {
        find_effect(arguments).expect_code(2).expect_stderr(&[hint]);
    }
}

#[test]
fn what_was_named_is_held_against_the_seal() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = r#"{ "axis": "load", "element": null }"#;
    let named = |effect: &str, alternatives: &str| {
        format!(
            r#"{{ "verdict": "named", "named": [{{ "effect": "{effect}", "where": {place}, "parameters": [{{ "name":
            "leakage_nl_per_min", "value": 5.91234, "unit": "Nl/min", "standard_error": 0.0512 }}],
            "alternatives": [{alternatives}] }}], "not_excited": [] }}"#
        )
    };
    let other = format!(r#"{{ "effect": "piston-leakage", "where": {place}, "parameters": [] }}"#);
    let nothing = r#"{ "verdict": "nothing-missing", "named": [], "not_excited": [] }"#.to_owned();
    let skews = ["position", "force"].map(|element| {
        format!(r#"{{ "effect": "time-skew", "where": {{ "axis": "load", "element": "{element}" }}, "parameters": [] }}"#)
    });
    let many = [&skews[..], std::slice::from_ref(&other)].concat().join(", ");
    let cases = [
        (named("piston-leakage", ""), 0, "\n  right\n"),
        (named("valve-offset", &other), 0, "right, within the set"),
        (named("valve-offset", &many), 1, "wrong, it is one of too many"),
        (named("valve-offset", ""), 1, "\n  wrong\n"),
        (nothing, 1, "named: nothing (nothing-missing)"),
    ];
    let scene = Scene::new(SHORT);
    let experiment = scene.path("experiment.toml").display().to_string();
    let short = ["--experiment", &experiment, "--held-out", &experiment];
    for (place, (report, code, reported)) in cases.iter().enumerate() {
        let (out, program) = (folder.path().join(place.to_string()), stand_in(folder.path(), report));
        let out = out.to_str().expect("a path in ASCII");
        let options =
            ["--lockstep", "--seed", SEED, "--expect-right", "--discrepancy", &program, "--out", out];
        let ended = find_effect(&[&options[..], &short].concat()).expect_code(*code);
        let hidden = format!("hidden: {HIDDEN} (leakage_nl_per_min 5.89");
        ended.expect_stdout(&[*reported, &hidden]);
        if *code == 0 {
            assert!(ended.stdout.contains("(leakage_nl_per_min 5.912 +- 0.051 Nl/min)"), "{}", ended.stdout);
        }
        // What names the hidden terms lies where only the last step looks.
        let run = Path::new(out).join("seed-9/fitted/measured");
        assert!(run.join("measurement.csv").exists() && !run.join("truth.csv").exists());
    }
}

#[test]
fn a_term_from_a_file_is_hidden_and_held_against_what_is_named() {
    let (scene, folder) = (Scene::new(SHORT), tempfile::tempdir().expect("a folder"));
    let experiment = scene.path("experiment.toml").display().to_string();
    let term = "[[terms]]\nname = \"eddy-brake\"\nplace = \"drive.force\"\nadd = \"-(30[N s/m] + 160[N s/m^2]*x)*v\"\n";
    let hidden = scene.write("hidden.toml", term).display().to_string();
    let named = |name: &str| {
        format!(
            r#"{{ "verdict": "named", "named": [{{ "effect": "{name}", "where": {{ "axis": "drive", "element": null }} }}] }}"#
        )
    };
    for (name, code) in [("eddy-brake", 0), ("wind-drag", 1)] {
        let (program, out) = (stand_in(folder.path(), &named(name)), scene.path(name).display().to_string());
        let options =
            ["--lockstep", "--hidden", &hidden, "--suspects", &hidden, "--expect-right", "--out", &out];
        let more = ["--discrepancy", &program, "--experiment", &experiment, "--held-out", &experiment];
        let ended = find_effect(&[&options[..], &more].concat()).expect_code(code);
        ended.expect_stdout(&["hidden: eddy-brake at drive.force (-(30[N s/m] + 160[N s/m^2]*x)*v)"]);
    }
    // It acted in the runs measured, and only the last step may know.
    let truth = scene.path("eddy-brake").join("seed-1/hidden/truth-fitted-measured.csv");
    let truth = fs::read_to_string(truth).expect("what the rig knows");
    assert!(truth.lines().any(|line| line.contains("drive_force_declared_N")), "a column of the term");
}

#[test]
fn a_sealed_effect_is_found_over_the_bus_added_and_the_gap_shrinks() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("found");
    let out = out.to_str().expect("a path in ASCII");
    let ended = find_effect(&["--lockstep", "--seed", SEED, "--expect-right", "--out", out]).expect_code(0);
    // The rig itself is a column.
    ended.expect_stdout(&[&format!("named: {HIDDEN}"), " repeated |"]);
    let folder = Path::new(out).join("seed-9");
    // What names the hidden terms of the rig measured once more lies where only the last step looks.
    let repeated = folder.join("held-out/repeated");
    assert!(repeated.join("measurement.csv").exists() && !repeated.join("truth.csv").exists());
    for file in ["gap.html", "told.txt", "workflow/report.html", "workflow/rig.toml", "hidden/sealed.toml"] {
        assert!(folder.join(file).exists(), "{file}");
    }
    let rig = fs::read_to_string(folder.join("workflow/rig.toml")).expect("the extended rig");
    assert!(rig.contains("[effects.piston-leakage.load]"), "{rig}");
    let report = json(&folder.join("workflow/report.json"));
    let gap = &report["gap"]["load_pressure_a_Pa"];
    let number = |key: &str| gap[key].as_f64().unwrap_or_else(|| panic!("no {key} in {}", report["gap"]));
    assert!(number("before") > 1.3 * number("floor"), "{gap}");
    assert!(number("closed") > 0.8, "{gap}");
}
