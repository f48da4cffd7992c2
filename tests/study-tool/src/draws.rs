//! Draws of a study: effects, amplitudes, places and difficulties, as a pure function of seed and shape.
//!
//! Each draw has its generator, seeded with the seed of the study, the kind of draw and its number within the kind. A study
//! with more draws therefore contains those of a smaller one.
//!
//! - Amplitude: log-uniform over the `drawn` range of the effect's sheet, either sign where the sheet says so. Each shape
//!   number of the effect: its default in one half of the draws, uniform over its `drawn` range in the other.
//! - Place: any that the effect allows. The record is of the axis of the place; of both, linked, for effects that need two.
//! - A fifth has a functional form that is not the catalogue's, a half 1 to 3 parameters of the baseline wrong by 1 to 3 %, a
//!   third coloured noise and jitter, each drawn independently. The form is the near one, or by the study's shape the far one.
//! - A study near the limits divides all amplitudes by a factor and keeps the draws otherwise: most drawn amplitudes lie far
//!   above the limits.
//! - A draw of wrong parameters only has one that is wrong by 3 to 15 %, and no other difficulty in the baseline.
//!
//! - A study of both worlds ([`worlds`]) records both axes. Its draws alternate between the world in which the catalogue's laws
//!   are exact and the one with model errors in the whole rig, each in the catalogue's form and in another.
//!
//! Source: effects.md; discrepancy-notes.md, Blind protocol.

pub(crate) mod twins;
mod worlds;

pub(crate) use worlds::is_beyond_drawn;

use crate::limits::Scale;
use plant::Axis;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Part, Place, PlaceKind, Sheet};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use record_maker::{Experiment, Form, Hidden, PARAMETERS, Recipe};
use serde::{Deserialize, Serialize};

/// Parameters of the draws of wrong parameters only, with their names in reports.
pub(crate) const SINGLE_PARAMETERS: [&str; 4] =
    ["parameter:mass", "parameter:viscous-friction", "parameter:supply-pressure", "parameter:kv-scale"];

/// Numbers of draws of a study, and what all its draws have in common.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Draws of each effect of the catalogue.
    pub each: u32,
    /// Draws with nothing hidden.
    pub nulls: u32,
    /// Draws of each parameter of the baseline that is wrong alone.
    pub parameters: u32,
    pub pairs: u32,
    pub triples: u32,
    /// Noise of all records over the specified noise.
    pub noise_factor: f64,
    /// Divisor of the amplitudes, counted from the baseline; absent in a file when it is 1.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub weaker_factor: f64,
    /// Draws alternate between the exact world and the one with a background, both axes recorded; absent in a file when false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub worlds: bool,
    /// Forms other than the catalogue's are the far ones instead of the near ones; absent in a file when false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub far_forms: bool,
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_one(factor: &f64) -> bool {
    *factor == one()
}

impl Shape {
    pub(crate) const NO_DRAW: Shape = Shape {
        each: 0,
        nulls: 0,
        parameters: 0,
        pairs: 0,
        triples: 0,
        noise_factor: 1.0,
        weaker_factor: 1.0,
        worlds: false,
        far_forms: false,
    };
    #[cfg(test)]
    pub(crate) const SMALL: Shape =
        Shape { each: 1, nulls: 2, parameters: 1, pairs: 1, triples: 1, ..Shape::NO_DRAW };
}

impl Default for Shape {
    fn default() -> Self {
        Shape { each: 6, nulls: 100, parameters: 6, pairs: 60, triples: 20, ..Shape::NO_DRAW }
    }
}

/// What is hidden in a draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Single,
    /// No effect; parameters of the baseline may be wrong by up to 3 %.
    Null,
    /// No effect; one parameter of the baseline is wrong by 3 to 15 %.
    Parameter,
    Pair,
    Triple,
}

/// One draw: number, kind, and the recipe of its records.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// Number within the study, from 0.
    pub number: usize,
    pub kind: Kind,
    /// Recipe of the train record; the other records differ in the experiment only.
    pub recipe: Recipe,
}

impl Draw {
    pub(crate) fn recipe(&self, experiment: Experiment) -> Recipe {
        Recipe { experiment, ..self.recipe.clone() }
    }

    /// The held-out experiment that the program is tested on: they alternate.
    pub(crate) fn test(&self) -> Experiment {
        Experiment::HeldOut((self.number % 2) as u8)
    }
}

