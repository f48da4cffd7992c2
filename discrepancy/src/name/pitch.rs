//! Grid search for the pitch of a ripple, since a local fit ends in a side lobe.
//!
//! ```text
//!   ripple off ──► a column for each pitch of a grid ──► the pitch and amplitude with the smallest loss ──► refit
//! ```
//!
//! Over a travel D two pitches are indistinguishable while D (1/P_1 - 1/P_2) is well below one, so that the grid is even in 1/P.

use super::STEPS;
use crate::engine::Engine;
use crate::parameters::COUNT;
use crate::refit::{
    FittedModel, coordinate_columns, coordinate_precision, linearise, prior_deviations, prior_precisions,
    refit_steps, rig_of,
};
use model_fit::parallel;

/// Grid points of the pitch.
const PITCHES: u32 = 40;
/// Amplitude coordinate at which the ripples are simulated.
const PROBE: f64 = 0.3;

/// The model with the best pitch of its last effect, if it lowers the loss; unchanged for effects without a ripple.
pub(super) fn at_best_pitch(engine: &Engine<'_>, model: &FittedModel) -> FittedModel {
    best(engine, model).filter(|other| other.loss < model.loss).unwrap_or_else(|| model.clone())
}

fn best(engine: &Engine<'_>, model: &FittedModel) -> Option<FittedModel> {
    let candidate = model.effects.last()?.candidate;
    let key_of = |name: &str| candidate.sheet.keys.iter().position(|key| key.name == name);
    let (ripple, pitch) = (key_of("ripple_n")?, key_of("pitch_mm")?);
    let mut plain = model.effects.clone();
    let last = plain.len() - 1;
    plain[last].coordinates[ripple] = 0.0;
    let rig = rig_of(&engine.rig, &plain, &model.factors)?;
    let [simulated, coarse] = [engine.simulate(&rig), engine.simulate_coarsely(&rig)];
    let [least, most] = candidate.sheet.keys[pitch].drawn;
    let step = (1.0 / least - 1.0 / most) / f64::from(PITCHES - 1);
    let pitches: Vec<f64> = (0..PITCHES).map(|at| 1.0 / (1.0 / most + f64::from(at) * step)).collect();
    let with = |amplitude: f64, at: f64| {
        let mut effects = plain.clone();
        effects[last].coordinates[ripple] = amplitude;
        effects[last].coordinates[pitch] = candidate.coordinate(pitch, at);
        effects
    };
    let ripples = parallel::map(&pitches, |at| {
        let rig = rig_of(&engine.rig, &with(PROBE, *at), &model.factors)?;
        Some(engine.difference(&engine.simulate_coarsely(&rig), &coarse))
    });
    let ripples: Vec<Vec<f64>> = ripples.into_iter().collect::<Option<_>>()?;
    let linearisation = linearise(engine, model);
    let numbers = coordinate_columns(engine, &model.factors, &plain, &simulated)?;
    let always = COUNT + numbers.len();
    let columns: Vec<&Vec<f64>> = linearisation.columns.iter().chain(&numbers).chain(&ripples).collect();
    let products = engine.products(&engine.residual(&simulated), &columns);
    let (mut precisions, mut from) =
        (prior_precisions(&plain), prior_deviations(&linearisation.factors, &plain));
    precisions.push(coordinate_precision(&candidate, ripple));
    from.push(0.0);
    let fits = (0..pitches.len()).map(|at| {
        let chosen: Vec<usize> = (0..always).chain([always + at]).collect();
        (at, products.fit_from(&chosen, &precisions, &from))
    });
    let (at, fit) = fits.min_by(|left, right| left.1.loss.total_cmp(&right.1.loss))?;
    let [smallest, largest] = candidate.fit_bounds(ripple);
    let amplitude = (PROBE * fit.coefficients[always]).clamp(smallest, largest);
    refit_steps(engine, &linearisation, &with(amplitude, pitches[at]), STEPS)
}
