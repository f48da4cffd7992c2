//! Suspects of a file beside a rig file: terms that may be missing, screened and fitted as the effects of the catalogue.
//!
//! ```text
//!   [[suspects]] ──► declared term (plant) ──► data sheet: places, numbers with ranges ──► candidate
//! ```
//! `use` names a law of a library, shipped or the user's, whose variables are the rig's (`plant/src/parameters/laws.rs`).
//!
//! A number without a value is an amplitude: 0 is the rig without the suspect, its `prior`, else half of the larger end of its
//! range, is a coordinate of 1. That is a scale: the standard deviation of the prior distribution is three times it. The smallest
//! amplitude that is named is `MIN_AMPLITUDE_RATIO` of a tenth of it. A number with a value is a shape, which starts there.

use crate::report::{DeclaredSuspect, place_of};
use model::{Change, EntryParameter, Library};
use plant::effects::declared::{Declared, Number};
use plant::effects::sheet::{EffectKey, Group, Place, PlaceKind, Sheet};
use plant::parameters::{Law, LawNumber, LawVariable, ParameterError, suspects_using};
use std::path::Path;

/// A suspect with its data sheet.
#[derive(Debug)]
pub struct Suspect {
    /// The term as the file declares it, a library's law written out.
    pub declared: Declared,
    pub(crate) sheet: Sheet,
    pub(crate) place: Place,
}

/// Reads a file of suspects, which may use libraries as a model file does. What is read lives as long as the program, as the
/// catalogue does.
///
/// # Errors
/// [`ParameterError`] with file, line and column.
pub fn read(text: &str, file: &str) -> Result<Vec<&'static Suspect>, ParameterError> {
    let folder = Path::new(file).parent().unwrap_or(Path::new(""));
    let all = suspects_using(text, file, &|used| law(used, folder))?;
    Ok(all.into_iter().map(|declared| &*Box::leak(Box::new(Suspect::of(declared)))).collect())
}

/// The law that `use` of a file in this folder names, where the rig can have it: a term that is added.
///
/// # Errors
/// What is no law of a library, or none for the rig.
fn law(used: &str, folder: &Path) -> Result<Law, String> {
    let found = Library::find(used, folder)?;
    let entry = found.entry();
    let keeps = !entry.states.is_empty() || !entry.memories.is_empty() || !entry.frictions.is_empty();
    if entry.change != Change::Add || keeps || entry.reads_place() || entry.expression.contains("delay(") {
        let why = "the rig takes terms that are added, without states, memory and the value at the place; write one with add";
        return Err(format!("{used}: {why}"));
    }
    let variables = found.library.variables_of(entry).into_iter().map(|one| LawVariable {
        name: one.name.clone(),
        about: format!("{}, usually in {}", one.about, one.unit.text),
        default: one.default.clone(),
    });
    let number = |one: &EntryParameter| LawNumber {
        name: one.name.clone(),
        unit: one.quantity.unit.text.clone(),
        value_si: one.values_si.first().copied(),
        range_si: one.range_si,
        is_fixed: one.is_fixed,
        is_amplitude: is_amplitude(one),
    };
    Ok(Law {
        name: entry.name.clone(),
        add: entry.expression.clone(),
        variables: variables.collect(),
        numbers: entry.parameters.iter().map(number).collect(),
    })
}

/// Whether a law is off where the number is 0: it has the dimension of its place over something, or begins at 0.
fn is_amplitude(one: &EntryParameter) -> bool {
    let begins = |text: &String| text.split(['/', ' ', '^']).next() == Some("place");
    !one.is_fixed
        && (one.quantity.dimension.as_ref().is_some_and(begins) || one.values_si.first() == Some(&0.0))
}

impl Suspect {
    fn of(declared: Declared) -> Suspect {
        let kept = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
        let target = declared.target;
        let key = |number: &Number| key(number, kept(number.name.clone()), kept(number.unit.text.clone()));
        let sheet = Sheet {
            name: kept(declared.name.clone()),
            group: match target.kind() {
                PlaceKind::Chamber => Group::Chamber,
                PlaceKind::Channel => Group::Sensor,
                _ => Group::Motion,
            },
            place: target.kind(),
            law: kept(format!("adds {} to {}", declared.add, declared.place())),
            source: "a file of suspects",
            keys: Box::leak(declared.numbers().iter().map(key).collect::<Vec<_>>().into_boxed_slice()),
            ..Sheet::USUAL
        };
        let place = declared.at();
        Suspect { declared, sheet, place }
    }

    pub(crate) fn reported(&self) -> DeclaredSuspect {
        DeclaredSuspect {
            effect: self.declared.name.clone(),
            place: place_of(self.place),
            adds_to: self.declared.place(),
            add: self.declared.add.clone(),
            twins: self.declared.twins.clone(),
            declaration: self.declared.toml("suspects"),
        }
    }
}

fn key(number: &Number, name: &'static str, unit: &'static str) -> EffectKey {
    let [min, max] = number.range;
    let is_amplitude = number.value == 0.0;
    let usual = number.prior.unwrap_or(0.5 * min.abs().max(max.abs()));
    let drawn = if is_amplitude {
        let sign = if max > 0.0 { 1.0 } else { -1.0 };
        [sign * 0.1 * usual, sign * usual]
    } else {
        let (value, half) = (number.value, number.prior.unwrap_or(0.5 * (max - min)));
        // A positive shape may be scaled by its logarithm: not down to 0.
        let least = if value > 0.0 { value / 20.0 } else { f64::NEG_INFINITY };
        [(value - half).max(min).max(least), (value + half).min(max)]
    };
    EffectKey {
        name,
        unit: plant::parameters::table::Unit::Written(unit),
        min,
        max,
        drawn,
        signed: min < 0.0 && max > 0.0,
        default: Some(number.value),
        neutral: is_amplitude.then_some(0.0),
        meaning: "declared by the suspect",
    }
}
