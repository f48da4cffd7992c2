//! Names missing effects by forward selection: screen linearly, refit in the simulator, accept or reject, eliminate backwards.
//!
//! ```text
//!   calibration ──► linear screening of all candidates ──► refit of the best in the simulator ──► gain sufficient?
//!                             ▲                                                                      │ yes: joins the model
//!                             └───────── residual of the model, its sensitivities beside ────────────┘ up to MAX_EFFECTS times
//!   backward elimination of each effect; fits of the same round with nearly the same loss are its alternatives
//! ```
//!
//! An effect joins when it removes a given share of the remaining loss with an amplitude above a floor. It stays when removing it
//! from the whole model raises the loss by a multiple of the null threshold. Where a model lacks fit, an effect
//! joins and stays when its amplitude is homogeneous over windows (`name/heterogeneity.rs`), small ones too. Probabilities of
//! all sets that were fitted then decide what is named ([`decision`]); where none reaches one half, the selection stands.
//! What is to be named has to gain more than chance gives, its best windows aside (`name/significance.rs`).
//!
//! Fits that are compared have the penalised loss J (`FittedModel::loss` of `refit` and `fit_all`), the reported model L and
//! priors alone (`fit_selected`, `fit_for_comparison`); L is the loss of the windows (`fit.rs`).
//!
//! | file | holds |
//! |---|---|
//! | `round` | a round of forward selection: contenders, their fits |
//! | `pitch` | pitch of a ripple by grid search |
//! | `start_states` | refits of linked rods with start states of their own |
//! | `heterogeneity` | homogeneity of amplitudes over windows, where a model lacks fit |
//! | `null_distribution` | null threshold and detection limits by sign flips |
//! | `elimination` | backward elimination, sequential replacement, alternatives |
//! | `gauss_newton` | Gauss-Newton on all numbers in the simulator |
//! | `needed_parameters` | backward elimination of parameters |
//! | `explanations`, `probabilities` | sets of effects and their features; their conditional logit |
//! | `marginal` | marginal likelihoods, reported beside |
//! | `decision` | what is named |
//! | `significance` | test of the name, by a parametric bootstrap |
//!
//! Source: discrepancy-notes.md, 3 to 8 and pipeline 5.

mod decision;
mod elimination;
mod explanations;
mod gauss_newton;
mod heterogeneity;
mod marginal;
mod needed_parameters;
mod null_distribution;
mod pitch;
mod probabilities;
mod round;
mod significance;
mod start_states;

use crate::calibrate::calibrate;
use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::parameters::{COUNT, with_factors};
use crate::refit::{EffectEstimate, FittedModel, Linearisation, coordinates, derivative, linearise, rig_of};
use crate::report::Significance;
use crate::screen::{Columns, ScreenedCandidate};
pub use decision::NotExplained;
use decision::{Decision, SearchOutcome, decide};
use elimination::Selection;
pub(crate) use elimination::{INDISTINGUISHABLE_LOSS_DIFFERENCE, is_same_effect};
pub use explanations::Explanation;
use explanations::{Fits, explanations};
use gauss_newton::{fit_selected, shrink_parameters};
use heterogeneity::{
    Heterogeneity, eliminate_heterogeneous, heterogeneity, parameter_tau, prefer_homogeneous, prefer_large,
};
use model_fit::estimator::RELINEARISATION;
use model_fit::parallel;
pub(crate) use needed_parameters::significantly_off;
use needed_parameters::with_needed;
use null_distribution::NullDistribution;
use plant::effects::sheet::Part;
use round::SelectionRound;
use significance::Fitted;
use start_states::{FitWithStartStates, refit_with_starts};

