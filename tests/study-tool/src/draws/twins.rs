//! Starts of twins: an effect on one axis, its drawn amplitude moved towards the smallest of its range.
//!
//! [`crate::twins`] finds the other effect that explains a part of its record as well, and the noise.

use super::worlds::smallest;
use super::{Generator, axis_of};
use crate::limits::Scale;

use plant::effects::SHEETS;
use plant::effects::sheet::{Place, PlaceKind};
use record_maker::{Background, Hidden, Recipe};

/// Streams of the generators of twins and of their backgrounds, separate from those of draws and worlds.
const STREAM: u64 = 1 << 21;
const BACKGROUND_STREAM: u64 = 1 << 22;
/// Range of the distance between the two models of a twin in the train record, set by its noise, in standard deviations: an
/// oracle is right in 60 to 70 % of the records.
const DISTANCES: [f64; 2] = [0.5, 1.04];

/// An effect from which a twin may be made.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Start {
    /// Of the train record, at the specified noise.
    pub(crate) recipe: Recipe,
    /// Required distance of the two models in the train record.
    pub(crate) distance: f64,
    /// Whether the hidden effect is the other one, which explains the record as well.
    pub(crate) rival_is_true: bool,
}

/// The start with this number; all effects in turn. `None` for an effect of linked rods, which needs records of both axes.
pub(crate) fn start(seed: u64, number: usize) -> Option<Start> {
    let (turn, repetition) = (number % SHEETS.len(), number / SHEETS.len());
    let sheet = &SHEETS[turn];
    if sheet.place == PlaceKind::Linkage {
        return None;
    }
    let mut generator = Generator::new(seed, STREAM + turn as u64, repetition as u32);
    let axis = generator.axis();
    let seen = |place: &&Place| axis_of(**place).is_none_or(|of_place| of_place == axis);
    let places: Vec<&Place> = sheet.place.places().iter().filter(seen).collect();
    let place = *places[generator.below(places.len())];
    let mut hidden = generator.hidden(sheet, place);
    weaken(&mut hidden, generator.share());
    let distance = generator.uniform(DISTANCES);
    let rival_is_true = generator.one_in(2.0);
    let recipe = Recipe { seed: generator.recipe_seed(), axis, hidden: vec![hidden], ..Recipe::default() };
    Some(Start { recipe, distance, rival_is_true })
}

/// Interpolates an amplitude between the smallest that is drawn (0) and its value (1).
fn weaken(hidden: &mut Hidden, share: f64) {
    let key = &plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn").keys[0];
    let amplitude = hidden.numbers[0];
    let of_scale = |scale: Scale| Some((scale, scale.excursion(amplitude)?, smallest(key, scale)?));
    let Some((scale, excursion, least)) = Scale::of(key).into_iter().find_map(of_scale) else { return };
    let value = scale.value(least * (excursion / least).powf(share)).clamp(key.min.max(0.0), key.max);
    hidden.numbers[0] = if key.signed { amplitude.signum() * value } else { value };
}

/// The background of a twin, at places that its record shows.
pub(crate) fn background(seed: u64, number: usize, recipe: &Recipe) -> Background {
    Generator::new(seed, BACKGROUND_STREAM, number as u32).background(recipe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::Axis;

    #[test]
    fn starts_are_of_the_recorded_axis_between_the_smallest_and_the_drawn_amplitude() {
        let starts: Vec<Start> = (0..12 * SHEETS.len()).filter_map(|number| start(3, number)).collect();
        assert!(
            starts.iter().any(|start| start.rival_is_true) && starts.iter().any(|start| !start.rival_is_true)
        );
        assert!(starts.iter().any(|start| start.recipe.axis == Axis::Load));
        for start in starts {
            let [hidden] = &start.recipe.hidden[..] else { panic!("one effect") };
            assert!(axis_of(hidden.place).is_none_or(|axis| axis == start.recipe.axis));
            assert!(!start.recipe.both_axes);
            let key = &plant::effects::sheet(hidden.name).unwrap().keys[0];
            let drawn = key.drawn[0] * 0.999..=key.drawn[1] * 1.001;
            assert!(drawn.contains(&hidden.numbers[0].abs()), "{} {:?}", hidden.name, hidden.numbers);
        }
    }

    #[test]
    fn the_background_of_a_twin_is_on_its_axis() {
        for number in 0..20 {
            let Some(start) = start(3, number) else { continue };
            let background = background(3, number, &start.recipe);
            assert!((5..=10).contains(&background.effects.len()));
            let seen = |effect: &Hidden| axis_of(effect.place).is_none_or(|axis| axis == start.recipe.axis);
            assert!(background.effects.iter().all(seen), "{background:?}");
        }
    }
}
