//! `emulator effects`: the catalogue as text, or as JSON.
//!
//! All names and ranges come from the data sheets of the effects.

use crate::cli::EffectsArguments;
use plant::effects::SHEETS;
use plant::effects::sheet::{EffectKey, Group, PlaceKind, Sheet};
use runlog::run_folder::SCHEMA_VERSION;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Line width of sentences.
const WIDTH: usize = 100;

pub(crate) fn text(arguments: &EffectsArguments) -> String {
    if arguments.json {
        serde_json::to_string_pretty(&as_json()).unwrap_or_default()
    } else {
        SHEETS.iter().map(as_text).collect::<Vec<_>>().join("\n")
    }
}

fn as_text(sheet: &Sheet) -> String {
    let mut text = format!("{}\n", sheet.name);
    let mut put = |head: &str, words: &str| {
        for (i, line) in broken(words).iter().enumerate() {
            let head = if i == 0 { head } else { "" };
            let _ = writeln!(text, "  {head:<8}{line}");
        }
    };
    put("at", &sheet.place.names().join(", "));
    put("law", sheet.law);
    for key in sheet.keys {
        let unit = key.unit.name();
        let default =
            key.default.map_or_else(|| "no default".to_owned(), |value| format!("default {value} {unit}"));
        let sign = if key.signed { "either sign of " } else { "" };
        let [least, most] = key.drawn;
        let drawn = format!("drawn from {sign}{least} to {most} {unit}");
        let words =
            format!("{}: {}; {}; {}; {}", key.name, key.meaning, key.range(), default.trim(), drawn.trim());
        put("number", &words);
    }
    put("source", sheet.source);
    text
}

/// The words in lines of at most [`WIDTH`] characters.
fn broken(words: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > 0 && line + 1 + word.chars().count() > WIDTH {
            lines.push(String::new());
        }
        let line = lines.last_mut().expect("there is a first one");
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines
}

fn as_json() -> Value {
    let effects: Vec<Value> = SHEETS.iter().map(effect).collect();
    json!({ "schema_version": SCHEMA_VERSION, "effects": effects })
}

fn effect(sheet: &Sheet) -> Value {
    json!({
        "effect": sheet.name,
        "group": match sheet.group {
            Group::Flow => "flow",
            Group::Chamber => "chamber",
            Group::Motion => "motion",
            Group::Sensor => "sensor",
        },
        "place": match sheet.place {
            PlaceKind::Axis => "axis",
            PlaceKind::Chamber => "chamber",
            PlaceKind::Channel => "channel",
            PlaceKind::Linkage => "linkage",
            PlaceKind::Supply => "supply",
        },
        "places": sheet.place.names(),
        "law": sheet.law,
        "source": sheet.source,
        "keys": sheet.keys.iter().map(number).collect::<Vec<_>>(),
    })
}

fn number(key: &EffectKey) -> Value {
    json!({
        "key": key.name,
        "unit": key.unit.name(),
        "min": key.min,
        "max": key.max,
        "drawn": key.drawn,
        "signed": key.signed,
        "default": key.default,
        // An infinite neutral value, which JSON cannot hold: no number in the range gives the baseline.
        "neutral": key.neutral.filter(|value| value.is_finite()),
        "meaning": key.meaning,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_tells_of_every_effect_its_places_numbers_law_and_source() {
        for sheet in SHEETS {
            let text = as_text(sheet).split_whitespace().collect::<Vec<_>>().join(" ");
            let mut wanted = vec![sheet.name.to_owned(), sheet.law.to_owned(), sheet.source.to_owned()];
            wanted.extend(sheet.place.names());
            wanted.extend(
                sheet.keys.iter().flat_map(|key| [key.name.to_owned(), key.range(), key.meaning.to_owned()]),
            );
            for words in wanted {
                let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
                assert!(text.contains(&words), "'{words}' is not in: {text}");
            }
        }
    }

    #[test]
    fn the_json_holds_every_effect_with_numbers_where_it_has_some() {
        let json = as_json();
        let effects = json["effects"].as_array().unwrap();
        assert_eq!(effects.len(), SHEETS.len());
        for (effect, sheet) in effects.iter().zip(SHEETS) {
            assert_eq!(effect["effect"], sheet.name);
            for (number, key) in effect["keys"].as_array().unwrap().iter().zip(sheet.keys) {
                assert_eq!(number["min"], key.min);
                assert_eq!(number["drawn"][1], key.drawn[1]);
                assert_eq!(number["default"].as_f64(), key.default);
            }
        }
    }

    #[test]
    fn no_line_is_wider_than_a_screen() {
        for line in
            SHEETS.iter().flat_map(|sheet| as_text(sheet).lines().map(str::to_owned).collect::<Vec<_>>())
        {
            assert!(line.chars().count() <= WIDTH + 10, "{line}");
        }
    }
}
