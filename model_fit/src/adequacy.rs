//! Tests whether the residual of an output is its noise.
//!
//! ```text
//!   rms^2 = sum e_i^2 / n                          e: residual on the training records
//!   s^2   = noise of the file, or sum (e_(i+1) - e_i)^2 / (2 m) over m pairs of neighbouring rows
//!   b^2   = rms^2 - s^2 - model_error^2            what is neither
//! ```
//! It is more than noise where b^2 is over half of rms^2, over 3/sqrt(n) of it (three standard errors of s^2/rms^2 beside white
//! noise) and b over a thousandth of the output's standard deviation. The ratio s^2/rms^2 is half of von Neumann's: near 1 for
//! white noise, near 0 for a residual that follows from its neighbours. Noise that is coloured over several samples looks like a
//! missing term: its file declares `noise`. A missing term below the noise, or faster than the samples, is not seen.
//!
//! Source: von Neumann 1941, Annals of Mathematical Statistics 12(4).

use super::fit::{Fitting, OutputSeries};
use super::report::{ModelReport, significant};
use super::select::Fitted;
use crate::Verdict;
use crate::stats::mean_and_variance;
use model::Failure;
use serde::Serialize;

/// Least share of the residual's power that is neither noise nor model error.
const MOST_OF_IT: f64 = 0.5;
/// Standard errors of that share.
const CERTAIN: f64 = 3.0;
/// Share of an output's standard deviation below which nothing is called missing: integration and rounding of a file.
const NEGLIGIBLE: f64 = 1e-3;

/// Residual of an output over all training records, under the reported model.
#[derive(Clone, Debug, Serialize)]
pub struct Residual {
    pub(crate) output: String,
    pub(crate) unit: String,
    /// Root mean square of measured less modelled; this, noise, model error and signal are in the output's unit.
    pub rms: f64,
    /// Standard deviation of the noise: of the file, or by differences of neighbours.
    pub noise: f64,
    /// Whether `noise` is that of the file, not an estimate.
    pub is_noise_declared: bool,
    /// Standard deviation of an error that the file declares as that of the model.
    pub(crate) model_error_rms: f64,
    /// Standard deviation of what was measured.
    pub signal_rms: f64,
    /// Whether it is no more than noise and declared error.
    pub is_noise: bool,
}

impl Residual {
    /// Square of the residual's rms less those of noise and declared error.
    fn excess_squared(&self) -> f64 {
        self.rms.powi(2) - self.noise.powi(2) - self.model_error_rms.powi(2)
    }

    /// The residual's rms beside the signal's and the noise.
    #[must_use]
    pub fn in_words(&self) -> String {
        let Self { output, unit, .. } = self;
        let [rms, signal, noise] = [self.rms, self.signal_rms, self.noise].map(significant);
        let error = match self.model_error_rms > 0.0 {
            true => format!(", declared model error {} {unit}", significant(self.model_error_rms)),
            false => String::new(),
        };
        format!("{output} {rms} {unit} rms of a signal of {signal} {unit}, noise {noise} {unit}{error}")
    }
}

/// Residual of each output under a fitted model.
pub(super) fn residuals(fitted: &Fitted<'_>) -> Result<Vec<Residual>, Failure> {
    let fitting = &fitted.fitting;
    let residuals = fitting.residuals(&fitted.point.values_si)?;
    Ok((0..fitting.model.outputs.len()).map(|output| residual(fitting, &residuals, output)).collect())
}

fn residual(fitting: &Fitting<'_>, residuals: &[OutputSeries], output: usize) -> Residual {
    let of_model = &fitting.model.outputs[output];
    let every = fitting.model.rows.every;
    let (mut differences, mut measured, mut squares) = (Vec::new(), Vec::new(), 0.0);
    for (record, of_record) in fitting.records.iter().zip(residuals) {
        let [residual, _] = &of_record[output];
        for (row, value) in residual.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            squares += value * value;
            let next = record.rows.get(row + 1).filter(|next| **next == record.rows[row] + every);
            let difference =
                next.map(|_| residual[row + 1] - value).filter(|difference| difference.is_finite());
            differences.extend(difference);
        }
        measured.extend(record.outputs[output].iter().flatten().copied());
    }
    let rows = measured.len().max(1) as f64;
    let rms_si = (squares / rows).sqrt();
    let noise_si = of_model.noise_si.unwrap_or_else(|| {
        let sum: f64 = differences.iter().map(|difference| difference * difference).sum();
        // Without a pair of neighbours nothing says that it is more than noise.
        if differences.is_empty() { rms_si } else { (sum / (2.0 * differences.len() as f64)).sqrt() }
    });
    let [rms, noise, model_error, signal] =
        [rms_si, noise_si, of_model.model_error_si, mean_and_variance(&measured).1.sqrt()]
            .map(|value| value / of_model.unit.factor);
    let residual = Residual {
        output: of_model.name.clone(),
        unit: of_model.unit.text.clone(),
        rms,
        noise,
        is_noise_declared: of_model.noise_si.is_some(),
        model_error_rms: model_error,
        signal_rms: signal,
        is_noise: true,
    };
    let least = MOST_OF_IT.max(CERTAIN / rows.sqrt()) * rms * rms;
    let is_noise = residual.excess_squared() <= least.max((NEGLIGIBLE * signal).powi(2));
    Residual { is_noise, ..residual }
}

impl ModelReport {
    /// Takes the residuals into the verdict and the headline, after the held-out records have been.
    pub(super) fn rate(&mut self, residuals: Vec<Residual>) {
        let worst = residuals.iter().filter(|one| !one.is_noise).max_by(|one, other| {
            let [one, other] = [one, other].map(|one| one.excess_squared() / one.signal_rms.powi(2));
            one.total_cmp(&other)
        });
        self.adequate = worst.is_none();
        if let Some(worst) = worst {
            let residual = worst.in_words();
            self.headline = match self.verdict {
                Verdict::NothingMissing if self.suspects.is_empty() => {
                    format!("{}, and what is left is more than noise: {residual}", self.headline)
                }
                Verdict::NothingMissing => format!("None of the suspects explains what is left: {residual}"),
                _ => format!("{}; more is missing beside: {residual}", self.headline),
            };
            if self.verdict == Verdict::NothingMissing {
                self.verdict = Verdict::OutsideCatalogue;
            }
        }
        self.residuals = residuals;
    }
}
