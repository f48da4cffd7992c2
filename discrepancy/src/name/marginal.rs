//! Marginal likelihoods of the explanations, and the probabilities that follow from them: a second rule, which is reported beside
//! the deciding one (`probabilities.rs`) and decides nothing.
//!
//! ```text
//!   Z_j = sum over sizes and correlation lengths of the term:  prior of both, times Z(j, size, length)         (fit/evidence.rs)
//!   Z(j, size, length) = integral of p(e | j, coordinates, size, length)^POWER prior(coordinates) d coordinates
//!   probability_j = prior_j Z_j / sum_k prior_k Z_k
//! ```
//!
//! Every explanation has the discrepancy term. One that is right has none or a small one; *none of these* is parameters alone
//! with a term of any size. Sensitivities to the parameters are those of parameters alone for all explanations, so that the term
//! is orthogonal to the same in each.
//!
//! Amplitudes have Cauchy priors, half-Cauchy where they have one sign; the median of their size is the middle of the range that
//! the sheet draws from. The leading amplitude of an effect that lies near a bound, or along which the simulated loss is no
//! parabola, is integrated by Gauss and Legendre's rule through the simulator, the other numbers refitted linearly at each node,
//! one amplitude of an explanation at most; all others by Laplace.
//!
//! Of linked rods there are none: each model has start states of its own there, and thus another residual.
//!
//! Source: Kennedy, O'Hagan 2001; Plumlee 2017; MacKay 1992, Neural Comput. 4(3): evidence and its Occam factor.

mod priors;

use super::explanations::Explanation;
use crate::engine::Engine;
use crate::fit::Products;
use crate::fit::evidence::{
    Covariance, HeavyTailed, InputGrams, IntegratedInputs, Priors, log_marginal_likelihood, log_sum,
    quadrature,
};
use crate::parameters::COUNT;
use crate::refit::{
    EffectEstimate, FittedModel, coordinate_columns, linearise, parameter_precisions, rig_of,
};
use crate::report::{ExplanationKind, Marginal};
use crate::windows::BLOCKS_PER_WINDOW;
use model_fit::parallel;
use nalgebra::DMatrix;
use priors::{prior_of, prior_of_coordinate, prior_of_terms, scaled};

/// Power of the likelihoods: the least mean log loss on one half of 32 draws of seed 18, a development seed.
const POWER: f64 = 0.004;
/// Sizes of the term beside none, N and Nl/min: half a decade apart, from what no sensor shows to more than is drawn.
const SIZES: [f64; 7] = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0];
/// Correlation lengths of the term, in blocks of 20 ms: a quarter of a window, and so long that it hardly changes in one.
const CORRELATION_BLOCKS: [f64; 2] = [5.0, 50.0];
/// Factors on the scale of the amplitude priors; the first is that of the probability, all make its range.
const SCALE_FACTORS: [f64; 3] = [1.0, 1.0 / 3.0, 3.0];
/// Posterior standard deviations from a bound below which an amplitude is integrated by quadrature, and those on either side of
/// the mode that the nodes cover.
const NEAR_BOUND: f64 = 2.0;
const COVERED: f64 = 4.0;
/// Rise of minus twice the log posterior at one standard deviation, 1 of a parabola, outside which the same is done.
const PARABOLIC: [f64; 2] = [0.5, 2.0];

/// Gives each explanation its marginal likelihood and probability; none where one of them has no mode, and for linked rods.
pub(super) fn weigh(
    engine: &Engine<'_>,
    calibrated: &FittedModel,
    candidates: usize,
    explanations: &mut [Explanation],
) {
    if engine.is_linked() {
        return;
    }
    if let Some(marginals) = marginals(engine, calibrated, candidates, explanations) {
        explanations.iter_mut().zip(marginals).for_each(|(one, marginal)| one.marginal = Some(marginal));
    }
}

