//! Reads `[effects.NAME.PLACE]` of a rig file against the data sheets of the effects.
//!
//! ```text
//! [effects.piston-leakage.drive]            an effect of an axis
//! leakage_nl_per_min = 2.5
//! [effects.pressure-sensor-offset.drive.a]  one of a chamber or a channel
//! offset_mbar = -30
//! ```
//!
//! A place of two words is a table in a table; what stands under an effect's name is walked down to its keys.

use toml::de::DeTable;

use super::reader::{ParameterError, Place as Text};
use crate::effects::sheet::{EffectKey, Sheet, Switched};
use crate::effects::{SHEETS, sheet};

/// All effects that the file switches on, in the order of the catalogue and of its places.
pub(super) fn read(root: &DeTable<'_>, text: &Text<'_>) -> Result<Vec<Switched>, ParameterError> {
    let Some((_, table)) = root.iter().find(|(name, _)| name.get_ref() == "effects") else {
        return Ok(Vec::new());
    };
    let mut effects = Vec::new();
    let names = SHEETS.iter().map(|sheet| sheet.name).collect::<Vec<_>>().join(", ");
    let table = table.get_ref().as_table().ok_or_else(|| text.wrong("effects", table, "tables"))?;
    for (name, value) in table {
        let path = format!("effects.{}", name.get_ref());
        let sheet = sheet(name.get_ref()).ok_or_else(|| text.unknown(name, &path, value, &names))?;
        let places = value.get_ref().as_table().ok_or_else(|| text.wrong(&path, value, &at(sheet)))?;
        // A table without a place would switch on nothing, and the file would not say so.
        if places.is_empty() {
            return Err(text.wrong(&path, value, &at(sheet)));
        }
        for (first, value) in places {
            let path = format!("{path}.{}", first.get_ref());
            let bad = |path: &str, value| text.unknown(first, path, value, &at(sheet));
            let inner = value.get_ref().as_table().ok_or_else(|| bad(&path, value))?;
            if let Some(place) = sheet.place_named(first.get_ref()) {
                let line = text.line(first.span().start);
                let numbers = read_numbers(sheet, inner, &path, line, text)?;
                effects.push(Switched { name: sheet.name, place, numbers });
                continue;
            }
            let part = format!("{}.", first.get_ref());
            if inner.is_empty() || !sheet.place.names().iter().any(|name| name.starts_with(&part)) {
                return Err(bad(&path, value));
            }
            for (second, value) in inner {
                let place = sheet.place_named(&format!("{}.{}", first.get_ref(), second.get_ref()));
                let path = format!("{path}.{}", second.get_ref());
                let (Some(place), Some(keys)) = (place, value.get_ref().as_table()) else {
                    return Err(bad(&path, value));
                };
                let line = text.line(second.span().start);
                let numbers = read_numbers(sheet, keys, &path, line, text)?;
                effects.push(Switched { name: sheet.name, place, numbers });
            }
        }
    }
    sort(&mut effects);
    Ok(effects)
}

/// One number for each key of the sheet, checked.
fn read_numbers(
    sheet: &Sheet,
    table: &DeTable<'_>,
    path: &str,
    line: usize,
    text: &Text<'_>,
) -> Result<Vec<f64>, ParameterError> {
    let known = || sheet.keys.iter().map(|key| key.name).collect::<Vec<_>>().join(", ");
    for (name, value) in table {
        if !sheet.keys.iter().any(|key| key.name == name.get_ref()) {
            let path = format!("{path}.{}", name.get_ref());
            return Err(text.unknown(name, &path, value, &known()));
        }
    }
    let number = |key: &EffectKey| {
        let path = format!("{path}.{}", key.name);
        let Some(value) = table.get(key.name) else {
            return key.default.ok_or_else(|| text.missing(line, &path, &key.range()));
        };
        let number =
            settings::number(value.get_ref()).ok_or_else(|| text.wrong(&path, value, &key.range()))?;
        // Written so that a NaN, which TOML admits, fails.
        if number >= key.min && number <= key.max {
            return Ok(number);
        }
        Err(text.out_of_range(&path, value, &key.range()))
    };
    sheet.keys.iter().map(number).collect()
}

/// Into the order of the catalogue, and of the places of an effect.
pub(super) fn sort(effects: &mut [Switched]) {
    effects.sort_by_key(|effect| (SHEETS.iter().position(|sheet| sheet.name == effect.name), effect.place));
}

fn at(sheet: &Sheet) -> String {
    sheet.place.names().join(", ")
}
