//! Makes the table of `docs/effects-cost.md`: what a period costs with no effect, with each alone, with ten, with all.
//!
//! `scripts/effects-tables` prints it, and puts it into the page with `--write`.
//!
//! The motion is that of the benchmark: a thousand periods in the middle of the linked motion under load steps, with the
//! baseline's commands, each effect at all its places at the geometric middle of its drawn range. Times are those of short
//! parts of a pass, each at the best of passes that take turns through all rigs, so that what else runs on the machine meets
//! them alike. Instructions are the difference of two runs of this program under valgrind, with and without the thousand
//! periods.

#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::process::{Command, ExitCode};
use std::time::Instant;

use plant::effects::SHEETS;
use plant::effects::sheet::Sheet;
use plant::{Inputs, Plant, RigParameters};

#[path = "../tests/scenario/mod.rs"]
mod scenario;

use scenario::{Kind, Scenario};

/// Periods of a pass.
const PERIODS: usize = 1000;
/// Period of the recorded motion at which a pass begins.
const BEGIN: usize = 2000;
/// Periods that are timed together: short enough to be left alone by the rest of the machine now and then.
const PART: usize = 25;
/// Passes through all rigs.
const PASSES: u32 = 40;
/// Every fourth effect of the catalogue: some of each room.
const EVERY: usize = 4;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        // What this program starts under valgrind.
        ["count", name, periods] => {
            let scenario = motion();
            let mut plant = Plant::in_state(&rig(name), &scenario.states[BEGIN]).expect("a recorded state");
            let periods: usize = periods.parse().expect("a number of periods");
            run(&mut plant, &scenario.inputs[BEGIN..BEGIN + periods]);
            black_box(&plant);
            ExitCode::SUCCESS
        }
        [] => {
            println!("{}", table());
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("usage: effects_cost");
            ExitCode::from(2)
        }
    }
}

/// The linked motion under load steps, of the baseline.
fn motion() -> Scenario {
    let kind = Kind { name: "linked under load steps", linked: true, ..Kind::FREE };
    scenario::record(&RigParameters::baseline(), kind, BEGIN + PERIODS)
}

fn names() -> Vec<&'static str> {
    let each = SHEETS.iter().map(|sheet| sheet.name);
    ["none"].into_iter().chain(each).chain(["ten", "all"]).collect()
}

fn rig(name: &str) -> RigParameters {
    let on = |sheets: Vec<&Sheet>| {
        sheets.iter().fold(RigParameters::baseline(), |rig, sheet| {
            let middle = |drawn: [f64; 2]| (drawn[0] * drawn[1]).sqrt();
            let numbers: Vec<(&str, f64)> =
                sheet.keys.iter().map(|key| (key.name, middle(key.drawn))).collect();
            sheet.place.names().iter().fold(rig, |rig, place| {
                rig.with_effect(sheet.name, place, &numbers).expect("the middle is allowed")
            })
        })
    };
    match name {
        "none" => RigParameters::baseline(),
        "all" => on(SHEETS.iter().collect()),
        "ten" => on(SHEETS.iter().step_by(EVERY).collect()),
        _ => on(SHEETS.iter().filter(|sheet| sheet.name == name).collect()),
    }
}

fn run(plant: &mut Plant, inputs: &[Inputs]) {
    inputs.iter().for_each(|inputs| plant.step(black_box(inputs)));
}

/// Nanoseconds of a period of each rig: the mean over parts of a pass, each part at its best pass.
fn times(names: &[&str], scenario: &Scenario) -> Vec<f64> {
    let rigs: Vec<RigParameters> = names.iter().map(|name| rig(name)).collect();
    let parts: Vec<&[Inputs]> = scenario.inputs[BEGIN..].chunks(PART).collect();
    let mut best = vec![vec![f64::INFINITY; parts.len()]; names.len()];
    for _ in 0..PASSES {
        for (rig, best) in rigs.iter().zip(&mut best) {
            let mut plant = Plant::in_state(rig, &scenario.states[BEGIN]).expect("a recorded state");
            for (part, best) in parts.iter().zip(best) {
                let start = Instant::now();
                run(&mut plant, part);
                *best = best.min(start.elapsed().as_nanos() as f64);
            }
            black_box(&plant);
        }
    }
    best.iter().map(|parts| parts.iter().sum::<f64>() / PERIODS as f64).collect()
}

/// Instructions of a period; `None` without valgrind.
fn instructions(name: &str) -> Option<f64> {
    let counted = |periods: usize| -> Option<f64> {
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe().ok()?)
            .args(["count", name, &periods.to_string()])
            .output()
            .ok()?;
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let line = text.lines().find(|line| line.contains("Collected :"))?;
        line.split(':').nth(1)?.trim().parse().ok()
    };
    Some((counted(PERIODS)? - counted(0)?) / PERIODS as f64)
}

fn table() -> String {
    let names = names();
    let times = times(&names, &motion());
    let counts: Vec<Option<f64>> = names.iter().map(|name| instructions(name)).collect();
    if counts.iter().any(Option::is_none) {
        eprintln!("no valgrind, so no instructions: install it with scripts/test or your package manager");
    }
    let mut lines = vec![
        "| effects on | instructions | times none | ns | times none |".to_owned(),
        "|---|---|---|---|---|".to_owned(),
    ];
    for ((name, time), count) in names.iter().zip(&times).zip(&counts) {
        let (count, ratio) = match (count, counts[0]) {
            (Some(count), Some(none)) => (format!("{count:.0}"), format!("{:.2}", count / none)),
            _ => ("-".to_owned(), "-".to_owned()),
        };
        lines.push(format!("| {name} | {count} | {ratio} | {time:.0} | {:.2} |", time / times[0]));
    }
    lines.join("\n")
}
