//! Reads a rig file against the table of parameters, and says where and what is wrong.
//!
//! The reader keeps the place of every key, so that a message names file, line, key, value and allowed range:
//! what a person needs to repair the file without opening the code.

use std::collections::BTreeMap;
use std::path::Path;

use settings::{Section, Source};

use super::table::{KEYS, Key, Unit};
use super::{declared, switched, tabulated};
use crate::effects::declared::Declared;
use crate::effects::sheet::ActiveEffect;
use crate::effects::tabulated::Tabulated;

/// Why a rig file is refused: the place, the key, the value and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ParameterError(String);

impl ParameterError {
    /// Of a line, from 1, of a file.
    pub(super) fn at(file: &str, line: usize, message: &str) -> Self {
        ParameterError(format!("{file}:{line}: {message}"))
    }

    pub(crate) fn of_term(name: &str, message: &str) -> Self {
        ParameterError(format!("term {name}: {message}"))
    }
}

impl From<settings::SettingsError> for ParameterError {
    fn from(error: settings::SettingsError) -> Self {
        ParameterError(error.to_string())
    }
}

/// One value as read: the numbers in the file's unit, the text and the line for messages.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) numbers: Vec<f64>,
    pub(super) text: String,
    pub(super) line: usize,
}

/// All values of a rig file in the file's units, each checked against its key.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entries {
    pub(super) file: String,
    pub(super) effects: Vec<ActiveEffect>,
    pub(super) tabulated: Vec<Tabulated>,
    pub(super) terms: Vec<Declared>,
    entries: BTreeMap<(&'static str, &'static str), Entry>,
}

impl Entries {
    /// Reads the whole file; unknown, missing, mistyped and out-of-range keys are errors.
    pub(super) fn read(text: &str, file: &str) -> Result<Self, ParameterError> {
        let source = Source::parse(text, Path::new(file))?;
        let mut root = source.root();
        let mut tables: Vec<&str> = KEYS.iter().map(|key| key.table).collect();
        tables.dedup();
        root.allow(&[&tables[..], &["effects", "tables", "tabulated", "terms"]].concat())?;
        let mut entries = BTreeMap::new();
        for table in tables {
            let section = root.section_or_empty(table)?;
            let keys: Vec<&Key> = KEYS.iter().filter(|key| key.table == table).collect();
            section.allow(&keys.iter().map(|key| key.name).collect::<Vec<_>>())?;
            for key in keys {
                entries.insert((key.table, key.name), read_key(&section, key, file)?);
            }
        }
        let effects = switched::read(&mut root)?;
        let tabulated = tabulated::read(&mut root)?;
        let terms = if root.has("terms") { declared::read(text, file, "terms")? } else { Vec::new() };
        Ok(Entries { file: file.to_owned(), effects, tabulated, terms, entries })
    }

    /// The entry of a key of the table.
    ///
    /// # Panics
    /// If the table holds no such key: a typing error in this crate.
    pub(super) fn entry(&self, table: &str, name: &str) -> &Entry {
        let key = KEYS.iter().find(|key| key.table == table && key.name == name);
        let key = key.unwrap_or_else(|| panic!("{table}.{name} is not in the table of parameters"));
        &self.entries[&(key.table, key.name)]
    }

    /// The value of a single-number key, in SI.
    pub(super) fn si(&self, table: &str, name: &str) -> f64 {
        self.si_points(table, name)[0]
    }

    /// The values of a key, in SI.
    pub(super) fn si_points(&self, table: &str, name: &str) -> Vec<f64> {
        let key = KEYS.iter().find(|key| key.table == table && key.name == name);
        let unit = key.map_or(Unit::One, |key| key.unit);
        self.entry(table, name).numbers.iter().map(|number| unit.to_si(*number)).collect()
    }

