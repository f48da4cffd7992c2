//! Detection limits: the amplitude from which an ideal observer, who knows which effect it is, sees it in 90 % of records at 1
//! % false alarms.
//!
//! ```text
//! |M J(a)| = z_0.99 + z_0.90 = 3.608         one side;  z_0.995 + z_0.90 = 3.857 where the effect may have either sign
//! ```
//!
//! `|M J|` is the observer's [`super::signature`] in the train record with nothing hidden; shapes have their defaults. The
//! amplitude is found on a logarithmic scale of the *excursion*, the distance from the value at which the rig is the
//! baseline:
//!
//! | neutral value | excursion |
//! |---|---|
//! | 0 | the magnitude |
//! | a number of the rig file | magnitude of the logarithm of the ratio, upwards and downwards each with its own limit |
//! | infinity | 1 / value |
//! | none | no limit: the weakest of the drawn range is reported in standard deviations |
//!
//! An effect that is seen at the weakest that a rig file takes (a stiffness or a coefficient that would have to be larger) has
//! no limit either: it is always seen.
//!
//! Limits are computed from the plant and committed before any program is judged.

use crate::draws::{axis_of, needs_both_axes};
use crate::signature::{Observer, length};
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Place, PlaceKind, Sheet};
use plant::{Axis, ParameterError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Rate of false alarms of the ideal observer.
const FALSE_ALARMS: f64 = 0.01;
/// Share of records in which it sees the effect.
const SEEN: f64 = 0.9;
/// Ratio of the ends of the last bracket.
const PRECISION: f64 = 1.02;
/// Excursions below this share of the largest are no matter of physics.
const LEAST_SHARE: f64 = 1e-6;

/// Where the baseline lies on an amplitude's scale, and to which side of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    Zero,
    About(f64, bool),
    Infinite,
    None,
}

impl Scale {
    /// The scales of an amplitude: two where the drawn range lies on both sides of a number.
    pub fn of(key: &EffectKey) -> Vec<Scale> {
        match key.neutral {
            None => vec![Scale::None],
            Some(0.0) => vec![Scale::Zero],
            Some(neutral) if neutral.is_infinite() => vec![Scale::Infinite],
            Some(neutral) => {
                let below = (key.drawn[0] < neutral).then_some(Scale::About(neutral, false));
                let above = (key.drawn[1] > neutral).then_some(Scale::About(neutral, true));
                below.into_iter().chain(above).collect()
            }
        }
    }

    /// Excursion of a value; `None` for one of the other side.
    #[must_use]
    pub fn excursion(self, value: f64) -> Option<f64> {
        match self {
            Scale::Zero => Some(value.abs()),
            Scale::About(neutral, above) => {
                let ratio = (value / neutral).ln();
                ((ratio > 0.0) == above).then_some(ratio.abs())
            }
            Scale::Infinite => Some(1.0 / value),
            Scale::None => None,
        }
    }

    #[must_use]
    pub fn value(self, excursion: f64) -> f64 {
        match self {
            Scale::Zero | Scale::None => excursion,
            Scale::About(neutral, true) => neutral * excursion.exp(),
            Scale::About(neutral, false) => neutral * (-excursion).exp(),
            Scale::Infinite => 1.0 / excursion,
        }
    }

    /// Excursions of the most that a file may hold and of the most that is drawn.
    fn most(self, key: &EffectKey) -> [f64; 2] {
        let ends = match self {
            Scale::Zero | Scale::About(_, true) | Scale::None => [key.max, key.drawn[1]],
            Scale::About(_, false) | Scale::Infinite => [key.min, key.drawn[0]],
        };
        ends.map(|end| self.excursion(end).unwrap_or(end))
    }

    /// Excursion of the least that a file may hold.
    fn least(self, key: &EffectKey) -> f64 {
        if self == Scale::Infinite { 1.0 / key.max } else { 0.0 }
    }

    fn two_sided(self, key: &EffectKey) -> bool {
        key.signed || matches!(self, Scale::About(..)) && Scale::of(key).len() > 1
    }
}

