//! Share of the signature of the near and far forms that the best fit of the catalogue's law leaves.
//!
//! ```text
//! share = min over z |M (y - y_law(z))|^2 / |M (y - y_baseline)|^2       y: readings without noise of the form, alone, train
//! ```
//!
//! At both ends and in the geometric middle of the drawn range; shape numbers have their default, or the middle of their range.
//! The record is of the drive; for an effect of the linkage it is of both axes, linked. There stick and contact events count as
//! differences too, so that even the catalogue's form leaves a large share.

use crate::compute::ComputeError;
use crate::draws::axis_of;
use crate::nearest::fitted;
use plant::effects::SHEETS;
use plant::effects::sheet::{Part, Place, Sheet};
use plant::{Axis, RigParameters};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use record_maker::{Form, Hidden, Recipe, simulate};
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};

/// The far form of each effect in words, in the order of the catalogue.
const FAR: &str = include_str!("forms/far.txt");

fn far() -> impl Iterator<Item = (&'static str, &'static str)> {
    FAR.lines().map(|line| line.split_once(": ").expect("an effect and its form"))
}

/// The forms that are not the catalogue's.
pub const OTHERS: [Form; 2] = [Form::Near, Form::Far];

/// Shares of the squared signature of a form that the best fit leaves: low end, middle and high end of the amplitudes.
#[derive(Debug, Clone, Copy)]
pub struct FormResidual {
    pub(crate) effect: &'static str,
    pub(crate) form: Form,
    pub(crate) shares: [f64; 3],
}

#[derive(Debug, Clone, Copy)]
pub struct Selection<'a> {
    /// Names of the effects; all when empty.
    pub effects: &'a [String],
    /// Name of the place; the first place of each effect when `None`.
    pub place: Option<&'a str>,
    pub forms: &'a [Form],
}

/// Share of the squared signature of a hidden effect in one of its forms that the best fit of the catalogue's law leaves.
pub(crate) fn unexplained_share(hidden: &Hidden, form: Form) -> Result<f64, ComputeError> {
    let axis = axis_of(hidden.place).unwrap_or(Axis::Drive);
    let both_axes = hidden.place.part == Part::Linkage;
    let recipe = Recipe { hidden: vec![hidden.clone()], axis, both_axes, form, ..Recipe::default() };
    let made = simulate(&recipe, &RigParameters::baseline())
        .map_err(|error| ComputeError::Make { number: 0, error })?;
    Ok(fitted(&made, hidden)?.left_share)
}

/// An effect at the low end of its drawn amplitudes, their geometric middle, and the high end.
pub(crate) fn amplitudes(sheet: &Sheet, place: Place) -> [Hidden; 3] {
    let middle = |drawn: [f64; 2]| (drawn[0] * drawn[1]).sqrt();
    let [low, high] = sheet.keys[0].drawn;
    [low, middle([low, high]), high].map(|amplitude| {
        let shaping = sheet.keys.iter().skip(1).map(|key| key.default.unwrap_or_else(|| middle(key.drawn)));
        Hidden { name: sheet.name, place, numbers: std::iter::once(amplitude).chain(shaping).collect() }
    })
}

/// Fits the catalogue's law to a selection of forms, `jobs` at a time, until `stop` is set: only finished ones are in the
/// result. `say` gets a line for each.
pub fn residuals(
    of: &Selection<'_>,
    jobs: usize,
    stop: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Vec<FormResidual>, ComputeError> {
    let is_meant = |sheet: &&Sheet| of.effects.is_empty() || of.effects.iter().any(|name| name == sheet.name);
    let at = |sheet: &Sheet| match of.place {
        None => sheet.place.places().first().copied(),
        Some(name) => sheet.place_named(name),
    };
    let all: Vec<(&Sheet, Place, Form)> = SHEETS
        .iter()
        .filter(is_meant)
        .filter_map(|sheet| Some((sheet, at(sheet)?)))
        .flat_map(|(sheet, place)| of.forms.iter().map(move |form| (sheet, place, *form)))
        .collect();
    let pool = ThreadPoolBuilder::new().num_threads(jobs.max(1)).build()?;
    let one = |(sheet, place, form): (&'static Sheet, Place, Form)| {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let mut shares = [0.0; 3];
        for (share, hidden) in shares.iter_mut().zip(amplitudes(sheet, place)) {
            *share = unexplained_share(&hidden, form)?;
        }
        say(&format!("{} {place} {}: {}", sheet.name, form.name(), percent(&shares)));
        Ok(Some(FormResidual { effect: sheet.name, form, shares }))
    };
    pool.install(|| all.into_par_iter().with_max_len(1).map(one).filter_map(Result::transpose).collect())
}

fn percent(shares: &[f64]) -> String {
    shares.iter().map(|share| format!("{:.1}", 100.0 * share)).collect::<Vec<_>>().join(", ")
}

/// The shares as a table in Markdown, a line for each effect.
pub fn table(residuals: &[FormResidual]) -> String {
    let mut table = String::from(
        "| effect | far form | left of near, %: low end, middle, high end | left of far, % |\n|---|---|---|---|\n",
    );
    for sheet in SHEETS {
        if !residuals.iter().any(|residual| residual.effect == sheet.name) {
            continue;
        }
        let of =
            |form| residuals.iter().find(|residual| residual.effect == sheet.name && residual.form == form);
        let shares =
            OTHERS.map(|form| of(form).map_or_else(String::new, |residual| percent(&residual.shares)));
        let words = far().find(|(effect, _)| *effect == sheet.name).map_or("", |(_, words)| words);
        let _ = writeln!(table, "| {} | {words} | {} |", sheet.name, shares.join(" | "));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_far_form_of_every_effect_is_said_in_words() {
        let named: Vec<_> = far().map(|(effect, _)| effect).collect();
        assert_eq!(named, SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>());
        assert!(far().all(|(_, words)| !words.is_empty()));
    }

    #[test]
    fn the_catalogues_law_leaves_a_tenth_to_two_fifths_of_a_far_form() {
        // One of each group: valve, air, motion, sensor.
        for name in ["valve-offset", "piston-leakage", "inclination", "force-sensor-offset"] {
            let sheet = plant::effects::sheet(name).expect("of the catalogue");
            let [_, middle, _] = amplitudes(sheet, sheet.place.places()[0]);
            let share = unexplained_share(&middle, Form::Far).unwrap();
            assert!((0.1..0.4).contains(&share), "{name}: {share}");
        }
    }
}
