//! Pairs of runs in real time, one with noise on the bus and one without, in turns: what the noise costs the loop.
//!
//! `scripts/noise` calls it; the table goes to standard output, progress to standard error.

use bench::grid::Grid;
use bench::median::{Median, median};
use std::process::ExitCode;
use std::time::Instant;
use system_tests::noise::{self, Outcome};

/// Frames of noise each second.
const PER_SECOND: u32 = 10_000;

/// A figure of a run: its name, and how it is read.
type Figure = (&'static str, fn(&Outcome) -> f64);

const FIGURES: [Figure; 6] = [
    ("missed cycles", |run| run.missed as f64),
    ("overruns", |run| run.overruns as f64),
    ("wake-up p99, us", |run| run.wakeup_p99_ns as f64 / 1e3),
    ("round trip p99, us", |run| run.round_trip_p99_ns as f64 / 1e3),
    ("commands lost at the rig", |run| run.commands_lost as f64),
    ("sensor frames lost at the controller", |run| run.sensors_lost as f64),
];

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|number| number.parse().ok());
    let mut next = |default: u32| numbers.next().flatten().unwrap_or(default);
    let (pairs, seconds) = (next(6), next(60));
    let began = Instant::now();
    let mut runs = Vec::new();
    for pair in 0..pairs {
        let one = |per_second: u32| noise::run(seconds, per_second, u64::from(pair) + 1);
        // Who comes first changes, so that what the machine does by and by meets both.
        let (without, with) = if pair % 2 == 0 {
            let without = one(0);
            (without, one(PER_SECOND))
        } else {
            let with = one(PER_SECOND);
            (one(0), with)
        };
        let left_s = began.elapsed().as_secs_f64() / f64::from(pair + 1) * f64::from(pairs - pair - 1);
        eprintln!(
            "{} of {pairs}, {left_s:.0} s left: missed {} without, {} with; wrong openings {}",
            pair + 1,
            without.missed,
            with.missed,
            with.wrong
        );
        runs.push((without, with));
    }
    print(&runs, seconds);
    ExitCode::from(u8::from(runs.iter().any(|(_, with)| with.wrong > 0)))
}

#[allow(clippy::print_stdout)] // the table is the result
fn print(runs: &[(Outcome, Outcome)], seconds: u32) {
    let head = ["in each run", "without", "with", "difference", "interval"];
    let mut grid = Grid { head: head.map(str::to_owned).to_vec(), rows: Vec::new() };
    for (name, of) in FIGURES {
        let middle =
            |values: Vec<f64>| median(values).map_or_else(String::new, |middle| number(middle.value));
        let without = runs.iter().map(|(without, _)| of(without)).collect();
        let with = runs.iter().map(|(_, with)| of(with)).collect();
        let difference = median(runs.iter().map(|(without, with)| of(with) - of(without)).collect());
        let Some(Median { value, interval, confidence }) = difference else { continue };
        let interval = match (interval, confidence) {
            (Some((least, most)), Some(confidence)) => {
                format!("{} to {} ({:.0} %)", number(least), number(most), confidence * 100.0)
            }
            _ => "too few pairs".to_owned(),
        };
        grid.rows.push(vec![name.to_owned(), middle(without), middle(with), number(value), interval]);
    }
    let sum = |of: fn(&Outcome) -> u64| runs.iter().map(|(_, with)| of(with)).sum::<u64>();
    let sent_s: f64 = runs.iter().map(|(_, with)| with.sent.duration_s).sum();
    println!("\n{} pairs of {seconds} s; medians, and of the difference an interval.\n", runs.len());
    println!("{}", grid.markdown());
    println!(
        "Noise: {:.0} frames a second, {} in all; the rig counted {} of them as malformed and {} as not its own. Of {} openings \
         that acted meanwhile, {} had been sent by no controller; in {} cycles a valve was shut that its controller wanted open, \
         {} commands being stale (without noise: {} cycles).",
        sum(|with| with.sent.frames) as f64 / sent_s,
        sum(|with| with.sent.frames),
        sum(|with| with.malformed),
        sum(|with| with.unknown),
        sum(|with| with.openings as u64),
        sum(|with| with.wrong as u64),
        sum(|with| with.shut as u64),
        sum(|with| with.stale),
        runs.iter().map(|(without, _)| without.shut).sum::<usize>()
    );
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.1}") }
}
