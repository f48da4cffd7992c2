//! The confusion table of disturbed runs: what was done against what `bench cause` named, run by run in turns.
//!
//! `scripts/disturb` calls it; the table goes to standard output, progress to standard error.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use system_tests::disturb::{self, Disturbance};

fn main() -> ExitCode {
    let runs: u32 = std::env::args().nth(1).and_then(|runs| runs.parse().ok()).unwrap_or(10);
    let kinds = Disturbance::ALL.into_iter().map(|(kind, _)| kind);
    let kinds: Vec<_> = kinds.filter(|kind| is_root() || !kind.needs_root()).collect();
    let mut counts: BTreeMap<(Disturbance, String), u32> = BTreeMap::new();
    let began = Instant::now();
    let all = runs * kinds.len() as u32;
    // In turns, so that what the machine does meanwhile meets all of them.
    for run in 0..runs {
        for (place, kind) in kinds.iter().enumerate() {
            // Somewhere in three fifths of a second, never at the same place of the experiment, the same each time.
            let after = Duration::from_millis(u64::from(500 + (run * 61 + place as u32 * 37) % 600));
            let named = disturb::run(*kind, after);
            let done = run * kinds.len() as u32 + place as u32 + 1;
            let left_s = began.elapsed().as_secs_f64() / f64::from(done) * f64::from(all - done);
            eprintln!(
                "{done}/{all}, {left_s:.0} s left: {} -> {}: {}",
                kind.name(),
                named.cause,
                named.sentence
            );
            *counts.entry((*kind, named.cause)).or_default() += 1;
        }
    }
    print(&kinds, &counts);
    let wrong: u32 =
        counts.iter().filter(|((kind, cause), _)| kind.name() != cause).map(|(_, count)| count).sum();
    eprintln!("{wrong} of {all} named wrongly");
    ExitCode::from(u8::from(wrong > 0))
}

fn is_root() -> bool {
    rustix::process::geteuid().is_root()
}

/// A row for what was done, a column for what was named.
#[allow(clippy::print_stdout)] // the table is the result
fn print(kinds: &[Disturbance], counts: &BTreeMap<(Disturbance, String), u32>) {
    let mut columns: Vec<String> = kinds.iter().map(|kind| kind.name().to_owned()).collect();
    for (_, cause) in counts.keys() {
        if !columns.contains(cause) {
            columns.push(cause.clone());
        }
    }
    println!("\n| done \\ named | {} |", columns.join(" | "));
    println!("|---|{}", "---|".repeat(columns.len()));
    for kind in kinds {
        let cell = |cause: &String| {
            counts.get(&(*kind, cause.clone())).map_or_else(|| "·".to_owned(), ToString::to_string)
        };
        let cells: Vec<_> = columns.iter().map(cell).collect();
        println!("| {} | {} |", kind.name(), cells.join(" | "));
    }
}
