//! Names what is missing: screened, fitted in the simulator, compared, accepted or refused.
//!
//! ```text
//!   parameters alone ──► screening of all candidates ──► the best fitted in the simulator ──► takes enough?
//!                             ▲                                                                  │ yes: joins the model
//!                             └──────── what is left, the model's own columns beside ────────────┘ up to three times
//!   each that joined is taken out once: what is not missed goes; what fits as well as one of them is its alternative
//! ```
//!
//! An effect joins when it takes a good share of what the model leaves, with an amplitude no smaller than a share of what occurs.
//! It stays when, beside all that joined, the loss without it is higher by several times what nothing gains there. What is left
//! after three, or beside an explanation that leaves much, is outside the catalogue.
//!
//! Source: discrepancy-notes.md, 3 to 8 and pipeline 5.

mod elimination;
mod gauss_newton;
mod needed_parameters;
mod null_distribution;
mod pitch;
mod round;
mod start_states;

use crate::calibrate::{Calibrated, calibrate};
use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::parameters::COUNT;
use crate::refit::{Around, Placed, Refit, derivative, refit, rig_of};
use crate::screen::{Columns, Screened};
pub(crate) use elimination::same;
use elimination::{alternatives, drop_unneeded, shares, swap};
use gauss_newton::{backtrack, fit_selected};
use needed_parameters::with_needed;
use null_distribution::NullDistribution;
use rayon::prelude::*;
use round::{Contenders, Round};
use start_states::{Restarted, refit_with_starts};

/// Effects at most.
const MOST: usize = 3;
/// Steps of a candidate's first fit.
const STEPS: usize = 5;
/// How often a model is fitted with sensitivities of its own at most, and the fall of the loss that ends it.
const RELINEARISATIONS: usize = 4;
const CONVERGED: f64 = 1.0;
/// Mean excess of a window's logarithm from which on a model that leaves it is no explanation.
const EXCESS: f64 = 0.08;
/// The same of linked records, where micrometres decide when the eye meets the carriage: records of nothing leave up to 0.2.
const EXCESS_LINKED: f64 = 0.3;
/// Screened gain below which nothing is fitted: the best of some forty candidates gains half of it by chance.
pub(crate) const WORTH_A_FIT: f64 = 25.0;
/// What each number of an effect costs: it must be worth more than one more candidate tried.
pub(crate) const NUMBER_COSTS: f64 = 8.0;
/// Multiple of the threshold of nothing that is asked of the first effect.
const SAFETY: f64 = 2.0;
/// Share of what the parameters leave that the first effect must take.
const TAKES_FIRST: f64 = 0.1;
/// Share of what a model leaves that one more effect must take.
const TAKES: f64 = 0.3;
/// Share of the smallest change that occurs below which an effect is none.
const FLOOR: f64 = 0.6;
/// Share of what the parameters leave that may stay beside an explanation.
const STAYS: f64 = 0.3;
/// Mean logarithm by which an explanation lowers what windows leave, from which on it is one: to a sixth. A law of another form
/// than the catalogue's leaves more than noise, and is this effect all the same.
const REDUCES: f64 = 1.8;
/// Effects that are none without their first number: without cracking pressure a check valve is the resistance of a line, and
/// where rods are linked, damping alone takes up what starts within micrometres leave.
const DEFINED_BY_FIRST: [&str; 3] = ["check-valve-restriction", "coupling-backlash", "coupling-compliance"];

/// What takes the place of an effect of a model just as well.
#[derive(Clone, Debug)]
pub struct Alternative {
    /// A model with it, last, in the round in which the other one joined.
    pub fit: Refit,
    /// Share of the excess that goes with it.
    pub share: f64,
}

/// What naming found.
#[derive(Debug)]
pub struct Found {
    /// The parameters alone.
    pub calibrated: Calibrated,
    /// The model that explains the records.
    pub model: Refit,
    /// The model as it is told: parameters that it does not need are what the file says. Of one that explains too little, the
    /// parameters alone.
    pub reported: Refit,
    /// What takes the place of each of its effects just as well.
    pub alternatives: Vec<Vec<Alternative>>,
    /// Share of the excess that goes with each effect.
    pub shares: Vec<f64>,
    /// All candidates as first screened, the best first.
    pub screened: Vec<Screened>,
    /// Those that were fitted, each as the last effect of its model: first alone, then beside what joined.
    pub fitted: Vec<Refit>,
    /// Loss that nothing may gain.
    pub threshold: f64,
    /// Screening's columns, for limits.
    pub columns: Columns,
    /// Loss with the parameters alone, as screening sees it.
    pub null_loss: f64,
    /// Smallest coordinate of each candidate's amplitude that would have been accepted; `None` where nothing is seen of it.
    pub limits: Vec<Option<f64>>,
    /// Whether the model leaves more than it may.
    pub inadequate: bool,
}

