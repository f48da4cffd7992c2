//! Refits of models of linked rods with the window start states re-estimated under the model itself.

use crate::engine::Engine;
use crate::refit::{EffectEstimate, FittedModel, Linearisation, linearise, loss_at, refit, rig_of};
use model_fit::parallel;

/// Starting amplitudes of the backlash.
const AMPLITUDES: [f64; 5] = [0.12, 0.25, 0.45, 0.7, 1.0];
/// Maximum number of alternations between start states and model, and the relative fall of the loss that ends them.
const MAX_ALTERNATIONS: usize = 3;
const RELATIVE_TOLERANCE: f64 = 0.05;

/// A fitted model, and the engine whose start states were estimated under it; `None` where the rods are not linked.
pub(super) struct FitWithStartStates<'a> {
    pub(super) engine: Option<Engine<'a>>,
    pub(super) fit: FittedModel,
}

/// Refits a model of linked rods, alternating with estimates of the window start states under it.
pub(super) fn refit_with_starts<'a>(engine: &Engine<'a>, model: &FittedModel) -> FitWithStartStates<'a> {
    let mut best = FitWithStartStates { engine: None, fit: model.clone() };
    for _ in 0..if engine.is_linked() { MAX_ALTERNATIONS } else { 0 } {
        let Some(rig) = rig_of(&engine.rig, &best.fit.effects, &best.fit.factors) else { break };
        let restarted = engine.with_starts_under(&rig);
        let Some(fit) = refit(&restarted, &linearise(&restarted, &best.fit), &best.fit.effects) else {
            break;
        };
        let converged =
            best.engine.is_some() && fit.loss > best.fit.loss - RELATIVE_TOLERANCE * best.fit.loss.abs();
        if best.engine.is_none() || fit.loss < best.fit.loss {
            best = FitWithStartStates { engine: Some(restarted), fit };
        }
        if converged {
            break;
        }
    }
    best
}

/// Start of the fit of a backlash: the amplitude with the smallest loss, each under its own start states. Under the start states
/// of another backlash even the true one fits badly.
pub(super) fn backlash_start(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &[EffectEstimate],
    start: &EffectEstimate,
) -> Vec<EffectEstimate> {
    let [least, most] = start.candidate.range(0);
    let screened_z = start.coordinates[0];
    let tried: Vec<Vec<EffectEstimate>> = AMPLITUDES
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
    let losses = parallel::map(&tried, |effects| {
        rig_of(&engine.rig, effects, &linearisation.factors)
            .map_or(f64::INFINITY, |rig| loss_at(&engine.with_starts_under(&rig), linearisation, effects))
    });
    let best = (0..tried.len()).min_by(|left, right| losses[*left].total_cmp(&losses[*right]));
    tried[best.expect("one at least")].clone()
}
