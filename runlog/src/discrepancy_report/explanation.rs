//! What explains the training records, and how probable it is.

use super::{EffectPlace, NamedEffect, Report, null_is_nan};
use serde::{Deserialize, Serialize};

/// What is the case, if an explanation is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExplanationKind {
    /// The null hypothesis: the rig file as it is.
    #[serde(rename = "nothing")]
    Null,
    /// Parameters of the rig file that are off.
    Parameters,
    /// Effects of the catalogue, parameters beside them.
    Effects,
    /// Other effects of the catalogue, other sets of them, or what it does not have.
    NoneOfThese,
}

/// What the records say about an explanation; `evidence` in the report.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Features {
    /// Loss per degree of freedom: the mean log ratio of a window's chi2 to what noise gives, penalties included; on the axes
    /// that its effects act on, where both are recorded and the rods are not linked.
    pub loss_per_dof: f64,
    /// Loss above that of the best explanation: the difference of minus twice the log-likelihoods, penalties included.
    #[serde(rename = "behind")]
    pub loss_difference: f64,
    /// Number of parameters off the rig file's values, each counted by x^2 / (x^2 + tolerance^2) of its relative deviation x.
    pub parameters_moved: f64,
    /// Largest coefficient of variation of its effects' amplitudes between windows; null without effects, or where no derivative
    /// exists.
    pub amplitude_variation: Option<f64>,
    /// Smallest amplitude of its effects over the smallest that is named; null without effects.
    pub smallest_amplitude: Option<f64>,
    /// Number of effects beside them that are too small to be named.
    pub small_beside: usize,
    /// Share of the loss under parameters alone that it removes, on the same axes.
    pub share: f64,
}

/// How probable an explanation is by its marginal likelihood: a second rule, which decides nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Marginal {
    /// Log marginal likelihood, tempered, up to a constant of the records.
    #[serde(deserialize_with = "null_is_nan")]
    pub log_likelihood: f64,
    /// Those of all explanations sum to one.
    #[serde(deserialize_with = "null_is_nan")]
    pub probability: f64,
    /// Smallest and largest with the scale of the amplitude priors as it is, a third of it and three times it.
    pub probability_range: [f64; 2],
    /// Whether an amplitude was integrated by quadrature, and not by Laplace.
    pub by_quadrature: bool,
}

/// What may explain the training records, and how probable it is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Explanation {
    /// What is the case if it is right.
    pub kind: ExplanationKind,
    /// Sets of effects that the records cannot tell apart, the best first; empty without effects.
    pub sets: Vec<Vec<EffectPlace>>,
    /// Those of all explanations sum to one.
    #[serde(deserialize_with = "null_is_nan")]
    pub probability: f64,
    /// What the records say about it; null for none of these.
    #[serde(skip_deserializing)]
    pub evidence: Option<Features>,
    /// The second rule; null where it was not asked for (`--marginal-likelihoods`), for linked rods, and where an explanation has
    /// no mode.
    #[serde(default)]
    pub marginal: Option<Marginal>,
}

impl Report {
    /// The explanation whose effects are named; `None` where none is named, or smaller effects came in beside them.
    #[must_use]
    pub fn named_explanation(&self) -> Option<&Explanation> {
        let is_in = |set: &[EffectPlace], named: &NamedEffect| {
            set.iter().any(|one| one.effect == named.effect && one.place == named.place)
        };
        let is_named = |set: &Vec<EffectPlace>| {
            set.len() == self.named.len() && self.named.iter().all(|named| is_in(set, named))
        };
        self.explanations.iter().find(|one| !self.named.is_empty() && one.sets.iter().any(is_named))
    }

    /// The most probable explanation, where it is another one than the named.
    #[must_use]
    pub fn more_probable(&self) -> Option<&Explanation> {
        let named = self.named_explanation()?;
        let others = self.explanations.iter().filter(|one| one.probability > named.probability);
        others.max_by(|one, other| one.probability.total_cmp(&other.probability))
    }
}
