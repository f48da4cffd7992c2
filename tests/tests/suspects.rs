//! A suspect written by hand, in no catalogue: hidden in the rig, named from records of the bus, written into the rig file, and
//! run by the emulator in real time.

use plant::RigParameters;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use system_tests::discrepancy::{discrepancy, rig};
use system_tests::{Build, Pace, Scene, count, json, run_both, turn};

/// An eddy brake on the carriage that grows along the stroke.
const HIDDEN: &str = include_str!("../scenes/terms/hidden.toml");

const SUSPECTS: &str = include_str!("../scenes/terms/suspects.toml");

/// Some 7 s of strokes over most of the way, at several speeds, and rests.
fn strokes(to_m: [f64; 2], duration_s: [f64; 3]) -> String {
    let [one, two] = to_m;
    let laws: Vec<String> = duration_s
        .iter()
        .flat_map(|duration_s| {
            [one, two].map(|to_m| {
                format!("    {{ law = \"bestehorn\", to_m = {to_m}, duration_s = {duration_s} }},\n")
            })
        })
        .collect();
    format!(
        "title = \"strokes\"\n[rig]\ncarriage_position_m = 0.1\n[run]\nsettling_s = 0.2\n[drive]\n\
         program = \"program.toml\"\nstart_m = 0.1\nset-point = [\n{}]\n",
        laws.concat()
    )
}

/// A record of the drive with a rig in lockstep.
fn measured(scene: &Scene, rig: &Path, name: &str, experiment: &str) -> PathBuf {
    let (out, file) = (scene.path(name), scene.write(&format!("{name}.toml"), experiment));
    let emulator = scene.emulator(Pace::Lockstep).rig(rig).experiment(&file).out(&out).with("--seed 5");
    let controller =
        scene.controller(Pace::Lockstep).experiment(&file).out(&scene.path(&format!("{name}-c")));
    run_both(&emulator, &controller);
    out.join("measurement.csv")
}

#[test]
fn a_suspect_in_a_file_is_named_over_the_bus_and_runs_in_real_time_in_the_extended_rig() {
    let scene = Scene::new(&strokes([0.4, 0.1], [0.8, 1.2, 0.6]));
    let hidden = scene.write("hidden.toml", &format!("{}{HIDDEN}", RigParameters::BASELINE_TOML));
    let train = measured(&scene, &hidden, "train", &strokes([0.4, 0.1], [0.8, 1.2, 0.6]));
    let test = measured(&scene, &hidden, "test", &strokes([0.35, 0.15], [0.7, 1.0, 0.5]));
    let (suspects, out) = (scene.write("suspects.toml", SUSPECTS), scene.path("closed"));
    let records: [&dyn AsRef<OsStr>; 4] = [&"--train", &train, &"--test", &test];
    let close: [&dyn AsRef<OsStr>; 7] =
        [&"close", &"--rig", &rig(), &"--suspects", &suspects, &"--out", &out];
    let printed = discrepancy(&[&close[..], &records].concat()).expect_code(0).stdout;
    let report = json(&out.join("report.json"));
    let named = &report["named"][0];
    assert_eq!(named["effect"], "eddy-brake", "{printed}");
    assert_eq!(report["verification"]["confirmed"], true, "{printed}");
    for (at, value) in [(0, 30.0), (1, 160.0)] {
        let number = &named["parameters"][at];
        let (found, error) = (number["value"].as_f64().unwrap(), number["standard_error"].as_f64().unwrap());
        assert!((found - value).abs() < 4.0 * error + 0.1 * value, "{number}");
    }

    // The extended rig file holds the term, and the emulator runs it with time, without an allocation.
    let extended = out.join("rig.toml");
    let term = &RigParameters::from_toml(&std::fs::read_to_string(&extended).unwrap(), "rig.toml").unwrap();
    assert_eq!(term.terms()[0].add, "-(c0 + c1*x)*v");
    let _machine = turn::take();
    let emulator = scene.emulator(Pace::Real).rig(&extended).build(Build::CountingAllocations);
    run_both(&emulator, &scene.controller(Pace::Real));
    let truth = scene.truth();
    let [brake, velocity] =
        ["drive_force_declared_N", "drive_rod_velocity_m_per_s"].map(|name| truth.column(name));
    let most = brake.iter().zip(&velocity).map(|(force, speed)| force * speed).fold(0.0, f64::min);
    assert!(most < -1.0, "the brake takes power: {most} W");
    let summary = scene.summary();
    assert!(count(&summary, "/cycles") > 1000);
    assert_eq!(scene.run_description()["counts_allocations"], true);
    assert_eq!(count(&summary, "/allocations_in_cycle"), 0);
}
