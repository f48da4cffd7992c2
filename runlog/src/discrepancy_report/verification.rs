//! Both models on the held-out record.

use super::{null_is_nan, unknown};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The misfit of a signal of the held-out record, rms over windows, in the signal's unit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SignalMisfit {
    /// Baseline against measurement.
    #[serde(default = "unknown", deserialize_with = "null_is_nan")]
    pub before: f64,
    /// Extended model against measurement.
    #[serde(default = "unknown", deserialize_with = "null_is_nan")]
    pub after: f64,
    /// Noise of the sensor alone.
    #[serde(default = "unknown", deserialize_with = "null_is_nan")]
    pub floor: f64,
    /// Closed share of the excess power over the floor, 1 - (after^2 - floor^2) / (before^2 - floor^2), at most 1; null when the
    /// excess is insignificant.
    pub closed: Option<f64>,
}

/// Figures of both models on the held-out record.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Verification {
    /// The record as it was given.
    #[serde(default)]
    pub record: String,
    /// Windowed chi2 per degree of freedom of the baseline.
    #[serde(default = "unknown", deserialize_with = "null_is_nan")]
    pub chi2_before: f64,
    /// Windowed chi2 per degree of freedom of the extended model.
    #[serde(deserialize_with = "null_is_nan")]
    pub chi2_after: f64,
    /// 95 % null range of `chi2_after`.
    pub chi2_null: [f64; 2],
    /// Per signal: normalised rms error of a free run, in percent of the signal's range.
    #[serde(skip_deserializing)]
    pub free_run_nrmse_percent: BTreeMap<String, BeforeAfter>,
    /// Per signal: lag-1 autocorrelation of the windowed residuals.
    #[serde(skip_deserializing)]
    pub whiteness: BTreeMap<String, BeforeAfter>,
    /// Unphysical events of the free run, in words.
    #[serde(default)]
    pub physical: Vec<String>,
    /// Whether the extended model is better by more than three standard errors over independent windows and no signal worse by
    /// more than 2 %.
    #[serde(default)]
    pub confirmed: bool,
    /// Whether a signal's rms rises by more than 2 %.
    #[serde(default)]
    pub worse: bool,
    /// Whether `chi2_after` is not above its null range.
    #[serde(default)]
    pub adequate: bool,
    /// Whether the record shows more than the extended model has: `chi2_after` exceeds its null range, and the middle of it by
    /// the factor at which a model of the training records is not adequate.
    #[serde(default)]
    pub more_missing: bool,
}

/// A figure of the held-out record for the rig file as given and for the extended one.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BeforeAfter {
    /// Of the rig file as given.
    pub before: f64,
    /// Of the extended rig file.
    pub after: f64,
}