fn marginals(
    engine: &Engine<'_>,
    calibrated: &FittedModel,
    candidates: usize,
    explanations: &[Explanation],
) -> Option<Vec<Marginal>> {
    let sensitivities = linearise(engine, calibrated).columns;
    let models = parallel::map(explanations, |one| {
        let are_exact = one.kind == ExplanationKind::Null;
        let alone = if are_exact { [1.0; COUNT] } else { calibrated.factors };
        let (effects, factors) =
            one.fit.as_ref().map_or((&[][..], alone), |fit| (&fit.effects[..], fit.factors));
        Model::of(Estimates { engine, effects, factors }, &sensitivities, are_exact)
    });
    let models: Vec<Model<'_>> = models.into_iter().collect::<Option<_>>()?;
    let (grams, places) = inputs(engine, &sensitivities, &models)?;
    let of_length = |blocks: &f64| grams.integrated(*blocks, &SIZES);
    let mut terms = vec![IntegratedInputs::none(grams.gram.len())];
    terms.extend(parallel::map(&CORRELATION_BLOCKS, of_length).into_iter().flatten());
    // A term under which a model has no mode adds nothing.
    let of_model = |at: usize| -> Vec<[f64; 3]> {
        let log = |term| models[at].log_likelihoods(term, &places[at]).unwrap_or([f64::NEG_INFINITY; 3]);
        terms.iter().map(log).collect()
    };
    let logs = parallel::map_range(0..models.len(), of_model);
    let kinds: Vec<ExplanationKind> = explanations.iter().map(|one| one.kind).collect();
    let priors: Vec<f64> = explanations.iter().map(|one| prior_of(one, candidates)).collect();
    let covariances: Vec<Covariance> = terms.iter().map(|term| term.covariance).collect();
    let by_scale = [0, 1, 2].map(|scale| {
        let of_kind = |(logs, kind): (&Vec<[f64; 3]>, &ExplanationKind)| {
            let weights = prior_of_terms(&covariances, *kind);
            log_sum(logs.iter().zip(weights).map(|(log, weight)| log[scale] + weight.ln()))
        };
        let logs: Vec<f64> = logs.iter().zip(&kinds).map(of_kind).collect();
        let probabilities = probabilities(&priors, &logs);
        (logs, probabilities)
    });
    if by_scale.iter().any(|(logs, _)| logs.iter().any(|log| !log.is_finite())) {
        return None;
    }
    let marginal = |at: usize| {
        let all = by_scale.each_ref().map(|(_, probabilities)| probabilities[at]);
        Marginal {
            log_likelihood: by_scale[0].0[at],
            probability: all[0],
            probability_range: [all.into_iter().fold(1.0, f64::min), all.into_iter().fold(0.0, f64::max)],
            by_quadrature: models[at].nodes.is_some(),
        }
    };
    Some((0..models.len()).map(marginal).collect())
}

/// Probabilities of explanations with these priors and log marginal likelihoods.
fn probabilities(priors: &[f64], logs: &[f64]) -> Vec<f64> {
    let shares = priors.iter().zip(logs).map(|(prior, log)| log + prior.ln());
    let total = log_sum(shares.clone());
    shares.map(|share| (share - total).exp()).collect()
}

/// Effects and factors of an explanation.
struct Estimates<'a> {
    engine: &'a Engine<'a>,
    effects: &'a [EffectEstimate],
    factors: [f64; COUNT],
}

impl Estimates<'_> {
    fn residual(&self, effects: &[EffectEstimate]) -> Option<Vec<f64>> {
        let rig = rig_of(&self.engine.rig, effects, &self.factors)?;
        Some(self.engine.residual(&self.engine.simulate(&rig)))
    }

    /// The residual with the leading amplitude of an effect elsewhere.
    fn residual_at(&self, effect: usize, z: f64) -> Option<Vec<f64>> {
        let mut effects = self.effects.to_vec();
        effects[effect].coordinates[0] = z;
        self.residual(&effects)
    }
}

/// A coordinate that is integrated by quadrature.
struct Nodes {
    coordinate: usize,
    nodes: Vec<Node>,
}

struct Node {
    z: f64,
    weight: f64,
    residual: Vec<f64>,
    products: Products,
}

/// An explanation, linearised at its fit.
struct Model<'a> {
    residual: Vec<f64>,
    sensitivities: &'a [Vec<f64>],
    /// Sensitivities to the coordinates.
    columns: Vec<Vec<f64>>,
    products: Products,
    /// Deviations of the parameters from the rig file.
    deviations: Vec<f64>,
    are_exact: bool,
    /// Of each coordinate: its prior and its value.
    coordinates: Vec<(HeavyTailed, f64)>,
    /// None where Laplace serves for all.
    nodes: Option<Nodes>,
}

