//! Prints the table of `docs/integration.md`: error and cost of integration schemes over the length of their step.
//!
//! `cargo run --release -p plant --example accuracy`
//!
//! Every window of 100 ms of five motions starts from the same state in every scheme and in the reference, and gets
//! the same commands. Errors are in units of the sensors' noise: the worst window and the median.

#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::time::Instant;

use plant::{Plant, RigParameters};

#[path = "../tests/reference/mod.rs"]
mod reference;
#[path = "../tests/scenario/mod.rs"]
mod scenario;
#[path = "../tests/windows/mod.rs"]
mod windows;

use reference::{Method, Reference};
use scenario::Scenario;
use windows::{Errors, Scheme, Window, compare, reference_windows};

/// Steps of the reference in a millisecond.
const REFERENCE_STEPS: u32 = 2000;

fn main() {
    let rig = RigParameters::baseline();
    let scenarios = scenario::all(&rig);
    let truth: Vec<Vec<Window>> =
        scenarios.iter().map(|scenario| reference_windows(scenario, REFERENCE_STEPS)).collect();

    println!(
        "| scheme | step | x worst | x median | p worst | p median | F worst | F median \
         | max x | max p | max F | ns per ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let euler = [10, 20, 40, 100].map(|n| ("explicit Euler", Scheme::Explicit(Method::Euler, n)));
    let rk4 = [10, 20, 40].map(|n| ("Runge-Kutta 4", Scheme::Explicit(Method::RungeKutta4, n)));
    let chosen = [2, 4, 5, 8, 10, 20, 40].map(|n| ("exact midpoint", Scheme::Plant(n)));
    let halved = [("reference, doubled step", Scheme::Explicit(Method::RungeKutta4, REFERENCE_STEPS / 2))];
    for (name, scheme) in euler.into_iter().chain(rk4).chain(chosen).chain(halved) {
        let mut errors = Errors::default();
        for (scenario, windows) in scenarios.iter().zip(&truth) {
            compare(&rig, scheme, scenario, windows, &mut errors);
        }
        let (Scheme::Plant(steps) | Scheme::Explicit(_, steps)) = scheme;
        let (worst, median, max) = (errors.worst(), errors.median(), errors.max);
        let pairs = [0, 1, 2].map(|i: usize| format!("{:.3} | {:.4}", worst[i], median[i])).join(" | ");
        println!(
            "| {name} | {:.1} us | {pairs} | {:.2} um | {:.0} Pa | {:.3} N | {:.0} |",
            1000.0 / f64::from(steps),
            max[0] * 1e6,
            max[1],
            max[2],
            nanoseconds_per_period(&rig, scheme, &scenarios[1]),
        );
    }
}

/// Best of several passes through the linked motion.
fn nanoseconds_per_period(rig: &RigParameters, scheme: Scheme, scenario: &Scenario) -> f64 {
    let passes = if matches!(scheme, Scheme::Explicit(_, 100..)) { 1 } else { 7 };
    let pass = |_| {
        let mut plant = Plant::in_state(rig, &scenario.states[0]).expect("a recorded state");
        let mut reference = Reference::from_state(&scenario.states[0]);
        if let Scheme::Plant(substeps) = scheme {
            plant = plant.with_substeps(substeps);
        }
        let start = Instant::now();
        match scheme {
            Scheme::Plant(_) => scenario.inputs.iter().for_each(|inputs| plant.step(black_box(inputs))),
            Scheme::Explicit(method, steps) => {
                scenario.inputs.iter().for_each(|inputs| reference.advance(black_box(inputs), steps, method));
            }
        }
        let spent = start.elapsed().as_nanos() as f64 / scenario.inputs.len() as f64;
        black_box((&plant, &reference));
        spent
    };
    (0..passes).map(pass).fold(f64::INFINITY, f64::min)
}