/// All draws of a study, in the order of their numbers.
pub(crate) fn draws(seed: u64, shape: &Shape) -> Vec<Draw> {
    let mut drawn: Vec<(Kind, Recipe)> = Vec::new();
    let in_world = |recipe, seed, stream, repetition| {
        if shape.worlds { worlds::turn(recipe, seed, stream, repetition) } else { recipe }
    };
    for (place, sheet) in SHEETS.iter().enumerate() {
        for repetition in 0..shape.each {
            let single = Generator::new(seed, place as u64, repetition).single(sheet);
            drawn.push((Kind::Single, in_world(single, seed, place as u64, repetition)));
        }
    }
    let more = |kind, stream, count, make: &dyn Fn(Generator) -> Recipe| {
        (0..count)
            .map(move |repetition| {
                let recipe = make(Generator::new(seed, stream, repetition));
                (kind, in_world(recipe, seed, stream, repetition))
            })
            .collect::<Vec<_>>()
    };
    drawn.extend(more(Kind::Null, 1000, shape.nulls, &Generator::null));
    for (place, name) in SINGLE_PARAMETERS.iter().enumerate() {
        let make = |generator: Generator| generator.parameter(name);
        drawn.extend(more(Kind::Parameter, 2000 + place as u64, shape.parameters, &make));
    }
    drawn.extend(more(Kind::Pair, 3000, shape.pairs, &|generator| generator.several(2)));
    drawn.extend(more(Kind::Triple, 4000, shape.triples, &|generator| generator.several(3)));
    let finish = |(number, (kind, recipe))| {
        let mut recipe = Recipe { noise: shape.noise_factor, ..recipe };
        if !is_one(&shape.weaker_factor) {
            recipe.hidden.iter_mut().for_each(|hidden| weaken(hidden, shape.weaker_factor));
        }
        if shape.far_forms && recipe.form.is_foreign() {
            recipe.form = Form::Far;
        }
        Draw { number, kind, recipe }
    };
    drawn.into_iter().enumerate().map(finish).collect()
}

/// Divides an amplitude, counted from the baseline; without a neutral value it stays.
fn weaken(hidden: &mut Hidden, factor: f64) {
    let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
    let (key, amplitude) = (&sheet.keys[0], hidden.numbers[0]);
    let scales = Scale::of(key);
    let excursion = scales.iter().find_map(|scale| Some((scale, scale.excursion(amplitude)?)));
    if let Some((scale, excursion)) = excursion {
        let sign = if key.signed { amplitude.signum() } else { 1.0 };
        hidden.numbers[0] = sign * scale.value(excursion / factor).clamp(key.min.max(0.0), key.max);
    }
}

/// Whether an effect shows only where the axes are linked, or both draw air.
pub(crate) fn needs_both_axes(kind: PlaceKind) -> bool {
    matches!(kind, PlaceKind::Linkage | PlaceKind::Supply)
}

struct Generator(Pcg64);

impl Generator {
    fn new(seed: u64, stream: u64, repetition: u32) -> Self {
        // An odd factor separates seeds; `seed_from_u64` spreads neighbours over the whole state.
        let stream_seed =
            seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(stream << 32 | u64::from(repetition));
        Generator(Pcg64::seed_from_u64(stream_seed))
    }

    fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn uniform(&mut self, [least, most]: [f64; 2]) -> f64 {
        least + (most - least) * self.share()
    }

