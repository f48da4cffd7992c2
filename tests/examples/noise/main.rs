//! Pairs of runs in real time, one with noise on the bus and one without, in turns: what the noise costs the loop.
//!
//! `scripts/noise` calls it; the table goes to standard output, progress to standard error.

use std::process::ExitCode;
use system_tests::noise::{self, Outcome, PER_SECOND};
use system_tests::pairs::{self, Figure};

const FIGURES: [Figure<Outcome>; 6] = [
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
    let runs = pairs::in_turns(
        pairs,
        |with, pair| noise::run(seconds, if with { PER_SECOND } else { 0 }, u64::from(pair)),
        |without, with| {
            format!(
                "missed {} without, {} with; wrong openings {}",
                without.missed, with.missed, with.openings.not_sent
            )
        },
    );
    print(&runs, seconds);
    ExitCode::from(u8::from(runs.iter().any(|(_, with)| with.openings.not_sent > 0)))
}

#[allow(clippy::print_stdout)] // the table is the result
fn print(runs: &[(Outcome, Outcome)], seconds: u32) {
    let sum = |of: fn(&Outcome) -> u64| runs.iter().map(|(_, with)| of(with)).sum::<u64>();
    let sent_s: f64 = runs.iter().map(|(_, with)| with.sent.duration_s).sum();
    println!("\n{} pairs of {seconds} s; medians, and of the difference an interval.\n", runs.len());
    println!("{}", pairs::table(runs, &FIGURES).markdown());
    println!(
        "Noise: {:.0} frames a second, {} in all; the rig counted {} of them as malformed and {} as not its own. Of {} openings \
         that acted meanwhile, {} had been sent by no controller; in {} cycles a valve was shut that its controller wanted open, \
         {} commands being stale (without noise: {} cycles).",
        sum(|with| with.sent.frames) as f64 / sent_s,
        sum(|with| with.sent.frames),
        sum(|with| with.malformed),
        sum(|with| with.unknown),
        sum(|with| with.openings.acted as u64),
        sum(|with| with.openings.not_sent as u64),
        sum(|with| with.openings.shut as u64),
        sum(|with| with.stale),
        runs.iter().map(|(without, _)| without.openings.shut).sum::<usize>()
    );
}