/// Names what is missing from a baseline.
#[must_use]
pub fn name(engine: &Engine<'_>, candidates: Vec<Candidate>, progress: &mut dyn FnMut(&str)) -> Found {
    let ones = [1.0; COUNT];
    let around = Around { columns: engine.parameter_columns(engine.rig(), &ones), factors: ones };
    progress("parameters alone");
    let calibrated = calibrate(engine, &around);
    progress(&format!("screening {} candidates", candidates.len()));
    let columns = Columns::new(engine, candidates);
    let baseline = engine.residual(&engine.simulate(engine.rig()));
    let (null_loss, mut screened) = columns.screen(engine, &around, &baseline, &[]);
    screened.sort_by(|left, right| left.loss.total_cmp(&right.loss));

    let Restarted { engine: mut restarted, fit } = refit_with_starts(engine, &calibrated.fit, 0.0);
    let calibrated = Calibrated { fit };
    let mut model = calibrated.fit.clone();
    let mut threshold = 0.0;
    let mut fitted = Vec::new();
    // Of each effect that joined, the fits of its round, the best first.
    let mut rounds: Vec<Vec<Refit>> = Vec::new();
    for number in 0..MOST {
        let here = restarted.as_ref().unwrap_or(engine);
        let screening =
            if number == 0 { (null_loss, screened.clone()) } else { screen_again(here, &columns, &model) };
        let Some(contenders) = Contenders::of(screening, here, &columns, &model, threshold) else { break };
        progress(&format!("fitting {} candidates, round {}", contenders.count(), number + 1));
        let point = if number == 0 { around.clone() } else { around_of(here, &model) };
        let Some(mut round) = Round::fitted(here, &point, &model, &contenders, progress) else { break };
        fitted.extend(round.fits.iter().cloned());
        round.keep_large();
        let best_restarted = round.take_engine();
        let there = best_restarted.as_ref().unwrap_or(here);
        let Some(best) = round.fits.first_mut() else { break };
        // What nothing gains is told by what the best model leaves: what it explains is no noise. What another effect still adds
        // is none either: a model that may be needed beside another one joins, and is taken out at the end if it is not.
        if !takes(&model, best) {
            break;
        }
        best.factors = backtrack(there, best);
        threshold = NullDistribution::new(there, &columns, &around_of(there, best), best).threshold();
        model = best.clone();
        rounds.push(round.fits);
        if number > 0 {
            swap(there, &mut model, &calibrated, &mut rounds, progress);
        }
        restarted = best_restarted.or(restarted);
    }
    let here = restarted.as_ref().unwrap_or(engine);
    drop_unneeded(here, &calibrated, &columns, &mut model, &mut rounds);
    let null = NullDistribution::new(here, &columns, &around_of(here, &model), &model);
    threshold = null.threshold();
    let limits = limits_of(&null, &columns, threshold);
    let excess = (calibrated.fit.loss - model.loss).max(1e-9);
    let freedom = here.freedom().iter().sum::<f64>();
    let level = model.loss / freedom;
    let excess_level = if engine.is_linked() { EXCESS_LINKED } else { EXCESS };
    let reduced = (calibrated.fit.loss - model.loss) / freedom;
    let inadequate = level > excess_level && model.loss > STAYS * calibrated.fit.loss && reduced < REDUCES;
    let reported = if inadequate {
        let restarted = engine.is_linked().then(|| engine.with_starts_under(&calibrated.rig(engine.rig())));
        with_needed(restarted.as_ref().unwrap_or(engine), &calibrated.fit)
    } else {
        with_needed(here, &model)
    };
    let shares = shares(&model, &rounds, &calibrated, excess);
    let with_shares = model.placed.iter().zip(&shares);
    let alternatives = with_shares
        .map(|(placed, share)| alternatives(placed, *share, &model, &calibrated, &rounds))
        .collect();
    Found {
        calibrated,
        model,
        reported,
        alternatives,
        shares,
        screened,
        fitted,
        threshold,
        columns,
        null_loss,
        limits,
        inadequate,
    }
}