    fn one_in(&mut self, count: f64) -> bool {
        self.share() * count < 1.0
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.share() * count as f64) as usize).min(count - 1)
    }

    fn sign(&mut self) -> f64 {
        if self.one_in(2.0) { -1.0 } else { 1.0 }
    }

    fn single(mut self, sheet: &'static Sheet) -> Recipe {
        let places = sheet.place.places();
        let place = places[self.below(places.len())];
        let axis = axis_of(place).unwrap_or(Axis::Drive);
        let hidden = vec![self.hidden(sheet, place)];
        let form = if self.one_in(5.0) { Form::Near } else { Form::Catalogue };
        Recipe { hidden, form, both_axes: needs_both_axes(sheet.place), ..self.plain(axis) }
    }

    fn null(mut self) -> Recipe {
        let axis = self.axis();
        // Linked as often as the draws of effects are.
        let linked = SHEETS.iter().filter(|sheet| needs_both_axes(sheet.place)).count();
        Recipe { both_axes: self.below(SHEETS.len()) < linked, ..self.plain(axis) }
    }

    fn parameter(mut self, name: &str) -> Recipe {
        let axis = self.axis();
        let factor = 1.0 + self.sign() * self.uniform([0.03, 0.15]);
        Recipe { wrong_parameters: vec![(name.to_owned(), factor)], ..self.plain(axis) }
    }

    /// Different effects at places of one axis; both axes when one of them needs them.
    fn several(mut self, count: usize) -> Recipe {
        let axis = self.axis();
        let mut sheets: Vec<&'static Sheet> = Vec::new();
        while sheets.len() < count {
            let sheet = &SHEETS[self.below(SHEETS.len())];
            if sheets.iter().all(|other| other.name != sheet.name) {
                sheets.push(sheet);
            }
        }
        let at = |place: &&Place| axis_of(**place).is_none_or(|of_place| of_place == axis);
        let both_axes = sheets.iter().any(|sheet| needs_both_axes(sheet.place));
        let mut hidden = Vec::new();
        for sheet in sheets {
            let places: Vec<&Place> = sheet.place.places().iter().filter(at).collect();
            let place = *places[self.below(places.len())];
            hidden.push(self.hidden(sheet, place));
        }
        let form = if self.one_in(5.0) { Form::Near } else { Form::Catalogue };
        Recipe { hidden, form, both_axes, ..self.plain(axis) }
    }

    /// Nothing hidden, with the difficulties of all draws.
    fn plain(&mut self, axis: Axis) -> Recipe {
        let coloured = self.one_in(3.0);
        let mut wrong_parameters = Vec::new();
        if self.one_in(2.0) {
            for _ in 0..=self.below(3) {
                let name = PARAMETERS[self.below(PARAMETERS.len())].to_owned();
                let factor = 1.0 + self.sign() * self.uniform([0.01, 0.03]);
                if wrong_parameters.iter().all(|(other, _)| *other != name) {
                    wrong_parameters.push((name, factor));
                }
            }
        }
        Recipe {
            seed: self.recipe_seed(),
            axis,
            wrong_parameters,
            coloured_noise: coloured,
            jitter: coloured,
            ..Recipe::default()
        }
    }

    /// 53 bits: every JSON reader represents it exactly.
    fn recipe_seed(&mut self) -> u64 {
        self.0.next_u64() >> 11
    }

    fn axis(&mut self) -> Axis {
        Axis::ALL[self.below(2)]
    }

    fn hidden(&mut self, sheet: &'static Sheet, place: Place) -> Hidden {
        let numbers = sheet.keys.iter().enumerate().map(|(at, key)| self.number(key, at == 0)).collect();
        Hidden { name: sheet.name, place, numbers }
    }

    fn number(&mut self, key: &EffectKey, amplitude: bool) -> f64 {
        let magnitude = match key.default {
            _ if amplitude => {
                let [least, most] = key.drawn.map(f64::ln);
                self.uniform([least, most]).exp().clamp(key.drawn[0], key.drawn[1])
            }
            Some(default) if self.one_in(2.0) => return default,
            _ => self.uniform(key.drawn),
        };
        if key.signed { self.sign() * magnitude } else { magnitude }
    }
}