    /// The same rig with one key changed, in the file's unit.
    pub(super) fn with(&self, path: &str, numbers: &[f64]) -> Result<Self, ParameterError> {
        let text = match numbers {
            [one] => format!("{one}"),
            many => format!("{many:?}"),
        };
        let Some(key) = KEYS.iter().find(|key| key.path() == path) else {
            let known = KEYS.iter().map(Key::path).collect::<Vec<_>>().join(", ");
            let message = format!("unknown key {path} = {text}; known here: {known}");
            return Err(ParameterError::at(&self.file, 0, &message));
        };
        let line = self.entries[&(key.table, key.name)].line;
        let entry = Entry { numbers: numbers.to_vec(), text, line };
        check_range(key, &entry, &self.file)?;
        let mut changed = self.clone();
        changed.entries.insert((key.table, key.name), entry);
        Ok(changed)
    }
}

impl Entries {
    /// The same rig with an effect switched on, by a file of its own that says so.
    pub(super) fn with_effect(
        &self,
        name: &str,
        place: &str,
        numbers: &[(&str, f64)],
    ) -> Result<Self, ParameterError> {
        // TOML writes NaN in small letters.
        let written = |number: f64| if number.is_nan() { "nan".to_owned() } else { format!("{number:?}") };
        let keys: String =
            numbers.iter().map(|(key, number)| format!("{key} = {}\n", written(*number))).collect();
        let text = format!("[effects.{name}.{place}]\n{keys}");
        self.with_effects_of(&text, &self.file)
    }

    /// The same rig with these tables and no others, by a file of their own that says so.
    pub(super) fn with_tabulated(&self, tables: &[Tabulated]) -> Result<Self, ParameterError> {
        let text: String = tables.iter().map(Tabulated::toml).collect();
        let source = Source::parse(&text, Path::new(&self.file))?;
        let tabulated = tabulated::read(&mut source.root())?;
        Ok(Entries { tabulated, ..self.clone() })
    }

    /// The same rig with the effects and declared terms of a file that holds nothing else; they replace those of the same name
    /// and place.
    pub(super) fn with_effects_of(&self, text: &str, file: &str) -> Result<Self, ParameterError> {
        let source = Source::parse(text, Path::new(file))?;
        let mut root = source.root();
        root.allow(&["effects", "tables", "terms"])?;
        let mut changed = self.clone();
        for effect in switched::read(&mut root)? {
            changed.effects.retain(|old| old.name != effect.name || old.place != effect.place);
            changed.effects.push(effect);
        }
        switched::sort(&mut changed.effects);
        if root.has("terms") {
            declared::read(text, file, "terms")?.into_iter().for_each(|term| changed.put_term(term));
        }
        Ok(changed)
    }

    /// Adds a declared term, in place of one of the same name and place.
    pub(super) fn put_term(&mut self, term: Declared) {
        match self.terms.iter_mut().find(|known| known.is_same(&term)) {
            Some(known) => *known = term,
            None => self.terms.push(term),
        }
    }
}

fn read_key(section: &Section<'_>, key: &Key, file: &str) -> Result<Entry, ParameterError> {
    let numbers = match key.count {
        1 => section.peek_number(key.name).map(|number| vec![number]),
        count => section.peek_numbers(key.name).filter(|numbers| numbers.len() == count),
    };
    let numbers = numbers.ok_or_else(|| section.refused(key.name, &format!("allowed is {}", key.range())))?;
    let entry = Entry { numbers, text: section.written(key.name), line: section.line_of(key.name) };
    check_range(key, &entry, file)?;
    Ok(entry)
}

fn check_range(key: &Key, entry: &Entry, file: &str) -> Result<(), ParameterError> {
    let whole = |value: f64| key.unit != Unit::Bits || value == value.trunc();
    // Written so that a NaN, which TOML admits, fails.
    let good = |value: &f64| *value >= key.min && *value <= key.max && whole(*value);
    if entry.numbers.len() == key.count && entry.numbers.iter().all(good) {
        return Ok(());
    }
    let message = format!("{key} = {} is out of range; allowed: {}", entry.text, key.range());
    Err(ParameterError::at(file, entry.line, &message))
}
