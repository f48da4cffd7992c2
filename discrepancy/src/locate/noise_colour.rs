//! AR(1) coefficient of sensor noise, from readings at rest.
//!
//! ```text
//! n_k = phi n_(k-1) + e_k        phi = 3 - var(second differences) / var(first differences)        at rest
//! ```
//!
//! Differences remove the level, and their mean removes drift. Windows with a constant command count, without those whose
//! variance exceeds the median by far. A second determines phi to a tenth.
//!
//! Source: Box, Jenkins, Reinsel 2008, Time Series Analysis, 3.2.

use super::SHORT_WINDOW_PERIODS;
use crate::gridded_record::{CHANNELS, GriddedRecord};

/// Fewest resting short windows.
const LEAST: usize = 15;
/// Threshold of white noise: three standard errors of an estimate from a second.
const WHITE: f64 = 0.15;
/// Ratio to the median variance above which a window moved.
const JOLT: f64 = 3.0;
/// Difference of phi that a second of readings does not resolve.
const ALIKE: f64 = 0.2;
/// Upper bound of phi.
const MAX_PHI: f64 = 0.95;

/// phi of each channel of an axis.
pub(super) fn ar1_coefficients(record: &GriddedRecord, axis: usize) -> [f64; CHANNELS] {
    let mut windows: [Vec<[f64; 2]>; CHANNELS] = Default::default();
    for from in (0..record.len().saturating_sub(SHORT_WINDOW_PERIODS)).step_by(SHORT_WINDOW_PERIODS) {
        let command = |at: usize| record.inputs[at].valve[axis];
        let since = from.saturating_sub(2 * SHORT_WINDOW_PERIODS);
        let is_held = |at: usize| !record.excluded_periods[at] && command(at) == command(since);
        if !(since..from + SHORT_WINDOW_PERIODS).all(is_held) {
            continue;
        }
        for (channel, windows) in windows.iter_mut().enumerate() {
            let sample = |at: usize| record.samples[from + at][axis][channel];
            let steps: Vec<Option<f64>> =
                (1..SHORT_WINDOW_PERIODS).map(|at| Some(sample(at)? - sample(at - 1)?)).collect();
            let bends: Vec<Option<f64>> = steps.windows(2).map(|pair| Some(pair[1]? - pair[0]?)).collect();
            windows.push(
                [steps, bends].map(|differences| variance(differences.into_iter().flatten().collect())),
            );
        }
    }
    let ar1_coefficients = windows.map(ar1_coefficient);
    let mean = ar1_coefficients.iter().sum::<f64>() / CHANNELS as f64;
    // One filter before one converter: channels without a significant difference share their mean.
    if ar1_coefficients.iter().all(|phi| (phi - mean).abs() < ALIKE) {
        [mean; CHANNELS]
    } else {
        ar1_coefficients
    }
}

/// phi from the variances of first and second differences.
fn ar1_coefficient(mut windows: Vec<[f64; 2]>) -> f64 {
    if windows.len() < LEAST {
        return 0.0;
    }
    windows.sort_by(|left, right| left[0].total_cmp(&right[0]));
    // Excludes windows with a jolt.
    let most = JOLT * windows[windows.len() / 2][0];
    let calm = windows.iter().filter(|window| window[0] <= most);
    let [first, second] = calm.fold([0.0; 2], |sum, window| [sum[0] + window[0], sum[1] + window[1]]);
    let phi = if first > 0.0 { 3.0 - second / first } else { 0.0 };
    if phi < WHITE { 0.0 } else { phi.min(MAX_PHI) }
}

fn variance(values: Vec<f64>) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n
}

/// Factor of AR(1) noise on the standard error of a mean.
pub(super) fn ar1_se_factor(phi: f64) -> f64 {
    ((1.0 + phi) / (1.0 - phi)).sqrt()
}