/// The axis of a place; `None` for linkage and supply.
pub(crate) fn axis_of(place: Place) -> Option<Axis> {
    match place.part {
        Part::Drive => Some(Axis::Drive),
        Part::Load => Some(Axis::Load),
        Part::Linkage | Part::Supply => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn many() -> Vec<Draw> {
        draws(3, &Shape { each: 60, nulls: 200, parameters: 20, pairs: 100, triples: 50, ..Shape::default() })
    }

    #[test]
    fn draws_are_a_function_of_the_seed() {
        assert_eq!(draws(1, &Shape::default()), draws(1, &Shape::default()));
        assert_ne!(draws(1, &Shape::default()), draws(2, &Shape::default()));
    }

    #[test]
    fn a_larger_study_keeps_the_draws_of_a_smaller_one() {
        let recipes = |each| {
            let shape = Shape { each, ..Shape::default() };
            draws(1, &shape).into_iter().map(|draw| (draw.kind, draw.recipe)).collect::<Vec<_>>()
        };
        let large = recipes(7);
        assert!(recipes(3).iter().all(|small| large.contains(small)));
    }

    #[test]
    fn a_weaker_study_has_the_same_draws_nearer_to_the_baseline() {
        let whole = Shape { each: 4, nulls: 1, parameters: 0, pairs: 2, triples: 0, ..Shape::default() };
        let weak = Shape { weaker_factor: 30.0, ..whole };
        for (strong, weak) in draws(3, &whole).iter().zip(draws(3, &weak)) {
            for (stronger, weaker) in strong.recipe.hidden.iter().zip(&weak.recipe.hidden) {
                let key = &plant::effects::sheet(stronger.name).unwrap().keys[0];
                let excursion = |value| Scale::of(key).iter().find_map(|scale| scale.excursion(value));
                let [strong, weak] = [stronger, weaker].map(|hidden| excursion(hidden.numbers[0]));
                // A file takes no spool that is faster than its largest number: there it stays.
                let held = [key.min, key.max].contains(&weaker.numbers[0].abs());
                let ratio = strong.zip(weak).map(|(strong, weak)| strong / weak);
                assert!(
                    ratio.is_none_or(|ratio| held || (ratio - 30.0).abs() < 1e-9),
                    "{}: {ratio:?}",
                    stronger.name
                );
                assert_eq!(stronger.numbers[0].is_sign_positive(), weaker.numbers[0].is_sign_positive());
                assert_eq!(stronger.numbers[1..], weaker.numbers[1..]);
            }
            assert_eq!(strong.recipe, Recipe { hidden: strong.recipe.hidden.clone(), ..weak.recipe });
        }
        // What was begun before there were weaker ones is still read.
        assert!(!serde_json::to_string(&whole).unwrap().contains("weaker"));
        assert_eq!(serde_json::from_str::<Shape>(&serde_json::to_string(&whole).unwrap()).unwrap(), whole);
    }

    #[test]
    fn every_number_lies_in_the_drawn_range_and_is_one_that_a_rig_file_takes() {
        for draw in many() {
            for hidden in &draw.recipe.hidden {
                let sheet = plant::effects::sheet(hidden.name).unwrap();
                assert!(sheet.place.places().contains(&hidden.place));
                for (at, (key, number)) in sheet.keys.iter().zip(&hidden.numbers).enumerate() {
                    let drawn = (key.drawn[0]..=key.drawn[1]).contains(&number.abs());
                    let default = at > 0 && key.default == Some(*number);
                    assert!(drawn || default, "{} {} = {number}", hidden.name, key.name);
                    assert!((key.min..=key.max).contains(number), "{} {} = {number}", hidden.name, key.name);
                    assert!(key.signed || *number >= 0.0);
                }
            }
        }
    }

    #[test]
    fn a_record_is_of_the_axis_of_its_effect_and_of_both_for_what_needs_two() {
        for draw in many() {
            let recipe = &draw.recipe;
            for hidden in &recipe.hidden {
                assert!(axis_of(hidden.place).is_none_or(|axis| axis == recipe.axis), "{draw:?}");
                assert!(axis_of(hidden.place).is_some() || recipe.both_axes, "{draw:?}");
            }
        }
    }

    #[test]
    fn difficulties_have_their_shares() {
        let draws = many();
        let singles: Vec<_> = draws.iter().filter(|draw| draw.kind == Kind::Single).collect();
        let share = |has: &dyn Fn(&Recipe) -> bool| {
            singles.iter().filter(|draw| has(&draw.recipe)).count() as f64 / singles.len() as f64
        };
        // 2280 draws: five standard errors are 0.042, 0.052, 0.049.
        assert!((share(&|recipe| recipe.form.is_foreign()) - 0.2).abs() < 0.042);
        assert!((share(&|recipe| !recipe.wrong_parameters.is_empty()) - 0.5).abs() < 0.052);
        assert!((share(&|recipe| recipe.coloured_noise) - 1.0 / 3.0).abs() < 0.049);
        for draw in draws {
            let off = |(_, factor): &(String, f64)| (factor - 1.0).abs();
            let range = if draw.kind == Kind::Parameter { 0.03..0.1501 } else { 0.01..0.0301 };
            assert!(draw.recipe.wrong_parameters.iter().all(|wrong| range.contains(&off(wrong))));
            assert!(draw.kind != Kind::Parameter || draw.recipe.wrong_parameters.len() == 1);
            assert!(!draw.recipe.form.is_foreign() || !draw.recipe.hidden.is_empty());
        }
    }

    #[test]
    fn several_effects_are_different_ones() {
        for draw in many() {
            let names: std::collections::BTreeSet<_> =
                draw.recipe.hidden.iter().map(|hidden| hidden.name).collect();
            let expected = match draw.kind {
                Kind::Single => 1,
                Kind::Null | Kind::Parameter => 0,
                Kind::Pair => 2,
                Kind::Triple => 3,
            };
            assert_eq!((names.len(), draw.recipe.hidden.len()), (expected, expected));
        }
    }
}
