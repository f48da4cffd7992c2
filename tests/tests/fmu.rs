//! The plant as an FMU, in unmodified FMPy: valid, and the same numbers as a rehearsal and as the plant itself.

use plant::{Inputs, Plant, RigParameters, Setup, quantise_valve};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use system_tests::foreign_python::run_script;
use system_tests::{CompletedProcess, Program, Running, SHORT, Scene, Table, same};

/// Largest difference that is none: the numbers go through a CSV with all their digits.
const TOLERANCE: f64 = 1e-9;

fn export(rig: &Path, out: &Path, options: &[&str]) -> CompletedProcess {
    let mut bench = Program::Bench.command();
    bench.arg("export-fmu").arg("--rig").arg(rig).arg("--out").arg(out);
    Running::start("bench export-fmu", bench.args(options)).wait()
}

fn exported(scene: &Scene, rig: &Path) -> PathBuf {
    let fmu = scene.path("plant.fmu");
    export(rig, &fmu, &[]).expect_code(0);
    fmu
}

/// Simulates in FMPy: inputs hold from each row's time on. Returns the outputs and what the FMU's logger said.
fn simulate(scene: &Scene, fmu: &Path, inputs: &str, starts: &[&str]) -> (Table, String) {
    let (table, out) = (scene.write("inputs.csv", inputs), scene.path("outputs.csv"));
    let paths = [fmu, &table, &out].map(|path| path.to_str().expect("UTF-8"));
    let reported = run_script("simulate_fmu.py", &[&paths[..], starts].concat());
    (Table::read(&out), reported)
}

#[track_caller]
fn expect_close(name: &str, cycle: usize, output: f64, expected: f64) {
    let most = TOLERANCE * expected.abs().max(1.0);
    assert!((output - expected).abs() <= most, "{name} in cycle {cycle}: {output} instead of {expected}");
}

#[test]
fn the_fmu_under_the_commands_of_a_rehearsal_gives_its_measurement_and_its_truth() {
    let scene = Scene::new(SHORT);
    scene.rehearsal().start().wait().expect_code(0);
    let measured = Table::read(&scene.path("controller/measurement.csv"));
    let truth = Table::read(&scene.path("controller/truth.csv"));
    let valves = [measured.column("drive_valve"), measured.column("load_valve")];
    assert!(valves[0].iter().any(|valve| *valve != 0.0));
    // What acts in a cycle was set in the one before.
    let mut inputs = String::from("time,drive_valve,load_valve\n");
    for cycle in 0..measured.len() - 1 {
        inputs += &format!("{},{},{}\n", cycle as f64 * 1e-3, valves[0][cycle + 1], valves[1][cycle + 1]);
    }
    let fmu = exported(&scene, &scene.path("rig.toml"));
    let (outputs, reported) = simulate(&scene, &fmu, &inputs, &[]);
    assert_eq!(reported.trim(), "");
    assert_eq!(outputs.len(), measured.len());
    let seen = ["position_m", "force_N", "pressure_a_Pa", "pressure_b_Pa"];
    for axis in ["drive", "load"] {
        for column in seen {
            let (quantity, unit) = column.rsplit_once('_').expect("a unit");
            let name = format!("{axis}_{quantity}_measured_{unit}");
            let rows = outputs.column(&name).into_iter().zip(measured.column(&format!("{axis}_{column}")));
            rows.enumerate()
                .for_each(|(cycle, (output, expected))| expect_close(&name, cycle, output, expected));
        }
    }
    for name in truth.names().iter().filter(|name| *name != "time_s") {
        let rows = outputs.column(name).into_iter().zip(truth.column(name));
        rows.enumerate().for_each(|(cycle, (output, expected))| expect_close(name, cycle, output, expected));
    }
}

