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
const FAR: [(&str, &str); 38] = [
    (
        "critical-pressure-ratio",
        "the ports differ: what b lies below 0.5 is 1.75 of it at chamber a, 0.25 at b",
    ),
    (
        "valve-characteristic",
        "the notches differ: 1.42 of bend and edge ratio as the rod extends, 0.58 as it retracts",
    ),
    ("valve-dead-zone", "the overlaps differ: 1.65 d as the rod extends, 0.35 d as it retracts"),
    ("valve-hysteresis", "the solenoids differ: 1.5 h at positive commands, 0.5 h at negative ones"),
    ("valve-offset", "drifts by 70 % with a period of 13 s as the valve warms up"),
    (
        "valve-null-leakage",
        "the lands are worn differently: a floor of 1.6 at the edges of chamber a, 0.4 at those of b",
    ),
    ("spool-second-order", "a spring helps to close: 1.22 w towards the middle, 0.78 w away from it"),
    ("spool-rate-limit", "a spring helps to close: 1.5 of the rate towards the middle, 0.5 away from it"),
    ("line-delay", "lines of different length: 1.5 l to chamber a, 0.5 l to b"),
    (
        "line-resistance",
        "filters of sintered bronze in the lines: the drop is linear in the flow, 1.25 of it at a, 0.75 at b",
    ),
    ("check-valve-restriction", "springs that differ: 1.5 of the cracking pressure at chamber a, 0.5 at b"),
    (
        "silencer-back-pressure",
        "porous, by Darcy's law: flow in proportion to the difference of the squared pressures, the same at twice the atmosphere",
    ),
    ("supply-droop", "the regulator falls with the root of the flow, 0.6 of the droop at full flow"),
    (
        "command-dead-time",
        "clocks that are not synchronised: it slides from 0.34 to 1.66 of the time every 0.37 s",
    ),
    ("heat-exchange", "the near form"),
    ("dead-volume", "the change is shared 1.75 : 0.25 between chambers a and b"),
    (
        "piston-leakage",
        "an orifice as the near form, scored where the piston is most of its time: 1 - 0.45 cos(2 pi x / L)",
    ),
    (
        "rod-leakage",
        "an orifice as the near form, scored where the rod is most of its time: 1 - 0.52 cos(2 pi x / L)",
    ),
    (
        "stribeck-friction",
        "lips that do not face both ways: 1.52 of the excess as the rod extends, 0.48 as it retracts",
    ),
    ("presliding", "lips that do not face both ways: 1.65 s_0 as the rod extends, 0.35 s_0 as it retracts"),
    ("friction-asymmetry", "a bent rod: a (1 + 0.9 (x - L/2) / (L/2))"),
    (
        "pressure-dependent-friction",
        "lips pressed on by what they seal: 0.2 of the sum and 1.8 of the difference of both pressures",
    ),
    ("position-dependent-friction", "1.55 of it as the rod extends, 0.45 as it retracts"),
    ("inclination", "a bent rail: twice as steep at one end, level at the other"),
    (
        "position-dependent-force",
        "a hose that hangs loose in the middle: cubic; a third harmonic of 0.5 on the ripple",
    ),
    (
        "rest-time-dependent-break-away",
        "the growth does not end with the break-away: it fades over 1 mm of way, as the film of oil is built again",
    ),
    ("coupling-backlash", "worn edges: a parabola over half of the gap"),
    ("coupling-compliance", "overlap to the power 1.5 (Hertz), the same at 200 N"),
    (
        "end-cushion",
        "the near form, and its lip does not lift quite: a chamber that fills goes through 7 K_V",
    ),
    (
        "position-sensor-lag",
        "a lag of 0.82 of the time, then a cycle of its own of 0.36 of it that holds the value",
    ),
    ("position-sensor-offset", "drifts by 55 % with a period of 13 s"),
    ("position-sensor-gain", "bent: -0.4 + 2.8 x/L of it"),
    ("pressure-sensor-lag", "a snubber: 0.5 of the time as the pressure rises, 1.5 as it falls"),
    ("pressure-sensor-offset", "drifts by 70 % with a period of 13 s"),
    ("pressure-sensor-gain", "drifts by 70 % with a period of 13 s"),
    ("force-sensor-offset", "drifts by 70 % with a period of 13 s"),
    (
        "force-sensor-gain",
        "85 % more in compression than on average, as much less in tension, tanh(F / 40 N)",
    ),
    (
        "time-skew",
        "clocks that are not synchronised: it slides every 0.37 s, of a position by 28 %, a force 50 %, a pressure 80 %",
    ),
];

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
        let numbers = std::iter::once(amplitude).chain(shaping).collect();
        Hidden { name: sheet.name, place, numbers }
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
        let words = FAR.iter().find(|(effect, _)| *effect == sheet.name).map_or("", |(_, words)| words);
        let _ = writeln!(table, "| {} | {words} | {} |", sheet.name, shares.join(" | "));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_far_form_of_every_effect_is_said_in_words() {
        let named: Vec<_> = FAR.iter().map(|(effect, _)| *effect).collect();
        assert_eq!(named, SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>());
        assert!(FAR.iter().all(|(_, words)| !words.is_empty()));
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
