//! One round of forward selection: which candidate joins the model.
//!
//! ```text
//!   screened ──► the few with the largest gain ──► each refitted beside the model ──► the best relinearised, at their best
//!                                                                                     pitch, with re-estimated start states
//! ```

use super::elimination::is_same_effect;
use super::gauss_newton::fit_all;
use super::pitch::at_best_pitch;
use super::start_states::{FitWithStartStates, backlash_start, refit_with_starts};
use super::{LACK_OF_FIT_PER_DOF, MIN_GAIN, STEPS, amplitude_ratio, lacks_fit, relinearise};
use crate::engine::Engine;
use crate::refit::{EffectEstimate, FittedModel, Linearisation, loss_at, refit_steps, relinearise_once};
use crate::screen::{Columns, ScreenedCandidate};
use model_fit::parallel;

/// Maximum number of candidates refitted in the simulator in each round.
const CONTENDERS: usize = 6;
/// The same from the third round on, whose fits take longest.
const CONTENDERS_LATE: usize = 3;
/// Smallest screened gain of a refitted candidate, as a share of the best.
const CONTENDER_SHARE: f64 = 0.35;
/// The same where a model lacks fit: what is missing beside the effect ranks first there.
const CONTENDER_SHARE_INEXACT: f64 = 0.15;
/// Smallest screened amplitude of a refitted candidate, as a share of its floor.
const MIN_SCREENED_RATIO: f64 = 0.5;
/// Maximum number of refitted candidates below [`MIN_SCREENED_RATIO`], and their smallest screened gain as a share of the best.
const SMALL_CONTENDERS: usize = 2;
const SMALL_CONTENDER_SHARE: f64 = 0.6;
/// Smallest screened gain of a further effect, as a share of the last round's threshold.
const SEARCHED_SHARE: f64 = 0.5;
/// Share of the predicted gain that the simulator may lack before other starting amplitudes are tried.
const MOST_SHORTFALL: f64 = 0.2;
/// Those amplitudes.
const AMPLITUDES: [f64; 6] = [0.05, 0.12, 0.25, 0.45, 0.7, 1.0];
/// Maximum number of fits of a round that are relinearised.
const MAX_RELINEARISED_FITS: usize = 3;
/// Share of the best gain after one new linearisation below which a fit has no further ones. Names and verdicts of 12 draws of
/// seed 1403356004951295, a development seed by then, stayed the same.
const MAY_BE_BEST: f64 = 0.8;
/// Fits are close when their losses differ by less than this share of the best gain.
const CLOSE: f64 = 0.02;
/// Effects of a model from which on no other widths of a backlash are tried: the residual is small by then, and each width has
/// start states of its own.
const BACKLASH_BESIDE: usize = 2;

struct Contenders {
    loss_before: f64,
    best: Vec<ScreenedCandidate>,
    /// The backlash of linked rods, whatever its screened gain.
    backlash: Option<ScreenedCandidate>,
}

impl Contenders {
    /// Selects the candidates outside the model with the largest gains, in descending order: those that may be large enough to be
    /// named, and smaller ones.
    ///
    /// The last round's threshold came from a residual with unexplained signal: it decides when to stop searching, not what to
    /// reject.
    fn of(
        (loss_before, screened): (f64, Vec<ScreenedCandidate>),
        engine: &Engine<'_>,
        columns: &Columns,
        model: &FittedModel,
        threshold: f64,
    ) -> [Option<Self>; 2] {
        let taken = |screened: &ScreenedCandidate| {
            model.effects.iter().any(|effect| is_same_effect(effect, &screened.start))
        };
        let mut all: Vec<ScreenedCandidate> =
            screened.into_iter().filter(|screened| !taken(screened)).collect();
        all.sort_by(|left, right| left.loss.total_cmp(&right.loss));
        let (large, small): (Vec<ScreenedCandidate>, Vec<ScreenedCandidate>) =
            all.into_iter().partition(|screened| amplitude_ratio(&screened.start) > MIN_SCREENED_RATIO);
        let gain = |screened: &ScreenedCandidate| loss_before - screened.loss;
        let enough = |screened: &[ScreenedCandidate]| {
            screened.first().is_some_and(|best| gain(best) > MIN_GAIN.max(SEARCHED_SHARE * threshold))
        };
        let is_backlash =
            |screened: &&ScreenedCandidate| columns.candidates[screened.at].sheet.moves_start_states;
        let backlash = if engine.is_linked() { large.iter().find(is_backlash).cloned() } else { None };
        let share = if lacks_fit(engine, loss_before) { CONTENDER_SHARE_INEXACT } else { CONTENDER_SHARE };
        let most = [&large, &small].map(|all| all.first().map_or(0.0, gain));
        let count = if model.effects.len() < 2 { CONTENDERS } else { CONTENDERS_LATE };
        let best = |mut all: Vec<ScreenedCandidate>, count: usize, least: f64| {
            all.retain(|screened| gain(screened) > least);
            all.truncate(count);
            all
        };
        [
            enough(&large).then(|| Self { loss_before, best: best(large, count, share * most[0]), backlash }),
            enough(&small)
                .then(|| Self {
                    loss_before,
                    best: best(small, SMALL_CONTENDERS, SMALL_CONTENDER_SHARE * most[0].max(most[1])),
                    backlash: None,
                })
                .filter(|small| !small.best.is_empty()),
        ]
    }
}

