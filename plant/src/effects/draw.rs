//! Draws effects that nobody chose: for sealed rigs and for studies, from the ranges of the sheets alone.
//!
//! ```text
//! which       any of the catalogue, each at most once; then any of its places on the axes asked for
//! amplitude   the first key: log-uniform between drawn[0] and drawn[1]
//! shape       every further key: one half its default, one half uniform between drawn[0] and drawn[1]
//! sign        of signed keys only, either with one half
//! ```
//!
//! A draw depends on its seed alone, to the bit on every machine: PCG-64 and libm's functions. It is not the noise of the
//! sensors: equal seeds share nothing. An amplitude within a fifth of the value at which the rig is the baseline (a dead
//! volume, a gap and a stiffness have one inside their drawn range) would hide nothing and is drawn again.
//!
//! Source: effects.md, ranges; which distribution is a choice: amplitudes of unknown size are drawn by their order of magnitude.

use std::fmt::Write as _;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use super::SHEETS;
use super::sheet::{ActiveEffect, EffectKey, Part, Place, Sheet};

/// Turns a seed into another than the sensors' noise has.
const DOMAIN: u64 = 0x5ea1_ed00_ef7e_c750;
/// |ln(amplitude / neutral)| below which nobody could see that the effect is there: a fifth.
const HIDES_NOTHING: f64 = 0.2;

/// Axes that effects are drawn for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisSelection {
    /// The drive axis, and the supply that feeds it.
    Drive,
    /// The load axis, and the supply that feeds it.
    Load,
    /// Either axis, their linkage, and the supply.
    Both,
}

impl AxisSelection {
    /// Whether effects may be drawn at this place.
    #[must_use]
    pub fn allows(self, place: Place) -> bool {
        match place.part {
            Part::Drive => self != AxisSelection::Load,
            Part::Load => self != AxisSelection::Drive,
            Part::Linkage => self == AxisSelection::Both,
            Part::Supply => true,
        }
    }

    /// The sheets of all effects that have a place here, in the order of the catalogue.
    #[must_use]
    pub fn sheets(self) -> Vec<&'static Sheet> {
        SHEETS.iter().filter(|sheet| sheet.place.places().iter().any(|place| self.allows(*place))).collect()
    }
}

/// More effects were asked for than there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{asked} different effects were asked for; allowed are 0 to {most} here")]
pub struct TooManyEffects {
    /// Effects asked for.
    pub asked: usize,
    /// Effects that have a place on the axes asked for.
    pub most: usize,
}

/// Draws `count` different effects, in the order of the catalogue.
///
/// # Errors
/// [`TooManyEffects`] if the axes have fewer.
pub fn draw(seed: u64, count: usize, among: AxisSelection) -> Result<Vec<ActiveEffect>, TooManyEffects> {
    let mut left = among.sheets();
    if count > left.len() {
        return Err(TooManyEffects { asked: count, most: left.len() });
    }
    let mut sampler = EffectSampler::new(seed);
    let mut effects: Vec<ActiveEffect> = Vec::new();
    for _ in 0..count {
        let sheet = left.remove(sampler.index(left.len()));
        let place = sampler.place(sheet, among).expect("only sheets with a place here are left");
        effects.push(ActiveEffect { name: sheet.name, place, numbers: sampler.numbers(sheet) });
    }
    effects.sort_by_key(|effect| SHEETS.iter().position(|sheet| sheet.name == effect.name));
    Ok(effects)
}

/// Where draws come from; for whoever wants another effect, place or number at a time than [`draw`] gives.
#[derive(Debug, Clone)]
pub struct EffectSampler {
    random: Pcg64,
}

