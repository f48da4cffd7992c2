//! What holds for the data sheets of all effects: names, units in names, ranges, neutral values, texts.

use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Sheet};
use plant::parameters::table::Unit;

/// The names of effects.md, in the order of its tables; they are binding. A row may have several: `…-offset, -gain`.
fn names_of_the_page() -> Vec<String> {
    let page = include_str!("../../docs/specification/effects.md");
    let (_, tables) = page.split_once("\n## Flow and valve\n").expect("the first table");
    let (tables, _) = tables.split_once("\n## Parameters").expect("the end of the last table");
    let first_cells = tables.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    first_cells.filter(|cell| *cell != "name").flat_map(names_of_a_row).collect()
}

/// The first name of a row, and those that differ from it in their last word.
fn names_of_a_row(cell: &str) -> Vec<String> {
    let (first, others) = cell.split_once(", ").unwrap_or((cell, ""));
    let stem = first.rsplit_once('-').map_or("", |(stem, _)| stem);
    let others = others.split(", ").filter(|ending| !ending.is_empty());
    std::iter::once(first.to_owned()).chain(others.map(|ending| format!("{stem}{ending}"))).collect()
}

fn keys() -> impl Iterator<Item = (&'static Sheet, &'static EffectKey)> {
    SHEETS.iter().flat_map(|sheet| sheet.keys.iter().map(move |key| (sheet, key)))
}

/// What a key in this unit ends with, as the keys of the rig file do: `_n_per_mm_per_s` of `N/(mm/s)`.
fn ending(unit: Unit) -> String {
    let spelt = unit.name().to_lowercase().replace('%', "percent").replace('/', "_per_").replace(' ', "_");
    // Of 1/s nothing is left before the slash.
    let spelt = spelt.replace(['^', '(', ')'], "").trim_start_matches('1').to_owned();
    if spelt.is_empty() || spelt.starts_with('_') { spelt } else { format!("_{spelt}") }
}

#[test]
fn the_catalogue_has_the_binding_names_in_their_order() {
    let names: Vec<&str> = SHEETS.iter().map(|sheet| sheet.name).collect();
    assert_eq!(names, names_of_the_page());
}

#[test]
fn names_are_kebab_case_and_unique() {
    for (place, sheet) in SHEETS.iter().enumerate() {
        let words = sheet.name.split('-');
        let kebab =
            words.clone().all(|word| !word.is_empty() && word.bytes().all(|b| b.is_ascii_lowercase()));
        assert!(kebab, "{}", sheet.name);
        assert!(SHEETS[..place].iter().all(|other| other.name != sheet.name), "{} twice", sheet.name);
    }
}

#[test]
fn keys_are_unique_in_their_sheet_and_end_with_their_unit() {
    for (sheet, key) in keys() {
        let path = format!("{}.{}", sheet.name, key.name);
        let snake = key.name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        assert!(snake, "{path}");
        assert!(key.name.ends_with(&ending(key.unit)), "{path}: end with {}", ending(key.unit));
        assert_eq!(sheet.keys.iter().filter(|other| other.name == key.name).count(), 1, "{path} twice");
    }
}

#[test]
fn a_key_without_a_unit_does_not_look_as_if_it_had_one() {
    let units = keys().map(|(_, key)| ending(key.unit)).filter(|ending| !ending.is_empty());
    let units: Vec<String> = units.collect();
    for (sheet, key) in keys().filter(|(_, key)| key.unit == Unit::One) {
        assert!(!units.iter().any(|unit| key.name.ends_with(unit.as_str())), "{}.{}", sheet.name, key.name);
    }
}

#[test]
fn what_is_drawn_lies_in_what_a_file_may_hold() {
    for (sheet, key) in keys() {
        let path = format!("{}.{}", sheet.name, key.name);
        let [low, high] = key.drawn;
        assert!(key.min < key.max && key.min.is_finite() && key.max.is_finite(), "{path}");
        assert!(0.0 <= low && low < high && key.min <= low && high <= key.max, "{path}: {low} to {high}");
        assert!(!key.signed || key.min <= -high, "{path}: the other sign of {high} must be allowed");
    }
}

#[test]
fn a_file_may_hold_every_default() {
    for (sheet, key) in keys() {
        if let Some(default) = key.default {
            assert!((key.min..=key.max).contains(&default), "{}.{}: {default}", sheet.name, key.name);
        }
    }
}

#[test]
fn neutral_values_can_be_written_or_are_limits() {
    for (sheet, key) in keys() {
        let Some(neutral) = key.neutral else { continue };
        // v_s = 0 is the baseline as a limit: the law divides by it.
        let limit = neutral.is_infinite() || sheet.name == "stribeck-friction";
        let path = format!("{}.{}", sheet.name, key.name);
        assert!(limit || (key.min..=key.max).contains(&neutral), "{path}: {neutral}");
        assert!(!limit || !(key.min..=key.max).contains(&neutral), "{path}: {neutral} is no limit");
    }
}

#[test]
fn every_amplitude_can_go_to_nothing() {
    for sheet in SHEETS {
        // Two poles in place of one: no natural frequency makes them the baseline's lag of 1.6 ms.
        if sheet.name == "spool-second-order" {
            continue;
        }
        assert!(sheet.keys[0].neutral.is_some(), "{}: its first key is its amplitude", sheet.name);
    }
}

#[test]
fn an_amplitude_is_drawn_away_from_nothing() {
    for sheet in SHEETS {
        let key = &sheet.keys[0];
        // An effect that re-values a number of the file is drawn on both sides of it.
        let is_revalued = ["dead-volume", "coupling-backlash", "coupling-compliance"].contains(&sheet.name);
        if let Some(neutral) = key.neutral.filter(|_| !is_revalued) {
            let [low, high] = key.drawn;
            assert!(neutral < low || high < neutral, "{}.{} may be drawn as nothing", sheet.name, key.name);
        }
    }
}

#[test]
fn every_sheet_says_what_where_from_and_how_much() {
    for sheet in SHEETS {
        assert!(!sheet.keys.is_empty(), "{}", sheet.name);
        assert!(!sheet.law.trim().is_empty(), "{}: no law", sheet.name);
        assert!(!sheet.source.trim().is_empty(), "{}: no source", sheet.name);
        assert!(!sheet.place.places().is_empty(), "{}", sheet.name);
    }
    for (sheet, key) in keys() {
        assert!(!key.meaning.trim().is_empty(), "{}.{}", sheet.name, key.name);
    }
}