/// |M J| from which an effect is seen.
pub fn threshold(two_sided: bool) -> f64 {
    let quantile = |share| Normal::standard().inverse_cdf(share);
    quantile(1.0 - if two_sided { FALSE_ALARMS / 2.0 } else { FALSE_ALARMS }) + quantile(SEEN)
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    pub effect: String,
    #[serde(rename = "where")]
    pub place: String,
    pub key: String,
    pub unit: String,
    /// `above` or `below` a number of the rig file.
    pub side: Option<String>,
    /// The amplitude from which it is seen; `None` when no amplitude that a rig file takes is, or every one.
    #[serde(rename = "limit")]
    pub limit_value: Option<f64>,
    /// |M J| / threshold at the most that is drawn; of the weakest of the drawn range where there is no neutral value.
    pub strength: f64,
    pub excited: bool,
}

/// All limits, as `tests/study/limits.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    pub schema_version: u32,
    pub window_ms: u32,
    pub seed: u64,
    pub limits: Vec<Limit>,
}

impl Limits {
    /// How far the amplitude of an effect lies above its limit: 0 when no amplitude is seen, `None` when every one is.
    pub fn ratio(&self, sheet: &Sheet, place: Place, amplitude: f64) -> Option<f64> {
        let key = &sheet.keys[0];
        Scale::of(key).into_iter().find_map(|scale| {
            let own = scale.excursion(amplitude)?;
            let limit = self.limits.iter().find(|limit| {
                limit.effect == sheet.name && limit.place == place.to_string() && limit.side == side(scale)
            })?;
            match limit.limit_value {
                Some(limit_value) => Some(own / scale.excursion(limit_value)?),
                None => (!limit.excited).then_some(0.0),
            }
        })
    }
}

fn side(scale: Scale) -> Option<String> {
    match scale {
        Scale::About(_, above) => Some(if above { "above" } else { "below" }.to_owned()),
        _ => None,
    }
}

/// Which records the limits are computed from: of each axis alone, and of both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    One(Axis),
    Both,
}

impl Measured {
    /// The record in which the limit of an effect at a place is looked for.
    pub fn of(kind: PlaceKind, place: Place) -> Self {
        match axis_of(place) {
            Some(axis) if !needs_both_axes(kind) => Measured::One(axis),
            _ => Measured::Both,
        }
    }
}

