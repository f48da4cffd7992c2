//! Detection limits: the amplitude at which an ideal observer that knows the effect detects it in 90 % of records at 1 % false
//! alarms.
//!
//! ```text
//! |M J(a)| = z_0.99 + z_0.90 = 3.608         one side;  z_0.995 + z_0.90 = 3.857 where the effect may have either sign
//! ```
//!
//! `|M J|` is the [`super::signature`] in the train record with nothing hidden; shapes have their defaults. The amplitude is
//! found on a logarithmic scale of the *excursion*, the distance from the value at which the rig is the baseline:
//!
//! | neutral value | excursion |
//! |---|---|
//! | 0 | the magnitude |
//! | a number of the rig file | magnitude of the logarithm of the ratio, upwards and downwards each with its own limit |
//! | infinity | 1 / value |
//! | none | no limit: the weakest amplitude of the drawn range is reported in standard deviations |
//!
//! An effect that is detected at the weakest value that a rig file allows (a larger stiffness or coefficient would be refused)
//! has no limit either: it is always detected.
//!
//! Limits are computed from the plant and committed before any program is judged.

use crate::draws::{axis_of, needs_both_axes};
use crate::signature::{Observer, length};
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Place, Sheet};
use plant::{Axis, ParameterError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Rate of false alarms of the ideal observer.
const FALSE_ALARMS: f64 = 0.01;
/// Detection rate at the limit.
const POWER: f64 = 0.9;
/// Ratio of the ends of the last bracket.
const PRECISION: f64 = 1.02;
/// Smallest excursion of the search as a share of the drawn one; below it the value has no physical meaning.
const LEAST_SHARE: f64 = 1e-6;

/// The value of an amplitude at which the rig is the baseline, and the side of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Scale {
    Zero,
    About(f64, bool),
    Infinite,
    None,
}

