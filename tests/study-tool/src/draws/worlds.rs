//! Draws of two worlds: one in which the catalogue's laws are exact, and one with small model errors in the whole rig.
//!
//! ```text
//!   number within its kind    0              1            2                   3                 4
//!   effects                   catalogue's    other form   background,         background,       catalogue's, and again from 0
//!                                                         catalogue's         other form
//!   nothing hidden            even: exact    odd: background
//! ```
//!
//! Both axes are recorded, so that the place of an effect has to be found. Every tenth amplitude lies beyond the drawn range,
//! where a rig file allows that. The smallest drawn amplitude is that of the sheet: weaker effects are background, which no
//! report is expected to name.

use super::{Generator, axis_of};
use crate::limits::Scale;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Place, PlaceKind, Sheet};
use plant::parameters::VALVE_POINTS;
use record_maker::{Background, Form, Hidden, Recipe};

/// Stream of the generators of worlds, separate from those of draws.
const STREAM: u64 = 1 << 20;
/// Amplitudes of background effects, as shares of the smallest of their sheets.
const BACKGROUND_SHARES: [f64; 2] = [0.2, 0.8];
/// Smallest excursion where the drawn range contains the rig file's value: one twentieth.
const SMALLEST_EXCURSION: f64 = 0.05;
/// Range of the factor by which an amplitude exceeds the drawn range.
const BEYOND: [f64; 2] = [1.2, 2.0];
/// Largest errors of K_V at a point of the table, of a dead volume, and of the air's temperature, as shares.
const VALVE_POINT_ERROR: f64 = 0.015;
const DEAD_VOLUME_ERROR: f64 = 0.03;
const TEMPERATURE_ERROR: f64 = 0.01;

/// A recipe in the world of its repetition.
pub(super) fn turn(recipe: Recipe, seed: u64, stream: u64, repetition: u32) -> Recipe {
    let mut generator = Generator::new(seed, STREAM + stream, repetition);
    let mut recipe = Recipe { unlinked: !recipe.both_axes, both_axes: true, ..recipe };
    let (background, is_foreign) = match (recipe.hidden.is_empty(), repetition % 5) {
        (true, _) => (repetition % 2 == 1, false),
        (false, turn) => (turn == 2 || turn == 3, turn == 1 || turn == 3),
    };
    recipe.form = if is_foreign { Form::Near } else { Form::Catalogue };
    for hidden in &mut recipe.hidden {
        if generator.one_in(10.0) {
            beyond(hidden, generator.uniform(BEYOND));
        }
    }
    if background {
        recipe.background = Some(generator.background(&recipe));
    }
    recipe
}

/// Sets an amplitude to `factor` times the excursion of the stronger end of its drawn range.
fn beyond(hidden: &mut Hidden, factor: f64) {
    let key = &plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn").keys[0];
    let scale_of = |scale: &Scale| scale.excursion(hidden.numbers[0]).is_some();
    let Some(scale) = Scale::of(key).into_iter().find(scale_of).filter(|scale| *scale != Scale::None) else {
        return;
    };
    let ends = key.drawn.map(|end| scale.excursion(end).unwrap_or(0.0));
    let value = scale.value(factor * ends[0].max(ends[1])).min(key.max);
    // Without this bound a value at the end of the allowed range might be refused.
    let value = value.max(if key.signed { 0.0 } else { key.min });
    hidden.numbers[0] = if key.signed { hidden.numbers[0].signum() * value } else { value };
}

/// Whether the amplitude of a hidden effect lies beyond the stronger end of its drawn range.
pub(crate) fn is_beyond_drawn(hidden: &Hidden) -> bool {
    let keys = plant::effects::sheet(hidden.name).map_or(&[][..], |sheet| sheet.keys);
    let Some((key, number)) = keys.first().zip(hidden.numbers.first()) else { return false };
    Scale::of(key).into_iter().filter_map(|scale| Some((scale, scale.excursion(*number)?))).any(
        |(scale, excursion)| {
            let ends = key.drawn.map(|end| scale.excursion(end).unwrap_or(0.0));
            excursion > ends[0].max(ends[1]) * (1.0 + f64::EPSILON)
        },
    )
}

impl Generator {
    pub(super) fn background(&mut self, recipe: &Recipe) -> Background {
        let count = 5 + self.below(6);
        let mut effects: Vec<Hidden> = Vec::new();
        while effects.len() < count {
            let sheet = &SHEETS[self.below(SHEETS.len())];
            let is_free = |hidden: &Hidden| hidden.name != sheet.name;
            let is_linked = recipe.both_axes && !recipe.unlinked;
            let can_be = !matches!(sheet.place, PlaceKind::Linkage) || is_linked;
            if can_be && effects.iter().chain(&recipe.hidden).all(is_free) {
                effects.extend(self.below_its_smallest(sheet, recipe));
            }
        }
        let mut factor = |error: f64| self.uniform([1.0 - error, 1.0 + error]);
        let valve_point_factors = [[0; VALVE_POINTS]; 2].map(|edge| edge.map(|_| factor(VALVE_POINT_ERROR)));
        Background {
            effects,
            valve_point_factors,
            dead_volume_ratio: factor(DEAD_VOLUME_ERROR),
            temperature_ratio: factor(TEMPERATURE_ERROR),
            fading_ratio: self.uniform([0.02, 0.1]),
            fading_below_m_per_s: self.uniform([1e-3, 5e-3]),
            slow_noise_ratio: self.uniform([0.05, 0.3]),
        }
    }