/// Maximum number of effects, those below the amplitude floor included.
const MAX_EFFECTS: usize = 3;
/// Gauss-Newton steps of a candidate's first fit.
const STEPS: usize = 5;
/// Penalised loss J over the degrees of freedom of all windows above which a model shows lack of fit (is inadequate): an
/// engineer's tolerance, many standard errors wide, and no test.
const LACK_OF_FIT_PER_DOF: f64 = 0.08;
/// The same for linked rods, where micrometres decide when the rod end meets the carriage: the true model has up to 0.2.
const LACK_OF_FIT_PER_DOF_LINKED: f64 = 0.3;
/// Screened gain that the best candidate must have for a round to be fitted; also the least gain of an effect that joins, of a
/// homogeneous one, and that of a detection limit. An empirical value, about twice what chance gives: of forty independent null
/// gains (chi2 of one degree of freedom) the largest has the median 5.7 and the 99th percentile 13.4.
pub(crate) const MIN_GAIN: f64 = 25.0;
/// Penalty for each fitted parameter of an effect.
pub(crate) const EFFECT_PARAMETER_PENALTY: f64 = 8.0;
/// Multiple of the null threshold required of a single effect.
const THRESHOLD_FACTOR_SINGLE: f64 = 2.0;
/// Share of the loss after calibration that the first effect must remove.
const MIN_LOSS_SHARE_FIRST: f64 = 0.1;
/// Share of the remaining loss that each further effect must remove.
const MIN_LOSS_SHARE_FURTHER: f64 = 0.3;
/// Smallest amplitude, as a share of the smallest change that occurs.
const MIN_AMPLITUDE_RATIO: f64 = 0.85;

/// An effect that explains the records as well as one of the model.
#[derive(Clone, Debug)]
pub(crate) struct Alternative {
    /// The model with it as the last effect, fitted in the round in which the other one joined.
    pub(crate) fit: FittedModel,
    /// Share of the excess that it removes.
    pub(crate) share: f64,
}

/// Outcome of the selection of effects on some records.
#[derive(Debug)]
pub struct SelectionResult {
    /// Calibration: parameters without effects.
    pub(crate) calibrated: FittedModel,
    /// The selected model, whether its effects are named or not; the calibration where none was selected.
    pub model: FittedModel,
    /// The model to report: parameters that it does not need are back at the rig file's values. Where the model is no
    /// explanation, the calibration alone.
    pub reported: FittedModel,
    pub(crate) alternatives: Vec<Vec<Alternative>>,
    /// Share of the excess that each effect removes.
    pub shares: Vec<f64>,
    /// First screening of all candidates, best first.
    pub(crate) screened: Vec<ScreenedCandidate>,
    /// All fits, each with its candidate as the last effect.
    pub(crate) fitted: Vec<FittedModel>,
    /// 99th percentile of the largest gain of any candidate under the null distribution.
    pub(crate) threshold: f64,
    /// Candidates with their whitened responses; `limits` is in their order.
    pub columns: Columns,
    /// Loss of the parameters alone, linearised.
    pub(crate) calibrated_loss: f64,
    /// Detection limit of each candidate as a coordinate of its amplitude; `None` where the record does not excite it.
    pub limits: Vec<Option<f64>>,
    /// Whether the model lacks fit on the searched part of the records.
    pub lacks_fit: bool,
    /// How much the windows disagree on each effect of the reported model; empty without one.
    pub(crate) heterogeneity: Vec<Heterogeneity>,
    /// tau of each parameter between the windows, of the reported model.
    pub parameter_tau: [f64; COUNT],
    /// Why the effects of the model are not named.
    pub not_explained: Option<NotExplained>,
    /// Whether each effect of the model has a name.
    pub(crate) is_named: Vec<bool>,
    /// Explanations compared, the null model first.
    pub explanations: Vec<Explanation>,
    /// Of the set that is named, or would be.
    pub significance: Option<Significance>,
}

