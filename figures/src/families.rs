//! What a run adds up to, in named numbers: `figures` of `summary.json`.
//!
//! One file for each family in `families/`, one line for each family in [`FAMILIES`]. A family says the name, unit and
//! meaning of its figures and computes them from a [`Record`]; a figure that the run has nothing to measure on is absent,
//! not zero.
//! `bench figures` lists them all.
//!
//! A run is cut into its repetitions, and a figure is the worst of theirs ([`Worst`]). A rig's events and hands come at times of
//! the run, so that figures of an emergency stop, and of stress that an earlier repetition left, are of the run.
//!
//! Smoothing is a centred moving mean, velocity a centred least-squares slope: both shift nothing in time.

/// Definitions as a table: name, unit, which repetition's value is the run's, meaning.
macro_rules! definitions {
    ($($name:ident: $unit:literal, $worst:ident, $meaning:literal;)+) => {
        &[$($crate::families::Definition {
            name: stringify!($name),
            unit: $unit,
            worst: $crate::families::Worst::$worst,
            meaning: $meaning,
        }),+]
    };
}

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

/// Which repetition's value is the run's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Worst {
    Largest,
    Smallest,
    /// The one farthest from zero.
    Farthest,
    /// The latest; none as soon as one repetition lacks it, since there it never came about.
    Latest,
    /// None: it is measured over the whole run. All definitions of its family are of this kind.
    Run,
}

impl Worst {
    fn of(self, values: &[Option<f64>]) -> Option<f64> {
        if self == Self::Latest && values.contains(&None) {
            return None;
        }
        let worse = |one: f64, other: f64| match self {
            Self::Smallest => one.min(other),
            Self::Farthest if other.abs() > one.abs() => other,
            Self::Farthest => one,
            Self::Largest | Self::Latest | Self::Run => one.max(other),
        };
        values.iter().flatten().copied().reduce(worse)
    }
}

/// A figure: its name, its unit and how it is measured.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// Its key, unit included; without a unit it is a number or a ratio.
    pub name: &'static str,
    /// Its unit; 1 for ratios, flags and counts.
    pub unit: &'static str,
    /// Which repetition's value is the run's.
    pub(crate) worst: Worst,
    /// How it is measured, in words.
    pub meaning: &'static str,
}

/// Figures that belong together.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// What they are about.
    pub title: &'static str,
    /// The figures, in the order in which they are listed.
    pub definitions: &'static [Definition],
    /// Computes those that the record has.
    compute: fn(&Record, &mut Figures),
}

/// All families, in the order in which they are listed.
pub(crate) const FAMILIES: &[Family] = &[
    position::FAMILY,
    position_step::FAMILY,
    force::FAMILY,
    force_step::FAMILY,
    hand::FAMILY,
    matching::FAMILY,
    relieving::FAMILY,
    emergency_stop::FAMILY,
];

/// The figures of a run, each finite; one without anything to measure is absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    values: BTreeMap<&'static str, f64>,
    /// A value for each repetition, of those figures that repetitions have.
    by_repetition: BTreeMap<&'static str, Vec<Option<f64>>>,
}

impl Figures {
    /// Puts a figure in; what is not known or not finite stays absent.
    fn put(&mut self, name: &'static str, value: Option<f64>) {
        debug_assert!(definition(name).is_some(), "{name} is in no family's list");
        if let Some(value) = value.filter(|value| value.is_finite()) {
            self.values.insert(name, value);
        }
    }

    /// The value of a figure, in the unit of its [`Definition`]; `None` when it was not measured.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.values.get(name).copied()
    }

    /// The values of each repetition, by name; a figure that is of the run has none.
    pub fn by_repetition(&self) -> impl Iterator<Item = (&'static str, &[Option<f64>])> {
        self.by_repetition.iter().map(|(name, values)| (*name, values.as_slice()))
    }

    /// All figures, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.values.iter().map(|(name, value)| (*name, *value))
    }
}

