//! Classes of effects that leave the same signature in a record, by the cosine between the signatures.
//!
//! ```text
//! cosine = |M J_true . M J_other| / (|M J_true| |M J_other|)         above 0.95 the two count as one class in this record
//! ```
//!
//! J_true is the signature of the hidden effect at its drawn numbers, in the catalogue's form. J_other is that of each other
//! effect, and of the same one at other places of the measured axes, at the geometric mean of its drawn range with default
//! shapes. The windows start from the true states of the record ([`super::signature`]). Classes are formed per draw: effects
//! that are alike in one record need not be in another.
//!
//! Parameters of the baseline are compared too, changed by 5 %. A wrong parameter is no missing effect, so such a twin is
//! reported but is not in the class.

use crate::SCHEMA_VERSION;
use crate::draws::{Draw, axis_of};
use crate::folder::{FolderError, Plan, read};
use crate::limits::threshold;
use crate::nearest::NearestLaw;
use crate::signature::{Observer, abs_cosine, length};
use crate::trajectory::TrueTrajectory;
use plant::effects::SHEETS;
use plant::effects::sheet::{Place, Sheet};
use plant::{ParameterError, RigParameters};
use record_maker::{PARAMETERS, Recipe};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Cosine above which two effects count as one class.
pub(crate) const TWIN_COSINE: f64 = 0.95;
/// Cosine above which a pair is reported.
const REPORTED_COSINE: f64 = 0.8;
/// Factor on a parameter of the baseline when it is compared.
const PARAMETER_FACTOR: f64 = 1.05;

/// Another effect, or a parameter, and the cosine of its signature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Member {
    /// Name of the effect or parameter.
    pub(crate) effect: String,
    /// Its place; empty for a parameter.
    #[serde(rename = "where")]
    pub(crate) place: String,
    /// |cosine| of the two signatures.
    pub(crate) cosine: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HiddenClass {
    pub(crate) effect: String,
    #[serde(rename = "where")]
    pub(crate) place: String,
    /// |M J| in this record over the threshold of an ideal observer.
    pub(crate) strength: f64,
    /// Members with a cosine above 0.8, in descending order; the first one in any case.
    pub(crate) members: Vec<Member>,
    /// The catalogue's law nearest to a hidden effect of another form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) nearest: Option<NearestLaw>,
}

/// The classes of the hidden effects of a draw, as `classes/NUMBER.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawClasses {
    pub(crate) schema_version: u32,
    pub(crate) number: usize,
    pub(crate) hidden: Vec<HiddenClass>,
}

/// The classes of a whole study, as `tests/study/classes.json` holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Classes {
    pub(crate) plan: Plan,
    pub(crate) draws: Vec<DrawClasses>,
}

impl Classes {
    /// The committed classes of these draws, by their number. A draw is identified by its recipe, since its number depends on
    /// the shape of the study.
    ///
    /// The size of the noise is ignored: it scales all signatures alike, but for the rounding of the sensors. The strengths are
    /// those at the noise of this study, as the committed limits are.
    pub fn of_draws(&self, draws: &[Draw]) -> BTreeMap<usize, DrawClasses> {
        let planned = self.plan.draws();
        let recipe_of = |number: usize| planned.get(number).map(|draw| &draw.recipe);
        let by_seed: BTreeMap<u64, &DrawClasses> = self
            .draws
            .iter()
            .filter_map(|classes| Some((recipe_of(classes.number)?.seed, classes)))
            .collect();
        let of_draw = |draw: &Draw| {
            let known = *by_seed.get(&draw.recipe.seed)?;
            let recipe = recipe_of(known.number)?;
            let same = *recipe == Recipe { noise: recipe.noise, ..draw.recipe.clone() };
            same.then(|| (draw.number, DrawClasses { number: draw.number, ..known.clone() }))
        };
        draws.iter().filter_map(of_draw).collect()
    }
}

