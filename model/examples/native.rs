//! What a model file costs beside the same equations and the same steps in Rust: `cargo run --release -p model --example native`.

#![allow(clippy::print_stdout)]

use model::{Inputs, Model, Program, Simulator};
use std::path::Path;
use std::time::Instant;

const ROWS: u32 = 20_000;
const PERIOD_S: f64 = 1e-3;
const STEPS: u32 = 10;
const REPEATS: u32 = 5;

/// An oscillator with smooth dry friction and a force that is held, by steps of 0.1 ms.
const OSCILLATOR: &str = "[solver]\nmethod = \"fixed\"\nstep_s = 1e-4\n[inputs.force]\nunit = \"N\"\nhold = \"zero\"\n\
    [parameters]\nmass = { unit = \"kg\", value = 2.0 }\nstiffness = { unit = \"N/m\", value = 50.0 }\n\
    friction = { unit = \"N\", value = 1.5 }\nscale = { unit = \"m/s\", value = 0.05 }\n\
    [states.x]\nunit = \"m\"\nstart = 0.1\nderivative = \"v\"\n[states.v]\nunit = \"m/s\"\nstart = 0.0\n\
    derivative = \"(force - stiffness*x - friction*tanh(v/scale))/mass\"\n[outputs.x_m]\nunit = \"m\"\nvalue = \"x\"\n";

fn native(force: &[f64], [mass, stiffness, friction, scale]: [f64; 4]) -> f64 {
    let rate =
        |[x, v]: [f64; 2], force: f64| [v, (force - stiffness * x - friction * libm::tanh(v / scale)) / mass];
    let after = |[x, v]: [f64; 2], [dx, dv]: [f64; 2], by: f64| [x + by * dx, v + by * dv];
    let (mut at, step_s) = ([0.1, 0.0], PERIOD_S / f64::from(STEPS));
    for force in &force[..force.len() - 1] {
        for _ in 0..STEPS {
            let first = rate(at, *force);
            let second = rate(after(at, first, 0.5 * step_s), *force);
            let third = rate(after(at, second, 0.5 * step_s), *force);
            let fourth = rate(after(at, third, step_s), *force);
            let sum = |index: usize| first[index] + 2.0 * (second[index] + third[index]) + fourth[index];
            at = after(at, [sum(0), sum(1)], step_s / 6.0);
        }
    }
    at[0]
}

/// The least time of some repetitions, s, and the result.
fn least(mut run: impl FnMut() -> f64) -> (f64, f64) {
    let timed = (0..REPEATS).map(|_| {
        let began = Instant::now();
        let result = run();
        (began.elapsed().as_secs_f64(), result)
    });
    timed.min_by(|one, other| one.0.total_cmp(&other.0)).expect("there are repetitions")
}

fn main() {
    let model = Model::parse(OSCILLATOR, Path::new("oscillator.toml")).expect("a model");
    let program = Program::new(&model, &[]).expect("it compiles");
    let time_s: Vec<f64> = (0..ROWS).map(|row| f64::from(row) * PERIOD_S).collect();
    let samples = [time_s.iter().map(|time_s| 4.0 * (2.0 * time_s).sin()).collect::<Vec<_>>()];
    let inputs = Inputs { time_s: &time_s, samples_si: &samples };
    let values = [&[2.0, 50.0, 1.5, 0.05][..], &[0.1, 0.0], &[]];
    let mut simulator = Simulator::new(&program, &[]);
    let (by_file_s, x) = least(|| {
        let mut last = 0.0;
        simulator.run(&inputs, values, |_, _, value, _| last = value).expect("it ends");
        last
    });
    let (native_s, expected) = least(|| native(&samples[0], [2.0, 50.0, 1.5, 0.05]));
    assert!((x - expected).abs() < 1e-9, "{x} m in place of {expected}");
    let steps = f64::from((ROWS - 1) * STEPS);
    println!(
        "model file {:.0} ns a step, Rust {:.0} ns: {:.1} times",
        by_file_s / steps * 1e9,
        native_s / steps * 1e9,
        by_file_s / native_s
    );
}