    /// An effect at a share of its smallest amplitude; `None` where no amplitude equals the baseline.
    fn below_its_smallest(&mut self, sheet: &'static Sheet, recipe: &Recipe) -> Option<Hidden> {
        let seen =
            |place: &&Place| recipe.both_axes || axis_of(**place).is_none_or(|axis| axis == recipe.axis);
        let places: Vec<&Place> = sheet.place.places().iter().filter(seen).collect();
        let place = *places[self.below(places.len())];
        let mut hidden = self.hidden(sheet, place);
        // All amplitudes of an effect, as bump, slope and ripple; shape numbers stay as drawn.
        for (at, (key, number)) in sheet.keys.iter().zip(&mut hidden.numbers).enumerate() {
            let scales = Scale::of(key);
            let scale = scales[self.below(scales.len())];
            let share = self.uniform(BACKGROUND_SHARES);
            let Some(smallest) = smallest(key, scale) else {
                if at == 0 {
                    return None;
                }
                continue;
            };
            if at == 0 || key.default != Some(*number) {
                let value = scale.value(share * smallest).clamp(key.min.max(0.0), key.max);
                *number = if key.signed { number.signum() * value } else { value };
            }
        }
        Some(hidden)
    }
}

/// The smallest drawn excursion.
pub(super) fn smallest(key: &EffectKey, scale: Scale) -> Option<f64> {
    match scale {
        Scale::None => None,
        Scale::About(..) if Scale::of(key).len() > 1 => Some(SMALLEST_EXCURSION),
        _ => key.drawn.into_iter().filter_map(|end| scale.excursion(end)).min_by(f64::total_cmp),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::{Draw, Kind, Shape, draws};

    fn many() -> Vec<Draw> {
        let shape = Shape { each: 40, nulls: 100, pairs: 40, triples: 20, worlds: true, ..Shape::NO_DRAW };
        draws(3, &shape)
    }

    #[test]
    fn worlds_and_forms_take_turns() {
        let draws = many();
        let share = |kind: Kind, has: &dyn Fn(&Recipe) -> bool| {
            let of_kind: Vec<_> = draws.iter().filter(|draw| draw.kind == kind).collect();
            of_kind.iter().filter(|draw| has(&draw.recipe)).count() as f64 / of_kind.len() as f64
        };
        for kind in [Kind::Single, Kind::Pair, Kind::Triple] {
            assert_eq!(share(kind, &|recipe| recipe.background.is_some()), 0.4);
            assert_eq!(share(kind, &|recipe| recipe.form.is_foreign()), 0.4);
            assert_eq!(share(kind, &|recipe| recipe.background.is_some() && recipe.form.is_foreign()), 0.2);
        }
        assert_eq!(share(Kind::Null, &|recipe| recipe.background.is_some()), 0.5);
        assert!(draws.iter().all(|draw| draw.recipe.both_axes));
        let linkage = |draw: &&Draw| draw.recipe.hidden.iter().any(|hidden| axis_of(hidden.place).is_none());
        assert!(draws.iter().filter(linkage).all(|draw| !draw.recipe.unlinked));
    }

    #[test]
    fn background_effects_lie_below_what_is_drawn_and_are_not_hidden() {
        let mut factors = Vec::new();
        for draw in many() {
            let Some(background) = draw.recipe.background else { continue };
            assert!((5..=10).contains(&background.effects.len()));
            for effect in &background.effects {
                assert!(draw.recipe.hidden.iter().all(|hidden| hidden.name != effect.name));
                let key = &plant::effects::sheet(effect.name).unwrap().keys[0];
                let scales = Scale::of(key);
                let excursions = scales
                    .iter()
                    .find_map(|scale| Some((scale.excursion(effect.numbers[0])?, smallest(key, *scale)?)));
                let (excursion, smallest) = excursions.unwrap_or_else(|| panic!("{}", effect.name));
                // A file takes no spool that is faster than its largest number.
                assert!(
                    excursion < 0.81 * smallest || effect.numbers[0] == key.max,
                    "{}: {excursion}",
                    effect.name
                );
            }
            factors.extend(background.valve_point_factors.into_iter().flatten());
        }
        assert!(factors.iter().all(|factor| (factor - 1.0).abs() <= VALVE_POINT_ERROR));
        assert!(factors.iter().any(|factor| *factor != factors[0]));
    }

    #[test]
    fn a_tenth_of_the_amplitudes_lies_beyond_the_drawn_range() {
        let draws = many();
        let hidden: Vec<&Hidden> = draws
            .iter()
            .filter(|draw| draw.kind == Kind::Single)
            .flat_map(|draw| &draw.recipe.hidden)
            .collect();
        let is_beyond = |hidden: &&&Hidden| {
            let key = &plant::effects::sheet(hidden.name).unwrap().keys[0];
            !(key.drawn[0]..=key.drawn[1]).contains(&hidden.numbers[0].abs())
        };
        let share = hidden.iter().filter(is_beyond).count() as f64 / hidden.len() as f64;
        // Of 1400; some have no amplitude that is the baseline's, or none beyond.
        assert!((0.06..0.13).contains(&share), "{share}");
        for hidden in hidden {
            let key = &plant::effects::sheet(hidden.name).unwrap().keys[0];
            assert!((key.min..=key.max).contains(&hidden.numbers[0]), "{} {:?}", hidden.name, hidden.numbers);
        }
    }
}