/// All figures that `record` has something to measure on: of several repetitions the worst.
pub fn of(record: &Record) -> Figures {
    let computed = |record: &Record, of_run: bool| {
        let mut figures = Figures::default();
        let is_of_run = |family: &Family| family.definitions.iter().all(|known| known.worst == Worst::Run);
        let families = FAMILIES.iter().filter(|family| is_of_run(family) == of_run);
        families.for_each(|family| (family.compute)(record, &mut figures));
        figures.values
    };
    let each: Vec<_> =
        record.repetitions().iter().map(|span| computed(&record.within(span), false)).collect();
    let mut figures = Figures { values: computed(record, true), ..Figures::default() };
    for Definition { name, worst, .. } in definitions() {
        let values: Vec<_> = each.iter().map(|values| values.get(name).copied()).collect();
        figures.put(name, figures.get(name).or_else(|| worst.of(&values)));
        if values.iter().any(Option::is_some) {
            figures.by_repetition.insert(name, values);
        }
    }
    figures
}

/// All figures, family by family.
pub fn definitions() -> impl Iterator<Item = &'static Definition> {
    FAMILIES.iter().flat_map(|family| family.definitions)
}

/// The figure of this name; `None` of a name that no family has.
pub fn definition(name: &str) -> Option<&'static Definition> {
    definitions().find(|definition| definition.name == name)
}

/// All figures with unit and meaning, a line each under the title of their family: `bench figures`.
pub fn list() -> String {
    let width = definitions().map(|definition| definition.name.len()).max().unwrap_or(0);
    let mut out = String::new();
    for family in FAMILIES {
        out += &format!("{}\n", family.title);
        for Definition { name, unit, meaning, .. } in family.definitions {
            out += &format!("  {name:width$}  {unit:3}  {meaning}\n");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{chain, each_ms, table};
    use settings::unit_of;
    use std::collections::BTreeSet;
    use std::f64::consts::PI;

    #[test]
    fn names_are_unique_and_end_with_their_unit() {
        let names: BTreeSet<_> = definitions().map(|definition| definition.name).collect();
        assert_eq!(names.len(), definitions().count());
        for Definition { name, unit, meaning, .. } in definitions() {
            assert_eq!(unit_of(name).unwrap_or("1"), *unit, "{name}");
            assert_eq!(*name, name.to_lowercase());
            assert!(!meaning.is_empty() && list().contains(name));
        }
    }

    /// Of a mixed family a `Run` figure would be the largest of the repetitions.
    #[test]
    fn a_family_is_of_the_whole_run_or_of_the_repetitions() {
        for Family { title, definitions, .. } in FAMILIES {
            let of_run = definitions.iter().filter(|known| known.worst == Worst::Run).count();
            assert!([0, definitions.len()].contains(&of_run), "{title}");
        }
    }

    #[test]
    fn the_worst_of_the_repetitions_is_the_runs() {
        let values = [Some(1.0), Some(-3.0), None, Some(2.0)];
        for (worst, expected) in [
            (Worst::Largest, Some(2.0)),
            (Worst::Smallest, Some(-3.0)),
            (Worst::Farthest, Some(-3.0)),
            (Worst::Latest, None),
        ] {
            assert_eq!(worst.of(&values), expected, "{worst:?}");
        }
        assert_eq!(Worst::Latest.of(&values[..2]), Some(1.0));
        assert_eq!(Worst::Largest.of(&[None]), None);
    }

    #[test]
    fn a_maximum_that_only_a_later_repetition_has_is_seen() {
        // Two moves of 1 s, each with its repetition around it; the error has a maximum in the first, three in the second.
        let error = |time: f64| if time < 2.0 { (PI * time).sin() } else { (3.0 * PI * time).sin() };
        let set_point = each_ms(0.0, 4.0, |time| (time % 2.0).min(1.0));
        let position = each_ms(0.0, 4.0, |time| {
            (time % 2.0).min(1.0) - if time % 2.0 < 1.0 { 0.004 * error(time) } else { 0.0 }
        });
        let moving = each_ms(0.0, 4.0, |time| f64::from(time % 2.0 < 1.0));
        let mut drive =
            table(&[("set_position_m", &set_point), ("position_m", &position), ("moving", &moving)]);
        let states = [
            ("experiment", 0.0),
            ("final-settling", 1.5),
            ("initial-positioning", 1.9),
            ("experiment", 2.0),
            ("final-settling", 3.5),
            ("", 4.0),
        ];
        drive.set_states("main_chain", chain(&states));
        let figures = of(&Record { drive, ..Record::default() });
        assert_eq!(figures.get("position_error_maxima"), Some(3.0));
        let each: BTreeMap<_, _> = figures.by_repetition().collect();
        assert_eq!(each["position_error_maxima"], [Some(1.0), Some(3.0)]);
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