/// Selects the effects that are missing from the baseline.
pub fn name(
    engine: &Engine<'_>,
    candidates: Vec<Candidate>,
    progress: &mut dyn FnMut(&str),
) -> SelectionResult {
    let linearisation = Linearisation::at_baseline(engine);
    progress("parameters alone");
    let calibrated = calibrate(engine, &linearisation);
    progress(&format!("screening {} candidates", candidates.len()));
    let columns = Columns::new(engine, candidates);
    let baseline = engine.residual(&engine.simulate(&engine.rig));
    let (calibrated_loss, mut screened) = columns.screen(engine, &linearisation, &baseline, &[]);
    screened.sort_by(|left, right| left.loss.total_cmp(&right.loss));

    let FitWithStartStates { engine: mut restarted, fit } = refit_with_starts(engine, &calibrated);
    let mut selection = Selection { calibrated: fit.clone(), model: fit, rounds: Vec::new() };
    let mut threshold = 0.0;
    let mut fitted = Vec::new();
    let mut any_homogeneous = false;
    for number in 0..MAX_EFFECTS {
        let here = restarted.as_ref().unwrap_or(engine);
        let model = &selection.model;
        let screening = if number == 0 {
            (calibrated_loss, screened.clone())
        } else {
            screen_again(here, &columns, model)
        };
        let at_model = if number == 0 { linearisation.clone() } else { linearise(here, model) };
        // Under lack of fit the residual is signal; the null threshold does not apply.
        let searched = if lacks_fit(here, model.loss) { 0.0 } else { threshold };
        let selected =
            SelectionRound::selected(here, &at_model, &columns, model, screening, searched, progress);
        let Some(mut round) = selected else { break };
        fitted.extend(round.fits.iter().cloned());
        let inexact = round.fits.first().is_some_and(|best| lacks_fit(here, best.loss));
        let homogeneous = if inexact {
            progress("comparing explanations");
            prefer_homogeneous(here, &at_model, model, &mut round.fits)
        } else {
            prefer_large(here, model, &mut round.fits);
            false
        };
        let best_restarted = round.take_engine();
        let there = best_restarted.as_ref().unwrap_or(here);
        let Some(best) = round.fits.first_mut() else { break };
        // The null distribution is drawn from the residual of the best model, since explained signal is not noise. No threshold
        // applies here: an effect that turns out unnecessary is eliminated at the end.
        if !homogeneous && !gains_enough(here, model, best) {
            break;
        }
        any_homogeneous |= homogeneous;
        // Its loss, squares and errors stay those of the factors before; the next fits start from these.
        best.factors = shrink_parameters(there, best);
        threshold = NullDistribution::new(there, &columns, &linearise(there, best), best).threshold();
        selection.model = best.clone();
        selection.rounds.push(round.fits);
        if number > 0 {
            selection.swap(there, progress);
        }
        restarted = best_restarted.or(restarted);
    }
    let here = restarted.as_ref().unwrap_or(engine);
    let all_rounds = selection.rounds.clone();
    if lacks_fit(here, selection.model.loss) {
        eliminate_heterogeneous(here, &mut selection);
    } else {
        selection.eliminate_backward(here, &columns);
    }
    let Selection { calibrated, model, .. } = &selection;
    let null = NullDistribution::new(here, &columns, &linearise(here, model), model);
    threshold = null.threshold();
    let limits = limits_of(&null, &columns, threshold);
    let lacks_fit = lacks_fit(here, model.loss);
    progress("weighing explanations");
    // Its parameters were shrunk to start the next round: the fit that its loss is of has others.
    let as_fitted = fitted.iter().find(|fit| fit.loss == model.loss).unwrap_or(model);
    let fits = Fits { parameters: calibrated, model: as_fitted, fitted: &fitted };
    let explanations = explanations(here, &linearisation, &columns, &fits);
    let searched = SearchOutcome { selection, all_rounds, lacks_fit, any_homogeneous };
    let mut decision = decide(here, &explanations, searched);
    let significance = decision.to_be_named().and_then(|model| {
        progress("testing what is named against chance");
        let calibrated = &decision.selection.calibrated;
        let fitted = Fitted {
            engine: here,
            linearisation: &linearisation,
            columns: &columns,
            calibrated,
            explanations: &explanations,
            threshold,
        };
        fitted.significance(model)
    });
    if let Some(objection) = significance.as_ref().and_then(Significance::rejection_reason) {
        decision = decision.without_names(here, objection);
    }
    let Decision { selection, lacks_fit, shares, is_named, explained } = decision;
    let lacks_fit = lacks_fit || lacks_fit_on_an_axis(here, &selection.model);
    let not_explained = explained.as_ref().err().copied();
    let reported = explained.unwrap_or_else(|_| {
        let rig = with_factors(&engine.rig, &selection.calibrated.factors);
        let restarted = engine.is_linked().then(|| engine.with_starts_under(&rig));
        with_needed(restarted.as_ref().unwrap_or(engine), &selection.calibrated)
    });
    let at_reported = linearise(here, &reported);
    let heterogeneity = if not_explained.is_none() && !reported.effects.is_empty() {
        heterogeneity(here, &at_reported, &reported).unwrap_or_default()
    } else {
        Vec::new()
    };
    let parameter_tau = parameter_tau(here, &at_reported, &reported).unwrap_or([0.0; COUNT]);
    let with_shares = selection.model.effects.iter().zip(&shares);
    let alternatives = with_shares.map(|(effect, share)| selection.alternatives(effect, *share)).collect();
    let Selection { calibrated, model, .. } = selection;
    SelectionResult {
        calibrated,
        model,
        reported,
        alternatives,
        shares,
        screened,
        fitted,
        threshold,
        columns,
        calibrated_loss,
        limits,
        lacks_fit,
        heterogeneity,
        parameter_tau,
        not_explained,
        is_named,
        explanations,
        significance,
    }
}

