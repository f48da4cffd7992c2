//! Linear screening: gain and starting point of each candidate, from one simulation at each of its probes.
//!
//! Each probe is one column. Fitted jointly with the parameters' columns, its coefficient is the amplitude of an effect whose
//! responses were proportional to it. Screening ranks, and ends the search where no gain exceeds
//! [`crate::name::MIN_GAIN`] and a share of the last threshold; the refit decides.

use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::fit::{Fit, Products};
use crate::parameters::COUNT;
use crate::refit::{EffectEstimate, Linearisation, parameter_precisions};
use model_fit::parallel;

/// Penalty for each column of a candidate.
pub(crate) const COLUMN_PENALTY: f64 = 6.0;
/// Prior precision of a column's coefficient, which is about 1: it keeps the equations regular.
const COLUMN_PRECISION: f64 = 1e-2;

/// Candidates with the whitened responses to their probes.
#[derive(Debug)]
pub struct Columns {
    /// In the order in which they were given.
    pub candidates: Vec<Candidate>,
    /// Probes of each candidate, with the indices of their columns.
    pub(crate) probes: Vec<Vec<(Vec<f64>, usize)>>,
    columns: Vec<Vec<f64>>,
}

#[derive(Clone, Debug)]
pub(crate) struct ScreenedCandidate {
    /// Index in [`Columns::candidates`].
    pub(crate) at: usize,
    /// Loss with it.
    pub(crate) loss: f64,
    /// Where its fit starts.
    pub(crate) start: EffectEstimate,
}

impl Columns {
    /// Simulates all probes of some candidates.
    pub(crate) fn new(engine: &Engine<'_>, candidates: Vec<Candidate>) -> Self {
        let baseline = engine.simulate_coarsely(&engine.rig);
        let tasks: Vec<(usize, Vec<f64>)> = candidates
            .iter()
            .enumerate()
            .flat_map(|(at, candidate)| candidate.probes().into_iter().map(move |probe| (at, probe)))
            .collect();
        let made = parallel::map(&tasks, |(at, probe)| {
            let rig = candidates[*at].rig(&engine.rig, probe).ok()?;
            Some(engine.difference(&engine.simulate_coarsely(&rig), &baseline))
        });
        let mut probes = vec![Vec::new(); candidates.len()];
        let mut columns = Vec::new();
        for ((at, probe), column) in tasks.into_iter().zip(made) {
            if let Some(column) = column {
                probes[at].push((probe, columns.len()));
                columns.push(column);
            }
        }
        Columns { candidates, probes, columns }
    }

    /// Number of columns of probes.
    pub(crate) fn count(&self) -> usize {
        self.columns.len()
    }

    /// Whitened response to a probe.
    pub(crate) fn column(&self, index: usize) -> &[f64] {
        &self.columns[index]
    }

    /// Null loss, and the screening of all candidates against a residual; `model_sensitivities` are columns fitted with each
    /// (effects already in the model).
    pub(crate) fn screen(
        &self,
        engine: &Engine<'_>,
        linearisation: &Linearisation,
        residual: &[f64],
        model_sensitivities: &[Vec<f64>],
    ) -> (f64, Vec<ScreenedCandidate>) {
        let all = self.with_model(linearisation, model_sensitivities);
        let joint = JointColumns::new(linearisation, model_sensitivities.len());
        let products = engine.products(residual, &all);
        let loss_before = joint.fit(&products).loss;
        let screened = parallel::map_range(0..self.candidates.len(), |at| {
            let BestColumns { loss, coordinates, .. } = self.best_columns(&products, at, &joint)?;
            let start = EffectEstimate { candidate: self.candidates[at], coordinates };
            Some(ScreenedCandidate { at, loss, start })
        });
        (loss_before, screened.into_iter().flatten().collect())
    }