/// Takes what is told of a part of the records to all of them: its numbers, fitted there, with their errors there.
pub fn on_all(engine: &Engine<'_>, found: &mut Found) {
    let Some(rig) = rig_of(engine.rig(), &found.reported.placed, &found.reported.factors) else { return };
    let restarted = engine.is_linked().then(|| engine.with_starts_under(&rig));
    let needed = found.reported.factors.map(|factor| factor != 1.0);
    if let Some(reported) = fit_selected(restarted.as_ref().unwrap_or(engine), &found.reported, &needed) {
        found.reported = reported;
    }
}

/// Sensitivities of the parameters at a model.
fn around_of(engine: &Engine<'_>, model: &Refit) -> Around {
    let rig = rig_of(engine.rig(), &model.placed, &[1.0; COUNT]).unwrap_or_else(|| engine.rig().clone());
    Around { columns: engine.parameter_columns(&rig, &model.factors), factors: model.factors }
}

/// Fits a model again with sensitivities taken at itself, until that no longer helps.
fn relinearise(engine: &Engine<'_>, model: &Refit) -> Refit {
    let mut best = model.clone();
    for _ in 0..RELINEARISATIONS {
        let Some(next) = refit(engine, &around_of(engine, &best), &best.placed, NUMBER_COSTS) else { break };
        let converged = next.loss > best.loss - CONVERGED;
        if next.loss < best.loss {
            best = next;
        }
        if converged {
            break;
        }
    }
    best
}

/// Whether a model's last effect takes a good share of what the model before it leaves.
fn takes(before: &Refit, after: &Refit) -> bool {
    let gain = before.loss - after.loss;
    let share = if before.placed.is_empty() { TAKES_FIRST } else { TAKES };
    gain > (share * before.loss).max(WORTH_A_FIT)
}

/// Whether one of an effect's amplitudes is no smaller than a share of what occurs.
#[must_use]
pub fn is_large(placed: &Placed) -> bool {
    let candidate = &placed.candidate;
    let keys = if DEFINED_BY_FIRST.contains(&candidate.sheet.name) { 1 } else { placed.coordinates.len() };
    (0..keys)
        .filter(|key| !candidate.is_shape(*key))
        .any(|key| placed.coordinates[key].abs() >= least_coordinate(candidate, key))
}

/// The smallest coordinate of an amplitude that counts as an effect.
fn least_coordinate(candidate: &Candidate, key: usize) -> f64 {
    let ends = candidate.sheet.keys[key].drawn.map(|number| candidate.coordinate(key, number));
    // A range that holds the neutral value has no smallest change, and what the rig file has already may be off by little.
    if candidate.is_present() || ends[0] * ends[1] < 0.0 {
        0.05
    } else {
        FLOOR * ends[0].abs().min(ends[1].abs())
    }
}

/// From which coordinate of its amplitude on a candidate would have been named: it must stand out of nothing, be worth a fit, and
/// be no smaller than what counts as an effect.
fn limits_of(null: &NullDistribution, columns: &Columns, threshold: f64) -> Vec<Option<f64>> {
    let limits = null.limits(columns.candidates.len(), (SAFETY * threshold).max(WORTH_A_FIT));
    let floored = |(limit, candidate): (Option<f64>, &Candidate)| {
        limit.map(|limit: f64| limit.max(least_coordinate(candidate, 0)))
    };
    limits.into_iter().zip(&columns.candidates).map(floored).collect()
}

/// Screens all candidates against what a model leaves, its own derivatives beside.
fn screen_again(engine: &Engine<'_>, columns: &Columns, model: &Refit) -> (f64, Vec<Screened>) {
    let around = around_of(engine, model);
    let rig = rig_of(engine.rig(), &model.placed, &model.factors).expect("a model that was fitted is a rig");
    let simulated = engine.simulate(&rig);
    let residual = engine.residual(&simulated);
    let beside: Vec<Vec<f64>> = (0..model.placed.len())
        .into_par_iter()
        .filter_map(|at| derivative(engine, &model.factors, &model.placed, &simulated, at, 0))
        .collect();
    columns.screen(engine, &around, &residual, &beside)
}