/// Models with one more effect.
pub(super) struct SelectionRound<'a> {
    pub(super) fits: Vec<FittedModel>,
    /// Their relinearised refits, each with its start states.
    restarted: Vec<FitWithStartStates<'a>>,
}

impl<'a> SelectionRound<'a> {
    /// The round of the candidates with the largest gains; `None` where none gains enough. Candidates below the amplitude floor
    /// take part where the others lack fit: a real machine differs from its rig file by many of them.
    pub(super) fn selected(
        engine: &Engine<'a>,
        linearisation: &Linearisation,
        columns: &Columns,
        model: &FittedModel,
        screening: (f64, Vec<ScreenedCandidate>),
        threshold: f64,
        progress: &mut dyn FnMut(&str),
    ) -> Option<Self> {
        let [large, small] = Contenders::of(screening, engine, columns, model, threshold);
        let mut fitted = |contenders: &Contenders| {
            let number = model.effects.len() + 1;
            progress(&format!("fitting {} candidates, round {number}", contenders.best.len()));
            SelectionRound::fitted(engine, linearisation, model, contenders, progress)
        };
        let mut round = large.and_then(|contenders| fitted(&contenders));
        let best_loss =
            round.as_ref().and_then(|round| round.fits.first()).map_or(model.loss, |best| best.loss);
        if lacks_fit(engine, model.loss.min(best_loss))
            && let Some(small) = small.and_then(|contenders| fitted(&contenders))
        {
            match &mut round {
                Some(round) => {
                    round.fits.extend(small.fits);
                    round.restarted.extend(small.restarted);
                    sort(&mut round.fits);
                }
                none => *none = Some(small),
            }
        }
        round
    }

    /// Fits the model with each contender; `linearisation` holds the parameter sensitivities. `None` where no fit is possible.
    fn fitted(
        engine: &Engine<'a>,
        linearisation: &Linearisation,
        model: &FittedModel,
        contenders: &Contenders,
        progress: &mut dyn FnMut(&str),
    ) -> Option<Self> {
        let Contenders { loss_before, best, backlash } = contenders;
        let fits = parallel::map(best, |screened| {
            let start = best_start(engine, linearisation, &model.effects, screened, *loss_before);
            refit_steps(engine, linearisation, &start, STEPS)
        });
        let mut fits: Vec<FittedModel> = fits.into_iter().flatten().collect();
        sort(&mut fits);
        // These fits used the sensitivities of the model without the effect; the best are relinearised. Gains compare with the
        // null loss of the same sensitivities.
        let gain = loss_before - fits.first()?.loss;
        let is_near = |fit: &&FittedModel| loss_before - fit.loss >= 0.5 * gain;
        let near = fits.iter().take(MAX_RELINEARISED_FITS).filter(is_near).count().max(1);
        let once = parallel::map(&fits[..near], |fit| relinearise_once(engine, at_best_pitch(engine, fit)));
        let most = once.iter().map(|fit| loss_before - fit.loss).fold(0.0, f64::max);
        let restarted = parallel::map(&once, |fit| {
            let may_be_best = loss_before - fit.loss >= MAY_BE_BEST * most;
            let fit = if may_be_best { relinearise(engine, fit.clone()) } else { fit.clone() };
            refit_with_starts(engine, &fit)
        });
        let mut round = Self { fits, restarted };
        round.fits.splice(..near, round.restarted.iter().map(|restarted| restarted.fit.clone()));
        let least = round.fits.iter().map(|fit| fit.loss).fold(model.loss, f64::min);
        if let Some(backlash) = backlash
            && model.effects.len() < BACKLASH_BESIDE
            && least > LACK_OF_FIT_PER_DOF * engine.scaled_dof.iter().sum::<f64>()
        {
            progress("trying other gaps");
            round.with_backlash(engine, linearisation, model, backlash);
        }
        sort(&mut round.fits);
        round.refit_close_jointly(engine, model);
        Some(round)
    }

