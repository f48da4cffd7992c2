//! Priors of explanations, of sizes of the discrepancy term and of amplitudes.

use super::super::explanations::Explanation;
use crate::candidates::Candidate;
use crate::fit::evidence::{Covariance, HeavyTailed};
use crate::report::ExplanationKind;

/// Scale of the half-normal prior of the size in an explanation that is right, N and Nl/min: the smallest force that is named.
const SIZE_OF_RIGHT: f64 = 1.0;
/// Prior probability that it has no term at all.
const NO_TERM: f64 = 0.5;
/// Scale of the half-Cauchy prior of the size of none of these: the middle of the forces that are drawn.
const SIZE_OF_NONE: f64 = 20.0;
/// Degrees of freedom of the Student t priors of amplitudes and of shapes, and the scale of shapes, in widths of the drawn range.
const AMPLITUDE_DOF: f64 = 1.0;
const SHAPE_DOF: f64 = 4.0;
const SHAPE_SCALE: f64 = 0.5;

/// Prior probabilities of the kinds: as often nothing is missing as an effect is, and once in five what nobody listed.
const PRIOR_NULL: f64 = 0.2;
const PRIOR_PARAMETERS: f64 = 0.2;
const PRIOR_EFFECTS: f64 = 0.4;
const PRIOR_NONE_OF_THESE: f64 = 0.2;
/// Shares of the sets of one, two and three effects in that of effects.
const OF_SETS: [f64; 3] = [0.7, 0.25, 0.05];

/// Prior probability of an explanation. All sets of as many effects out of the candidates are equally probable, those that the
/// search did not list too: of so many, some fit by chance. Sets that count as one have that of all of them.
pub(super) fn prior_of(explanation: &Explanation, candidates: usize) -> f64 {
    match explanation.kind {
        ExplanationKind::Null => PRIOR_NULL,
        ExplanationKind::Parameters => PRIOR_PARAMETERS,
        ExplanationKind::NoneOfThese => PRIOR_NONE_OF_THESE,
        ExplanationKind::Effects => {
            let effects = explanation.fit.as_ref().map_or(1, |fit| fit.effects.len()).clamp(1, OF_SETS.len());
            let number: f64 = (0..effects).map(|at| (candidates - at) as f64 / (at + 1) as f64).product();
            PRIOR_EFFECTS * OF_SETS[effects - 1] * explanation.sets.len() as f64 / number.max(1.0)
        }
    }
}

/// Prior weights of sizes and correlation lengths of the term; they sum to one.
pub(super) fn prior_of_terms(covariances: &[Covariance], kind: ExplanationKind) -> Vec<f64> {
    // The density times the size, since the grid is even in its logarithm.
    let weight = |size: f64| match kind {
        ExplanationKind::NoneOfThese => size / (1.0 + (size / SIZE_OF_NONE).powi(2)),
        _ => size * (-0.5 * (size / SIZE_OF_RIGHT).powi(2)).exp(),
    };
    let total: f64 = covariances.iter().map(|covariance| weight(covariance.size)).sum();
    let none = if kind == ExplanationKind::NoneOfThese { 0.0 } else { NO_TERM };
    let of = |covariance: &Covariance| {
        if covariance.size == 0.0 { none } else { (1.0 - none) * weight(covariance.size) / total }
    };
    covariances.iter().map(of).collect()
}

pub(super) fn prior_of_coordinate(candidate: &Candidate, key: usize) -> HeavyTailed {
    if candidate.is_shape(key) {
        return HeavyTailed { scale: SHAPE_SCALE, dof: SHAPE_DOF, is_one_sided: false };
    }
    let ends = candidate.sheet.keys[key].drawn.map(|number| candidate.coordinate(key, number).abs());
    let [least, most] = candidate.fit_bounds(key);
    HeavyTailed { scale: 0.5 * (ends[0] + ends[1]), dof: AMPLITUDE_DOF, is_one_sided: least * most >= 0.0 }
}

/// Coordinates whose amplitude priors are wider by a factor; shapes stay.
pub(super) fn scaled(coordinates: &[(HeavyTailed, f64)], factor: f64) -> Vec<(HeavyTailed, f64)> {
    let wider = |(prior, z): &(HeavyTailed, f64)| {
        let scale = if prior.dof == AMPLITUDE_DOF { factor * prior.scale } else { prior.scale };
        (HeavyTailed { scale, ..*prior }, *z)
    };
    coordinates.iter().map(wider).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::COUNT;
    use crate::refit::{EffectEstimate, FittedModel};
    use plant::RigParameters;

    const KINDS: [ExplanationKind; 5] = [
        ExplanationKind::Null,
        ExplanationKind::Parameters,
        ExplanationKind::Effects,
        ExplanationKind::Effects,
        ExplanationKind::NoneOfThese,
    ];

    #[test]
    fn all_sets_of_as_many_effects_share_one_prior() {
        let of = |effects: usize, sets: usize| {
            let all = Candidate::all(&RigParameters::baseline(), [true, false], false, &[]);
            let effect = |candidate: &Candidate| EffectEstimate {
                candidate: *candidate,
                coordinates: candidate.origin(),
            };
            let fit = FittedModel {
                effects: all[..effects].iter().map(effect).collect(),
                factors: [1.0; COUNT],
                loss: 0.0,
                squares: Vec::new(),
                errors: Vec::new(),
                design_effect: 1.0,
                convergence: Default::default(),
            };
            let sets = vec![fit.effects.clone(); sets];
            let one = Explanation {
                kind: ExplanationKind::Effects,
                sets,
                features: None,
                fit: Some(fit),
                probability: 0.0,
                marginal: None,
            };
            prior_of(&one, 40)
        };
        let whole = 40.0 * of(1, 1) + 780.0 * of(2, 1) + 9880.0 * of(3, 1);
        assert!((whole - PRIOR_EFFECTS).abs() < 1e-12 && of(1, 2) == 2.0 * of(1, 1), "{whole}");
        let all = PRIOR_NULL + PRIOR_PARAMETERS + PRIOR_EFFECTS + PRIOR_NONE_OF_THESE;
        assert!((all - 1.0).abs() < 1e-12, "{all}");
    }

    #[test]
    fn only_none_of_these_expects_a_large_term() {
        let covariances: Vec<Covariance> = std::iter::once(0.0)
            .chain([0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])
            .map(|size| Covariance { size, correlation_blocks: 0.0 })
            .collect();
        for kind in KINDS {
            let prior = prior_of_terms(&covariances, kind);
            assert!((prior.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{prior:?}");
            let large: f64 = prior[5..].iter().sum();
            assert_eq!(large > 0.8, kind == ExplanationKind::NoneOfThese, "{prior:?}");
            assert_eq!(prior[0] == 0.0, kind == ExplanationKind::NoneOfThese, "{prior:?}");
        }
    }

    #[test]
    fn half_of_an_amplitudes_prior_is_below_the_middle_of_what_is_drawn() {
        for candidate in Candidate::all(&RigParameters::baseline(), [true, false], false, &[]) {
            let prior = prior_of_coordinate(&candidate, 0);
            let ends = candidate.sheet.keys[0].drawn.map(|number| candidate.coordinate(0, number).abs());
            assert!((0.5..=1.0).contains(&(prior.scale / ends[0].max(ends[1]))), "{}", candidate.name());
        }
    }
}
