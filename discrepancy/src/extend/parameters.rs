//! `parameter:` names and the keys of the rig file that they scale; numbers of the file by their keys.

use super::edits::Edits;
use super::{ExtendError, quantity_text, written};
use crate::parameters::PARAMETERS;
use crate::report::Quantity;
use plant::Axis;
use plant::parameters::table::{KEYS, Key};
use std::ops::Range;
use toml_edit::{Document, Item};

/// All names, in the order of effects.md.
pub(super) fn names() -> Vec<&'static str> {
    PARAMETERS.iter().map(|parameter| parameter.name).collect()
}

/// The keys of the rig file, as `mass.drive_kg`, that a parameter scales; the first holds the parameter's value.
///
/// Only the mass differs between the axes. The carriage, which the force sensor moves, is scaled with the drive's mass.
pub(crate) fn key_of_parameter(name: &str, axis: Axis) -> Option<Vec<&'static str>> {
    let parameter = PARAMETERS.iter().find(|parameter| parameter.name == name)?;
    let of_axis = |key: &&&str| name != "parameter:mass" || (**key == "mass.load_kg") == (axis == Axis::Load);
    Some(parameter.keys.iter().filter(of_axis).copied().collect())
}

/// The keys of a changed parameter, and the factor on them.
///
/// Without a unit the value is the factor, on both axes; with the file's unit it is the new number of the first key, a mass that
/// of the axis that was `mass_axis`.
fn scaling(
    quantity: &Quantity,
    mass_axis: Axis,
    number_of: impl Fn(&str) -> Option<f64>,
) -> Result<(Vec<&'static str>, Option<f64>), ExtendError> {
    let unknown = || ExtendError::UnknownParameter { name: quantity.name.clone(), known: names().join(", ") };
    if quantity.unit.is_empty() {
        let mut keys = key_of_parameter(&quantity.name, Axis::Drive).ok_or_else(unknown)?;
        for key in key_of_parameter(&quantity.name, Axis::Load).ok_or_else(unknown)? {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        return Ok((keys, Some(quantity.value)));
    }
    let keys = key_of_parameter(&quantity.name, mass_axis).ok_or_else(unknown)?;
    expect_unit(quantity, KEYS.iter().find(|key| key.path() == keys[0]).filter(|key| key.count == 1))?;
    // A number that was 0 has no factor; no key beside the first one needs it then.
    let factor = number_of(keys[0]).map(|old| quantity.value / old).filter(|factor| factor.is_finite());
    Ok((keys, factor))
}

/// Refuses a quantity that is not in the unit of its key.
fn expect_unit(quantity: &Quantity, key: Option<&Key>) -> Result<(), ExtendError> {
    let wanted = key.map_or("", |key| key.unit.name());
    if quantity.unit == wanted {
        return Ok(());
    }
    let (name, unit, wanted) = (quantity.name.clone(), quantity.unit.clone(), wanted.to_owned());
    Err(ExtendError::Unit { name, unit, wanted })
}

/// `valve.kv_supply_m3_per_h[2]`, `cylinder.dead_volume_cm3`: key and place in its list; `None` for what is no number of a rig
/// file.
fn number_of_file(name: &str) -> Option<(&str, usize)> {
    let indexed = name.strip_suffix(']').and_then(|name| name.split_once('['));
    let (path, place) = indexed.map_or(Some((name, 0)), |(path, place)| Some((path, place.parse().ok()?)))?;
    let is_named = |key: &Key| (key.count > 1) == indexed.is_some() && place < key.count;
    KEYS.iter().any(|key| key.path() == path && is_named(key)).then_some((path, place))
}

/// The text with all changed parameters.
pub(super) fn change(
    text: &str,
    changed: &[Quantity],
    mass_axis: Axis,
    from: &str,
    layout: &dyn Fn(&str, String) -> ExtendError,
) -> Result<String, ExtendError> {
    let document =
        Document::parse(text).map_err(|error| layout("changed parameters", error.message().to_owned()))?;
    let mut edits = Edits::new(text);
    let mut done: Vec<&str> = Vec::new();
    let number_of = |path: &str| match entry_spans(&document, path)?.values.as_slice() {
        [only] => number(text, only),
        _ => None,
    };
    for quantity in changed {
        if !quantity.value.is_finite() {
            let (what, value) = (quantity.name.clone(), quantity.value.to_string());
            return Err(ExtendError::NotFinite { what, value });
        }
        if let Some((path, place)) = number_of_file(&quantity.name) {
            expect_unit(quantity, KEYS.iter().find(|key| key.path() == path))?;
            if done.contains(&path) || done.contains(&quantity.name.as_str()) {
                return Err(ExtendError::Twice { what: quantity.name.clone() });
            }
            done.push(&quantity.name);
            let Some(spans) = entry_spans(&document, path) else { continue };
            let Some(span) = spans.values.get(place) else { continue };
            let new = quantity_text(quantity.value, quantity.standard_error, &quantity.unit);
            edits.comment_above(
                spans.key.start,
                &format!("was {}; {new}, by {}{from}", &text[span.clone()], quantity.name),
            );
            edits.replace(span.clone(), written(quantity.value));
            continue;
        }
        let (keys, factor) = scaling(quantity, mass_axis, number_of)?;
        for (at, path) in keys.into_iter().enumerate() {
            if done.iter().any(|key| key.split('[').next() == Some(path)) {
                return Err(ExtendError::Twice { what: path.to_owned() });
            }
            done.push(path);
            let Some(spans) = entry_spans(&document, path) else { continue };
            let is_value = at == 0 && !quantity.unit.is_empty();
            let unit = if is_value { quantity.unit.as_str() } else { "" };
            let new = if is_value {
                quantity_text(quantity.value, quantity.standard_error, unit)
            } else {
                let error =
                    quantity.standard_error.map(|error| error * factor.unwrap_or(1.0) / quantity.value);
                format!("times {}", quantity_text(factor.unwrap_or(1.0), error, ""))
            };
            let comment = format!("was {}; {new}, by {}{from}", spans.written(text), quantity.name);
            edits.comment_above(spans.key.start, &comment);
            for span in &spans.values {
                let Some(old) = number(text, span) else { continue };
                let new = if is_value { quantity.value } else { old * factor.unwrap_or(1.0) };
                edits.replace(span.clone(), written(new));
            }
        }
    }
    hold_at_rest(text, &document, changed, from, &mut edits);
    Ok(edits.applied())
}

/// The break-away force is at least the sliding force and follows it.
fn hold_at_rest(
    text: &str,
    document: &Document<&str>,
    changed: &[Quantity],
    from: &str,
    edits: &mut Edits<'_>,
) {
    let new = |name: &str, old_n: f64| {
        let quantity = changed.iter().find(|quantity| quantity.name == name)?;
        Some(if quantity.unit.is_empty() { old_n * quantity.value } else { quantity.value })
    };
    let (Some(sliding), Some(rest)) = (
        entry_spans(document, "friction.sliding_force_n"),
        entry_spans(document, "friction.break_away_force_n"),
    ) else {
        return;
    };
    let (Some(old_sliding_n), Some(old_rest_n)) =
        (number(text, &sliding.values[0]), number(text, &rest.values[0]))
    else {
        return;
    };
    let Some(sliding_n) = new("parameter:sliding-friction", old_sliding_n) else { return };
    if new("parameter:break-away-force", old_rest_n).is_none() && sliding_n > old_rest_n {
        let comment = format!("was {}; not below the sliding force{from}", rest.written(text));
        edits.comment_above(rest.key.start, &comment);
        edits.replace(rest.values[0].clone(), written(sliding_n));
    }
}

/// Byte ranges of a key of the rig file and of its numbers.
struct EntrySpans {
    key: Range<usize>,
    values: Vec<Range<usize>>,
    is_array: bool,
}

impl EntrySpans {
    /// The value on one line, without the comments that an array may hold.
    fn written(&self, text: &str) -> String {
        let numbers: Vec<&str> = self.values.iter().map(|span| &text[span.clone()]).collect();
        if self.is_array { format!("[{}]", numbers.join(", ")) } else { numbers.join(", ") }
    }
}

/// Byte ranges of `table.key`; `None` when it is no number or array of them, which the reader of rig files has refused.
fn entry_spans(document: &Document<&str>, path: &str) -> Option<EntrySpans> {
    let (table, name) = path.split_once('.')?;
    let table = document.get(table)?.as_table_like()?;
    let key = table.key(name)?.span()?;
    let item = table.get(name)?;
    let array = item.as_array();
    let values = match array {
        Some(array) => array.iter().map(|value| value.span()).collect::<Option<Vec<_>>>()?,
        None => vec![Item::span(item)?],
    };
    (!values.is_empty()).then_some(EntrySpans { key, values, is_array: array.is_some() })
}

fn number(text: &str, span: &Range<usize>) -> Option<f64> {
    let value: toml_edit::Value = text.get(span.clone())?.parse().ok()?;
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}
