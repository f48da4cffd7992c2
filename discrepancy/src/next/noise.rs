//! Sensor noise of the training records, drawn anew for a rehearsed record.
//!
//! ```text
//!   reading(t) = shown(t + dt) + e(t)      e(t) = r e(t - 1) + sqrt(1 - r^2) s w(t),  w ~ N(0, 1)
//!                                          dt ~ N(0, jitter^2), common to all readings of an instant
//! ```
//!
//! s, r and the jitter are those that the gridding of the training record estimated.

use super::closed_loop::ClosedLoopRun;
use super::divergence::noise_with_rounding;
use crate::gridded_record::{CHANNELS, GriddedRecord};
use plant::{PERIOD_S, RigParameters};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};

/// Standard deviation and lag-1 autocorrelation of each reading, and jitter of the sampling instant.
#[derive(Clone, Debug)]
pub struct ReadingNoise {
    /// Standard deviations, SI.
    deviation: [[f64; CHANNELS]; 2],
    lag1_autocorrelation: [[f64; CHANNELS]; 2],
    jitter_s: f64,
}

impl ReadingNoise {
    /// White noise as the rig file specifies it.
    pub fn specified(rig: &RigParameters) -> Self {
        let deviation = [noise_with_rounding(rig); 2];
        ReadingNoise { deviation, lag1_autocorrelation: [[0.0; CHANNELS]; 2], jitter_s: 0.0 }
    }

    /// The noise of a record; of an axis that it does not show, the specified one.
    pub(crate) fn of(record: &GriddedRecord, rig: &RigParameters) -> Self {
        let mut noise = ReadingNoise { jitter_s: record.jitter_s, ..Self::specified(rig) };
        for axis in (0..2).filter(|axis| record.measured[*axis]) {
            noise.deviation[axis] = record.noise[axis];
            noise.lag1_autocorrelation[axis] = record.lag1_autocorrelation[axis];
        }
        noise
    }

    /// The record that a run would leave on the measured axes.
    pub(crate) fn record(
        &self,
        run: &ClosedLoopRun,
        rig: &RigParameters,
        measured: [bool; 2],
        seed: u64,
    ) -> GriddedRecord {
        let mut random = Pcg64::seed_from_u64(seed);
        let normal = Normal::standard();
        // Half of a step of 2^-53 above 0: never 0 and never 1.
        let mut gaussian =
            || normal.inverse_cdf(((random.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64);
        let mut lasting = [[None::<f64>; CHANNELS]; 2];
        let last = run.readings.len().saturating_sub(1);
        let samples = (0..run.readings.len())
            .map(|at| {
                let early_s = self.jitter_s * gaussian();
                let mut samples = [[None; CHANNELS]; 2];
                for axis in (0..2).filter(|axis| measured[*axis]) {
                    for channel in 0..CHANNELS {
                        let r = self.lag1_autocorrelation[axis][channel];
                        let new = self.deviation[axis][channel] * gaussian();
                        let error = match lasting[axis][channel] {
                            Some(before) => r * before + (1.0 - r * r).sqrt() * new,
                            None => new,
                        };
                        lasting[axis][channel] = Some(error);
                        let of = |at: usize| run.readings[at][axis][channel];
                        let rate = (of((at + 1).min(last)) - of(at.saturating_sub(1))) / (2.0 * PERIOD_S);
                        samples[axis][channel] = Some(of(at) + rate * early_s + error);
                    }
                }
                samples
            })
            .collect();
        // The record of one axis says nothing of the other's valve.
        let mut inputs = run.inputs.clone();
        for axis in (0..2).filter(|axis| !measured[*axis]) {
            inputs.iter_mut().for_each(|inputs| inputs.valve[axis] = 0.0);
        }
        let given = GriddedRecord {
            name: String::new(),
            linked: run.linked,
            added_mass_kg: run.added_mass_kg,
            measured,
            inputs,
            samples,
            noise: self.deviation,
            ..GriddedRecord::default()
        };
        GriddedRecord::of_samples(given, rig)
    }
}
