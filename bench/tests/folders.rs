//! The program on folders of runs that were put together: what a user sees of summary, compare, spread and check.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const EXPERIMENT: &str = r#"
title = "load-step"
about = "A step of 200 N."
[drive]
program = "position-p"
[load]
program = "force-p"
[passed]
force_settling_s = { least = 0.05, most = 0.13 }
frames_lost = 0
"#;

/// Text and exit code of the program.
fn bench(arguments: &[&Path]) -> (String, i32) {
    let output = Command::new(env!("CARGO_BIN_EXE_bench")).args(arguments).output().unwrap();
    let text =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat();
    (text, output.status.code().unwrap())
}

/// A run whose load follows a step of 200 N at 1 s with this time constant, by a process for each axis.
fn run(parent: &Path, name: &str, experiment: &str, time_constant_s: f64) -> PathBuf {
    let folder = parent.join(name);
    fs::create_dir(&folder).unwrap();
    let write = |file: &str, text: String| fs::write(folder.join(file), text).unwrap();
    write("run.json", serde_json::json!({ "pace": "lockstep", "experiment_toml": experiment }).to_string());
    write("summary.json", r#"{ "passed": true, "frames_lost_at_rig": 0, "cycles": 2000 }"#.into());
    for axis in ["drive", "load"] {
        let reported = serde_json::json!({ "ended_well": true, "axes": { axis: { "sensors_lost": 0 } } });
        write(&format!("controller-{axis}.json"), reported.to_string());
    }
    let head = "time_s,main_chain,set_position_m,set_force_N,position_m,moving\n";
    let (mut drive, mut load) = (head.to_owned(), head.to_owned());
    let mut measured = "time_s,drive_valve,drive_position_m,load_valve,load_force_N\n".to_owned();
    for ms in 0..2000_u32 {
        let time_s = f64::from(ms) * 1e-3;
        let state = if ms < 500 { "settling" } else { "experiment" };
        let wanted_n = if ms < 1000 { 100.0 } else { 300.0 };
        let force_n = 300.0 - 200.0 * (-(time_s - 1.0).max(0.0) / time_constant_s).exp();
        writeln!(drive, "{time_s:.3},{state},0.25,,0.2501,0").unwrap();
        writeln!(load, "{time_s:.3},{state},,{wanted_n},0.25,0").unwrap();
        writeln!(measured, "{time_s:.3},0.0,0.2501,0.1,{force_n}").unwrap();
    }
    write("controller-drive.csv", drive);
    write("controller-load.csv", load);
    write("measurement.csv", measured);
    folder
}

#[test]
fn a_run_is_summed_up_judged_and_drawn() {
    let parent = tempfile::tempdir().unwrap();
    let good = run(parent.path(), "good", EXPERIMENT, 0.03);
    let (text, code) = bench(&[Path::new("summary"), &good]);
    assert!(code == 0 && text.contains("from 0.05 to 0.13, is 0.09") && text.contains("step.svg"), "{text}");
    let summary: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(good.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["figures"]["force_aperiodic"], 1.0);
    assert!((summary["position_error_static_m"].as_f64().unwrap() - 1e-4).abs() < 1e-12);
    assert!(fs::read_to_string(good.join("step.svg")).unwrap().contains("A step of 200 N."));
    let slow = run(parent.path(), "slow", EXPERIMENT, 0.06);
    let (text, code) = bench(&[Path::new("summary"), &slow]);
    assert!(code == 1 && text.contains("BROKEN"), "{text}");
}

#[test]
fn runs_of_one_experiment_are_compared_and_others_refused() {
    let parent = tempfile::tempdir().unwrap();
    let one = run(parent.path(), "one", EXPERIMENT, 0.03);
    let two = run(parent.path(), "two", &EXPERIMENT.replace("force-p", "force-pid-map"), 0.015);
    let other =
        run(parent.path(), "other", &EXPERIMENT.replace("[load]", "[load]\ninitial_force_n = 50.0"), 0.03);
    let page = parent.path().join("pages/both.html");
    let (text, code) = bench(&[Path::new("compare"), &one, &two, Path::new("--out"), &page]);
    assert!(code == 0 && text.contains("force settling") && text.contains("-50"), "{text}");
    let html = fs::read_to_string(&page).unwrap();
    assert!(html.contains("force-pid-map") && html.matches("<svg").count() == 2);
    let (text, code) = bench(&[Path::new("compare"), &one, &other]);
    assert!(code == 2 && text.contains("--anyway"), "{text}");
    let (_, code) = bench(&[Path::new("compare"), &one, &other, Path::new("--anyway")]);
    assert_eq!(code, 0);
    let (_, code) = bench(&[Path::new("compare"), &one]);
    assert_eq!(code, 2, "one run is nothing to compare");
}

#[test]
fn repetitions_have_a_spread() {
    let parent = tempfile::tempdir().unwrap();
    let runs =
        [("a", 0.03), ("b", 0.03), ("c", 0.03)].map(|(name, s)| run(parent.path(), name, EXPERIMENT, s));
    let out = parent.path().join("out");
    let (text, code) = bench(&[Path::new("spread"), &runs[0], &runs[1], &runs[2], Path::new("--out"), &out]);
    assert!(code == 0 && text.contains("standard deviation"), "{text}");
    let reported: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join("spread.json")).unwrap()).unwrap();
    assert_eq!(reported["figures"]["force_settling_s"]["n"], 3);
    assert_eq!(reported["figures"]["force_settling_s"]["standard_deviation"], 0.0);
}

#[test]
fn a_misspelt_bound_is_found_before_a_run() {
    let parent = tempfile::tempdir().unwrap();
    let file = parent.path().join("e.toml");
    for (name, code, hint) in [("force_settling_s", 0, ""), ("force_setling_s", 2, "no such figure")] {
        fs::write(&file, EXPERIMENT.replace("force_settling_s", name)).unwrap();
        let (text, ended) = bench(&[Path::new("check-experiment"), &file]);
        assert!(ended == code && text.contains(hint), "{text}");
    }
    let (text, code) = bench(&[Path::new("figures")]);
    assert!(code == 0 && text.contains("force_settling_s"));
}
