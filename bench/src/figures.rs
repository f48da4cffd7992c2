//! What a run adds up to, in named numbers: `figures` of `summary.json`.
//!
//! One file for each family in `figures/`, one line for each family in [`FAMILIES`]. A family says the name, unit and
//! meaning of its figures and computes them from a [`Record`]; a figure that the run has nothing to measure on is absent,
//! not zero.
//! `bench figures` lists them all.
//!
//! Smoothing is a centred moving mean, velocity a centred least-squares slope: both shift nothing in time.

pub mod emergency_stop;
mod force;
mod force_step;
mod hand;
mod matching;
pub mod position;
mod position_step;
mod relieving;

use crate::record::Record;
use std::collections::BTreeMap;

/// What a figure is.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// Its key, unit included; without a unit it is a number or a ratio.
    pub name: &'static str,
    /// Its unit; 1 for ratios, flags and counts.
    pub unit: &'static str,
    /// What it is, in words.
    pub meaning: &'static str,
}

/// Figures that belong together.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// What they are about.
    pub title: &'static str,
    /// Its figures.
    pub definitions: &'static [Definition],
    /// Computes those that the record has.
    compute: fn(&Record, &mut Figures),
}

/// All families, in the order in which they are listed.
pub const FAMILIES: &[Family] = &[
    position::FAMILY,
    position_step::FAMILY,
    force::FAMILY,
    force_step::FAMILY,
    hand::FAMILY,
    matching::FAMILY,
    relieving::FAMILY,
    emergency_stop::FAMILY,
];

/// Figures by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures(BTreeMap<&'static str, f64>);

impl Figures {
    /// Puts a figure in; what is not known or not finite stays absent.
    fn put(&mut self, name: &'static str, value: Option<f64>) {
        debug_assert!(definition(name).is_some(), "{name} is in no family's list");
        if let Some(value) = value.filter(|value| value.is_finite()) {
            self.0.insert(name, value);
        }
    }

    /// The figure of this name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// All figures, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.0.iter().map(|(name, value)| (*name, *value))
    }
}

/// All figures that `record` has something to measure on.
#[must_use]
pub fn of(record: &Record) -> Figures {
    let mut figures = Figures::default();
    FAMILIES.iter().for_each(|family| (family.compute)(record, &mut figures));
    figures
}

/// All definitions, family by family.
pub fn definitions() -> impl Iterator<Item = &'static Definition> {
    FAMILIES.iter().flat_map(|family| family.definitions)
}

/// The definition of the figure of this name.
#[must_use]
pub fn definition(name: &str) -> Option<&'static Definition> {
    definitions().find(|definition| definition.name == name)
}

/// The list for a terminal.
#[must_use]
pub fn list() -> String {
    let width = definitions().map(|definition| definition.name.len()).max().unwrap_or(0);
    let mut out = String::new();
    for family in FAMILIES {
        out += &format!("{}\n", family.title);
        for Definition { name, unit, meaning } in family.definitions {
            out += &format!("  {name:width$}  {unit:3}  {meaning}\n");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_end_with_their_unit() {
        let names: BTreeSet<_> = definitions().map(|definition| definition.name).collect();
        assert_eq!(names.len(), definitions().count());
        for Definition { name, unit, meaning } in definitions() {
            let ending = match *unit {
                "m" => name.ends_with("_m"),
                "s" => name.ends_with("_s"),
                "N" => name.ends_with("_n"),
                "m/s" => name.ends_with("_m_per_s"),
                "1" => !["_m", "_s", "_n"].iter().any(|unit| name.ends_with(unit)),
                _ => false,
            };
            assert!(ending, "{name} in {unit}");
            assert!(!meaning.is_empty() && list().contains(name));
        }
    }

    #[test]
    fn a_run_without_tables_has_no_figures() {
        assert_eq!(of(&Record::default()), Figures::default());
    }

    #[test]
    fn what_is_not_finite_stays_absent() {
        let mut figures = Figures::default();
        figures.put("force_settling_s", Some(f64::NAN));
        figures.put("force_rise_s", None);
        assert_eq!(figures.iter().count(), 0);
    }
}