/// Valves, hands, a stop and its release, linked rods, weights, a switched-on effect and another supply.
#[test]
fn the_fmu_of_a_rig_with_effects_gives_what_the_plant_gives() {
    const CYCLES: usize = 800;
    let scene = Scene::new(SHORT);
    let rig_toml = fs::read_to_string(scene.path("rig.toml")).expect("the rig file");
    let rig_toml = format!(
        "{rig_toml}\n[effects.piston-leakage.drive]\nleakage_nl_per_min = 5\n[effects.stribeck-friction.load]\nvelocity_mm_per_s = 10\n"
    );
    let rig_file = scene.write("effects.toml", &rig_toml);
    let rig = RigParameters::from_toml(&rig_toml, "effects.toml")
        .and_then(|rig| rig.with("supply.pressure_bar", &[6.0]));
    let rig = rig.expect("a good rig");
    let setup = Setup { carriage_position_m: 0.2, linked: true, added_mass_kg: 2.5 };
    let mut plant = Plant::new(&rig, &setup).expect("a good set-up");

    let asked = |cycle: usize| {
        let phase = cycle as f64 * 0.02;
        let valve = [0.6 * phase.sin(), 0.3 * (1.7 * phase).cos()];
        let hand_n = if (200..300).contains(&cycle) { 40.0 } else { 0.0 };
        (valve, hand_n, (400..500).contains(&cycle))
    };
    let mut inputs = String::from(
        "time,drive_valve,load_valve,hand_force_carriage_N,hand_force_load_N,emergency_stop,link\n",
    );
    for cycle in 0..CYCLES {
        let ([drive, load], hand_n, stop) = asked(cycle);
        inputs +=
            &format!("{},{drive},{load},{hand_n},{},{},1\n", cycle as f64 * 1e-3, -hand_n, u8::from(stop));
    }
    let fmu = exported(&scene, &rig_file);
    let starts = ["carriage_position_m=0.2", "added_mass_kg=2.5", "supply.pressure_bar=6.0"];
    let (outputs, reported) = simulate(&scene, &fmu, &inputs, &starts);
    assert_eq!(reported.trim(), "");
    assert_eq!(outputs.len(), CYCLES + 1);

    let names = [plant::Truth::COLUMNS.map(str::to_owned).to_vec(), plant.term_names()].concat();
    assert!(names.len() > plant::Truth::COLUMNS.len() + 1, "both effects have terms");
    let columns: Vec<_> = names.iter().map(|name| outputs.column(name)).collect();
    let mut acting = [0.0; 2];
    let mut moved = 0.0_f64;
    for cycle in 0..CYCLES {
        let (valve, hand_n, stop) = asked(cycle);
        // FMPy reads outputs before it sets the inputs of the same time: hands are those of the step before.
        let before_n = if cycle == 0 { asked(0).1 } else { asked(cycle - 1).1 };
        let hands =
            |hand_n: f64| Inputs { valve: acting, hand_force_carriage_n: hand_n, hand_force_load_n: -hand_n };
        let (truth, terms) = (plant.truth(&hands(before_n)), plant.terms(&hands(before_n)));
        let expected = truth.values().into_iter().chain(terms.values().iter().copied());
        for ((name, column), expected) in names.iter().zip(&columns).zip(expected) {
            expect_close(name, cycle, column[cycle], expected);
        }
        if stop {
            plant.trip_emergency_stop()
        } else {
            plant.release_emergency_stop()
        }
        plant.step(&hands(hand_n));
        acting = valve.map(quantise_valve);
        moved = moved.max((truth.axes[0].position_m - 0.2).abs());
    }
    assert!(moved > 0.01, "the carriage moved by {moved} m");
}

#[test]
fn states_and_resets_repeat_to_the_bit_and_refusals_reach_the_importers_log() {
    let scene = Scene::new(SHORT);
    let fmu = exported(&scene, &scene.path("rig.toml"));
    let reported: Value = serde_json::from_str(&run_script("fmu_by_hand.py", &[&fmu])).expect("JSON");
    assert_eq!(reported["first"], reported["anew"], "after a reset");
    assert_eq!(reported["on"], reported["again"], "from a state that was kept");
    assert_eq!(reported["on"], reported["after"], "refusals change nothing");
    assert_ne!(reported["first"], reported["on"]);
    for (what, words) in [
        ("half_step", "whole milliseconds"),
        ("beyond", "drive_valve = 1.5: allowed are -1 to 1"),
        ("fixed", "cannot be set after the initialisation"),
        ("other_guid", "put together from two builds"),
    ] {
        assert!(!reported[what]["error"].is_null(), "{what} was taken");
        let said = reported[what]["log"].to_string();
        assert!(said.contains(words), "{what}: {said}");
    }
}

#[test]
fn the_same_rig_gives_the_same_file_and_what_is_none_is_refused() {
    let scene = Scene::new(SHORT);
    let [one, other] = ["one.fmu", "other.fmu"].map(|name| scene.path(name));
    for out in [&one, &other] {
        export(&scene.path("rig.toml"), out, &[]).expect_code(0);
    }
    assert!(same(&one, &other));
    let bad = scene.rig_with("bad.toml", "pressure_bar = 7.0", "pressure_bar = 70");
    let out = scene.path("bad.fmu");
    export(&bad, &out, &[]).expect_code(2).expect_stderr(&["bad.toml:", "pressure_bar = 70 is out of range"]);
    assert!(!out.exists());
    let none = scene.path("none.so");
    let said =
        export(&scene.path("rig.toml"), &out, &["--library", none.to_str().expect("UTF-8")]).expect_code(2);
    said.expect_stderr(&["none.so"]);
}
