//! Pairs of runs in real time, one with ten viewers of the live page and one without, in turns: what they cost the loop.
//!
//! `scripts/viewers` calls it; the table goes to standard output, progress to standard error.

use system_tests::pairs::{self, Figure};
use system_tests::viewers::{self, Outcome};

const FIGURES: [Figure<Outcome>; 6] = [
    ("missed cycles", |run| run.missed as f64),
    ("overruns", |run| run.overruns as f64),
    ("wake-up p50, us", |run| run.wakeup_ns[0] as f64 / 1e3),
    ("wake-up p99, us", |run| run.wakeup_ns[1] as f64 / 1e3),
    ("round trip p99, us", |run| run.round_trip_p99_ns as f64 / 1e3),
    ("records that did not reach the files", |run| run.records_dropped as f64),
];

#[allow(clippy::print_stdout)] // the table is the result
fn main() {
    let mut numbers = std::env::args().skip(1).map(|number| number.parse().ok());
    let mut next = |default: u32| numbers.next().flatten().unwrap_or(default);
    let (pairs, seconds) = (next(6), next(30));
    let runs = pairs::in_turns(
        pairs,
        |with, _| viewers::run(seconds, with),
        |without, with| {
            format!("missed {} without, {} with {} viewers", without.missed, with.missed, with.viewers)
        },
    );
    let least = runs.iter().map(|(_, with)| with.viewers).min().unwrap_or_default();
    println!(
        "\n{pairs} pairs of {seconds} s; medians, and of the difference an interval. Viewers, the one that reads nothing \
              among them: {least} at least.\n"
    );
    println!("{}", pairs::table(&runs, &FIGURES).markdown());
}
