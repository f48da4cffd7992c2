//! One period of 1 ms of both axes, linked and moving, and the same scheme in plain C as its floor.
//!
//! `cargo bench -p benchmarks --bench period`
//!
//! The motion is the recorded one of plant's tests of accuracy: set-points under load steps, with rests, sticking and
//! contact. Before anything is timed, both codes run the whole record and must stay together to 1e-9: only then is it
//! the same scheme. Divan gives the distribution over
//! samples of 50 periods; the lines after it compare the best of alternating passes, which is what
//! noise from the machine touches least. The code is that which ships: plain x86-64, the release profile.
//!
//! A batch of n rigs shares the record out: each begins at another place of it and makes an n-th, so that a pass of a batch is
//! the same 6 s as a pass of one plant, corners and all, but no two corners coincide. That each ends where its neighbour began,
//! to the bit, is checked before anything is timed.

#![allow(clippy::print_stdout)] // a benchmark prints

use std::hint::black_box;
use std::time::Instant;

use benchmarks::{Floor, FloorAxis};
use divan::Bencher;
use plant::{Batch, Inputs, Plant, Registers, RigParameters};

#[path = "../../../plant/tests/scenario/mod.rs"]
mod scenario;

use scenario::{Kind, Scenario};

fn motion() -> (RigParameters, Scenario) {
    let rig = RigParameters::baseline();
    let kind = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    let scenario = scenario::record(&rig, kind, 6000);
    (rig, scenario)
}

fn start(rig: &RigParameters, scenario: &Scenario) -> (Plant, Floor) {
    let plant = Plant::in_state(rig, &scenario.states[0]).expect("a recorded state");
    let floor = Floor::new(rig, &scenario.states[0].axes);
    (plant, floor)
}

#[divan::bench(sample_count = 600, sample_size = 50)]
fn plant_period(bencher: Bencher) {
    let (rig, scenario) = motion();
    let (fresh, _) = start(&rig, &scenario);
    let (mut plant, mut k) = (fresh.clone(), 0);
    bencher.bench_local(|| {
        if k == scenario.inputs.len() {
            (plant, k) = (fresh.clone(), 0);
        }
        plant.step(black_box(&scenario.inputs[k]));
        k += 1;
    });
}

#[divan::bench(sample_count = 600, sample_size = 50)]
fn floor_period(bencher: Bencher) {
    let (rig, scenario) = motion();
    let (_, mut floor) = start(&rig, &scenario);
    let (fresh, mut k) = (floor.axes, 0);
    bencher.bench_local(|| {
        if k == scenario.inputs.len() {
            (floor.axes, k) = (fresh, 0);
        }
        floor.step(black_box(&scenario.inputs[k]));
        k += 1;
    });
}

/// Both codes through the whole record; panics where they part.
fn check_the_same_scheme(rig: &RigParameters, scenario: &Scenario) {
    let (mut plant, mut floor) = start(rig, scenario);
    // What 1 means for each number of an axis: m, m/s, opening, J, J, m^3/s, m^3/s.
    let scale = [0.5, 1.0, 1.0, 500.0, 500.0, 1e-2, 1e-2];
    let mut worst = 0.0_f64;
    for (k, inputs) in scenario.inputs.iter().enumerate() {
        plant.step(inputs);
        floor.step(inputs);
        for (ours, theirs) in plant.state().axes.iter().zip(&floor.axes) {
            for ((ours, theirs), scale) in FloorAxis::of(ours).0.iter().zip(&theirs.0).zip(scale) {
                worst = worst.max((ours - theirs).abs() / scale);
                assert!(worst <= 1e-9, "{k} ms: the floor is another scheme, {ours} against {theirs}");
            }
        }
    }
    println!("same trajectory over {} ms to {worst:.1e}", scenario.inputs.len());
}

/// Rigs of the batches that are timed; the floor's ratios are reported for all of them.
const BATCHES: [usize; 4] = [3, 8, 64, 256];

/// A batch that shares a record out among its rigs, and the inputs of each of its periods.
struct Shared {
    rigs: usize,
    registers: Registers,
    fresh: Batch,
    inputs: Vec<Vec<Inputs>>,
    ns: f64,
}

impl Shared {
    fn new(rig: &RigParameters, scenario: &Scenario, rigs: usize, registers: Registers) -> Self {
        let each = scenario.inputs.len() / rigs;
        let plant = |i: usize| Plant::in_state(rig, &scenario.states[i * each]).expect("a recorded state");
        let fresh = Batch::new((0..rigs).map(plant).collect()).with_registers(registers);
        let inputs = (0..each).map(|k| (0..rigs).map(|i| scenario.inputs[i * each + k]).collect()).collect();
        let shared = Shared { rigs, registers, fresh, inputs, ns: f64::INFINITY };
        for (i, plant) in shared.passed().plants()[..rigs - 1].iter().enumerate() {
            assert_eq!(*plant.state(), scenario.states[(i + 1) * each], "rig {i} of {rigs} in {registers:?}");
        }
        shared
    }

    fn passed(&self) -> Batch {
        let mut batch = self.fresh.clone();
        self.inputs.iter().for_each(|inputs| batch.step(black_box(inputs)));
        batch
    }

    /// One more pass; keeps the best.
    fn time(&mut self) {
        let mut batch = self.fresh.clone();
        let before = Instant::now();
        self.inputs.iter().for_each(|inputs| batch.step(black_box(inputs)));
        let periods = (self.inputs.len() * self.rigs) as f64;
        self.ns = self.ns.min(before.elapsed().as_nanos() as f64 / periods);
        black_box(&batch);
    }
}

fn main() {
    let (rig, scenario) = motion();
    check_the_same_scheme(&rig, &scenario);
    let there = || Registers::ALL.into_iter().filter(|registers| registers.are_there());
    let mut batches: Vec<Shared> = there()
        .flat_map(|registers| BATCHES.map(|rigs| (rigs, registers)))
        .map(|(rigs, registers)| Shared::new(&rig, &scenario, rigs, registers))
        .collect();
    divan::main();

    let periods = scenario.inputs.len() as f64;
    let (mut plant_ns, mut floor_ns) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..30 {
        let (mut plant, mut floor) = start(&rig, &scenario);
        let before = Instant::now();
        scenario.inputs.iter().for_each(|inputs| plant.step(black_box(inputs)));
        plant_ns = plant_ns.min(before.elapsed().as_nanos() as f64 / periods);
        let before = Instant::now();
        scenario.inputs.iter().for_each(|inputs| floor.step(black_box(inputs)));
        floor_ns = floor_ns.min(before.elapsed().as_nanos() as f64 / periods);
        black_box((&plant, &floor.axes));
        batches.iter_mut().for_each(Shared::time);
    }
    println!("plant {plant_ns:.0} ns per period of 1 ms: {:.0} times faster than real time", 1e6 / plant_ns);
    println!("floor {floor_ns:.0} ns per period: the plant takes {:.2} of it", plant_ns / floor_ns);
    for Shared { rigs, registers, ns, .. } in &batches {
        println!(
            "batch of {rigs:3} in {registers:?}: {ns:.0} ns per rig and period, {:.2} of the floor and {:.2} of the plant, \
             {:.0} s simulated in a second of a core",
            ns / floor_ns,
            ns / plant_ns,
            1e6 / ns
        );
    }
    let widest = Registers::widest();
    if let Some(batch) = batches.iter().find(|batch| batch.rigs == 64 && batch.registers == widest) {
        let of_floor = batch.ns / floor_ns;
        println!("batch {:.0} ns per rig and period: {of_floor:.2} of the floor", batch.ns);
    }
}