/// Gives the explanations of a search their marginal likelihoods.
pub fn weigh_by_marginal_likelihood(engine: &Engine<'_>, found: &mut SelectionResult) {
    marginal::weigh(engine, &found.calibrated, found.columns.candidates.len(), &mut found.explanations);
}

/// Refits the reported model on all of the records, where the search used a part of them.
pub(crate) fn on_all(engine: &Engine<'_>, found: &mut SelectionResult) {
    let Some(rig) = rig_of(&engine.rig, &found.reported.effects, &found.reported.factors) else { return };
    let restarted = engine.is_linked().then(|| engine.with_starts_under(&rig));
    let needed = found.reported.factors.map(|factor| factor != 1.0);
    if let Some(reported) = fit_selected(restarted.as_ref().unwrap_or(engine), &found.reported, &needed) {
        found.reported = reported;
    }
}

/// Refits a model with sensitivities relinearised at itself.
fn relinearise(engine: &Engine<'_>, model: FittedModel) -> FittedModel {
    crate::refit::relinearise(engine, model, RELINEARISATION)
}

/// Whether a model's last effect removes the required share of the loss before it.
fn gains_enough(engine: &Engine<'_>, before: &FittedModel, after: &FittedModel) -> bool {
    let gain = before.loss - after.loss;
    let share = if before.effects.is_empty() { MIN_LOSS_SHARE_FIRST } else { MIN_LOSS_SHARE_FURTHER };
    gain > (share * loss_where_last_acts(engine, before, after)).max(MIN_GAIN)
}

/// The axes that effects act on; both where there is none.
fn axes_of(effects: &[EffectEstimate]) -> [bool; 2] {
    [Part::Drive, Part::Load].map(|axis| {
        effects.is_empty()
            || effects.iter().any(|effect| {
                let part = effect.candidate.place.part;
                part == axis || matches!(part, Part::Linkage | Part::Supply)
            })
    })
}

/// The loss of a fit on some axes, its penalties included; the whole one where the axes are not judged apart.
fn loss_on(engine: &Engine<'_>, axes: [bool; 2], fit: &FittedModel) -> f64 {
    let of = |axes: [bool; 2]| engine.loss_on(axes, &fit.squares).0;
    if engine.axis_by_axis && axes != [true; 2] { fit.loss - of([true; 2]) + of(axes) } else { fit.loss }
}

/// The loss of a model on the axes that the last effect of another one acts on.
fn loss_where_last_acts(engine: &Engine<'_>, model: &FittedModel, other: &FittedModel) -> f64 {
    loss_on(engine, axes_of(other.effects.last().map_or(&[], std::slice::from_ref)), model)
}

/// Share of a loss that a model removes; 0 where there was none to remove.
pub(crate) fn share_removed(before: f64, after: f64) -> f64 {
    if before > 0.0 { (1.0 - after / before).clamp(0.0, 1.0) } else { 0.0 }
}

/// Whether a model with this penalised loss lacks fit.
fn lacks_fit(engine: &Engine<'_>, loss: f64) -> bool {
    loss > lack_of_fit_per_dof(engine.is_linked()) * engine.scaled_dof.iter().sum::<f64>()
}

/// Whether a model lacks fit on one of the axes, where each counts: the other one would hide it in the sum.
fn lacks_fit_on_an_axis(engine: &Engine<'_>, model: &FittedModel) -> bool {
    let lacks_on = |axes| {
        let (loss, dof) = engine.loss_on(axes, &model.squares);
        loss > lack_of_fit_per_dof(engine.is_linked()) * dof
    };
    engine.axis_by_axis && (lacks_on([true, false]) || lacks_on([false, true]))
}