/// Computes the classes of a draw in its train record.
///
/// # Errors
/// [`ParameterError`] when a drawn effect is refused, which is a fault of the catalogue.
pub(crate) fn classes_of(draw: &Draw, trajectory: TrueTrajectory) -> Result<DrawClasses, ParameterError> {
    let measured = trajectory.measured;
    let observer = Observer::new(trajectory);
    let rig = observer.rig();
    let mut others: Vec<(String, String, Vec<f64>)> = Vec::new();
    for sheet in SHEETS {
        let is_measured =
            |place: &&Place| axis_of(**place).map_or(measured == [true, true], |axis| measured[axis.index()]);
        for place in sheet.place.places().iter().filter(is_measured) {
            let other = rig.with_effect(sheet.name, &place.to_string(), &nominal(sheet))?;
            others.push((sheet.name.to_owned(), place.to_string(), observer.signature(&other)));
        }
    }
    for name in PARAMETERS {
        let other = with_parameter(rig, name, PARAMETER_FACTOR)?;
        others.push((name.to_owned(), String::new(), observer.signature(&other)));
    }
    let mut hidden_classes = Vec::new();
    for hidden in &draw.recipe.hidden {
        let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
        let place = hidden.place.to_string();
        let numbers: Vec<_> =
            sheet.keys.iter().map(|key| key.name).zip(hidden.numbers.iter().copied()).collect();
        let hidden_signature = observer.signature(&rig.with_effect(sheet.name, &place, &numbers)?);
        let other = others.iter().filter(|(effect, at, _)| effect != hidden.name || *at != place);
        let mut members: Vec<_> = other
            .map(|(effect, at, signature)| Member {
                effect: effect.clone(),
                place: at.clone(),
                // Four digits are precise enough, and keep the file small.
                cosine: (abs_cosine(&hidden_signature, signature) * 1e4).round() / 1e4,
            })
            .collect();
        members.sort_by(|left, right| right.cosine.total_cmp(&left.cosine));
        let reported = members.iter().take_while(|member| member.cosine > REPORTED_COSINE).count();
        members.truncate(reported.max(1));
        let strength = length(&hidden_signature) / threshold(sheet.keys[0].signed);
        let effect = hidden.name.to_owned();
        hidden_classes.push(HiddenClass { effect, place, strength, members, nearest: None });
    }
    Ok(DrawClasses { schema_version: SCHEMA_VERSION, number: draw.number, hidden: hidden_classes })
}

/// The first key of a sheet at the middle of its drawn range.
pub(crate) fn nominal(sheet: &Sheet) -> Vec<(&'static str, f64)> {
    let key = &sheet.keys[0];
    let mean = (key.drawn[0] * key.drawn[1]).sqrt();
    // The middle must not be the baseline.
    let value = if key.neutral.is_some_and(|neutral| (mean / neutral).ln().abs() < 0.1) {
        key.drawn[1]
    } else {
        mean
    };
    vec![(key.name, value)]
}

