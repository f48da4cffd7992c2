//! Reads `[rig]` of an experiment file, and says where and what is wrong.
//!
//! The tables below are the file's form; each number is held against its range, and keys that do not go together
//! are refused, so that what comes out can be played without a look back.

use serde::Deserialize;
use toml::Spanned;

use super::hand::{
    DEFAULT_DAMPING_N_S_PER_M, DEFAULT_MOST_N, DEFAULT_RAMP_S, DEFAULT_STIFFNESS_N_PER_M, DEFAULT_TRAVEL_S,
};
use super::{Action, Arm, Event, Hand, Part, Scene, cycle_of};
use crate::parameters::RigParameters;

/// Why the `[rig]` of an experiment is refused: file, line, key, value and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(String);

#[derive(Deserialize)]
struct ExperimentFile {
    #[serde(default)]
    rig: RigTable,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct RigTable {
    carriage_position_m: Option<Spanned<f64>>,
    linked: Option<bool>,
    added_mass_kg: Option<Spanned<f64>>,
    sealed: Option<String>,
    hand: Vec<HandTable>,
    event: Vec<EventTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HandTable {
    on: Spanned<Part>,
    from_s: Spanned<f64>,
    to_s: Spanned<f64>,
    force_n: Option<Spanned<f64>>,
    ramp_s: Option<Spanned<f64>>,
    guide_to_m: Option<Spanned<f64>>,
    travel_s: Option<Spanned<f64>>,
    stiffness_n_per_m: Option<Spanned<f64>>,
    damping_n_s_per_m: Option<Spanned<f64>>,
    most_n: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EventTable {
    at_s: Spanned<f64>,
    #[serde(rename = "do")]
    kind: Spanned<Kind>,
    at_position_m: Option<Spanned<f64>>,
    until_s: Option<Spanned<f64>>,
    added_mass_kg: Option<Spanned<f64>>,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    EmergencyStop,
    Release,
    Link,
    Unlink,
    Weights,
}

/// A number of the file.
#[derive(Clone, Copy)]
struct Key {
    path: &'static str,
    unit: &'static str,
    least: f64,
    most: f64,
}

const fn key(path: &'static str, unit: &'static str, least: f64, most: f64) -> Key {
    Key { path, unit, least, most }
}

/// Longest time of a script, s: more than a day.
const LONGEST_S: f64 = 1e5;
/// Strongest push, N: what the bus can ask of a hand.
const STRONGEST_N: f64 = 2000.0;

const FROM_S: Key = key("rig.hand.from_s", "s", 0.0, LONGEST_S);
const TO_S: Key = key("rig.hand.to_s", "s", 0.0, LONGEST_S);
const FORCE_N: Key = key("rig.hand.force_n", "N", -STRONGEST_N, STRONGEST_N);
const RAMP_S: Key = key("rig.hand.ramp_s", "s", 0.0, 60.0);
const TRAVEL_S: Key = key("rig.hand.travel_s", "s", 0.01, 3600.0);
// Held over a cycle of 1 ms on at least half a kilogram, both ends of these ranges are stable.
const STIFFNESS: Key = key("rig.hand.stiffness_n_per_m", "N/m", 1.0, 20_000.0);
const DAMPING: Key = key("rig.hand.damping_n_s_per_m", "N s/m", 0.0, 500.0);
const MOST_N: Key = key("rig.hand.most_n", "N", 1.0, STRONGEST_N);
const AT_S: Key = key("rig.event.at_s", "s", 0.0, LONGEST_S);
const UNTIL_S: Key = key("rig.event.until_s", "s", 0.0, LONGEST_S);

/// The `[rig]` of an experiment, checked.
pub(super) fn read(text: &str, file: &str, rig: &RigParameters) -> Result<Scene, SceneError> {
    let check = Check { text, file, rig };
    let table = toml::from_str::<ExperimentFile>(text).map_err(|error| {
        check.refused(error.span().map_or(0, |span| span.start), error.to_string().trim_end())
    })?;
    let RigTable { carriage_position_m, linked, added_mass_kg, sealed, hand, event } = table.rig;
    let default = Scene::default();
    let position = check.place("rig.carriage_position_m");
    let mass = check.weights("rig.added_mass_kg");
    Ok(Scene {
        carriage_position_m: check.or(position, carriage_position_m.as_ref(), default.carriage_position_m)?,
        linked: linked.unwrap_or(default.linked),
        added_mass_kg: check.or(mass, added_mass_kg.as_ref(), default.added_mass_kg)?,
        sealed,
        hand: hand.iter().map(|table| check.hand(table)).collect::<Result<_, _>>()?,
        event: event.iter().map(|table| check.event(table)).collect::<Result<_, _>>()?,
    })
}

struct Check<'a> {
    text: &'a str,
    file: &'a str,
    rig: &'a RigParameters,
}

impl Check<'_> {
    fn refused(&self, offset: usize, message: &str) -> SceneError {
        SceneError(format!("{}:{}: {message}", self.file, settings::line_of(self.text, offset)))
    }

    /// A place on the stroke.
    fn place(&self, path: &'static str) -> Key {
        key(path, "m", 0.0, self.rig.cylinder().stroke_m)
    }

    /// Weights on the carriage.
    fn weights(&self, path: &'static str) -> Key {
        key(path, "kg", 0.0, self.rig.mass().added_limit_kg)
    }

    fn number(&self, key: Key, value: &Spanned<f64>) -> Result<f64, SceneError> {
        let number = *value.get_ref();
        let Key { path, unit, least, most } = key;
        // A NaN lies in no range.
        if (least..=most).contains(&number) {
            return Ok(number);
        }
        let message = format!("{path} = {number}: allowed are {least} to {most} {unit}");
        Err(self.refused(value.span().start, &message))
    }

    fn or(&self, key: Key, value: Option<&Spanned<f64>>, default: f64) -> Result<f64, SceneError> {
        value.map_or(Ok(default), |value| self.number(key, value))
    }

    /// A value that may stand alone, but not beside another, or lacks another; `key` with its value where it has a number.
    fn refuse<T>(&self, at: &Spanned<T>, key: &str, rule: &str) -> SceneError {
        self.refused(at.span().start, &format!("{key}: {rule}"))
    }

    /// Refuses the first of `keys` that is there.
    fn none_of(&self, keys: &[(&str, &Option<Spanned<f64>>)], rule: &str) -> Result<(), SceneError> {
        let there = keys.iter().find_map(|(key, value)| Some((key, value.as_ref()?)));
        there.map_or(Ok(()), |(key, value)| {
            Err(self.refuse(value, &format!("{key} = {}", value.get_ref()), rule))
        })
    }

    /// Holds that `end`, a time, comes after the time `begin`.
    fn after(&self, end: (Key, &Spanned<f64>), begin: (Key, f64)) -> Result<f64, SceneError> {
        let end_s = self.number(end.0, end.1)?;
        if cycle_of(end_s) > cycle_of(begin.1) {
            return Ok(end_s);
        }
        let rule = format!("it must be at least 0.001 s after {} = {}", begin.0.path, begin.1);
        Err(self.refuse(end.1, &format!("{} = {end_s}", end.0.path), &rule))
    }

    fn hand(&self, table: &HandTable) -> Result<Hand, SceneError> {
        let from_s = self.number(FROM_S, &table.from_s)?;
        let to_s = self.after((TO_S, &table.to_s), (FROM_S, from_s))?;
        let arm = match (&table.force_n, &table.guide_to_m) {
            (Some(force), None) => {
                let of_a_guide = [
                    ("rig.hand.travel_s", &table.travel_s),
                    ("rig.hand.stiffness_n_per_m", &table.stiffness_n_per_m),
                    ("rig.hand.damping_n_s_per_m", &table.damping_n_s_per_m),
                    ("rig.hand.most_n", &table.most_n),
                ];
                self.none_of(&of_a_guide, "it belongs to a hand with guide_to_m, and this one has force_n")?;
                let ramp_s = self.or(RAMP_S, table.ramp_s.as_ref(), DEFAULT_RAMP_S)?;
                Arm::Push { force_n: self.number(FORCE_N, force)?, ramp_s }
            }
            (None, Some(guide_to)) => {
                let of_a_push = [("rig.hand.ramp_s", &table.ramp_s)];
                self.none_of(&of_a_push, "it belongs to a hand with force_n, and this one has guide_to_m")?;
                let travel_s = DEFAULT_TRAVEL_S.min(to_s - from_s);
                let (stiffness, damping) = (&table.stiffness_n_per_m, &table.damping_n_s_per_m);
                Arm::Guide {
                    guide_to_m: self.number(self.place("rig.hand.guide_to_m"), guide_to)?,
                    travel_s: self.or(TRAVEL_S, table.travel_s.as_ref(), travel_s)?,
                    stiffness_n_per_m: self.or(STIFFNESS, stiffness.as_ref(), DEFAULT_STIFFNESS_N_PER_M)?,
                    damping_n_s_per_m: self.or(DAMPING, damping.as_ref(), DEFAULT_DAMPING_N_S_PER_M)?,
                    most_n: self.or(MOST_N, table.most_n.as_ref(), DEFAULT_MOST_N)?,
                }
            }
            _ => {
                let rule = "a hand has one of force_n, guide_to_m: it pushes or it guides";
                return Err(self.refuse(&table.on, "rig.hand", rule));
            }
        };
        Ok(Hand { on: *table.on.get_ref(), from_s, to_s, arm })
    }

    fn event(&self, table: &EventTable) -> Result<Event, SceneError> {
        let at_s = self.number(AT_S, &table.at_s)?;
        let place = table.at_position_m.as_ref();
        let at_position_m =
            place.map(|place| self.number(self.place("rig.event.at_position_m"), place)).transpose()?;
        let kind = *table.kind.get_ref();
        if kind != Kind::Link {
            let until = [("rig.event.until_s", &table.until_s)];
            self.none_of(&until, "it belongs to do = \"link\" alone")?;
        }
        if kind != Kind::Weights {
            let mass = [("rig.event.added_mass_kg", &table.added_mass_kg)];
            self.none_of(&mass, "it belongs to do = \"weights\" alone")?;
        }
        let action = match kind {
            Kind::EmergencyStop => Action::EmergencyStop,
            Kind::Release => Action::Release,
            Kind::Unlink => Action::Unlink,
            Kind::Link => {
                let until = table.until_s.as_ref();
                let until_s = until.map(|until| self.after((UNTIL_S, until), (AT_S, at_s))).transpose()?;
                Action::Link { until_s }
            }
            Kind::Weights => {
                let mass = self.weights("rig.event.added_mass_kg");
                let Some(added) = &table.added_mass_kg else {
                    let rule = format!("it needs added_mass_kg, {} to {} kg", mass.least, mass.most);
                    return Err(self.refuse(&table.kind, "rig.event.do = \"weights\"", &rule));
                };
                Action::Weights { added_mass_kg: self.number(mass, added)? }
            }
        };
        Ok(Event { at_s, at_position_m, action })
    }
}
