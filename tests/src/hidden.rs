//! Effects for whole-system tests: every one, some drawn, at the ends of their ranges; and an experiment in which each has
//! work to do.

use crate::launch::{Pace, run_both};
use crate::records::{Table, count, json};
use crate::scene::Scene;
use plant::Truth;
use plant::effects::SHEETS;
use plant::effects::draw::{AxisSelection, as_toml, draw};
use plant::effects::sheet::{ActiveEffect, EffectKey, Sheet};
use std::path::{Path, PathBuf};

const PERIOD_NS: f64 = 1e6;

/// Both axes linked and on their way together, then each for itself: to and fro, for `--repeat`. Nothing is judged.
pub const LIVELY: &str = include_str!("../scenes/lively.toml");

/// Which end of its range each number has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extreme {
    /// Each the largest that a file may hold.
    Most,
    Least,
    /// Now this, now that, from key to key and place to place.
    Mixed,
    /// The largest that is drawn: far, but of this world.
    Drawn,
}

/// Every effect at each of its places, at the end of its range.
pub fn everything(extreme: Extreme) -> Vec<ActiveEffect> {
    let mut turn = false;
    let mut number = |key: &EffectKey| {
        turn = !turn;
        match extreme {
            Extreme::Most => key.max,
            Extreme::Least => key.min,
            Extreme::Mixed if turn => key.max,
            Extreme::Mixed => key.min,
            Extreme::Drawn => key.drawn[1],
        }
    };
    let mut effects = Vec::new();
    for sheet in SHEETS {
        for place in sheet.place.places() {
            let numbers = sheet.keys.iter().map(&mut number).collect();
            effects.push(ActiveEffect { name: sheet.name, place: *place, numbers });
        }
    }
    effects
}

/// Each effect once: at the largest number that is drawn of its amplitude, its other keys at their defaults.
pub fn each_alone() -> Vec<ActiveEffect> {
    let alone = |sheet: &Sheet| ActiveEffect {
        name: sheet.name,
        place: sheet.place.places()[0],
        numbers: sheet
            .keys
            .iter()
            .enumerate()
            .map(|(i, key)| key.default.filter(|_| i > 0).unwrap_or(key.drawn[1]))
            .collect(),
    };
    SHEETS.iter().map(alone).collect()
}

/// So many different effects, drawn from this seed.
pub fn drawn(seed: u64, count: usize) -> Vec<ActiveEffect> {
    draw(seed, count, AxisSelection::Both).expect("the catalogue has so many")
}

/// The shipped rig file with these effects, as `rig-effects.toml` of the scene.
pub fn rig_with(scene: &Scene, effects: &[ActiveEffect]) -> PathBuf {
    let rig = std::fs::read_to_string(scene.path("rig.toml")).expect("the rig file is there");
    scene.write("rig-effects.toml", &format!("{rig}\n{}", as_toml(effects)))
}

/// What a run of both programs in real time showed of the rig's loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopTiming {
    pub cycles: u64,
    /// Cycles computed late and not sent.
    pub missed: u64,
    /// Cycles whose own work, without the time that another thread had the CPU, was longer than the period.
    pub overworked: u64,
    /// Median and 99th percentile of the stage that computes: the step of the plant, its truth and its terms.
    pub step_ns: [u64; 2],
    /// The same of the stage that samples the sensors and sends.
    pub send_ns: [u64; 2],
    pub execution_ns: [u64; 2],
}

/// Runs emulator and controllers in real time with these effects; the run lies in the folder `run` of the scene.
pub fn live(scene: &Scene, effects: &[ActiveEffect], seconds: u32) -> LoopTiming {
    let rig = rig_with(scene, effects);
    let folder = scene.path("run");
    let options = format!("--seconds {seconds} --full-timing --no-flight");
    run_both(
        &scene.emulator(Pace::Real).rig(&rig).out(&folder).with(&options),
        &scene.controller(Pace::Real).out(&folder).with("--repeat"),
    );
    let summary = json(&folder.join("summary.json"));
    let percentiles = |stage: &str| ["p50", "p99"].map(|of| count(&summary, &format!("/{stage}/{of}")));
    let rows = Table::read(&folder.join("emulator-timing.csv"));
    let [woke, done, others] = ["woke_ns", "done_ns", "run_delay_ns"].map(|column| rows.column(column));
    // The first second touches memory for the first time.
    let work_ns = (1000..rows.len()).map(|row| done[row] - woke[row] - others[row]);
    LoopTiming {
        cycles: count(&summary, "/cycles"),
        missed: count(&summary, "/skipped"),
        overworked: work_ns.filter(|ns| *ns > PERIOD_NS).count() as u64,
        step_ns: percentiles("step_ns"),
        send_ns: percentiles("send_ns"),
        execution_ns: percentiles("execution_ns"),
    }
}

/// Holds that everything in a truth.csv is finite and every pressure positive, from the first row to the last.
pub fn expect_physical(truth: &Path) {
    let table = Table::read(truth);
    assert!(table.len() > 100, "{}: {} rows", truth.display(), table.len());
    for name in table.names() {
        // Terms may have either sign; states that are pressures may not, and those are the truth's own columns.
        let pressure = Truth::COLUMNS.contains(&name.as_str()) && name.contains("_pressure_");
        for (row, value) in table.column(name).iter().enumerate() {
            let good = value.is_finite() && (!pressure || *value > 0.0);
            assert!(good, "{}: {name} = {value} in row {row}", truth.display());
        }
    }
}
