//! One round of the search: which candidate would join the model.
//!
//! ```text
//!   screened ──► the few that gain most ──► each fitted beside the model ──► the best of them again, with sensitivities of
//!                                                                            their own, at their pitch, from their own home
//! ```

use super::elimination::same;
use super::gauss_newton::fit_all;
use super::pitch::at_best_pitch;
use super::start_states::{Restarted, gap_start, refit_with_starts};
use super::{EXCESS, NUMBER_COSTS, STEPS, WORTH_A_FIT, is_large, relinearise};
use crate::engine::Engine;
use crate::refit::{Around, Placed, Refit, loss_at, refit_steps};
use crate::screen::{Columns, Screened};
use rayon::prelude::*;

/// Candidates that are fitted in the simulator at most, in each round.
const CONTENDERS: usize = 6;
/// Share of the best screened gain below which a candidate is not fitted.
const CONTENDS: f64 = 0.35;
/// Share of the last round's threshold below which no further effect is fitted.
const LOOKED_FOR: f64 = 0.5;
/// Share of a screened gain that the simulator may deny before other amplitudes are tried.
const BELIEVED: f64 = 0.2;
/// Amplitudes that are tried then.
const AMPLITUDES: [f64; 6] = [0.05, 0.12, 0.25, 0.45, 0.7, 1.0];
/// How many contenders are fitted with sensitivities of their own.
const REFINED: usize = 3;
/// Share of what the best takes within which others come close.
const CLOSE: f64 = 0.02;
/// What stands between linked rods: screening sees little of it, since starts were moved to where the rig without it meets the
/// readings.
const BACKLASH: &str = "coupling-backlash";

/// Candidates that are worth a fit.
pub(super) struct Contenders {
    /// Loss of the model without any of them, as screening sees it.
    null_loss: f64,
    /// The one that gains most first.
    best: Vec<Screened>,
    /// A gap between linked rods, however little screening sees of it.
    gap: Option<Screened>,
}

impl Contenders {
    /// Of all candidates those that are not in the model yet and gain much; `None` where none gains enough.
    ///
    /// The last round's threshold is that of a residual in which much was still missing: it tells when to stop looking, not what
    /// to refuse.
    pub(super) fn of(
        (null_loss, screened): (f64, Vec<Screened>),
        engine: &Engine<'_>,
        columns: &Columns,
        model: &Refit,
        threshold: f64,
    ) -> Option<Self> {
        let taken = |screened: &Screened| model.placed.iter().any(|placed| same(placed, &screened.start));
        let mut best: Vec<Screened> = screened.into_iter().filter(|screened| !taken(screened)).collect();
        best.sort_by(|left, right| left.loss.total_cmp(&right.loss));
        let most = null_loss - best.first()?.loss;
        if most < WORTH_A_FIT.max(LOOKED_FOR * threshold) {
            return None;
        }
        let is_gap = |screened: &&Screened| columns.candidates[screened.at].sheet.name == BACKLASH;
        let gap = if engine.is_linked() { best.iter().find(is_gap).cloned() } else { None };
        best.truncate(CONTENDERS);
        best.retain(|screened| null_loss - screened.loss > CONTENDS * most);
        Some(Self { null_loss, best, gap })
    }

    pub(super) fn count(&self) -> usize {
        self.best.len()
    }
}

/// Models with one effect more.
pub(super) struct Round<'a> {
    /// The best first.
    pub(super) fits: Vec<Refit>,
    /// Those of them that were fitted again, each with its home.
    restarted: Vec<Restarted<'a>>,
}