    /// Where several fits are close, fits all numbers of each in the simulator: with linearised parameters, a wrong effect that
    /// moves all parameters may beat the right one.
    fn refit_close_jointly(&mut self, engine: &Engine<'a>, model: &FittedModel) {
        let Some(best) = self.fits.first().map(|fit| fit.loss) else { return };
        let is_close = |fit: &&FittedModel| fit.loss - best < CLOSE * (model.loss - best);
        let close = self.fits.iter().take(MAX_RELINEARISED_FITS).filter(is_close).count();
        if close < 2 || engine.is_linked() {
            return;
        }
        let fits = parallel::map(&self.fits[..close], |fit| fit_all(engine, fit));
        self.fits.splice(..close, fits);
        sort(&mut self.fits);
    }

    /// Fits the backlash from other starting widths than the screened one.
    fn with_backlash(
        &mut self,
        engine: &Engine<'a>,
        linearisation: &Linearisation,
        model: &FittedModel,
        backlash: &ScreenedCandidate,
    ) {
        let start = backlash_start(engine, linearisation, &model.effects, &backlash.start);
        let Some(fit) = refit_steps(engine, linearisation, &start, STEPS) else {
            return;
        };
        let restarted = refit_with_starts(engine, &relinearise(engine, fit));
        // The fit from the screened width is the same effect, not an alternative.
        let is_backlash = |other: &FittedModel| {
            other.effects.last().is_some_and(|effect| is_same_effect(effect, &backlash.start))
        };
        if self.fits.iter().filter(|other| is_backlash(other)).all(|other| restarted.fit.loss < other.loss) {
            self.fits.retain(|other| !is_backlash(other));
            self.fits.push(restarted.fit.clone());
            self.restarted.push(restarted);
        }
    }

    /// The engine with the start states of the best model, where they were re-estimated.
    pub(super) fn take_engine(&mut self) -> Option<Engine<'a>> {
        let best = self.fits.first()?;
        self.restarted
            .iter_mut()
            .find(|restarted| restarted.fit.loss == best.loss)
            .and_then(|restarted| restarted.engine.take())
    }
}

fn sort(fits: &mut [FittedModel]) {
    fits.sort_by(|left, right| left.loss.total_cmp(&right.loss));
}

/// Start of a candidate's fit: the screened amplitude, or the best of some amplitudes where the simulator's loss there is far
/// above the predicted one.
fn best_start(
    engine: &Engine<'_>,
    linearisation: &Linearisation,
    model: &[EffectEstimate],
    screened: &ScreenedCandidate,
    loss_before: f64,
) -> Vec<EffectEstimate> {
    let with = |amplitude: f64| {
        let mut effects = model.to_vec();
        let mut effect = screened.start.clone();
        effect.coordinates[0] = amplitude;
        effects.push(effect);
        effects
    };
    let screened_z = screened.start.coordinates[0];
    let loss = loss_at(engine, linearisation, &with(screened_z));
    if loss < screened.loss + MOST_SHORTFALL * (loss_before - screened.loss) {
        return with(screened_z);
    }
    let [least, most] = screened.start.candidate.range(0);
    let tried =
        AMPLITUDES.iter().map(|size| size * screened_z.signum()).filter(|z| *z >= least && *z <= most);
    let losses = tried.map(|z| (loss_at(engine, linearisation, &with(z)), z));
    let (_, best) =
        losses.chain([(loss, screened_z)]).min_by(|a, b| a.0.total_cmp(&b.0)).expect("one at least");
    with(best)
}