impl<'a> Model<'a> {
    /// `None` where no rig can have the model or its neighbours.
    fn of(at: Estimates<'_>, sensitivities: &'a [Vec<f64>], are_exact: bool) -> Option<Self> {
        let Estimates { engine, effects, factors } = at;
        let simulated = engine.simulate(&rig_of(&engine.rig, effects, &factors)?);
        let residual = engine.residual(&simulated);
        let columns = coordinate_columns(engine, &factors, effects, &simulated)?;
        let all: Vec<&Vec<f64>> = sensitivities.iter().chain(&columns).collect();
        let of_effect = |effect: &'_ EffectEstimate| {
            let candidate = effect.candidate;
            let all = effect.coordinates.clone().into_iter().enumerate();
            all.map(move |(key, z)| (prior_of_coordinate(&candidate, key), z))
        };
        let mut model = Model {
            products: engine.products(&residual, &all),
            residual,
            sensitivities,
            columns,
            deviations: factors.iter().map(|factor| factor - 1.0).collect(),
            are_exact,
            coordinates: effects.iter().flat_map(of_effect).collect(),
            nodes: None,
        };
        model.nodes = model.nodes(&at);
        Some(model)
    }

    /// Nodes along the first leading amplitude that needs them.
    fn nodes(&self, at: &Estimates<'_>) -> Option<Nodes> {
        let mut coordinate = 0;
        for (effect, estimate) in at.effects.iter().enumerate() {
            let deviation = self.posterior_deviation(at.engine, coordinate)?;
            let z = estimate.coordinates[0];
            let [least, most] = estimate.candidate.fit_bounds(0);
            let is_near_bound = (z - least).min(most - z) < NEAR_BOUND * deviation;
            if is_near_bound || !self.is_parabolic(at, effect, coordinate, deviation) {
                let ends = [(z - COVERED * deviation).max(least), (z + COVERED * deviation).min(most)];
                let columns = self.columns_without(coordinate);
                let node = |(z, weight): (f64, f64)| {
                    let residual = at.residual_at(effect, z)?;
                    let products = at.engine.products(&residual, &columns);
                    Some(Node { z, weight, residual, products })
                };
                let nodes = quadrature(ends).into_iter().map(node).collect::<Option<_>>()?;
                return Some(Nodes { coordinate, nodes });
            }
            coordinate += estimate.coordinates.len();
        }
        None
    }

    /// Whether the simulated loss rises on both sides of an amplitude about as a parabola does, all else refitted linearly.
    fn is_parabolic(&self, at: &Estimates<'_>, effect: usize, coordinate: usize, deviation: f64) -> bool {
        let (prior, z) = self.coordinates[coordinate];
        let twice_minus_log = |z: f64, residual: &[f64]| {
            POWER * self.refitted_loss(at.engine, residual, coordinate) - 2.0 * prior.log_density(z)
        };
        let here = twice_minus_log(z, &self.residual);
        [-deviation, deviation].iter().all(|change| {
            at.residual_at(effect, z + change).is_some_and(|residual| {
                let rise = twice_minus_log(z + change, &residual) - here;
                (PARABOLIC[0]..PARABOLIC[1]).contains(&rise)
            })
        })
    }

    fn columns_without(&self, coordinate: usize) -> Vec<&[f64]> {
        let others = without(&self.columns, coordinate).map(Vec::as_slice);
        self.sensitivities.iter().map(Vec::as_slice).chain(others).collect()
    }

    /// Standard deviation of a coordinate under the tempered likelihood, the other numbers free.
    fn posterior_deviation(&self, engine: &Engine<'_>, coordinate: usize) -> Option<f64> {
        let all: Vec<usize> = (0..self.products.columns).collect();
        let of_coordinates = self.coordinates.iter().map(|(prior, z)| prior.precision(*z));
        let precisions: Vec<f64> = parameter_precisions()
            .into_iter()
            .chain(of_coordinates)
            .map(|precision| precision / POWER)
            .collect();
        let weights = self.products.weights(&engine.squares(&self.residual));
        let (hessian, _) = self.products.normal(&all, &weights, &precisions);
        let at = COUNT + coordinate;
        Some((hessian.cholesky()?.inverse()[(at, at)] / POWER).sqrt())
    }

    /// Loss of a residual with all numbers but one coordinate refitted linearly, priors included.
    fn refitted_loss(&self, engine: &Engine<'_>, residual: &[f64], coordinate: usize) -> f64 {
        let columns = self.columns_without(coordinate);
        let others = || without(&self.coordinates, coordinate);
        let of_others = others().map(|(prior, z)| prior.precision(*z));
        let precisions: Vec<f64> =
            parameter_precisions().into_iter().chain(of_others).map(|precision| precision / POWER).collect();
        let from: Vec<f64> = self.deviations.iter().copied().chain(others().map(|(_, z)| *z)).collect();
        let all: Vec<usize> = (0..columns.len()).collect();
        engine.products(residual, &columns).fit_from(&all, &precisions, &from).loss
    }

    /// Log marginal likelihoods beside a term, for each scale of the amplitude priors.
    fn log_likelihoods(&self, term: &IntegratedInputs, places: &Places) -> Option<[f64; 3]> {
        let Some(Nodes { coordinate, nodes }) = &self.nodes else {
            let reduced = term.products(&self.products, places.residual, &places.columns);
            return self.by_scale(|factor| {
                self.log_likelihood(term, (&self.products, &reduced), scaled(&self.coordinates, factor))
            });
        };
        let columns: Vec<usize> = without(&places.columns, COUNT + coordinate).copied().collect();
        let reduced: Vec<Products> = nodes
            .iter()
            .zip(&places.nodes)
            .map(|(node, residual)| term.products(&node.products, *residual, &columns))
            .collect();
        self.by_scale(|factor| {
            let (prior, _) = scaled(&self.coordinates, factor)[*coordinate];
            let of_node = |(node, reduced): (&Node, &Products)| {
                let others = without(&self.coordinates, *coordinate).copied().collect::<Vec<_>>();
                let log = self.log_likelihood(term, (&node.products, reduced), scaled(&others, factor))?;
                Some(log + prior.log_density(node.z) + node.weight.ln())
            };
            let logs: Vec<f64> = nodes.iter().zip(&reduced).map(of_node).collect::<Option<_>>()?;
            Some(log_sum(logs.into_iter()))
        })
    }

    fn by_scale(&self, log: impl Fn(f64) -> Option<f64>) -> Option<[f64; 3]> {
        let first = log(SCALE_FACTORS[0])?;
        if self.coordinates.is_empty() {
            return Some([first; 3]);
        }
        Some([first, log(SCALE_FACTORS[1])?, log(SCALE_FACTORS[2])?])
    }

    fn log_likelihood(
        &self,
        term: &IntegratedInputs,
        (plain, reduced): (&Products, &Products),
        coordinates: Vec<(HeavyTailed, f64)>,
    ) -> Option<f64> {
        let priors = Priors {
            parameters: parameter_precisions(),
            deviations: self.deviations.clone(),
            are_exact: self.are_exact,
            coordinates,
        };
        log_marginal_likelihood(plain, reduced, term.log_determinant, &priors, POWER)
    }
}

