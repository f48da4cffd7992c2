//! Noise model: force spikes, sampling jitter, autocorrelated noise, and draws of it.

use super::{FORCE, WINDOW_PERIODS, Windows, dot};
use crate::gridded_record::{CHANNELS, GriddedRecord};
use model_fit::stats::median;
use plant::PERIOD_S;
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Neighbours to each side in the median filter of the force.
const SPIKE_REACH: usize = 4;
/// Largest deviation from the median, in standard deviations.
pub(super) const SPIKE: f64 = 6.0;

impl Windows<'_> {
    /// A draw of noise, processed like a residual.
    pub(crate) fn noise(&self, random: &mut Pcg64) -> Vec<f64> {
        let mut noise = self.raw_noise(random);
        self.reduce(&mut noise);
        noise
    }

    /// A draw of noise with the autocorrelation and the jitter of the record.
    pub(super) fn raw_noise(&self, random: &mut Pcg64) -> Vec<f64> {
        let width = self.outputs.len();
        let autocorrelations: Vec<f64> = self
            .outputs
            .iter()
            .map(|(axis, channel)| self.record.lag1_autocorrelation[*axis][*channel])
            .collect();
        let mut noise = Vec::with_capacity(self.readings.len());
        for sensitivities in self.jitter_sensitivity.chunks_exact(self.rows().max(1)) {
            let mut coloured = vec![0.0; width];
            for (period, sensitivities) in sensitivities.chunks_exact(width).enumerate() {
                for (coloured, lag1_autocorrelation) in coloured.iter_mut().zip(&autocorrelations) {
                    let kept = if period == 0 { 0.0 } else { *lag1_autocorrelation };
                    *coloured = kept * *coloured + (1.0 - kept * kept).sqrt() * gaussian(random);
                }
                let instant = gaussian(random);
                noise.extend(
                    coloured
                        .iter()
                        .zip(sensitivities)
                        .map(|(coloured, sensitivity)| coloured + sensitivity * instant),
                );
            }
        }
        noise
    }

    /// Whitens a window: jitter, common to all readings of an instant (of an axis, where they are apart), by (I + d d')^(-1/2)
    /// with d their rates times the jitter over the noise; then AR(1) noise by (e_n - r e_(n-1)) / sqrt(1 - r^2), r the lag-1
    /// correlation over 1 + d^2. The first sample of a window is not transformed.
    pub(super) fn whiten(&self, at: usize, window: &mut [f64]) {
        let width = self.outputs.len();
        let sensitivities = &self.jitter_sensitivity[at * self.rows()..][..self.rows()];
        // What is missing on one axis must not spread to the other.
        let group = if self.axes_are_apart() { CHANNELS } else { width };
        for (readings, sensitivity) in window.chunks_exact_mut(group).zip(sensitivities.chunks_exact(group)) {
            let square = dot(sensitivity, sensitivity);
            if square > 1e-6 {
                let share = dot(readings, sensitivity) * (1.0 - 1.0 / (1.0 + square).sqrt()) / square;
                readings
                    .iter_mut()
                    .zip(sensitivity)
                    .for_each(|(reading, sensitivity)| *reading -= share * sensitivity);
            }
        }
        for (output, (axis, channel)) in self.outputs.iter().enumerate() {
            let lag1_autocorrelation = self.record.lag1_autocorrelation[*axis][*channel];
            if lag1_autocorrelation == 0.0 {
                continue;
            }
            for period in (1..WINDOW_PERIODS).rev() {
                let (place, before) = (period * width + output, (period - 1) * width + output);
                if !(self.valid[at * self.rows() + place] && self.valid[at * self.rows() + before]) {
                    continue;
                }
                // Jitter lowers the correlation of neighbours.
                let correlation = lag1_autocorrelation / (1.0 + sensitivities[place] * sensitivities[place]);
                window[place] =
                    (window[place] - correlation * window[before]) / (1.0 - correlation * correlation).sqrt();
            }
        }
    }

    /// Hampel-type filter: force readings that differ from the median of their neighbours by more than `limit` become it.
    pub(super) fn flatten(&self, values: &mut [f64], limit: f64) {
        let width = self.outputs.len();
        for output in (0..width).filter(|output| self.outputs[*output].1 == FORCE) {
            let series: Vec<f64> = values.iter().skip(output).step_by(width).copied().collect();
            for at in 0..series.len() {
                let mut near = [0.0; 2 * SPIKE_REACH + 1];
                let from = at.saturating_sub(SPIKE_REACH);
                let to = (at + SPIKE_REACH + 1).min(series.len());
                let near = &mut near[..to - from];
                near.copy_from_slice(&series[from..to]);
                let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
                let (low, high) = near.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
                if high - low <= limit {
                    continue; // the median is as near as that
                }
                let Some(median) = median(near) else { continue };
                if (series[at] - median).abs() > limit {
                    values[at * width + output] = median;
                }
            }
        }
    }
}

/// Rate of a reading times the jitter, over its noise.
pub(super) fn jitter_sensitivity_of(record: &GriddedRecord, at: usize, axis: usize, channel: usize) -> f64 {
    if record.jitter_s == 0.0 {
        return 0.0;
    }
    let (before, after) = (at.saturating_sub(1), (at + 1).min(record.len() - 1));
    if channel == FORCE {
        // Contacts of linked rods are shorter than a period, so that the difference is no rate.
        if record.linked {
            return 0.0;
        }
        // A central difference: the noise of the force is a few hundredths of the rates that matter here.
        let [before, after] = [before, after].map(|at| record.samples[at][axis][FORCE]);
        let change = after.zip(before).map_or(0.0, |(after, before)| after - before);
        return change / (2.0 * PERIOD_S) * record.jitter_s / record.noise[axis][FORCE];
    }
    let [before, here, after] = [before, at, after].map(|at| record.smoothed_states[at][axis]);
    let rate = match channel {
        0 if axis == 0 => here.rod_velocity_m_per_s,
        0 => -here.rod_velocity_m_per_s,
        channel => {
            let [before, after] = [before, after].map(|point| point.pressures_pa[channel - 2]);
            (after - before) / (2.0 * PERIOD_S)
        }
    };
    rate * record.jitter_s / record.noise[axis][channel]
}

/// A number of mean 0 and variance 1 [Box, Muller 1958, Ann. Math. Stat. 29(2), eq. 1].
pub(super) fn gaussian(random: &mut Pcg64) -> f64 {
    const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
    let never_zero = ((random.next_u64() >> 11) + 1) as f64 * STEP;
    let turn = (random.next_u64() >> 11) as f64 * STEP;
    (-2.0 * never_zero.ln()).sqrt() * (TAU * turn).cos()
}
