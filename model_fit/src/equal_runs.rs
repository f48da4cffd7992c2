//! Runs of one value in a column that are longer than noise permits.
//!
//! Where a share f of neighbours are equal by chance, a run of n equal samples comes N f^(n-1) times in a record of N; a run that
//! would come less than once in a hundred thousand records did not come by chance. A column whose rounding is coarser than its
//! noise repeats values anyway and is not tested, nor is its rest.

use crate::quantum;
use std::ops::Range;

/// Chance of a run, in records.
const CHANCE: f64 = 1e-5;
/// Shortest reported run, samples.
const SHORTEST: usize = 12;
/// Share of equal neighbours above which a channel is not tested.
const MOSTLY_EQUAL: f64 = 0.6;
/// Runs that are no chance whatever the noise: left out of the share of equal neighbours.
pub const SURELY: usize = 60;
/// Share of a channel beyond which too little is left of it.
pub const MOST: f64 = 0.5;

/// Runs of a column that did not come by chance, and whether too little is left beside them.
pub fn stuck(values: &[Option<f64>]) -> (Vec<Run>, bool) {
    let Some(longest) = by_chance(values) else { return (Vec::new(), false) };
    let step = quantum::of(&values.iter().flatten().copied().collect::<Vec<_>>());
    let stuck: Vec<Run> =
        runs(values).into_iter().filter(|run| run.samples > longest && !is_rest(values, run, step)).collect();
    let samples: usize = stuck.iter().map(|run| run.samples).sum();
    (stuck, samples as f64 > MOST * values.iter().flatten().count() as f64)
}

/// Whether a run is a rest that rounding shows as one value: it begins and ends with a single step, where a sensor that stuck
/// jumps to what went on meanwhile.
pub fn is_rest(values: &[Option<f64>], run: &Run, step: Option<f64>) -> bool {
    let (Some(step), Some(level)) = (step, values[run.places.start]) else { return false };
    let near = |other: Option<f64>| other.is_none_or(|other| (other - level).abs() < 1.5 * step);
    let before = values[..run.places.start].iter().rev().flatten().next();
    let after = values[run.places.end..].iter().flatten().next();
    // A run over the whole record is no rest.
    (before.is_some() || after.is_some()) && near(before.copied()) && near(after.copied())
}

/// Equal values in a row, missing samples aside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// Places from its first sample to its last.
    pub places: Range<usize>,
    /// Samples in it: what is missing in between is not known to be equal.
    pub samples: usize,
}

/// Runs of equal values; a missing sample ends none.
pub fn runs(values: &[Option<f64>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut level = None;
    for (place, value) in values.iter().enumerate() {
        let Some(value) = value else { continue };
        match runs.last_mut() {
            Some(run) if level == Some(*value) => {
                run.places.end = place + 1;
                run.samples += 1;
            }
            _ => runs.push(Run { places: place..place + 1, samples: 1 }),
        }
        level = Some(*value);
    }
    runs
}

/// Longest run of equal values by chance; `None` for a channel that is not tested.
pub fn by_chance(values: &[Option<f64>]) -> Option<usize> {
    let (mut equal, mut pairs) = (0_usize, 0_usize);
    for run in runs(values).into_iter().filter(|run| run.samples < SURELY) {
        equal += run.samples - 1;
        pairs += run.samples;
    }
    if pairs == 0 {
        return None;
    }
    let share = (equal as f64 / pairs as f64).max(0.01);
    let longest = 1.0 + (CHANCE / pairs as f64).ln() / share.ln();
    (share < MOSTLY_EQUAL).then_some((longest.ceil() as usize).max(SHORTEST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_go_on_over_missing_samples() {
        let values = [Some(1.0), Some(1.0), None, Some(1.0), Some(2.0), None];
        let run = |places, samples| Run { places, samples };
        assert_eq!(runs(&values), [run(0..4, 3), run(4..5, 1)]);
    }

    #[test]
    fn the_rarer_equal_neighbours_are_the_shorter_is_chance() {
        let often: Vec<_> = (0..9000).map(|at| Some(f64::from(at / 2))).collect();
        let never: Vec<_> = (0..9000).map(|at| Some(f64::from(at))).collect();
        // Half of the neighbours: 1 + ln(1e-5 / 9000) / ln(1/2) = 30.7.
        assert_eq!((by_chance(&often), by_chance(&never)), (Some(31), Some(SHORTEST)));
        let coarse: Vec<_> = (0..9000).map(|at| Some(f64::from(at / 10))).collect();
        assert_eq!(by_chance(&coarse), None);
    }
}