impl Scale {
    /// Scales of an amplitude: two where the drawn range lies on both sides of a number.
    pub(crate) fn of(key: &EffectKey) -> Vec<Scale> {
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

    /// Excursion of a value; `None` for one on the other side.
    pub(crate) fn excursion(self, value: f64) -> Option<f64> {
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

    pub(crate) fn value(self, excursion: f64) -> f64 {
        match self {
            Scale::Zero | Scale::None => excursion,
            Scale::About(neutral, true) => neutral * excursion.exp(),
            Scale::About(neutral, false) => neutral * (-excursion).exp(),
            Scale::Infinite => 1.0 / excursion,
        }
    }

    /// Excursions of the strongest value that a file allows, and of the strongest that is drawn.
    fn most(self, key: &EffectKey) -> [f64; 2] {
        let ends = match self {
            Scale::Zero | Scale::About(_, true) | Scale::None => [key.max, key.drawn[1]],
            Scale::About(_, false) | Scale::Infinite => [key.min, key.drawn[0]],
        };
        ends.map(|end| self.excursion(end).unwrap_or(end))
    }

    /// Excursion of the weakest value that a file allows.
    fn least(self, key: &EffectKey) -> f64 {
        if self == Scale::Infinite { 1.0 / key.max } else { 0.0 }
    }

    fn two_sided(self, key: &EffectKey) -> bool {
        key.signed || matches!(self, Scale::About(..)) && Scale::of(key).len() > 1
    }
}

/// |M J| at the detection limit.
pub(crate) fn threshold(two_sided: bool) -> f64 {
    let quantile = |share| Normal::standard().inverse_cdf(share);
    quantile(1.0 - if two_sided { FALSE_ALARMS / 2.0 } else { FALSE_ALARMS }) + quantile(POWER)
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Limit {
    pub(crate) effect: String,
    #[serde(rename = "where")]
    pub(crate) place: String,
    pub(crate) key: String,
    pub(crate) unit: String,
    /// `above` or `below` a number of the rig file.
    pub(crate) side: Option<String>,
    /// The amplitude at the limit; `None` when no amplitude that a rig file allows is detected, or every one.
    #[serde(rename = "limit")]
    pub(crate) limit_value: Option<f64>,
    /// |M J| / threshold at the strongest drawn value; at the weakest where there is no neutral value.
    pub(crate) strength: f64,
    pub(crate) excited: bool,
}

/// All limits, as `tests/study/limits.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    pub(crate) schema_version: u32,
    pub(crate) window_ms: u32,
    pub(crate) seed: u64,
    pub(crate) limits: Vec<Limit>,
}

impl Limits {
    /// Ratio of the excursion of an amplitude to that of its limit: 0 when no amplitude is detected, `None` when every one is.
    pub(crate) fn ratio(&self, sheet: &Sheet, place: Place, amplitude: f64) -> Option<f64> {
        Scale::of(&sheet.keys[0]).into_iter().find_map(|scale| {
            let excursion = scale.excursion(amplitude)?;
            let limit = self.limits.iter().find(|limit| {
                limit.effect == sheet.name && limit.place == place.to_string() && limit.side == side(scale)
            })?;
            match limit.limit_value {
                Some(limit_value) => Some(excursion / scale.excursion(limit_value)?),
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

/// The limits of all effects at all places that show in a record of one axis; in one of both where `measured` is `None`.
///
/// # Errors
/// [`ParameterError`] when a value of a sheet's range is refused, which is a fault of the catalogue.
pub(crate) fn limits_in(
    observer: &Observer,
    measured: Option<Axis>,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Limit>, ParameterError> {
    let mut cases = Vec::new();
    for sheet in SHEETS {
        let axis = |place: Place| axis_of(place).filter(|_| !needs_both_axes(sheet.place));
        for place in sheet.place.places().iter().filter(|place| axis(**place) == measured) {
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
        // Rounding of an excursion and back may leave the range.
        let value = value.clamp(key.min, key.max);
        let rig = observer.rig().with_effect(sheet.name, &name, &[(key.name, value)])?;
        Ok::<_, ParameterError>(length(&observer.signature(&rig)) / threshold)
    };
    let (limit_value, strength) = if scale == Scale::None {
        (None, weakest_strength(key, strength_at)?)
    } else {
        let range =
            SearchRange { least: scale.least(key), most: scale.most(key)[0], drawn: scale.most(key)[1] };
        let (limit, strength) = search(&range, |excursion| strength_at(scale.value(excursion)))?;
        (limit.map(|excursion| scale.value(excursion)), strength)
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

fn weakest_strength(
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

/// Range of excursions in which a limit is searched.
struct SearchRange {
    least: f64,
    /// Strongest that a file allows.
    most: f64,
    drawn: f64,
}

/// The excursion at which the strength crosses 1, searched from the strongest drawn one, down to the least or up to the most; and
/// the strength at the drawn one.
fn search<E>(
    range: &SearchRange,
    strength_at: impl Fn(f64) -> Result<f64, E>,
) -> Result<(Option<f64>, f64), E> {
    let &SearchRange { least, most, drawn } = range;
    let strength = strength_at(drawn)?;
    let least = least.max(drawn * LEAST_SHARE);
    let (beyond, mut low, mut high) =
        if strength >= 1.0 { (least, least, drawn) } else { (most, drawn, most) };
    let there = strength_at(beyond)?;
    if (there >= 1.0) == (strength >= 1.0) {
        return Ok((None, strength));
    }
    let mut next = drawn / strength;
    while high / low > PRECISION {
        // Strength is nearly proportional to the excursion; where that predicts a point outside the bracket or at its edge, its
        // middle is used.
        let inside = next > low * PRECISION.sqrt() && next < high / PRECISION.sqrt();
        let at = if inside { next } else { (low * high).sqrt() };
        let here = strength_at(at)?;
        if here >= 1.0 {
            high = at;
        } else {
            low = at;
        }
        // Overshoots the limit, so that the bracket closes from both ends.
        let overshoot = if here >= 1.0 { 1.0 / PRECISION.sqrt() } else { PRECISION.sqrt() };
        next = if here > 0.0 { at / here * overshoot } else { 0.0 };
    }
    Ok((Some(high), strength))
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
        let range = SearchRange { least: 0.0, most: 100.0, drawn: 10.0 };
        let find = |law: fn(f64) -> f64| search(&range, |at| Ok::<_, ()>(law(at))).unwrap().0;
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