/// Bound on J/f of all windows, and on L/f of an axis, above which a model lacks fit; on the held-out record on the logarithm of
/// chi2 over the middle of its null range (`verify::lacks_fit`).
pub(crate) fn lack_of_fit_per_dof(linked: bool) -> f64 {
    if linked { LACK_OF_FIT_PER_DOF_LINKED } else { LACK_OF_FIT_PER_DOF }
}

/// Whether one of an effect's amplitudes is above the floor.
pub fn is_large(effect: &EffectEstimate) -> bool {
    amplitude_ratio(effect) >= 1.0
}

/// The largest of an effect's amplitudes over its floor.
fn amplitude_ratio(effect: &EffectEstimate) -> f64 {
    amplitude_ratios(effect).map(|(_, ratio)| ratio).fold(0.0, f64::max)
}

/// The key with the largest amplitude over its floor.
fn leading_key(effect: &EffectEstimate) -> usize {
    amplitude_ratios(effect).max_by(|left, right| left.1.total_cmp(&right.1)).map_or(0, |(key, _)| key)
}

/// The keys that are amplitudes, each over its floor.
fn amplitude_ratios(effect: &EffectEstimate) -> impl Iterator<Item = (usize, f64)> {
    let candidate = &effect.candidate;
    let keys = if candidate.sheet.defined_by_first { 1 } else { effect.coordinates.len() };
    (0..keys)
        .filter(|key| !candidate.is_shape(*key))
        .map(|key| (key, effect.coordinates[key].abs() / least_coordinate(candidate, key)))
}

/// Amplitude floor of a key, as a coordinate.
fn least_coordinate(candidate: &Candidate, key: usize) -> f64 {
    let ends = candidate.sheet.keys[key].drawn.map(|number| candidate.coordinate(key, number));
    // A range that contains the neutral value has no smallest change, and an effect already in the rig file may be off by little.
    if candidate.is_present() || ends[0] * ends[1] < 0.0 {
        0.05
    } else {
        MIN_AMPLITUDE_RATIO * ends[0].abs().min(ends[1].abs())
    }
}

/// Detection limits, in Currie's terms (1968) decision limits: the amplitude whose expected linear gain reaches
/// [`THRESHOLD_FACTOR_SINGLE`] null thresholds and the gain worth a fit, at least the floor. The linear gain exceeds that in half
/// of the records; the procedure finds fewer, since J has [`EFFECT_PARAMETER_PENALTY`] for each parameter of the effect.
/// The smallest limit of several probes is optimistic for nonlinear effects.
fn limits_of(null: &NullDistribution, columns: &Columns, threshold: f64) -> Vec<Option<f64>> {
    let limits = null.limits(columns.candidates.len(), (THRESHOLD_FACTOR_SINGLE * threshold).max(MIN_GAIN));
    let floored = |(limit, candidate): (Option<f64>, &Candidate)| {
        limit.map(|limit: f64| limit.max(least_coordinate(candidate, 0)))
    };
    limits.into_iter().zip(&columns.candidates).map(floored).collect()
}

/// Screens all candidates against a model's residual, with the derivatives of its effects as extra columns.
fn screen_again(
    engine: &Engine<'_>,
    columns: &Columns,
    model: &FittedModel,
) -> (f64, Vec<ScreenedCandidate>) {
    let linearisation = linearise(engine, model);
    let rig = rig_of(&engine.rig, &model.effects, &model.factors).expect("a model that was fitted is a rig");
    let simulated = engine.simulate(&rig);
    let residual = engine.residual(&simulated);
    let sensitivities = parallel::map(&coordinates(&model.effects), |(at, key)| {
        derivative(engine, &model.factors, &model.effects, &simulated, *at, *key)
    });
    let model_sensitivities: Vec<Vec<f64>> = sensitivities.into_iter().flatten().collect();
    columns.screen(engine, &linearisation, &residual, &model_sensitivities)
}

#[cfg(test)]
mod tests {
    use super::share_removed;

    #[test]
    fn nothing_is_removed_of_a_loss_that_noise_explains() {
        let all = [(10.0, 4.0), (10.0, -2.0), (10.0, 12.0), (-1.0, -5.0), (0.0, -5.0)];
        assert_eq!(all.map(|(before, after)| share_removed(before, after)), [0.6, 1.0, 0.0, 0.0, 0.0]);
    }
}
