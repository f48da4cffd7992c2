//! Backward elimination of effects, swaps between rounds, and alternatives.

use super::null_distribution::NullDistribution;
use super::{Alternative, STEPS, THRESHOLD_FACTOR_SINGLE, axes_of, loss_on, relinearise};
use crate::engine::Engine;
use crate::refit::{EffectEstimate, FittedModel, linearise, refit_steps};
use crate::screen::Columns;
use model_fit::parallel;

/// Runners-up of an earlier round that are tried again after another effect joined.
const SWAPPED: usize = 3;
/// Fits are indistinguishable when their J differ by less than this times the design effect. Noise alone makes the wrong
/// one of two better by more in one record of 700 at most, if both have the same number of effect parameters; each further
/// parameter shifts the difference by [`super::EFFECT_PARAMETER_PENALTY`].
pub(crate) const INDISTINGUISHABLE_LOSS_DIFFERENCE: f64 = 9.0;
/// The same as a share of the fall of J since calibration, or of the remaining J if that is less: model error may decide between
/// two fits.
const INDISTINGUISHABLE_LOSS_SHARE: f64 = 0.02;
/// Multiple of the null threshold required of each effect while others remain, since no model is exact.
const THRESHOLD_FACTOR_SEVERAL: f64 = 3.0;
/// Share of the gain of all effects together below which an effect is eliminated, whatever the threshold.
const MIN_SHARE_OF_GAIN: f64 = 0.002;

#[derive(Clone)]
pub(super) struct Selection {
    /// Parameters without effects.
    pub(super) calibrated: FittedModel,
    pub(super) model: FittedModel,
    /// For each effect of the model the fits of its round, best first.
    pub(super) rounds: Vec<Vec<FittedModel>>,
}

impl Selection {
    /// Swaps the winner of an earlier round for one of its runners-up where that lowers the loss beside the effects that joined
    /// since.
    pub(super) fn swap(&mut self, engine: &Engine<'_>, progress: &mut dyn FnMut(&str)) {
        let Self { model, rounds, .. } = self;
        let point = linearise(engine, model);
        let mut tried = Vec::new();
        for (at, refits) in rounds.iter().enumerate().take(model.effects.len() - 1) {
            for (rank, other) in refits.iter().enumerate().skip(1).take(SWAPPED) {
                let Some(other) = other.effects.last() else { continue };
                if model.effects.iter().any(|effect| is_same_effect(effect, other)) {
                    continue;
                }
                let mut effects = model.effects.clone();
                effects[at] = other.clone();
                tried.push((at, rank, effects));
            }
        }
        progress(&format!("trying {} other combinations", tried.len()));
        let refitted = parallel::map(&tried, |(at, rank, effects)| {
            Some((*at, *rank, refit_steps(engine, &point, effects, STEPS)?))
        });
        let best = refitted.into_iter().flatten().min_by(|left, right| left.2.loss.total_cmp(&right.2.loss));
        let Some((at, rank, best)) = best.filter(|(_, _, best)| best.loss < model.loss) else { return };
        let best = relinearise(engine, best);
        // The replaced effect stays as an alternative where it fits as well.
        let is_alike = self.model.loss - best.loss < self.alike(&best);
        let refits = &mut self.rounds[at];
        let came = refits.remove(rank);
        refits.truncate(usize::from(is_alike));
        refits.insert(0, came);
        self.model = best;
    }

    /// Those of other fits whose loss differs from that of a fit by hardly anything.
    pub(super) fn close_alternatives(&self, fit: &FittedModel, others: &[FittedModel]) -> Vec<FittedModel> {
        let (most, last) = (self.alike(fit), fit.effects.last());
        let is_close = |other: &&FittedModel| {
            let is_it =
                other.effects.last().zip(last).is_some_and(|(other, last)| is_same_effect(other, last));
            !is_it && (other.loss - fit.loss).abs() < most
        };
        others.iter().filter(is_close).cloned().collect()
    }

    /// Largest difference in loss at which an explanation is indistinguishable from the best.
    fn alike(&self, best: &FittedModel) -> f64 {
        (INDISTINGUISHABLE_LOSS_DIFFERENCE * best.design_effect)
            .max(INDISTINGUISHABLE_LOSS_SHARE * best.loss.min(self.calibrated.loss - best.loss))
    }

