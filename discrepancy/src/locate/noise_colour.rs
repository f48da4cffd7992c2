//! How much a sensor's noise remembers, from its readings at rest, and rows made white by it.
//!
//! ```text
//! n_k = phi n_(k-1) + e_k        phi = 3 - var(second differences) / var(first differences)        at rest
//! ```
//!
//! Differences forget the level, and without their mean the drift; with a command that has not changed for a while, mostly at
//! rest, they are the noise's own; windows that move more than the median's are left out. A second of it tells phi to less than
//! a tenth.
//!
//! Source: Box, Jenkins, Reinsel 2008, Time Series Analysis, 3.2.

use super::WINDOW;
use crate::gridded_record::{CHANNELS, GriddedRecord};

/// Resting windows that an estimate needs.
const LEAST: usize = 15;
/// Below this the noise counts as white: three standard errors of the estimate from a second.
const WHITE: f64 = 0.15;
/// A window's variance over the median's that is no noise.
const JOLT: f64 = 3.0;
/// Difference of phi that a second of readings does not tell.
const ALIKE: f64 = 0.2;
/// Largest phi that is believed.
const MOST: f64 = 0.95;

/// phi of each channel of an axis.
pub(super) fn colours(record: &GriddedRecord, axis: usize) -> [f64; CHANNELS] {
    let mut windows: [Vec<[f64; 2]>; CHANNELS] = Default::default();
    for from in (0..record.len().saturating_sub(WINDOW)).step_by(WINDOW) {
        let command = |at: usize| record.inputs[at].valve[axis];
        let since = from.saturating_sub(2 * WINDOW);
        if !(since..from + WINDOW).all(|at| !record.gaps[at] && command(at) == command(since)) {
            continue;
        }
        for (channel, windows) in windows.iter_mut().enumerate() {
            let sample = |at: usize| record.samples[from + at][axis][channel];
            let steps: Vec<Option<f64>> = (1..WINDOW).map(|at| Some(sample(at)? - sample(at - 1)?)).collect();
            let bends: Vec<Option<f64>> = steps.windows(2).map(|pair| Some(pair[1]? - pair[0]?)).collect();
            windows.push(
                [steps, bends].map(|differences| variance(differences.into_iter().flatten().collect())),
            );
        }
    }
    let colours = windows.map(colour);
    let mean = colours.iter().sum::<f64>() / CHANNELS as f64;
    // One filter before one converter: channels as alike as a second can tell share their mean.
    if colours.iter().all(|phi| (phi - mean).abs() < ALIKE) { [mean; CHANNELS] } else { colours }
}

/// phi of the variances of first and second differences of many windows.
fn colour(mut windows: Vec<[f64; 2]>) -> f64 {
    if windows.len() < LEAST {
        return 0.0;
    }
    windows.sort_by(|left, right| left[0].total_cmp(&right[0]));
    // A jolt in a window that seemed at rest is no noise.
    let most = JOLT * windows[windows.len() / 2][0];
    let calm = windows.iter().filter(|window| window[0] <= most);
    let [first, second] = calm.fold([0.0; 2], |sum, window| [sum[0] + window[0], sum[1] + window[1]]);
    let phi = if first > 0.0 { 3.0 - second / first } else { 0.0 };
    if phi < WHITE { 0.0 } else { phi.min(MOST) }
}

/// Mean square around the mean, which is next to nothing: the sum of differences is that of both ends alone.
fn variance(values: Vec<f64>) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n
}

/// By how much coloured noise widens a mean of many readings.
pub(super) fn widens(phi: f64) -> f64 {
    ((1.0 + phi) / (1.0 - phi)).sqrt()
}
