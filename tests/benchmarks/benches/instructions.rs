//! Instructions of one period of 1 ms, counted by valgrind: a figure that no other process on the machine moves.
//!
//! `cargo install gungraun-runner --version 0.20.0 --root target/tools`, then
//! `PATH="$PWD/target/tools/bin:$PATH" cargo bench -p benchmarks --bench instructions`
//!
//! Both motions start in the middle of the recorded one; a thousand periods are counted together, so one period is the
//! figure over a thousand. With effects: all of them, every fourth, and a few alone; `plant/docs/effects-cost.md` has each.

#![allow(missing_docs, unused_qualifications)] // the macros below make items and paths of their own

use std::hint::black_box;

use gungraun::{library_benchmark, library_benchmark_group, main};
use plant::effects::SHEETS;
use plant::effects::sheet::Sheet;
use plant::{Inputs, Plant, RigParameters, Setup};

#[path = "../../../plant/tests/scenario/mod.rs"]
mod scenario;

use scenario::Kind;

/// A plant in the middle of a linked motion, and the commands that follow.
fn moving() -> (Plant, Vec<Inputs>) {
    moving_with(|_| false)
}

/// The same with effects on at all their places, at the geometric middle of their drawn ranges.
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

/// Every fourth effect of the catalogue: some of each room.
fn moving_with_ten() -> (Plant, Vec<Inputs>) {
    moving_with(|sheet| SHEETS.iter().step_by(4).any(|fourth| fourth.name == sheet.name))
}

fn resting() -> (Plant, Vec<Inputs>) {
    let rig = RigParameters::baseline();
    let plant = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("a good setup");
    (plant, vec![Inputs::default(); 1000])
}

#[library_benchmark]
#[bench::moving_linked(moving())]
#[bench::resting_linked(resting())]
#[bench::inclination(moving_with_one("inclination"))]
#[bench::line_resistance(moving_with_one("line-resistance"))]
#[bench::presliding(moving_with_one("presliding"))]
#[bench::ten_effects(moving_with_ten())]
#[bench::all_effects(moving_with(|_| true))]
fn a_thousand_periods((mut plant, inputs): (Plant, Vec<Inputs>)) -> Plant {
    inputs.iter().for_each(|inputs| plant.step(black_box(inputs)));
    plant
}

library_benchmark_group!(name = period; benchmarks = a_thousand_periods);
main!(library_benchmark_groups = period);