    /// All columns: of the parameters, of a model, of the probes.
    pub(crate) fn with_model<'c>(
        &'c self,
        linearisation: &'c Linearisation,
        model_sensitivities: &'c [Vec<f64>],
    ) -> Vec<&'c [f64]> {
        let all = linearisation.columns.iter().chain(model_sensitivities).chain(&self.columns);
        all.map(Vec::as_slice).collect()
    }

    /// Largest gain of `count` candidates that join one after the other, those before the last by their loss; `products` are
    /// of [`Columns::with_model`] without a model. `gain` is that of windows from the squares without to those with them; each
    /// column is charged [`COLUMN_PENALTY`].
    pub(crate) fn largest_gain(
        &self,
        products: &Products,
        linearisation: &Linearisation,
        count: usize,
        gain: impl Fn(&[f64], &[f64]) -> f64,
    ) -> f64 {
        let mut joint = JointColumns::new(linearisation, 0);
        let null = joint.fit(products);
        let mut joined: Vec<usize> = Vec::new();
        let mut largest = f64::NEG_INFINITY;
        for _ in 0..count {
            let others = (0..self.candidates.len()).filter(|at| !joined.contains(at));
            let fitted: Vec<(usize, BestColumns)> =
                others.filter_map(|at| Some((at, self.best_columns(products, at, &joint)?))).collect();
            let gains = fitted.iter().map(|(_, best)| {
                let penalty = COLUMN_PENALTY * best.columns.len() as f64 + joint.penalty;
                gain(&null.squares, &best.squares) - penalty
            });
            largest = gains.fold(largest, f64::max);
            let best = fitted.into_iter().min_by(|left, right| left.1.loss.total_cmp(&right.1.loss));
            let Some((at, best)) = best else { break };
            joined.push(at);
            joint.join(&best.columns);
        }
        largest
    }

    /// The best fit of a candidate's probes, in some of their combinations.
    fn best_columns(&self, products: &Products, at: usize, joint: &JointColumns) -> Option<BestColumns> {
        let always = joint.columns.len();
        let candidate = self.candidates[at];
        // Probes of the amplitude enter one at a time; probes of further keys with a neutral value join.
        let (leading, joining): (Vec<_>, Vec<_>) =
            self.probes[at].iter().partition(|(probe, _)| probe[0] != 0.0);
        let mut best: Option<BestColumns> = None;
        let alone = Vec::new();
        for (probe, index) in &leading {
            for with in if joining.is_empty() { vec![&alone] } else { vec![&alone, &joining] } {
                let mut joined = joint.clone();
                let columns: Vec<usize> = std::iter::once(index)
                    .chain(with.iter().map(|(_, index)| index))
                    .map(|index| joint.first_probe + index)
                    .collect();
                joined.join(&columns);
                let fit = joined.fit(products);
                let mut coordinates = probe.clone();
                let [least, most] = candidate.range(0);
                let coefficient = fit.coefficients[always];
                let amplitude = coefficient * probe[0];
                // An amplitude beyond the neutral value is no explanation.
                let outside = amplitude <= least.max(-10.0) || amplitude >= most.min(10.0);
                if outside && amplitude.signum() != probe[0].signum() {
                    continue;
                }
                coordinates[0] = amplitude.clamp(least.max(-1.3), most.min(1.3));
                for ((probe, _), coefficient) in with.iter().zip(&fit.coefficients[always + 1..]) {
                    for (key, z) in probe.iter().enumerate().skip(1).filter(|(_, z)| **z != 0.0) {
                        let [least, most] = candidate.range(key);
                        coordinates[key] = (coefficient * z).clamp(least.max(-1.3), most.min(1.3));
                    }
                }
                let loss = fit.loss + joined.penalty;
                if best.as_ref().is_none_or(|best| loss < best.loss) {
                    best = Some(BestColumns { loss, coordinates, columns, squares: fit.squares });
                }
            }
        }
        best
    }
}

/// A candidate's best fit.
struct BestColumns {
    loss: f64,
    coordinates: Vec<f64>,
    /// Its columns among all.
    columns: Vec<usize>,
    /// Of each window.
    squares: Vec<f64>,
}

/// Columns that are fitted jointly, with the priors of their coefficients.
#[derive(Clone)]
struct JointColumns {
    columns: Vec<usize>,
    precisions: Vec<f64>,
    prior_offset: Vec<f64>,
    /// Of the candidates' columns among them.
    penalty: f64,
    /// Index of the first probe's column.
    first_probe: usize,
}

impl JointColumns {
    /// The parameters, and the first columns after them, which are a model's.
    fn new(linearisation: &Linearisation, of_model: usize) -> Self {
        let always = COUNT + of_model;
        let (mut precisions, mut prior_offset) = (parameter_precisions(), linearisation.deviations());
        precisions.resize(always, COLUMN_PRECISION);
        prior_offset.resize(always, 0.0);
        JointColumns {
            columns: (0..always).collect(),
            precisions,
            prior_offset,
            penalty: 0.0,
            first_probe: always,
        }
    }

    fn join(&mut self, columns: &[usize]) {
        self.columns.extend(columns);
        self.precisions.resize(self.columns.len(), COLUMN_PRECISION);
        self.prior_offset.resize(self.columns.len(), 0.0);
        self.penalty += COLUMN_PENALTY * columns.len() as f64;
    }

    fn fit(&self, products: &Products) -> Fit {
        products.fit_from(&self.columns, &self.precisions, &self.prior_offset)
    }
}
