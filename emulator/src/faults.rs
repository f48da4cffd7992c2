//! Fault injection: the table of faults, their schedule, and their record.
//!
//! ```text
//!   faults.toml ── script.rs ──┐                              ┌─► plant::faults      valve, hose, friction, supply, sensors
//!   console ────── parse ──────┴─► schedule.rs, once a cycle ───┼─► protocol wire      by orders to the bus's host
//!                                        │                    └─► hands              a push towards an end of the stroke
//!                                        └─► marks: events, faults.csv, truth.csv, a frame of the bench
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`table`] | every fault: name, places, numbers with unit and range, description |
//! | [`script`] | a file of faults with their times and conditions, checked |
//! | [`schedule`] | begin and end of faults in a run |
//! | [`overlay`] | effect of the active faults on plant, sensors and hands |
//! | [`mark`] | the record of a begin or end, for every log |
//! | [`listing`] | `emulator faults`: the table as text, JSON and Markdown |

pub(crate) mod listing;
pub(crate) mod mark;
pub mod overlay;
pub(crate) mod schedule;
pub mod script;
pub(crate) mod table;

use table::{FaultSpec, MOST_KEYS};

/// A fault of the table at a place, with its numbers, each within its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    pub(crate) spec: &'static FaultSpec,
    /// Index of its place in the table.
    place: u8,
    /// Its numbers, in the order of the table's keys.
    pub(crate) values: [f64; MOST_KEYS],
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum FaultError {
    #[error("fault '{0}' is unknown; 'emulator faults' lists the known ones{near}", near = of_the_kind(.0))]
    Unknown(String),
    #[error("at = '{at}': {fault} acts at {allowed}")]
    Place { fault: &'static str, at: String, allowed: String },
    #[error("unknown key {key} = {value}; {fault} has {known}")]
    Key { fault: &'static str, key: String, value: String, known: String },
    /// A number without default is missing.
    #[error("{fault} needs {key}; allowed: {range}")]
    Missing { fault: &'static str, key: &'static str, range: String },
    /// Out of range, not finite, or no number.
    #[error("{key} = {value}: allowed: {range}")]
    Value { key: String, value: String, range: String },
}

/// Most places of a fault that a message names.
const MOST_PLACES_NAMED: usize = 12;

/// Why a fault of the bus cannot be injected.
pub(crate) const NEEDS_HOST: &str =
    "only the embedded bus that this emulator hosts can do it; use --bus unix:///PATH without another host";

/// Hint for an unknown name: the faults that begin with the same word.
fn of_the_kind(name: &str) -> String {
    let kind = name.split('-').next();
    let near: Vec<_> =
        table::all().map(|spec| spec.name).filter(|near| near.split('-').next() == kind).collect();
    if near.is_empty() { String::new() } else { format!(", such as {}", near.join(", ")) }
}

impl Fault {
    /// A fault of this name at this place, for comparisons; its numbers are unset.
    pub(crate) fn like(name: &str, at: Option<&str>) -> Result<Self, FaultError> {
        let spec = table::spec(name).ok_or_else(|| FaultError::Unknown(name.to_owned()))?;
        let numbers: Vec<_> =
            spec.keys.iter().map(|key| (key.name.to_string(), Some(key.max), String::new())).collect();
        Self::new(name, at, &numbers)
    }

    /// The fault of this name at this place (`None`: its only place, or the whole bus), with the numbers given by key, as
    /// number and as text.
    pub(crate) fn new(
        name: &str,
        at: Option<&str>,
        numbers: &[(String, Option<f64>, String)],
    ) -> Result<Self, FaultError> {
        let spec = table::spec(name).ok_or_else(|| FaultError::Unknown(name.to_owned()))?;
        let places = spec.places.names();
        let place = match at {
            Some(at) => places.iter().position(|place| place == at),
            None => spec.places.has_default_place().then_some(0),
        };
        let place = place.ok_or_else(|| {
            let reported = places.iter().take(MOST_PLACES_NAMED).cloned().collect::<Vec<_>>().join(", ");
            let more = if places.len() > MOST_PLACES_NAMED { ", …: 'emulator faults' has all" } else { "" };
            let at = at.unwrap_or_default().to_owned();
            FaultError::Place { fault: spec.name, at, allowed: format!("one of {reported}{more}") }
        })?;
        if let Some((key, _, value)) =
            numbers.iter().find(|(key, ..)| spec.keys.iter().all(|known| known.name != *key))
        {
            let known: Vec<_> = spec.keys.iter().map(|key| &*key.name).collect();
            let known = if known.is_empty() { "no numbers".to_owned() } else { known.join(", ") };
            let (key, value) = (key.clone(), value.clone());
            return Err(FaultError::Key { fault: spec.name, key, value, known });
        }
        let mut values = [0.0; MOST_KEYS];
        for (value, key) in values.iter_mut().zip(spec.keys) {
            let given = numbers.iter().rev().find(|(name, ..)| *name == key.name);
            *value = match (given, key.default) {
                (Some((_, Some(number), _)), _) if key.allows(*number) => *number,
                (Some((name, _, written)), _) => {
                    let (key_name, value) = (name.clone(), written.clone());
                    return Err(FaultError::Value { key: key_name, value, range: key.range() });
                }
                (None, Some(default)) => default,
                (None, None) => {
                    let range = key.range();
                    return Err(FaultError::Missing { fault: spec.name, key: &key.name, range });
                }
            };
        }
        Ok(Self { spec, place: place as u8, values })
    }

    /// Its place by name.
    pub(crate) fn place(&self) -> String {
        self.spec.places.names().swap_remove(usize::from(self.place))
    }

    pub(crate) fn place_index(&self) -> usize {
        usize::from(self.place)
    }

    /// Its numbers by key, each in the unit of the table.
    pub fn numbers(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.spec.keys.iter().map(|key| &*key.name).zip(self.values)
    }
}

#[cfg(test)]
mod tests;
