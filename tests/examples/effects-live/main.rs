//! Prints, as Markdown, what effects cost the rig's loop in real time: `scripts/effects-live`.
#![allow(clippy::print_stdout)] // This is what it is for.

use plant::effects::sheet::ActiveEffect;
use system_tests::Scene;
use system_tests::hidden::{Extreme, LIVELY, LoopTiming, drawn, everything, live};

/// Each slice, s.
const SECONDS: u32 = 10;
/// Slices of each kind, in turns; percentiles are those of the middle one.
const ROUNDS: usize = 5;

fn main() {
    let kinds: [(&str, Vec<ActiveEffect>); 5] = [
        ("none", Vec::new()),
        ("piston-leakage", drawn_of("piston-leakage")),
        ("ten, seed 7", drawn(7, 10)),
        ("all at all places, largest drawn", everything(Extreme::Drawn)),
        ("all at all places, ends of their ranges", everything(Extreme::Mixed)),
    ];
    let mut slices: Vec<Vec<LoopTiming>> = vec![Vec::new(); kinds.len()];
    for _ in 0..ROUNDS {
        for (slices, (_, effects)) in slices.iter_mut().zip(&kinds) {
            slices.push(live(&Scene::new(LIVELY), effects, SECONDS));
        }
    }
    println!(
        "| effects | cycles | missed | own work longer than the period | step p50 / p99, us | sample and send p50 / p99, us | \
         whole cycle p50 / p99, us |\n|---|---:|---:|---:|---:|---:|---:|"
    );
    for (slices, (name, _)) in slices.iter().zip(&kinds) {
        let sum = |of: fn(&LoopTiming) -> u64| slices.iter().map(of).sum::<u64>();
        let middle = |of: fn(&LoopTiming) -> [u64; 2]| {
            let [p50_us, p99_us] = [0, 1].map(|percentile| {
                let mut values: Vec<u64> = slices.iter().map(|live| of(live)[percentile]).collect();
                values.sort_unstable();
                values[values.len() / 2] as f64 / 1e3
            });
            format!("{p50_us:.1} / {p99_us:.1}")
        };
        println!(
            "| {name} | {} | {} | {} | {} | {} | {} |",
            sum(|live| live.cycles),
            sum(|live| live.missed),
            sum(|live| live.overworked),
            middle(|live| live.step_ns),
            middle(|live| live.send_ns),
            middle(|live| live.execution_ns),
        );
    }
}

/// The first seed's draw of this effect alone.
fn drawn_of(name: &str) -> Vec<ActiveEffect> {
    let found = (0..).map(|seed| drawn(seed, 1)).find(|effects| effects[0].name == name);
    found.expect("every effect comes up")
}
