//! Instructions of one period of 1 ms, counted by valgrind: a figure that no other process on the machine moves.
//!
//! `cargo bench -p benchmarks --bench instructions [-- CASE]` starts itself under `valgrind --tool=callgrind` for each case, and
//! callgrind counts inside one function.
//!
//! Both motions start in the middle of the recorded one; a thousand periods are counted together, so one period is the
//! figure over a thousand. With effects: all of them, every fourth, and a few alone; `plant/docs/effects-cost.md` has each.

#![allow(clippy::print_stdout, reason = "the figures are its output")]

use std::hint::black_box;
use std::process::Command;

use plant::effects::SHEETS;
use plant::effects::sheet::Sheet;
use plant::{Inputs, Plant, RigParameters, Setup};

#[path = "../../../plant/tests/scenario/mod.rs"]
mod scenario;

use scenario::Kind;

/// A plant in the middle of a linked motion, and the commands that follow; effects are on at all their places, at the geometric
/// middle of their drawn ranges.
fn moving_with(on: impl Fn(&Sheet) -> bool) -> (Plant, Vec<Inputs>) {
    let baseline = RigParameters::baseline();
    let kind = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    let record = scenario::record(&baseline, kind, 3000);
    let mut rig = baseline;
    for sheet in SHEETS.iter().filter(|sheet| on(sheet)) {
        let middle = |drawn: [f64; 2]| (drawn[0] * drawn[1]).sqrt();
        let numbers: Vec<(&str, f64)> = sheet.keys.iter().map(|key| (key.name, middle(key.drawn))).collect();
        for place in sheet.place.names() {
            rig = rig.with_effect(sheet.name, &place, &numbers).expect("the middle is allowed");
        }
    }
    let plant = Plant::in_state(&rig, &record.states[2000]).expect("a recorded state");
    (plant, record.inputs[2000..].to_vec())
}

fn moving_with_one(name: &str) -> (Plant, Vec<Inputs>) {
    moving_with(|sheet| sheet.name == name)
}

fn resting() -> (Plant, Vec<Inputs>) {
    let rig = RigParameters::baseline();
    let plant = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("a good setup");
    (plant, vec![Inputs::default(); 1000])
}

type Case = (&'static str, fn() -> (Plant, Vec<Inputs>));

const CASES: [Case; 7] = [
    ("moving_linked", || moving_with(|_| false)),
    ("resting_linked", resting),
    ("inclination", || moving_with_one("inclination")),
    ("line_resistance", || moving_with_one("line-resistance")),
    ("presliding", || moving_with_one("presliding")),
    // Every fourth effect of the catalogue: some of each room.
    ("ten_effects", || moving_with(|sheet| SHEETS.iter().step_by(4).any(|fourth| fourth.name == sheet.name))),
    ("all_effects", || moving_with(|_| true)),
];

/// Which case the process under callgrind runs.
const COUNTED: &str = "AIRBENCH_COUNTED_CASE";

/// What is counted; never inlined, so that callgrind finds it by its name.
#[inline(never)]
fn a_thousand_periods(plant: &mut Plant, inputs: &[Inputs]) {
    inputs.iter().for_each(|inputs| plant.step(black_box(inputs)));
}

/// Instructions of a case, counted in a process of its own.
fn count(name: &str) -> u64 {
    let executable = std::env::current_exe().expect("the path of this executable");
    let counted = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*a_thousand_periods*"])
        .arg(executable)
        .env(COUNTED, name)
        .output()
        .expect("valgrind is installed");
    let report = String::from_utf8_lossy(&counted.stderr);
    let collected = report.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok());
    collected
        .filter(|count| *count > 0)
        .unwrap_or_else(|| panic!("callgrind counted nothing for {name}:\n{report}"))
}

fn main() {
    if let Ok(name) = std::env::var(COUNTED) {
        let (_, set_up) = CASES.iter().find(|case| case.0 == name).expect("a case");
        let (mut plant, inputs) = set_up();
        a_thousand_periods(&mut plant, &inputs);
        black_box(plant);
        return;
    }
    // cargo adds --bench.
    let chosen = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    for (name, _) in CASES.iter().filter(|case| case.0.contains(&chosen)) {
        println!("{name}: {} instructions in 1000 periods of 1 ms", count(name));
    }
}
