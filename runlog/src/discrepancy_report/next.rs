//! The next experiment.

use serde::{Deserialize, Serialize};

/// What to measure next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct NextExperiment {
    /// Why this experiment, or why none, in a sentence.
    pub reason: String,
    /// File of the experiment beside the report; null when none discriminates.
    pub experiment: Option<String>,
    /// Expected divergence of the alternatives, in squared standard deviations; the target is 25.
    pub divergence: Option<f64>,
    /// Share of the rehearsed records of the best experiment that tell the alternatives apart.
    pub probability: Option<f64>,
    /// Interval of `probability`, 95 %.
    pub probability_interval: Option<[f64; 2]>,
    /// How many records were rehearsed.
    pub rehearsals: Option<usize>,
    /// The experiment after this one, where it leaves much open.
    pub then: Option<SecondExperiment>,
    /// Manual measurement that resolves the ambiguity where no experiment does.
    pub otherwise: Option<String>,
}

/// An experiment after the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SecondExperiment {
    /// Its name in the menu.
    pub experiment: String,
    /// Probability that one of the two, or both together, tell the alternatives apart.
    pub probability: f64,
    /// Interval of `probability`, 95 %.
    pub probability_interval: [f64; 2],
}
