//! The explanations of the records, each with the figures that its probability rests on: nothing, parameters alone, sets of
//! effects, none of these.
//!
//! ```text
//!   model of the selection, then all fits by loss ──► a set of effects each ──► alike sets together ──► the first few
//!   features of each: loss over dof, loss above the best, parameters moved, agreement of the windows, amplitude, share
//! ```
//!
//! A set has the effects that are large enough to be named; fits that differ in smaller ones beside them are the same
//! explanation, and its features are those of the best of them. Sets are alike when they differ in one effect, and the responses
//! to the two have a cosine above [`ALIKE_COSINE`], parameters projected out. Losses are J, the penalised loss of a fit:
//! minus twice the log-likelihood of the windows, priors and penalties included.

use super::probabilities::probabilities;
use super::{
    amplitude_ratio, axes_of, heterogeneity::heterogeneity, is_large, is_same_effect, loss_on, share_removed,
};
use crate::engine::Engine;
use crate::fit;
use crate::parameters::{COUNT, PARAMETERS};
use crate::refit::{EffectEstimate, FittedModel, Linearisation, linearise, parameter_precisions};
use crate::report::{ExplanationKind, Features, Marginal};
use crate::screen::Columns;

/// Number of sets of effects, alike ones counted once.
const SETS: usize = 4;
/// Cosine above which the responses to two effects are alike; that of the study's classes.
const ALIKE_COSINE: f64 = 0.95;

/// An explanation and its features; none of these has none.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// Nothing, parameters alone, effects, or none of these.
    pub kind: ExplanationKind,
    /// Sets of effects that these records cannot tell apart, the best first.
    pub sets: Vec<Vec<EffectEstimate>>,
    /// Of the best set, or of the model without effects; `None` for none of these.
    pub features: Option<Features>,
    /// Of the best set of effects, small ones beside them included.
    pub(super) fit: Option<FittedModel>,
    /// All sum to one.
    pub(crate) probability: f64,
    /// The second rule; none for linked rods.
    pub marginal: Option<Marginal>,
}

/// The fits that explanations are made of.
pub(super) struct Fits<'a> {
    pub(super) parameters: &'a FittedModel,
    /// Of the selection.
    pub(super) model: &'a FittedModel,
    pub(super) fitted: &'a [FittedModel],
}

/// All explanations that were fitted: nothing, parameters, the best sets of effects, none of these.
pub(super) fn explanations(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    columns: &Columns,
    fits: &Fits<'_>,
) -> Vec<Explanation> {
    let at_model = linearise(engine, fits.model);
    let dof: f64 = engine.scaled_dof.iter().sum();
    // Of linked rods each model has start states of its own.
    let restarted = engine.is_linked().then(|| engine.with_starts_under(&engine.rig));
    let of_rig_file = restarted.as_ref().unwrap_or(engine);
    let baseline = of_rig_file.squares(&of_rig_file.residual(&of_rig_file.simulate(&engine.rig)));
    let null_loss = fit::loss(&baseline, &of_rig_file.scaled_dof);
    let similarity = ResponseSimilarity::new(engine, linearisation, columns, fits.model);
    let classes = classes(fits, |left, right| similarity.are_alike(left, right));
    let losses = classes.iter().map(|class| class[0].loss).chain([null_loss, fits.parameters.loss]);
    let best = losses.fold(f64::INFINITY, f64::min);
    let features = |loss: f64, factors: &[f64; COUNT]| Features {
        loss_per_dof: loss / dof,
        loss_difference: loss - best,
        parameters_moved: parameters_moved(factors),
        amplitude_variation: None,
        smallest_amplitude: None,
        small_beside: 0,
        share: share_removed(fits.parameters.loss, loss),
    };
    let without_effects = |kind, features| Explanation {
        kind,
        sets: Vec::new(),
        features,
        fit: None,
        probability: 0.0,
        marginal: None,
    };
    let mut all = vec![
        without_effects(ExplanationKind::Null, Some(features(null_loss, &[1.0; COUNT]))),
        without_effects(
            ExplanationKind::Parameters,
            Some(features(fits.parameters.loss, &fits.parameters.factors)),
        ),
    ];
    all.extend(classes.iter().map(|class| {
        let best = class[0];
        let variations = heterogeneity(engine, &at_model, best).map(|all| {
            let of_large = all.into_iter().zip(&best.effects).filter(|(_, effect)| is_large(effect));
            of_large.map(|(effect, _)| effect.variation).fold(0.0, f64::max)
        });
        let named = large(best);
        let axes = axes_of(&named);
        let [after, before] = [best, fits.parameters].map(|fit| loss_on(engine, axes, fit));
        let features = Features {
            loss_per_dof: after / engine.loss_on(axes, &best.squares).1,
            share: share_removed(before, after),
            amplitude_variation: variations,
            smallest_amplitude: Some(named.iter().map(amplitude_ratio).fold(f64::INFINITY, f64::min)),
            small_beside: best.effects.len() - named.len(),
            ..features(best.loss, &best.factors)
        };
        Explanation {
            kind: ExplanationKind::Effects,
            sets: class.iter().map(|fit| large(fit)).collect(),
            features: Some(features),
            fit: Some(best.clone()),
            probability: 0.0,
            marginal: None,
        }
    }));
    all.push(without_effects(ExplanationKind::NoneOfThese, None));
    let probabilities = probabilities(&all);
    all.iter_mut().zip(probabilities).for_each(|(one, probability)| one.probability = probability);
    all
}

