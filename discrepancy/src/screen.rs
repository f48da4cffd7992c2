//! Linear screening: gain and starting point of each candidate, from one simulation at each of its probes.
//!
//! Each probe is one column. Fitted jointly with the parameters' columns, its coefficient is the amplitude of an effect whose
//! responses were proportional to it. Screening ranks, and ends the search where no gain exceeds
//! [`crate::name::MIN_LOSS_REDUCTION`] and a share of the last threshold; the refit decides.

use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::fit::Products;
use crate::parameters::COUNT;
use crate::refit::{EffectEstimate, Linearisation, parameter_precisions};
use rayon::prelude::*;

/// Penalty for each column of a candidate.
const COLUMN_PENALTY: f64 = 6.0;

#[derive(Debug)]
pub struct Columns {
    pub candidates: Vec<Candidate>,
    /// Probes of each candidate, with the indices of their columns.
    pub(crate) probes: Vec<Vec<(Vec<f64>, usize)>>,
    columns: Vec<Vec<f64>>,
}

#[derive(Clone, Debug)]
pub(crate) struct Screened {
    /// Index in [`Columns::candidates`].
    pub at: usize,
    /// Loss with it.
    pub loss: f64,
    /// Where its fit starts.
    pub start: EffectEstimate,
}

impl Columns {
    /// Simulates all probes of some candidates.
    pub fn new(engine: &Engine<'_>, candidates: Vec<Candidate>) -> Self {
        let baseline = engine.simulate_coarsely(engine.rig());
        let tasks: Vec<(usize, Vec<f64>)> = candidates
            .iter()
            .enumerate()
            .flat_map(|(at, candidate)| candidate.probes().into_iter().map(move |probe| (at, probe)))
            .collect();
        let made: Vec<Option<Vec<f64>>> = tasks
            .par_iter()
            .map(|(at, probe)| {
                let rig = candidates[*at].rig(engine.rig(), probe).ok()?;
                Some(engine.difference(&engine.simulate_coarsely(&rig), &baseline))
            })
            .collect();
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

    /// Column of a probe.
    pub fn column(&self, index: usize) -> &[f64] {
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
    ) -> (f64, Vec<Screened>) {
        let always = COUNT + model_sensitivities.len();
        let all: Vec<&Vec<f64>> =
            linearisation.columns.iter().chain(model_sensitivities).chain(&self.columns).collect();
        let products = engine.products(residual, &all);
        let (mut precisions, mut prior_offset) = (parameter_precisions(), linearisation.deviations());
        precisions.resize(always, 1e-2);
        prior_offset.resize(always, 0.0);
        let basic: Vec<usize> = (0..always).collect();
        let null_loss = products.fit_from(&basic, &precisions, &prior_offset).loss;
        let screened = (0..self.candidates.len())
            .into_par_iter()
            .filter_map(|at| self.screen_one(&products, at, &basic, &precisions, &prior_offset))
            .collect();
        (null_loss, screened)
    }

    fn screen_one(
        &self,
        products: &Products,
        at: usize,
        basic: &[usize],
        precisions: &[f64],
        prior_offset: &[f64],
    ) -> Option<Screened> {
        let always = basic.len();
        let candidate = self.candidates[at];
        // Probes of the amplitude enter one at a time; probes of further keys with a neutral value join.
        let (leading, joining): (Vec<_>, Vec<_>) =
            self.probes[at].iter().partition(|(probe, _)| probe[0] != 0.0);
        let mut best: Option<(f64, Vec<f64>)> = None;
        let alone = Vec::new();
        for (probe, index) in &leading {
            for with in if joining.is_empty() { vec![&alone] } else { vec![&alone, &joining] } {
                let mut chosen = basic.to_vec();
                let mut chosen_precisions = precisions.to_vec();
                chosen.push(always + index);
                chosen.extend(with.iter().map(|(_, index)| always + index));
                chosen_precisions.extend(std::iter::repeat_n(1e-2, 1 + with.len()));
                let mut chosen_from = prior_offset.to_vec();
                chosen_from.resize(chosen.len(), 0.0);
                let fit = products.fit_from(&chosen, &chosen_precisions, &chosen_from);
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
                let loss = fit.loss + COLUMN_PENALTY * (1 + with.len()) as f64;
                if best.as_ref().is_none_or(|(best, _)| loss < *best) {
                    best = Some((loss, coordinates));
                }
            }
        }
        best.map(|(loss, coordinates)| Screened {
            at,
            loss,
            start: EffectEstimate { candidate, coordinates },
        })
    }
}
