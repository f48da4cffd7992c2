//! Probabilities of the explanations: a conditional logit of their features (McFadden 1974).
//!
//! Of a record, explanation j has the probability (1 - lapse) exp(w'x_j) / sum_k exp(w'x_k), that of none of these the lapse
//! more. The regressors x are transforms of the features (logarithms, a clamp) and indicators of the kind and of the search's own
//! set; none of these has a constant utility. `discrepancy/study/explanations.py` fits w to draws of the study whose truth is
//! known; its function `regressors` gives the same x. What they say holds where nothing, parameters and effects are as frequent
//! as in those draws.

use super::explanations::Explanation;
use crate::report::ExplanationKind;
use serde::Deserialize;
use std::sync::LazyLock;

static WEIGHTS: LazyLock<Weights> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../study/weights.json")).expect("weights of a fit")
});

/// Scales of the features, fixed with the weights: the loss difference and the lack of fit of the search when they were fitted, a
/// variation that chance does not give.
const LOSS_DIFFERENCE_SCALE: f64 = 9.0;
const EXCESS_SCALE: f64 = 0.08;
const VARIATION_SCALE: f64 = 0.1;
/// Above so many times the smallest amplitude that is named, a larger one counts no more.
const LARGEST_RATIO: f64 = 10.0;
/// Amplitude variation assumed for effects whose amplitude cannot be estimated by window.
const UNKNOWN_VARIATION: f64 = 1.0;
/// Lower bound of the soft count of moved parameters, and the count at which its logarithm is 0.
const SMALLEST_MOVED: f64 = 1e-3;
const MOVED_SCALE: f64 = 0.1;

/// Utility for each unit of a regressor.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Weights {
    parameters: f64,
    effects: f64,
    none_of_these: f64,
    /// The first set of effects: that of the search, or the best fit where it selected none.
    selected: f64,
    #[serde(rename = "behind")]
    loss_difference: f64,
    excess: f64,
    /// Of effects, on top of `excess`: the laws of a catalogue are never exact.
    excess_of_effects: f64,
    parameters_alone: f64,
    variation: f64,
    amplitude: f64,
    /// Probability of none of these whatever the features say.
    lapse: f64,
}

/// Of each explanation, in their order; they sum to one.
pub(super) fn probabilities(explanations: &[Explanation]) -> Vec<f64> {
    let selected = explanations.iter().position(|one| one.kind == ExplanationKind::Effects);
    let utilities: Vec<f64> = explanations
        .iter()
        .enumerate()
        .map(|(at, one)| utility(one, &WEIGHTS) + if selected == Some(at) { WEIGHTS.selected } else { 0.0 })
        .collect();
    let most = utilities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Vec<f64> = utilities.iter().map(|utility| (utility - most).exp()).collect();
    let sum: f64 = shares.iter().sum();
    let lapse = |one: &Explanation| if one.features.is_none() { WEIGHTS.lapse } else { 0.0 };
    let weighed = shares.into_iter().zip(explanations);
    weighed.map(|(share, one)| (1.0 - WEIGHTS.lapse) * share / sum + lapse(one)).collect()
}

fn utility(explanation: &Explanation, weights: &Weights) -> f64 {
    let Some(features) = &explanation.features else { return weights.none_of_these };
    let of_kind = match explanation.kind {
        ExplanationKind::Parameters => {
            let moved = features.parameters_moved.max(SMALLEST_MOVED) / MOVED_SCALE;
            weights.parameters + weights.parameters_alone * moved.ln()
        }
        ExplanationKind::Effects => weights.effects,
        ExplanationKind::Null | ExplanationKind::NoneOfThese => 0.0,
    };
    let smallest = features.smallest_amplitude.unwrap_or(1.0);
    let (of_effects, variation) = match explanation.kind {
        ExplanationKind::Effects => {
            (weights.excess_of_effects, features.amplitude_variation.unwrap_or(UNKNOWN_VARIATION))
        }
        _ => (0.0, 0.0),
    };
    of_kind
        + weights.loss_difference * (features.loss_difference / LOSS_DIFFERENCE_SCALE).ln_1p()
        + (weights.excess + of_effects) * (features.loss_per_dof.max(0.0) / EXCESS_SCALE).ln_1p()
        + weights.variation * (variation / VARIATION_SCALE).ln_1p()
        + weights.amplitude * smallest.clamp(1.0, LARGEST_RATIO).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Features;

    fn explanation(kind: ExplanationKind, loss_per_dof: f64, loss_difference: f64) -> Explanation {
        let features = Features {
            loss_per_dof,
            loss_difference,
            parameters_moved: 0.0,
            amplitude_variation: None,
            smallest_amplitude: None,
            small_beside: 0,
            share: 0.0,
        };
        let features = (kind != ExplanationKind::NoneOfThese).then_some(features);
        Explanation { kind, sets: Vec::new(), features, fit: None, probability: 0.0, marginal: None }
    }

    #[test]
    fn probabilities_sum_to_one_and_follow_what_is_left() {
        let of = |null_loss_per_dof: f64, null_loss_difference: f64| {
            probabilities(&[
                explanation(ExplanationKind::Null, null_loss_per_dof, null_loss_difference),
                explanation(ExplanationKind::Parameters, 0.0, 0.0),
                explanation(ExplanationKind::NoneOfThese, 0.0, 0.0),
            ])
        };
        let [clean, wrong] = [of(0.0, 2.0), of(4.0, 3e5)];
        for all in [&clean, &wrong] {
            assert!((all.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        assert!(
            clean[0] > clean[1].max(clean[2]) && wrong[0] < wrong[1].min(wrong[2]),
            "{clean:?} {wrong:?}"
        );
        let nobody = probabilities(&[
            explanation(ExplanationKind::Null, 4.0, 1e5),
            explanation(ExplanationKind::Parameters, 2.0, 0.0),
            explanation(ExplanationKind::NoneOfThese, 0.0, 0.0),
        ]);
        assert!(nobody[2] > nobody[0].max(nobody[1]), "{nobody:?}");
        assert!(probabilities(&[]).is_empty());
    }
}