fn parameters_moved(factors: &[f64; COUNT]) -> f64 {
    let deviations = factors.iter().zip(&PARAMETERS).map(|(factor, parameter)| {
        let square = ((factor - 1.0) / parameter.prior_std).powi(2);
        square / (square + 1.0)
    });
    deviations.sum()
}

/// Its effects that are large enough to be named.
fn large(fit: &FittedModel) -> Vec<EffectEstimate> {
    fit.effects.iter().filter(|effect| is_large(effect)).cloned().collect()
}

/// The best fit of each set of large effects, alike ones together: the model's class first, then by loss.
fn classes<'a>(
    fits: &Fits<'a>,
    are_alike: impl Fn(&EffectEstimate, &EffectEstimate) -> bool,
) -> Vec<Vec<&'a FittedModel>> {
    let mut all: Vec<&FittedModel> = fits.fitted.iter().collect();
    all.sort_by(|left, right| left.loss.total_cmp(&right.loss));
    all.insert(0, fits.model);
    let mut classes: Vec<Vec<&FittedModel>> = Vec::new();
    for fit in all {
        if large(fit).is_empty()
            || classes.iter().flatten().any(|other| has_all(other, fit) && has_all(fit, other))
        {
            continue;
        }
        match classes.iter().position(|class| differ_by_alike(class[0], fit, &are_alike)) {
            Some(at) => classes[at].push(fit),
            None if classes.len() < SETS => classes.push(vec![fit]),
            None => {}
        }
    }
    classes
}

/// Whether a model has all large effects of another one among its own.
fn has_all(model: &FittedModel, other: &FittedModel) -> bool {
    let large_of_model = large(model);
    large(other).iter().all(|effect| large_of_model.iter().any(|of_model| is_same_effect(of_model, effect)))
}

fn differ_by_alike(
    left: &FittedModel,
    right: &FittedModel,
    are_alike: impl Fn(&EffectEstimate, &EffectEstimate) -> bool,
) -> bool {
    let only = |of: &FittedModel, other: &FittedModel| -> Vec<EffectEstimate> {
        let others = large(other);
        large(of)
            .into_iter()
            .filter(|effect| !others.iter().any(|other| is_same_effect(effect, other)))
            .collect()
    };
    match (&only(left, right)[..], &only(right, left)[..]) {
        ([left], [right]) => are_alike(left, right),
        _ => false,
    }
}

/// Responses to effects, parameters projected out.
struct ResponseSimilarity<'a> {
    columns: &'a Columns,
    /// Products of the columns of all probes.
    products: nalgebra::DMatrix<f64>,
}