fn without<T>(all: &[T], left_out: usize) -> impl Iterator<Item = &T> {
    all.iter().enumerate().filter(move |(at, _)| *at != left_out).map(|(_, one)| one)
}

/// Places of a model's residuals and columns among all.
struct Places {
    residual: usize,
    columns: Vec<usize>,
    nodes: Vec<usize>,
}

/// Unknown inputs under the rig file's own values, beside the sensitivities to the parameters and all models: calibrated
/// parameters may be far off while an effect is missing. `None` where an input brings the rig into a state that it cannot be in.
fn inputs(
    engine: &Engine<'_>,
    sensitivities: &[Vec<f64>],
    models: &[Model<'_>],
) -> Option<(InputGrams, Vec<Places>)> {
    let mut all: Vec<&[f64]> = sensitivities.iter().map(Vec::as_slice).collect();
    let mut place = |column| {
        all.push(column);
        all.len() - 1
    };
    let places = models
        .iter()
        .map(|model| Places {
            residual: place(model.residual.as_slice()),
            columns: (0..COUNT).chain(model.columns.iter().map(|column| place(column.as_slice()))).collect(),
            nodes: (model.nodes.iter().flat_map(|nodes| &nodes.nodes))
                .map(|node| place(node.residual.as_slice()))
                .collect(),
        })
        .collect();
    let mut grams = InputGrams { blocks: BLOCKS_PER_WINDOW, gram: Vec::new(), cross: Vec::new() };
    let mut from = 0;
    for part in &engine.windows {
        let to = from + part.count() * part.rows();
        let columns: Vec<&[f64]> = all.iter().map(|column| &column[from..to]).collect();
        let measured = part.record.measured;
        for products in part.input_products(&engine.rig, &columns, engine.axis_by_axis)? {
            for axis in (0..2).filter(|axis| measured[*axis]) {
                grams.gram.push(products.gram[axis].clone());
                grams.cross.push(DMatrix::transpose(&products.cross[axis]));
            }
        }
        from = to;
    }
    Some((grams, places))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_sum_to_one_however_unlikely_all_are() {
        for logs in [[0.0; 3], [-9e5, -1e6, -9e5 + 3.0]] {
            let all = probabilities(&[0.2, 0.5, 0.3], &logs);
            // The logarithms have a rounding error of 1e-10.
            assert!((all.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{all:?}");
        }
        assert!((probabilities(&[0.2, 0.2], &[7.0; 2])[1] - 0.5).abs() < 1e-12);
    }
}