    /// Eliminates effects whose removal raises the loss by less than a multiple of the null threshold.
    pub(super) fn eliminate_backward(&mut self, engine: &Engine<'_>, columns: &Columns) {
        let Self { calibrated, model, rounds } = self;
        while !model.effects.is_empty() {
            let linearisation = linearise(engine, model);
            let null = NullDistribution::new(engine, columns, &linearisation, model);
            let threshold = null.threshold();
            let without = parallel::map_range(0..model.effects.len(), |at| {
                let mut effects = model.effects.clone();
                effects.remove(at);
                if effects.is_empty() {
                    return Some(calibrated.clone());
                }
                refit_steps(engine, &linearisation, &effects, 4)
            });
            let least = without
                .into_iter()
                .enumerate()
                .filter_map(|(at, fit)| Some((at, fit?)))
                .min_by(|left, right| left.1.loss.total_cmp(&right.1.loss));
            let Some((at, fit)) = least else { break };
            let loss_rise = null.loss_rise(engine, &fit, model);
            let safety =
                if fit.effects.is_empty() { THRESHOLD_FACTOR_SINGLE } else { THRESHOLD_FACTOR_SEVERAL };
            let share = loss_rise / (calibrated.loss - model.loss).max(1e-9);
            if loss_rise > safety * threshold && share > MIN_SHARE_OF_GAIN {
                break;
            }
            rounds.remove(at.min(rounds.len() - 1));
            *model = fit;
        }
    }

    /// Alternatives to an effect of the model; `share` is the share of the excess that the effect removes.
    pub(super) fn alternatives(&self, effect: &EffectEstimate, share: f64) -> Vec<Alternative> {
        // The round in which it joined.
        let Some(refits) = self.rounds.iter().find(|refits| {
            refits
                .first()
                .and_then(|best| best.effects.last())
                .is_some_and(|joined| is_same_effect(joined, effect))
        }) else {
            return Vec::new();
        };
        let best = &refits[0];
        let is_new = |fit: &FittedModel| {
            fit.effects.last().is_some_and(|other| {
                !self.model.effects.iter().any(|of_model| is_same_effect(of_model, other))
            })
        };
        refits[1..]
            .iter()
            .filter(|fit| fit.loss - best.loss < self.alike(best) && is_new(fit))
            .map(|fit| {
                let less = (fit.loss - best.loss) / self.calibrated.loss.max(1e-9);
                Alternative { fit: fit.clone(), share: (share - less).clamp(0.0, 1.0) }
            })
            .collect()
    }

    /// Share of the excess on its axes that each effect removed in the round in which it joined.
    pub(super) fn shares(&self, engine: &Engine<'_>) -> Vec<f64> {
        let Self { calibrated, model, rounds } = self;
        let excess = (calibrated.loss - model.loss).max(1e-9);
        let whole = (excess / calibrated.loss.max(1e-9)).clamp(0.0, 1.0);
        let mut before = calibrated.loss;
        model
            .effects
            .iter()
            .enumerate()
            .map(|(at, effect)| {
                let after =
                    rounds.get(at).and_then(|refits| refits.first()).map_or(model.loss, |fit| fit.loss);
                let on_axes = loss_on(engine, axes_of(std::slice::from_ref(effect)), calibrated);
                let removed = before - after;
                // A loss below what noise gives, of all axes or of those of the effect, is no measure of what was there.
                let share = if calibrated.loss > 0.0 && on_axes > 0.0 {
                    removed / excess * whole * (calibrated.loss / on_axes)
                } else {
                    removed / on_axes.max(removed).max(1e-9)
                };
                before = after;
                share.clamp(0.0, 1.0)
            })
            .collect()
    }
}

/// Whether two are the same effect at the same place.
pub(crate) fn is_same_effect(left: &EffectEstimate, right: &EffectEstimate) -> bool {
    left.candidate.sheet.name == right.candidate.sheet.name && left.candidate.place == right.candidate.place
}

pub(super) fn has_effect(set: &[EffectEstimate], effect: &EffectEstimate) -> bool {
    set.iter().any(|other| is_same_effect(effect, other))
}

/// Whether a set has these effects and no other one.
pub(super) fn is_same_set(set: &[EffectEstimate], effects: &[&EffectEstimate]) -> bool {
    set.len() == effects.len() && effects.iter().all(|effect| has_effect(set, effect))
}