/// The limits of all effects at all places that are seen in such records.
///
/// # Errors
/// [`ParameterError`] when a sheet's own range is refused: a bug of the catalogue.
pub fn limits_in(
    observer: &Observer,
    measured: Measured,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Limit>, ParameterError> {
    let mut cases = Vec::new();
    for sheet in SHEETS {
        for place in
            sheet.place.places().iter().filter(|place| Measured::of(sheet.place, **place) == measured)
        {
            cases.extend(Scale::of(&sheet.keys[0]).into_iter().map(|scale| (sheet, *place, scale)));
        }
    }
    let found = cases.par_iter().map(|(sheet, place, scale)| {
        let limit = limit(observer, sheet, *place, *scale)?;
        say(&format!("{} {}: {:?} {}", limit.effect, limit.place, limit.limit_value, limit.unit));
        Ok(limit)
    });
    found.collect()
}

fn limit(observer: &Observer, sheet: &Sheet, place: Place, scale: Scale) -> Result<Limit, ParameterError> {
    let key = &sheet.keys[0];
    let name = place.to_string();
    let threshold = threshold(scale.two_sided(key));
    let strength_at = |value: f64| {
        // An excursion to the end of the range and back may round beyond it.
        let value = value.clamp(key.min, key.max);
        let rig = observer.rig().with_effect(sheet.name, &name, &[(key.name, value)])?;
        Ok::<_, ParameterError>(length(&observer.signature(&rig)) / threshold)
    };
    let (limit_value, strength) = if scale == Scale::None {
        (None, weakest(key, strength_at)?)
    } else {
        let ends = Ends { least: scale.least(key), most: scale.most(key)[0], drawn: scale.most(key)[1] };
        let found = search(&ends, |excursion| strength_at(scale.value(excursion)))?;
        (found.limit.map(|excursion| scale.value(excursion)), found.strength)
    };
    Ok(Limit {
        effect: sheet.name.to_owned(),
        place: name,
        key: key.name.to_owned(),
        unit: key.unit.name().to_owned(),
        side: side(scale),
        limit_value,
        strength,
        excited: strength >= 1.0,
    })
}

fn weakest(
    key: &EffectKey,
    strength_at: impl Fn(f64) -> Result<f64, ParameterError>,
) -> Result<f64, ParameterError> {
    const POINTS: i32 = 7;
    let [least, most] = key.drawn.map(f64::ln);
    let value = |at: i32| (least + (most - least) * f64::from(at) / f64::from(POINTS - 1)).exp();
    (0..POINTS).try_fold(f64::INFINITY, |weakest, at| {
        Ok(weakest.min(strength_at(value(at).clamp(key.drawn[0], key.drawn[1]))?))
    })
}

/// Excursions between which a limit is looked for.
struct Ends {
    least: f64,
    /// That a file may hold.
    most: f64,
    drawn: f64,
}

struct Found {
    limit: Option<f64>,
    strength: f64,
}

/// The excursion at which the strength passes 1, looked for from the most that is drawn: down to the least, or up to the most.
fn search<E>(ends: &Ends, strength_at: impl Fn(f64) -> Result<f64, E>) -> Result<Found, E> {
    let &Ends { least, most, drawn } = ends;
    let strength = strength_at(drawn)?;
    let least = least.max(drawn * LEAST_SHARE);
    let (beyond, mut low, mut high) =
        if strength >= 1.0 { (least, least, drawn) } else { (most, drawn, most) };
    let there = strength_at(beyond)?;
    if (there >= 1.0) == (strength >= 1.0) {
        return Ok(Found { limit: None, strength });
    }
    let mut next = drawn / strength;
    while high / low > PRECISION {
        // Strength is nearly proportional to the excursion; where that leads out of the bracket, or no further, its middle is
        // safer.
        let inside = next > low * PRECISION.sqrt() && next < high / PRECISION.sqrt();
        let at = if inside { next } else { (low * high).sqrt() };
        let here = strength_at(at)?;
        if here >= 1.0 {
            high = at;
        } else {
            low = at;
        }
        // To the other side of the limit, so that the bracket closes from both ends.
        let overshoot = if here >= 1.0 { 1.0 / PRECISION.sqrt() } else { PRECISION.sqrt() };
        next = if here > 0.0 { at / here * overshoot } else { 0.0 };
    }
    Ok(Found { limit: Some(high), strength })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_that_of_the_normal_distribution() {
        assert!((threshold(false) - 3.6079).abs() < 1e-4);
        assert!((threshold(true) - 3.8574).abs() < 1e-4);
    }

    #[test]
    fn values_and_excursions_are_inverse_on_each_side() {
        for sheet in SHEETS {
            let key = &sheet.keys[0];
            for scale in Scale::of(key).into_iter().filter(|scale| *scale != Scale::None) {
                let [most, drawn] = scale.most(key);
                assert!(drawn > 0.0 && most >= drawn * (1.0 - 1e-12), "{}: {most} {drawn}", sheet.name);
                let value = scale.value(drawn);
                assert!((scale.excursion(value).unwrap() / drawn - 1.0).abs() < 1e-9, "{}", sheet.name);
                assert!((key.min..=key.max).contains(&value), "{}", sheet.name);
            }
        }
    }

    #[test]
    fn the_search_finds_where_the_strength_passes_one() {
        let ends = Ends { least: 0.0, most: 100.0, drawn: 10.0 };
        let find = |law: fn(f64) -> f64| search(&ends, |at| Ok::<_, ()>(law(at))).unwrap().limit;
        for law in [|at| at / 3.0, |at: f64| (at / 3.0).powi(2), |at: f64| (at / 3.0).sqrt()] {
            let found = find(law).unwrap();
            assert!((3.0..=3.0 * PRECISION * PRECISION).contains(&found), "{found}");
        }
        // Above what is drawn, and above what a file takes.
        let above = find(|at| at / 50.0).unwrap();
        assert!((50.0..=50.0 * PRECISION * PRECISION).contains(&above), "{above}");
        assert_eq!(find(|at| at / 500.0), None);
        assert_eq!(find(|_| 0.0), None);
        // Seen however small.
        assert_eq!(find(|_| 7.0), None);
    }
}
