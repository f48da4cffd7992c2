//! Settings files: the one reader of TOML sections, parameters with unit and range, units in names, and places for messages.
//!
//! Texts become types here; callers read the files. A message names file, line, key, value and what is allowed.

#![warn(missing_docs)] // an interface of other crates

pub mod parameters;
mod section;
mod source;
mod spelling;
mod unit;

pub use section::{Section, Text};
pub use source::{Result, SettingsError, Source};
pub use unit::{unit_of, without_unit};

use std::ops::Range;
use toml::Value;
use toml::de::DeValue;

/// Longest value that a message repeats, in characters.
const LONGEST_WRITTEN: usize = 60;

/// Line of a byte of a text, from 1.
#[must_use]
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}

/// Column of a byte of a text in its line, in characters from 1.
#[must_use]
pub fn column_of(text: &str, offset: usize) -> usize {
    let before = text.get(..offset.min(text.len())).unwrap_or_default();
    1 + before.rsplit('\n').next().map_or(0, |line| line.chars().count())
}

/// A part of a text as it is written, on one line and cut to a readable length.
#[must_use]
pub fn written(text: &str, span: Range<usize>) -> String {
    let words = text.get(span).unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
    if words.chars().count() > LONGEST_WRITTEN {
        words.chars().take(LONGEST_WRITTEN - 3).chain("...".chars()).collect()
    } else {
        words
    }
}

/// The number of a value, whole or not; `None` for any other.
#[must_use]
pub fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(integer) => {
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|whole| whole as f64)
        }
        _ => None,
    }
}

/// [`number`] of a value that keeps no place.
#[must_use]
pub fn number_of(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::de::DeTable;

    #[test]
    fn a_place_is_counted_in_lines_from_1_and_beyond_the_end_is_the_last() {
        let text = "a = 1\nb = 2\n\nc = 3";
        assert_eq!([0, 5, 6, 12, 13, 99].map(|offset| line_of(text, offset)), [1, 1, 2, 3, 4, 4]);
        assert_eq!(line_of("", 0), 1);
    }

    #[test]
    fn a_value_is_written_on_one_line_and_cut() {
        let text = "[1,\n  2]";
        assert_eq!(written(text, 0..text.len()), "[1, 2]");
        let long = "ä".repeat(61);
        assert_eq!(written(&long, 0..long.len()), format!("{}...", "ä".repeat(57)));
        assert_eq!(written(text, 3..99), "");
    }

    #[test]
    fn numbers_of_every_spelling_are_read() {
        let text = "a = 1\nb = 0x10\nc = 1_000.5\nd = nan\ne = \"1\"\nf = true";
        let table = DeTable::parse(text).expect("TOML");
        let of = |key: &str| number(table.get_ref().get(key).expect("there").get_ref());
        assert_eq!(
            [of("a"), of("b"), of("c"), of("e"), of("f")],
            [Some(1.0), Some(16.0), Some(1000.5), None, None]
        );
        assert!(of("d").is_some_and(f64::is_nan));
        let table: toml::Table = text.parse().expect("TOML");
        assert_eq!(
            ["a", "b", "c", "e"].map(|key| number_of(&table[key])),
            [Some(1.0), Some(16.0), Some(1000.5), None]
        );
    }
}
