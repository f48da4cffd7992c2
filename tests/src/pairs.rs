//! Pairs of runs, one with something and one without, in turns: what it costs, with the interval of the difference.

use figures::median::{Median, median};
use pagekit::grid::Grid;
use std::time::Instant;

/// A figure of a run: its name, and how it is read.
pub type Figure<T> = (&'static str, fn(&T) -> f64);

/// Runs so many pairs, without and with; `run` is given which, and the pair's number from 1. `describe` says something of each
/// pair.
pub fn in_turns<T>(
    pairs: u32,
    mut run: impl FnMut(bool, u32) -> T,
    describe: impl Fn(&T, &T) -> String,
) -> Vec<(T, T)> {
    let began = Instant::now();
    let mut runs = Vec::new();
    for pair in 1..=pairs {
        // Who comes first changes, so that what the machine does by and by meets both.
        let (without, with) = if pair % 2 == 1 {
            let without = run(false, pair);
            (without, run(true, pair))
        } else {
            let with = run(true, pair);
            (run(false, pair), with)
        };
        let left_s = began.elapsed().as_secs_f64() / f64::from(pair) * f64::from(pairs - pair);
        eprintln!("{pair} of {pairs}, {left_s:.0} s left: {}", describe(&without, &with));
        runs.push((without, with));
    }
    runs
}

/// Medians without and with, and of the difference with its interval.
pub fn table<T>(runs: &[(T, T)], figures: &[Figure<T>]) -> Grid {
    let mut grid = Grid::new(["in each run", "without", "with", "difference", "interval"], []);
    for (name, of) in figures {
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
        grid.rows.push(vec![(*name).to_owned(), middle(without), middle(with), number(value), interval]);
    }
    grid
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.1}") }
}
