//! The paper's rig was faster than its simulation right after a step. With the emulator as the rig, over the bus: what does that,
//! and what the workflow says of the record. The whole table is in `discrepancy/docs/faster-after-a-step.md`.

use plant::RigParameters;
use std::path::Path;
use system_tests::discrepancy::{discrepancy, rig};
use system_tests::{Pace, SHORT, Scene, json, workspace};

/// Periods after the valve's edge that are compared: the valve stays at its limit.
const COMPARED: usize = 50;
/// Jump of the command that is an edge.
const EDGE: f64 = 0.3;

/// A step over the bus, with this rig in the emulator and a controller that knows the shipped one.
struct Step {
    scene: Scene,
    /// Change of velocity, m/s, and of both pressures, Pa, after the edge.
    changes: [f64; 3],
}

fn step(rig: &str) -> Step {
    let scene = Scene::new(SHORT);
    let experiment = workspace().join("controller/experiments/step.toml");
    let rig = scene.write("measured.toml", rig);
    let emulator =
        scene.emulator(Pace::Lockstep).experiment(&experiment).rig(&rig).with("--seconds 5.5").start();
    let controller = scene.controller(Pace::Lockstep).experiment(&experiment).start();
    // Whether the step passes is not asked: what is missing may well spoil it.
    controller.wait();
    emulator.wait();
    let truth = scene.truth();
    let valve = scene.measurement().column("drive_valve");
    let edge = (1..valve.len()).find(|at| valve[*at] - valve[at - 1] > EDGE).expect("an edge of the valve");
    let changes = ["drive_rod_velocity_m_per_s", "drive_pressure_a_Pa", "drive_pressure_b_Pa"].map(|name| {
        let column = truth.column(name);
        column[edge + COMPARED] - column[edge]
    });
    Step { scene, changes }
}

fn closed(measured: &Path, out: &Path) -> serde_json::Value {
    discrepancy(&[&"close", &"--rig", &rig(), &"--train", &measured, &"--out", &out]).expect_code(0);
    json(&out.join("report.json"))
}

#[test]
fn what_makes_the_rig_faster_after_a_step_is_named_from_that_step() {
    let plain = RigParameters::BASELINE_TOML;
    let baseline = step(plain).changes;
    let with = |effect: &str| format!("{plain}\n{effect}\n");
    let cases = [
        (with("[effects.heat-exchange.drive]\ncoefficient_w_per_m2_k = 20.0"), "heat-exchange", 20.0),
        (with("[effects.dead-volume.drive]\nvolume_cm3 = 12.0"), "dead-volume", 12.0),
        (
            with("[effects.critical-pressure-ratio.drive]\ncritical_ratio = 0.6"),
            "critical-pressure-ratio",
            0.6,
        ),
        (plain.replacen("pressure_bar = 7.0", "pressure_bar = 7.4", 1), "parameter:supply-pressure", 7.4),
    ];
    for (text, name, number) in cases {
        let Step { scene, changes } = step(&text);
        // Outwards: v and p_a rise.
        for (change, plain) in changes.iter().zip(baseline).take(2) {
            assert!(*change > plain && plain > 0.0, "{name}: {changes:?}, without it {baseline:?}");
        }
        let report = closed(&scene.path("emulator/measurement.csv"), &scene.path("closed"));
        let named = report["named"].as_array().expect("a list");
        let estimate = match name.strip_prefix("parameter:") {
            Some(_) => {
                assert!(named.is_empty(), "{name}: {}", report["summary"]);
                let all = report["parameters"].as_array().expect("a list");
                all.iter()
                    .find(|parameter| parameter["name"] == name)
                    .unwrap_or_else(|| panic!("{}", report["summary"]))
            }
            None => {
                assert!(named.len() == 1 && named[0]["effect"] == name, "{name}: {}", report["summary"]);
                &named[0]["parameters"][0]
            }
        };
        let [value, error] = ["value", "standard_error"].map(|key| estimate[key].as_f64().expect("a number"));
        let more: [f64; 3] = std::array::from_fn(|at| changes[at] - baseline[at]);
        eprintln!("{name}: {more:?} m/s, Pa, Pa more than without; {value} +- {error}");
        assert!((value - number).abs() < 4.0 * error + 0.01 * number, "{name}: {value} +- {error}");
    }
}
