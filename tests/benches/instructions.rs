//! Instructions of one period of 1 ms, counted by valgrind: a figure that no other process on the machine moves.
//!
//! `cargo install gungraun-runner --version 0.20.0 --root target/tools`, then
//! `PATH="$PWD/target/tools/bin:$PATH" cargo bench -p system-tests --bench instructions`
//!
//! Both motions start in the middle of the recorded one; a thousand periods are counted together, so one period is the
//! figure over a thousand.

#![allow(missing_docs, unused_qualifications)] // the macros below make items and paths of their own

use std::hint::black_box;

use gungraun::{library_benchmark, library_benchmark_group, main};
use plant::{Inputs, Plant, RigParameters, Setup};

#[path = "../../plant/tests/scenario/mod.rs"]
mod scenario;

use scenario::Kind;

/// A plant in the middle of a linked motion, and the commands that follow.
fn moving() -> (Plant, Vec<Inputs>) {
    let rig = RigParameters::baseline();
    let kind = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    let record = scenario::record(&rig, kind, 3000);
    let plant = Plant::in_state(&rig, &record.states[2000]).expect("a recorded state");
    (plant, record.inputs[2000..].to_vec())
}

/// A plant at rest.
fn resting() -> (Plant, Vec<Inputs>) {
    let rig = RigParameters::baseline();
    let plant = Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("a good setup");
    (plant, vec![Inputs::default(); 1000])
}

#[library_benchmark]
#[bench::moving_linked(moving())]
#[bench::resting_linked(resting())]
fn a_thousand_periods((mut plant, inputs): (Plant, Vec<Inputs>)) -> Plant {
    inputs.iter().for_each(|inputs| plant.step(black_box(inputs)));
    plant
}

library_benchmark_group!(name = period; benchmarks = a_thousand_periods);
main!(library_benchmark_groups = period);
