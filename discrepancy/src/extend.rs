//! Writes the extended rig file: new effects and changed numbers; all other bytes stay.
//!
//! ```text
//!   rig.toml ──► spans of its keys and values ──► edits of the text ──► read again as a rig
//!   [mass]                                     [mass]
//!   drive_kg = 5.0  # mine                     # was 5.0; 5.263 +- 0.041 kg, by parameter:mass from a.csv
//!                                              drive_kg = 5.2631  # mine
//!                                              [effects.piston-leakage.drive] …
//! ```
//!
//! The text is edited at the spans that the parser gives, so that comments, order, blanks and line ends of the rest stay as they
//! are. Old values stay as comments. New numbers are written in full, so that the emulator computes with the bits that were
//! verified; their comments are rounded by the standard error.
//!
//! What a `parameter:` name scales is what the records of the study scale [tests/record-maker/src/numbers.rs].

mod edits;
mod parameters;

use crate::report::{DeclaredSuspect, NamedEffect, Quantity, decimals};
use edits::Edits;
use plant::effects::declared::Number;
use plant::effects::sheet::{EffectKey, Sheet};
use plant::effects::tabulated::Tabulated;
use plant::effects::{SHEETS, sheet};
use plant::parameters::suspects;
use plant::{Axis, ParameterError, RigParameters};
use toml_edit::Document;

/// An effect to be switched on.
#[derive(Clone, Debug, PartialEq)]
pub struct Addition {
    pub(crate) effect: String,
    /// `drive`, `drive.a` and so on.
    pub(crate) place: String,
    /// Keys of its sheet, values in the file's units, standard errors; keys left out keep their value or get their default.
    pub(crate) numbers: Vec<(String, f64, Option<f64>)>,
}

/// Why a rig file cannot be extended.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum ExtendError {
    #[error(transparent)]
    Rig(ParameterError),
    #[error("unknown effect {effect}; known: {known}")]
    UnknownEffect { effect: String, known: String },
    #[error("{effect} cannot be at {place}; it can be at {known}")]
    UnknownPlace { effect: String, place: String, known: String },
    #[error("{effect} has no number {key}; it has {known}")]
    UnknownKey { effect: String, key: String, known: String },
    #[error("{what} is to be changed twice")]
    Twice { what: String },
    #[error("unknown parameter {name}; known: {known}")]
    UnknownParameter { name: String, known: String },
    #[error("{name} is in {unit:?}; the rig file has it in {wanted:?}, and a factor has no unit")]
    Unit { name: String, unit: String, wanted: String },
    #[error("{what} = {value} is no finite number")]
    NotFinite { what: String, value: String },
    #[error("the extended rig file would be refused: {0}")]
    Refused(ParameterError),
    #[error(
        "{file}: cannot add {what} to a file written like this: {reason}; write it as a table of its own"
    )]
    Layout { file: String, what: String, reason: String },
}

/// The rig file with these effects and parameters, `records` named as where they come from; `file` is only its name for messages.
///
/// `mass_axis` is the axis that a mass with a unit is the mass of; a mass without one is a factor on all masses.
///
/// # Errors
/// [`ExtendError`] with what is known or allowed, for a file that is no rig, for effects, places, keys and parameters that do not
/// exist, and for values that a rig file must not hold.
pub fn extend(
    rig_text: &str,
    file: &str,
    additions: &[Addition],
    changed: &[Quantity],
    mass_axis: Axis,
    records: &[String],
) -> Result<String, ExtendError> {
    RigParameters::from_toml(rig_text, file).map_err(ExtendError::Rig)?;
    let from = source(records);
    let layout = |what: &str, reason: String| ExtendError::Layout {
        file: file.to_owned(),
        what: what.to_owned(),
        reason: reason.lines().last().unwrap_or_default().to_owned(),
    };
    let mut text = parameters::change(rig_text, changed, mass_axis, &from, &layout)?;
    let mut done: Vec<(&str, &str)> = Vec::new();
    for addition in additions {
        let effect = format!("{} at {}", addition.effect, addition.place);
        if done.contains(&(addition.effect.as_str(), addition.place.as_str())) {
            return Err(ExtendError::Twice { what: effect });
        }
        done.push((&addition.effect, &addition.place));
        let sheet = checked(addition)?;
        // Parsed anew for each: its predecessor has moved the spans.
        let document =
            Document::parse(text.as_str()).map_err(|error| layout(&effect, error.message().to_owned()))?;
        let mut edits = Edits::new(&text);
        edits.switch_on(&document, sheet, addition, &from);
        let extended = edits.applied();
        Document::parse(extended.as_str()).map_err(|error| layout(&effect, error.message().to_owned()))?;
        text = extended;
    }
    RigParameters::from_toml(&text, file).map_err(ExtendError::Refused)?;
    Ok(text)
}