/// A rig with one parameter multiplied by a factor.
///
/// # Errors
/// [`ParameterError`] when the rig file does not allow the value.
///
/// # Panics
/// For a name that is not in [`PARAMETERS`].
pub(crate) fn with_parameter(
    rig: &RigParameters,
    name: &str,
    factor: f64,
) -> Result<RigParameters, ParameterError> {
    let one = |key, value: f64| rig.with(key, &[value * factor]);
    let scaled = |values: &[f64]| values.iter().map(|value| value * factor).collect::<Vec<_>>();
    let (friction, cylinder, valve) = (rig.friction(), rig.cylinder(), rig.valve());
    match name {
        "parameter:mass" => rig
            .with("mass.drive_kg", &[rig.mass().drive_kg * factor])?
            .with("mass.carriage_kg", &[rig.mass().carriage_kg * factor])?
            .with("mass.load_kg", &[rig.mass().load_kg * factor]),
        "parameter:viscous-friction" => {
            one("friction.viscous_n_per_mm_per_s", friction.viscous_n_s_per_m / 1e3)
        }
        "parameter:sliding-friction" => one("friction.sliding_force_n", friction.sliding_force_n),
        "parameter:break-away-force" => one("friction.break_away_force_n", friction.break_away_force_n),
        "parameter:supply-pressure" => one("supply.pressure_bar", rig.supply().pressure_pa / 1e5),
        "parameter:spool-time-constant" => {
            one("valve.spool_time_constant_ms", valve.spool_time_constant_s * 1e3)
        }
        "parameter:flow-lag" => one("valve.flow_lag_time_constant_ms", valve.flow_lag_time_constant_s * 1e3),
        "parameter:kv-scale" => rig
            .with("valve.kv_supply_m3_per_h", &scaled(&valve.kv_supply_m3_per_h))?
            .with("valve.kv_exhaust_m3_per_h", &scaled(&valve.kv_exhaust_m3_per_h)),
        "parameter:piston-area" => {
            let areas = [cylinder.piston_area_m2, cylinder.annulus_area_m2].map(|area| area * 1e6 * factor);
            rig.with("cylinder.piston_area_mm2", &areas[..1])?.with("cylinder.annulus_area_mm2", &areas[1..])
        }
        _ => panic!("{name} is no parameter of the study"),
    }
}

/// Reads the classes of draw `number`.
///
/// # Errors
/// [`FolderError`] when the file cannot be read, is of another version or of another draw.
pub fn read_draw(path: &Path, number: usize) -> Result<DrawClasses, FolderError> {
    let classes: DrawClasses = serde_json::from_str(&read(path)?)
        .map_err(|error| FolderError::content(path, format!("holds no classes of this version: {error}")))?;
    if classes.schema_version != SCHEMA_VERSION || classes.number != number {
        return Err(FolderError::content(
            path,
            "holds the classes of another draw: delete it and compute it again",
        ));
    }
    Ok(classes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_the_study_can_be_off() {
        let rig = RigParameters::baseline();
        for name in PARAMETERS {
            for factor in [0.85, 1.15] {
                let off = with_parameter(&rig, name, factor);
                // The break-away force cannot fall below the sliding force, nor the other way round.
                assert!(off.is_ok(), "{name} {factor}: {off:?}");
                assert_ne!(off.unwrap(), rig, "{name}");
            }
        }
    }

    #[test]
    fn the_committed_classes_are_found_by_the_draw_and_not_by_its_number() {
        use crate::draws::Shape;
        let text = include_str!("../../study/classes.json");
        let classes: Classes = serde_json::from_str(text).unwrap();
        let of = |seed, shape| classes.of_draws(&Plan::new(seed, shape).draws());
        // Fewer of each effect, more of others, other noise: all single draws are still those of the committed study.
        let shape = Shape { each: 2, nulls: 3, pairs: 2, noise_factor: 4.0, ..Shape::SMALL };
        let found = of(1, shape);
        assert_eq!(found.keys().copied().collect::<Vec<_>>(), (0..2 * SHEETS.len()).collect::<Vec<_>>());
        for (number, draw) in &found {
            assert_eq!(draw.number, *number);
            assert_eq!(draw.hidden[0].effect, SHEETS[number / 2].name);
        }
        assert_eq!(found[&3].hidden, classes.draws[7].hidden);
        assert!(of(5, shape).is_empty());
    }

    #[test]
    fn the_middle_of_what_is_drawn_is_not_the_baseline() {
        for sheet in SHEETS {
            let [(_, value)] = nominal(sheet)[..] else { panic!("{}: one amplitude", sheet.name) };
            let key = &sheet.keys[0];
            assert!((key.drawn[0]..=key.drawn[1]).contains(&value), "{}", sheet.name);
            assert_ne!(Some(value), key.neutral, "{}", sheet.name);
        }
    }
}
