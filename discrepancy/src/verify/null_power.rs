//! Null distribution of the residual power, from draws of noise and synthetic records.

use super::Model;
use super::power::{Power, levels, pooled, sums, untrimmed};
use crate::windows::Windows;
use model_fit::parallel;
use model_fit::stats::mean_and_variance;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;

/// Draws of noise.
const DRAWS: usize = 60;
/// Synthetic records.
const RECORDS: usize = 8;
/// Fixed seed: the range is a result and has the same bits in each run.
const SEED: u64 = 0x7e1d_0c7a_11ed_0006;
/// 97.5th percentiles of the standard normal, and of Student's t with the degrees of freedom of the synthetic records.
const Z_975: f64 = 1.96;
const T_975: f64 = 2.365;

#[derive(Debug)]
pub(super) struct NullPower {
    /// Mean sum of squares of each window and output, window by window.
    pub(super) expected: Vec<f64>,
    /// Mean of [`Power::lower_decile`], of each output.
    pub(super) lower_decile: Vec<f64>,
    /// Standard deviation of each output's pooled power.
    pub(super) pooled_sds: Vec<f64>,
    /// 95 % range of chi2 per degree of freedom: of the draws of noise or of the synthetic records, whichever is wider.
    pub(super) range: [f64; 2],
}

impl NullPower {
    /// Of a model on a record. For a long record the synthetic records cover a `part`, and their standard deviation is
    /// scaled by the number of windows.
    pub(super) fn new(model: &Model<'_>, part: Option<&Model<'_>>) -> Self {
        let (mut null, of_noise) = Self::of_noise(&model.windows);
        let (mean, of_records) = match part {
            None => null.of_records(model),
            Some(part) => {
                let (mean, deviation) = Self::of_noise(&part.windows).0.of_records(part);
                (mean, deviation * (part.windows.count() as f64 / model.windows.count() as f64).sqrt())
            }
        };
        let half = (Z_975 * of_noise).max(T_975 * of_records) * (1.0 + 1.0 / RECORDS as f64).sqrt();
        null.range = [mean - half, mean + half];
        null
    }

    /// All but the range, and the standard deviation of the joint power of noise.
    fn of_noise(windows: &Windows<'_>) -> (Self, f64) {
        let outputs = windows.outputs.len();
        let draws = parallel::map_range(0..DRAWS, |draw| {
            sums(&windows.noise(&mut Pcg64::seed_from_u64(SEED ^ draw as u64)), outputs)
        });
        // Windows differ in their degrees of freedom; outputs without samples have none.
        let mut expected = vec![0.0; windows.count() * outputs];
        for draw in &draws {
            expected.iter_mut().zip(draw).for_each(|(sum, value)| *sum += value / DRAWS as f64);
        }
        let powers: Vec<Power> = draws.iter().map(|draw| Power::new(draw, &expected, outputs)).collect();
        let lower_decile = (0..outputs)
            .map(|output| powers.iter().map(|power| power.lower_decile()[output]).sum::<f64>() / DRAWS as f64)
            .collect();
        let mut null = NullPower { expected, lower_decile, pooled_sds: Vec::new(), range: [1.0; 2] };
        // Each draw is processed like a record: level correction and trimming.
        let powers: Vec<Power> =
            powers.iter().map(|power| power.divided_by_levels(&levels(power, &null))).collect();
        let of_output = |power: &Power, output: usize| {
            let squares = power.output(output);
            pooled(&squares, &untrimmed(&squares))
        };
        null.pooled_sds = (0..outputs)
            .map(|output| {
                let pooled: Vec<f64> = powers.iter().map(|power| of_output(power, output)).collect();
                mean_and_sd(&pooled).1
            })
            .collect();
        let (_, of_noise) = mean_and_sd(&powers.iter().map(joint).collect::<Vec<_>>());
        (null, of_noise)
    }

    /// Mean and standard deviation of the joint power of synthetic records. Around a stop or a break-away the residual of even
    /// the true model is more than noise, since start states are known to micrometres only.
    fn of_records(&self, model: &Model<'_>) -> (f64, f64) {
        let outputs = model.windows.outputs.len();
        let sensitivities = model.windows.sensitivities();
        let powers = parallel::map_range(0..RECORDS, |draw| {
            let mut random = Pcg64::seed_from_u64(SEED ^ (DRAWS + draw) as u64);
            let windows = model.windows.redrawn(&model.simulated, &sensitivities, &mut random);
            let residual = windows.residual(&windows.simulate(&windows.rig));
            let power = Power::new(&sums(&residual, outputs), &self.expected, outputs);
            joint(&power.divided_by_levels(&levels(&power, self)))
        });
        mean_and_sd(&powers)
    }
}

fn joint(power: &Power) -> f64 {
    let squares = power.joint();
    pooled(&squares, &untrimmed(&squares))
}

fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let (mean, variance) = mean_and_variance(values);
    (mean, variance.sqrt())
}