/// The rig file with these tables at its end, `records` named as where they come from; `file` is only its name for messages.
pub(crate) fn add_tables(
    rig_text: &str,
    file: &str,
    tables: &[Tabulated],
    records: &[String],
) -> Result<String, ExtendError> {
    if tables.is_empty() {
        return Ok(rig_text.to_owned());
    }
    let from = source(records);
    let mut added = String::new();
    for table in tables {
        added += "\n# What no effect of the catalogue explains, as a table: a straight line between points, constant beyond.\n";
        added += &format!("# Found{from}.\n{}", table.toml());
    }
    let mut edits = Edits::new(rig_text);
    edits.append_text(&added);
    let text = edits.applied();
    Document::parse(text.as_str()).map_err(|error| ExtendError::Layout {
        file: file.to_owned(),
        what: "a table".to_owned(),
        reason: error.message().lines().last().unwrap_or_default().to_owned(),
    })?;
    RigParameters::from_toml(&text, file).map_err(ExtendError::Refused)?;
    Ok(text)
}

/// The rig file with these named suspects as terms: new ones at its end, the numbers of those that it has already in their place.
pub(crate) fn add_terms(
    rig_text: &str,
    file: &str,
    named: &[(&NamedEffect, &DeclaredSuspect)],
    records: &[String],
) -> Result<String, ExtendError> {
    let mut text = rig_text.to_owned();
    for (effect, suspect) in named {
        let what = format!("{} at {}", suspect.effect, suspect.adds_to);
        let declared = suspects(&suspect.declaration, "report.json").map_err(ExtendError::Rig)?.remove(0);
        let values: Vec<f64> = effect.parameters.iter().map(|number| number.value).collect();
        let term = declared.with(&values).map_err(ExtendError::Refused)?;
        let layout = |reason: &str| ExtendError::Layout {
            file: file.to_owned(),
            what: what.clone(),
            reason: reason.lines().last().unwrap_or_default().to_owned(),
        };
        let document = Document::parse(text.as_str()).map_err(|error| layout(error.message()))?;
        let mut edits = Edits::new(&text);
        let errors = |(number, quantity): (&Number, &Quantity)| {
            let value = quantity_text(quantity.value, quantity.standard_error, &number.unit.text);
            format!("{} = {value}", number.name)
        };
        let found: Vec<String> = term.numbers().iter().zip(&effect.parameters).map(errors).collect();
        let comment = format!("Found{}: {}.", source(records), found.join(", "));
        if !edits.renew_term(&document, &term, &comment) {
            edits.append_text(&format!(
                "\n# What no effect of the catalogue is, as a declared term.\n# {comment}\n"
            ));
            edits.append_text(&term.toml("terms"));
        }
        let extended = edits.applied();
        Document::parse(extended.as_str()).map_err(|error| layout(error.message()))?;
        text = extended;
    }
    RigParameters::from_toml(&text, file).map_err(ExtendError::Refused)?;
    Ok(text)
}

/// The sheet of an addition whose place and keys it has.
fn checked(addition: &Addition) -> Result<&'static Sheet, ExtendError> {
    let effect = addition.effect.clone();
    let Some(sheet) = sheet(&addition.effect) else {
        let known = SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>().join(", ");
        return Err(ExtendError::UnknownEffect { effect, known });
    };
    if sheet.place_named(&addition.place).is_none() {
        let known = sheet.place.names().join(", ");
        return Err(ExtendError::UnknownPlace { effect, place: addition.place.clone(), known });
    }
    for (at, (key, value, _)) in addition.numbers.iter().enumerate() {
        if !sheet.keys.iter().any(|known| known.name == key) {
            let known = sheet.keys.iter().map(|key| key.name).collect::<Vec<_>>().join(", ");
            return Err(ExtendError::UnknownKey { effect, key: key.clone(), known });
        }
        let what = format!("effects.{effect}.{}.{key}", addition.place);
        if addition.numbers[..at].iter().any(|(earlier, ..)| earlier == key) {
            return Err(ExtendError::Twice { what });
        }
        if !value.is_finite() {
            return Err(ExtendError::NotFinite { what, value: value.to_string() });
        }
    }
    Ok(sheet)
}

/// ` from a.csv, b.csv`, or nothing.
fn source(records: &[String]) -> String {
    if records.is_empty() { String::new() } else { format!(" from {}", in_comment(&records.join(", "))) }
}

/// Text that a comment can hold: TOML refuses control characters there.
fn in_comment(text: &str) -> String {
    text.chars()
        .map(|letter| if letter.is_control() { char::REPLACEMENT_CHARACTER } else { letter })
        .collect()
}

/// `2.513 +- 0.041 Nl/min`: the value rounded to the second digit of its standard error.
fn quantity_text(value: f64, standard_error: Option<f64>, unit: &str) -> String {
    let text = match standard_error.filter(|error| error.is_finite() && *error > 0.0) {
        Some(error) => {
            let digits = decimals(error);
            format!("{value:.digits$} +- {error:.digits$} {unit}")
        }
        None => format!("{value} {unit}").trim_end().to_owned() + ", not bounded by the records",
    };
    text.trim_end().to_owned()
}

/// A number as TOML reads it back with the same bits; whole ones keep their point.
fn written(value: f64) -> String {
    format!("{value:?}")
}

/// The comment above a number of an effect.
fn key_comment(key: &EffectKey, value: f64, standard_error: Option<f64>, from: &str) -> String {
    format!(
        "{}{from}; {}: {}",
        quantity_text(value, standard_error, key.unit.name()),
        key.range(),
        key.meaning
    )
}

#[cfg(test)]
mod tests;