impl<'a> ResponseSimilarity<'a> {
    /// With the weights of a model's windows.
    fn new(
        engine: &Engine<'_>,
        linearisation: &Linearisation,
        columns: &'a Columns,
        model: &FittedModel,
    ) -> Self {
        let probes = (0..columns.count()).map(|index| columns.column(index));
        let all: Vec<&[f64]> = linearisation.columns.iter().map(Vec::as_slice).chain(probes).collect();
        let products = engine.products(&vec![0.0; all[0].len()], &all);
        let mut precisions = parameter_precisions();
        precisions.resize(all.len(), 0.0);
        let chosen: Vec<usize> = (0..all.len()).collect();
        let (normal, _) = products.normal(&chosen, &products.weights(&model.squares), &precisions);
        let further = all.len() - COUNT;
        let between = normal.view((0, COUNT), (COUNT, further));
        let among = normal.view((COUNT, COUNT), (further, further));
        let projected = match normal.view((0, 0), (COUNT, COUNT)).into_owned().cholesky() {
            Some(parameters) => among - between.transpose() * parameters.solve(&between.into_owned()),
            None => among.into_owned(),
        };
        ResponseSimilarity { columns, products: projected }
    }

    fn are_alike(&self, left: &EffectEstimate, right: &EffectEstimate) -> bool {
        let probes = |effect: &EffectEstimate| -> Vec<usize> {
            let candidates = &self.columns.candidates;
            let is_it = |candidate: &crate::candidates::Candidate| {
                candidate.sheet.name == effect.candidate.sheet.name
                    && candidate.place == effect.candidate.place
            };
            let at = candidates.iter().position(is_it);
            at.map_or(Vec::new(), |at| self.columns.probes[at].iter().map(|(_, index)| *index).collect())
        };
        let right = probes(right);
        probes(left).iter().any(|left| right.iter().any(|right| self.cosine(*left, *right) > ALIKE_COSINE))
    }

    fn cosine(&self, left: usize, right: usize) -> f64 {
        let products = &self.products;
        let lengths = (products[(left, left)] * products[(right, right)]).max(0.0).sqrt();
        if lengths > 0.0 { products[(left, right)].abs() / lengths } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidates::Candidate;
    use plant::RigParameters;

    fn fit(names: &[&str], loss: f64) -> FittedModel {
        let all = Candidate::all(&RigParameters::baseline(), [true, false], false, &[]);
        let effect = |name: &&str| {
            let candidate = *all.iter().find(|candidate| candidate.sheet.name == *name).unwrap();
            let mut coordinates = candidate.origin();
            coordinates[0] = 1.0;
            EffectEstimate { candidate, coordinates }
        };
        FittedModel {
            effects: names.iter().map(effect).collect(),
            factors: [1.0; COUNT],
            loss,
            squares: Vec::new(),
            errors: Vec::new(),
            design_effect: 1.0,
            convergence: Default::default(),
        }
    }

    #[test]
    fn a_parameter_counts_by_its_tolerance() {
        let mut factors = [1.0; COUNT];
        assert_eq!(parameters_moved(&factors), 0.0);
        factors[0] += PARAMETERS[0].prior_std;
        assert!((parameters_moved(&factors) - 0.5).abs() < 1e-9);
        factors[1] += 100.0 * PARAMETERS[1].prior_std;
        assert!((parameters_moved(&factors) - 1.5).abs() < 1e-3);
    }

    #[test]
    fn the_models_class_is_first_and_alike_sets_are_one() {
        let [model, parameters] = [fit(&["inclination"], 5.0), fit(&[], 90.0)];
        let fitted = [
            fit(&["dead-volume"], 4.0),
            fit(&["inclination"], 6.0),
            fit(&["friction-asymmetry"], 7.0),
            fit(&["friction-asymmetry", "dead-volume"], 3.0),
            fit(&["dead-volume", "inclination"], 2.0),
        ];
        let fits = Fits { parameters: &parameters, model: &model, fitted: &fitted };
        let alike = |left: &EffectEstimate, right: &EffectEstimate| {
            [left, right].iter().all(|effect| effect.candidate.sheet.name != "dead-volume")
        };
        let losses: Vec<Vec<f64>> =
            classes(&fits, alike).iter().map(|class| class.iter().map(|fit| fit.loss).collect()).collect();
        assert_eq!(losses, [vec![5.0, 7.0], vec![2.0, 3.0], vec![4.0]]);
    }
}