impl<'a> Round<'a> {
    /// Fits a model with each of the contenders, `point` the parameters' sensitivities at the model; `None` where none can be
    /// fitted.
    pub(super) fn fitted(
        engine: &Engine<'a>,
        point: &Around,
        model: &Refit,
        contenders: &Contenders,
        progress: &mut dyn FnMut(&str),
    ) -> Option<Self> {
        let Contenders { null_loss, best, gap } = contenders;
        let mut fits: Vec<Refit> = best
            .par_iter()
            .filter_map(|screened| {
                let start = best_start(engine, point, &model.placed, screened, *null_loss);
                refit_steps(engine, point, &start, NUMBER_COSTS, STEPS)
            })
            .collect();
        sort(&mut fits);
        // Sensitivities of the parameters were those of the model before: the best get their own. What they gain is held against
        // what the parameters alone reach with the same sensitivities.
        let gain = null_loss - fits.first()?.loss;
        let near = fits.iter().take(REFINED).filter(|fit| null_loss - fit.loss >= 0.5 * gain).count().max(1);
        let restarted = fits[..near]
            .par_iter()
            .map(|fit| {
                refit_with_starts(engine, &relinearise(engine, &at_best_pitch(engine, fit)), NUMBER_COSTS)
            })
            .collect();
        let mut round = Self { fits, restarted };
        round.fits.splice(..near, round.restarted.iter().map(|restarted| restarted.fit.clone()));
        let least = round.fits.iter().map(|fit| fit.loss).fold(model.loss, f64::min);
        if let Some(gap) = gap
            && least > EXCESS * engine.freedom().iter().sum::<f64>()
        {
            progress("trying other gaps");
            round.with_gap(engine, point, model, gap);
        }
        sort(&mut round.fits);
        round.run_off(engine, model);
        Some(round)
    }

    /// Where others come close to the best, fits all of them in the simulator to the end: with straight lines of the parameters,
    /// one that leads all of them far from the file may pass the one that is right.
    fn run_off(&mut self, engine: &Engine<'a>, model: &Refit) {
        let Some(best) = self.fits.first().map(|fit| fit.loss) else { return };
        let is_close = |fit: &&Refit| fit.loss - best < CLOSE * (model.loss - best);
        let close = self.fits.iter().take(REFINED).filter(is_close).count();
        if close < 2 || engine.is_linked() {
            return;
        }
        let fits: Vec<Refit> = self.fits[..close].par_iter().map(|fit| fit_all(engine, fit)).collect();
        self.fits.splice(..close, fits);
        sort(&mut self.fits);
    }

    /// Fits a gap from another width than the one that screening says.
    fn with_gap(&mut self, engine: &Engine<'a>, point: &Around, model: &Refit, gap: &Screened) {
        let start = gap_start(engine, point, &model.placed, &gap.start);
        let Some(fit) = refit_steps(engine, point, &start, NUMBER_COSTS, STEPS) else { return };
        let restarted = refit_with_starts(engine, &relinearise(engine, &fit), NUMBER_COSTS);
        // The one fitted from where screening said is the same effect, and no alternative to it.
        let is_gap = |other: &Refit| other.placed.last().is_some_and(|placed| same(placed, &gap.start));
        if self.fits.iter().filter(|other| is_gap(other)).all(|other| restarted.fit.loss < other.loss) {
            self.fits.retain(|other| !is_gap(other));
            self.fits.push(restarted.fit.clone());
            self.restarted.push(restarted);
        }
    }

    /// What is smaller than what occurs is no explanation, however well it fits.
    pub(super) fn keep_large(&mut self) {
        self.fits.retain(|fit| fit.placed.last().is_some_and(is_large));
    }

    /// The records as the best model meets them, where it has a home of its own.
    pub(super) fn take_engine(&mut self) -> Option<Engine<'a>> {
        let best = self.fits.first()?;
        self.restarted
            .iter_mut()
            .find(|restarted| restarted.fit.loss == best.loss)
            .and_then(|restarted| restarted.engine.take())
    }
}

fn sort(fits: &mut [Refit]) {
    fits.sort_by(|left, right| left.loss.total_cmp(&right.loss));
}

/// Where a candidate's fit begins: where screening says, unless the simulator finds it far worse there than screening does; then
/// at the best of some amplitudes.
fn best_start(
    engine: &Engine<'_>,
    point: &Around,
    model: &[Placed],
    screened: &Screened,
    null_loss: f64,
) -> Vec<Placed> {
    let with = |amplitude: f64| {
        let mut placed = model.to_vec();
        let mut effect = screened.start.clone();
        effect.coordinates[0] = amplitude;
        placed.push(effect);
        placed
    };
    let screened_z = screened.start.coordinates[0];
    let loss = loss_at(engine, point, &with(screened_z));
    if loss < screened.loss + BELIEVED * (null_loss - screened.loss) {
        return with(screened_z);
    }
    let [least, most] = screened.start.candidate.range(0);
    let tried =
        AMPLITUDES.iter().map(|size| size * screened_z.signum()).filter(|z| *z >= least && *z <= most);
    let losses = tried.map(|z| (loss_at(engine, point, &with(z)), z));
    let (_, best) =
        losses.chain([(loss, screened_z)]).min_by(|a, b| a.0.total_cmp(&b.0)).expect("one at least");
    with(best)
}
