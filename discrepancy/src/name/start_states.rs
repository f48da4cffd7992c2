//! Models of linked rods, fitted from where they say themselves that the pistons were.

use super::around_of;
use crate::engine::Engine;
use crate::refit::{Around, Placed, Refit, loss_at, refit, rig_of};
use rayon::prelude::*;

/// Amplitudes of a gap that are tried.
const AMPLITUDES: [f64; 5] = [0.12, 0.25, 0.45, 0.7, 1.0];
/// How often a model of linked rods and the starts that it says follow each other, and the share of the loss that ends it.
const MOVES: usize = 3;
const MOVED: f64 = 0.05;

/// A model, and the records as they are met best by it; `None` where its own starts make no difference.
pub(super) struct Restarted<'a> {
    pub(super) engine: Option<Engine<'a>>,
    pub(super) fit: Refit,
}

/// Fits a model again from where it says itself that the pistons were, where that matters.
pub(super) fn refit_with_starts<'a>(engine: &Engine<'a>, model: &Refit, penalty: f64) -> Restarted<'a> {
    let mut best = Restarted { engine: None, fit: model.clone() };
    for _ in 0..if engine.is_linked() { MOVES } else { 0 } {
        let Some(rig) = rig_of(engine.rig(), &best.fit.placed, &best.fit.factors) else { break };
        let restarted = engine.with_starts_under(&rig);
        let Some(fit) = refit(&restarted, &around_of(&restarted, &best.fit), &best.fit.placed, penalty)
        else {
            break;
        };
        let converged = best.engine.is_some() && fit.loss > best.fit.loss - MOVED * best.fit.loss.abs();
        if best.engine.is_none() || fit.loss < best.fit.loss {
            best = Restarted { engine: Some(restarted), fit };
        }
        if converged {
            break;
        }
    }
    best
}

/// Where the fit of a gap begins: where the records are met best from its own home. From the home of a rig with another one it is
/// worse, however right it is.
pub(super) fn gap_start(
    engine: &Engine<'_>,
    point: &Around,
    model: &[Placed],
    start: &Placed,
) -> Vec<Placed> {
    let [least, most] = start.candidate.range(0);
    let screened_z = start.coordinates[0];
    let tried: Vec<Vec<Placed>> = AMPLITUDES
        .iter()
        .map(|size| size * screened_z.signum())
        .filter(|size| *size >= least && *size <= most)
        .chain([screened_z])
        .map(|amplitude| {
            let mut effect = start.clone();
            effect.coordinates[0] = amplitude;
            [model, &[effect]].concat()
        })
        .collect();
    let losses: Vec<f64> = tried
        .par_iter()
        .map(|placed| {
            rig_of(engine.rig(), placed, &point.factors)
                .map_or(f64::INFINITY, |rig| loss_at(&engine.with_starts_under(&rig), point, placed))
        })
        .collect();
    let best = (0..tried.len()).min_by(|left, right| losses[*left].total_cmp(&losses[*right]));
    tried[best.expect("one at least")].clone()
}