impl EffectSampler {
    /// A sampler of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        EffectSampler { random: Pcg64::seed_from_u64(seed ^ DOMAIN) }
    }

    /// One of the effect's places here; `None` if it has none.
    pub fn place(&mut self, sheet: &Sheet, among: AxisSelection) -> Option<Place> {
        let places: Vec<Place> =
            sheet.place.places().iter().copied().filter(|place| among.allows(*place)).collect();
        if places.is_empty() { None } else { Some(places[self.index(places.len())]) }
    }

    /// A number for each key of the sheet, in the file's units.
    pub fn numbers(&mut self, sheet: &Sheet) -> Vec<f64> {
        sheet.keys.iter().enumerate().map(|(i, key)| self.number(key, i == 0)).collect()
    }

    fn number(&mut self, key: &EffectKey, amplitude: bool) -> f64 {
        let [least, most] = key.drawn;
        let magnitude = if amplitude {
            self.amplitude(key)
        } else if let (true, Some(default)) = (self.coin(), key.default) {
            return default;
        } else {
            least + (most - least) * self.unit()
        };
        if key.signed && self.coin() { -magnitude } else { magnitude }
    }

    fn amplitude(&mut self, key: &EffectKey) -> f64 {
        let [least, most] = key.drawn.map(libm::log);
        let neutral = key.neutral.filter(|neutral| (key.drawn[0]..=key.drawn[1]).contains(neutral));
        loop {
            let logarithm = least + (most - least) * self.unit();
            if neutral.is_none_or(|neutral| (logarithm - libm::log(neutral)).abs() >= HIDES_NOTHING) {
                // The ends' logarithms come back with a rounding.
                return libm::exp(logarithm).clamp(key.drawn[0], key.drawn[1]);
            }
        }
    }

    /// A place in a list of this length, which must not be empty.
    fn index(&mut self, length: usize) -> usize {
        // The unit lies below 1, and no product with a short length rounds up to it.
        (self.unit() * length as f64) as usize
    }

    fn coin(&mut self) -> bool {
        self.random.next_u64() >> 63 == 1
    }

    /// Uniform in [0, 1) with 53 bits.
    fn unit(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The tables `[effects.…]` that switch these on: what a rig file or a sealed file holds.
#[must_use]
pub fn as_toml(effects: &[ActiveEffect]) -> String {
    let mut text = String::new();
    for effect in effects {
        // Writing into a text cannot fail.
        let _ = writeln!(text, "[effects.{}.{}]", effect.name, effect.place);
        let keys = super::sheet(effect.name).map_or(&[][..], |sheet| sheet.keys);
        for (key, number) in keys.iter().zip(&effect.numbers) {
            let _ = writeln!(text, "{} = {number:?}", key.name);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::sheet::PlaceKind;
    use super::*;
    use crate::parameters::RigParameters;
    use std::collections::BTreeSet;

    fn many(count: usize, among: AxisSelection) -> Vec<ActiveEffect> {
        (0..2000).flat_map(|seed| draw(seed, count, among).expect("there are so many")).collect()
    }

    #[test]
    fn a_draw_is_a_function_of_its_seed() {
        for seed in [0, 1, 7, u64::MAX] {
            assert_eq!(draw(seed, 5, AxisSelection::Both), draw(seed, 5, AxisSelection::Both));
        }
        let texts: BTreeSet<String> =
            (0..100).map(|seed| as_toml(&draw(seed, 2, AxisSelection::Both).unwrap())).collect();
        assert_eq!(texts.len(), 100);
    }

    #[test]
    fn a_draw_of_today_is_that_of_any_day() {
        // Seeds are stored in place of what they draw: a sheet whose range or place in the list changes makes them another study.
        let text = as_toml(&draw(1, 1, AxisSelection::Both).unwrap());
        let was = "[effects.stribeck-friction.drive]\nvelocity_mm_per_s = 2.83160585667273\nexponent = 1.9889313915891174\n\n";
        assert_eq!(text, was);
    }

    #[test]
    fn every_effect_and_every_place_comes_up() {
        let drawn: BTreeSet<_> =
            many(3, AxisSelection::Both).iter().map(|effect| (effect.name, effect.place)).collect();
        let all: usize = SHEETS.iter().map(|sheet| sheet.place.places().len()).sum();
        assert_eq!(drawn.len(), all);
    }

    #[test]
    fn no_effect_comes_twice_and_more_than_there_are_is_refused() {
        let of_linkage = SHEETS.iter().filter(|sheet| sheet.place == PlaceKind::Linkage).count();
        let (all, of_one_axis) = (SHEETS.len(), SHEETS.len() - of_linkage);
        assert!(of_one_axis < all);
        for (among, most) in [
            (AxisSelection::Both, all),
            (AxisSelection::Drive, of_one_axis),
            (AxisSelection::Load, of_one_axis),
        ] {
            let names: BTreeSet<_> = draw(3, most, among).unwrap().iter().map(|effect| effect.name).collect();
            assert_eq!(names.len(), most);
            assert_eq!(draw(3, most + 1, among), Err(TooManyEffects { asked: most + 1, most }));
            assert_eq!(draw(3, 0, among), Ok(Vec::new()));
        }
    }

    #[test]
    fn an_axis_gets_its_own_effects_and_those_of_the_supply() {
        for (among, part) in [(AxisSelection::Drive, Part::Drive), (AxisSelection::Load, Part::Load)] {
            let parts: BTreeSet<Part> = many(2, among).iter().map(|effect| effect.place.part).collect();
            assert_eq!(parts, BTreeSet::from([part, Part::Supply]));
        }
    }

    #[test]
    fn numbers_lie_in_their_drawn_range_with_the_sign_that_they_may_have_and_never_near_the_baselines() {
        for effect in many(4, AxisSelection::Both) {
            let sheet = super::super::sheet(effect.name).unwrap();
            for (i, (key, number)) in sheet.keys.iter().zip(&effect.numbers).enumerate() {
                let what = format!("{} {} = {number}", effect.name, key.name);
                let is_default = i > 0 && key.default == Some(*number);
                assert!(is_default || (key.drawn[0]..=key.drawn[1]).contains(&number.abs()), "{what}");
                assert!(is_default || key.signed || *number > 0.0, "{what}");
                let near = |neutral: f64| {
                    (key.drawn[0]..=key.drawn[1]).contains(&neutral) && (number / neutral).ln().abs() < 0.19
                };
                assert!(i > 0 || !key.neutral.is_some_and(near), "{what}");
            }
        }
    }

    #[test]
    fn amplitudes_are_drawn_by_their_order_of_magnitude_and_shapes_are_their_default_half_of_the_time() {
        let mut sampler = EffectSampler::new(1);
        let sheet = super::super::sheet("position-dependent-force").unwrap();
        let draws: Vec<Vec<f64>> = (0..4000).map(|_| sampler.numbers(sheet)).collect();
        let share = |of: &dyn Fn(&[f64]) -> bool| {
            draws.iter().filter(|numbers| of(numbers)).count() as f64 / draws.len() as f64
        };
        // Standard error of a share of one half of 4000 draws: 0.008; five of them.
        let middle = (sheet.keys[0].drawn[0] * sheet.keys[0].drawn[1]).sqrt();
        assert!((share(&|n| n[0].abs() < middle) - 0.5).abs() < 0.04);
        assert!((share(&|n| n[0] < 0.0) - 0.5).abs() < 0.04);
        assert!((share(&|n| Some(n[2]) == sheet.keys[2].default) - 0.5).abs() < 0.04);
    }

    #[test]
    fn the_text_of_a_draw_switches_on_what_was_drawn() {
        let baseline = RigParameters::baseline();
        for seed in 0..200 {
            let effects = draw(seed, 6, AxisSelection::Both).unwrap();
            let rig = baseline.with_effects_of(&as_toml(&effects), "sealed.toml").unwrap();
            assert_eq!(rig.effects(), effects);
        }
    }
}
