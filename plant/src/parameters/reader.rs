//! Reads a rig file against the table of parameters, and says where and what is wrong.
//!
//! The reader keeps the place of every key, so that a message names file, line, key, value and allowed range:
//! what a person needs to repair the file without opening the code.

use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::table::{KEYS, Key, Unit};
use super::{declared, switched, tabulated};
use crate::effects::declared::Declared;
use crate::effects::sheet::Switched;
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

    /// Of a declared term.
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
    pub(super) effects: Vec<Switched>,
    pub(super) tabulated: Vec<Tabulated>,
    pub(super) terms: Vec<Declared>,
    entries: BTreeMap<(&'static str, &'static str), Entry>,
}

impl Entries {
    /// Reads the whole file; unknown, missing, mistyped and out-of-range keys are errors.
    pub(super) fn read(text: &str, file: &str) -> Result<Self, ParameterError> {
        let place = Place { text, file };
        let root = place.parse()?;
        place.refuse_unknown(root.get_ref())?;
        let mut entries = BTreeMap::new();
        for key in KEYS {
            entries.insert((key.table, key.name), place.read_key(root.get_ref(), key)?);
        }
        let effects = switched::read(root.get_ref(), &place)?;
        let tabulated = tabulated::read(root.get_ref(), &place)?;
        let terms = if root.get_ref().contains_key("terms") {
            declared::read(text, file, "terms")?
        } else {
            Vec::new()
        };
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
        let place = Place { text: &text, file: &self.file };
        let tabulated = tabulated::read(place.parse()?.get_ref(), &place)?;
        Ok(Entries { tabulated, ..self.clone() })
    }

    /// The same rig with the effects and declared terms of a file that holds nothing else; they replace those of the same name
    /// and place.
    pub(super) fn with_effects_of(&self, text: &str, file: &str) -> Result<Self, ParameterError> {
        let in_file = Place { text, file };
        let root = in_file.parse()?;
        let is_known = |name: &str| ["effects", "tables", "terms"].contains(&name);
        if let Some((name, value)) = root.get_ref().iter().find(|(name, _)| !is_known(name.get_ref())) {
            return Err(in_file.unknown(name, name.get_ref(), value, "effects, tables, terms"));
        }
        let mut changed = self.clone();
        for effect in switched::read(root.get_ref(), &in_file)? {
            changed.effects.retain(|old| old.name != effect.name || old.place != effect.place);
            changed.effects.push(effect);
        }
        switched::sort(&mut changed.effects);
        if root.get_ref().contains_key("terms") {
            declared::read(text, file, "terms")?.into_iter().for_each(|term| changed.put_term(term));
        }
        Ok(changed)
    }

    /// Adds a declared term, in place of one of the same name and place.
    pub(super) fn put_term(&mut self, term: Declared) {
        match self.terms.iter_mut().find(|own| own.is_same(&term)) {
            Some(own) => *own = term,
            None => self.terms.push(term),
        }
    }
}

/// Text and name of the file being read.
pub(super) struct Place<'t> {
    text: &'t str,
    file: &'t str,
}

impl<'t> Place<'t> {
    fn parse(&self) -> Result<Spanned<DeTable<'t>>, ParameterError> {
        DeTable::parse(self.text).map_err(|error| {
            let line = self.line(error.span().map_or(0, |span| span.start));
            self.refused(line, &format!("not TOML: {}", error.message()))
        })
    }
}

impl Place<'_> {
    pub(super) fn line(&self, offset: usize) -> usize {
        settings::line_of(self.text, offset)
    }

    /// The value as the file writes it.
    fn written(&self, value: &Spanned<DeValue<'_>>) -> String {
        settings::written(self.text, value.span())
    }

    fn refused(&self, line: usize, message: &str) -> ParameterError {
        ParameterError::at(self.file, line, message)
    }

    /// A key or table that no rig has, `key` in the file and `path` in full.
    pub(super) fn unknown<T>(
        &self,
        key: &Spanned<T>,
        path: &str,
        value: &Spanned<DeValue<'_>>,
        known: &str,
    ) -> ParameterError {
        let message = format!("unknown key {path} = {}; known here: {known}", self.written(value));
        self.refused(self.line(key.span().start), &message)
    }

    /// A key that is not there, in a table that starts in this line.
    pub(super) fn missing(&self, line: usize, path: &str, range: &str) -> ParameterError {
        let message = format!("key {path} is missing from the table that starts here; allowed: {range}");
        self.refused(line, &message)
    }

    /// A value of the wrong type.
    pub(super) fn wrong(&self, path: &str, value: &Spanned<DeValue<'_>>, range: &str) -> ParameterError {
        self.of_value(path, value, &format!("is of the wrong type; allowed: {range}"))
    }

    pub(super) fn out_of_range(
        &self,
        path: &str,
        value: &Spanned<DeValue<'_>>,
        range: &str,
    ) -> ParameterError {
        self.of_value(path, value, &format!("is out of range; allowed: {range}"))
    }

    /// What is said of a value, behind it.
    pub(super) fn of_value(&self, path: &str, value: &Spanned<DeValue<'_>>, message: &str) -> ParameterError {
        self.refused(self.line(value.span().start), &format!("{path} = {} {message}", self.written(value)))
    }

    fn refuse_unknown(&self, root: &DeTable<'_>) -> Result<(), ParameterError> {
        let is_key = |name: &str| !["effects", "tables", "tabulated", "terms"].contains(&name);
        for (name, value) in root.iter().filter(|(name, _)| is_key(name.get_ref())) {
            let known: Vec<&str> =
                KEYS.iter().filter(|key| key.table == name.get_ref()).map(|key| key.name).collect();
            if known.is_empty() {
                let mut tables: Vec<&str> = KEYS.iter().map(|key| key.table).collect();
                tables.dedup();
                return Err(self.unknown(name, name.get_ref(), value, &tables.join(", ")));
            }
            for (inner, value) in value.get_ref().as_table().into_iter().flatten() {
                if !known.iter().any(|known| known == inner.get_ref()) {
                    let path = format!("{}.{}", name.get_ref(), inner.get_ref());
                    return Err(self.unknown(inner, &path, value, &known.join(", ")));
                }
            }
        }
        Ok(())
    }

    fn read_key(&self, root: &DeTable<'_>, key: &Key) -> Result<Entry, ParameterError> {
        let table = root.iter().find(|(name, _)| name.get_ref() == key.table);
        let value =
            table.and_then(|(_, table)| table.get_ref().as_table()).and_then(|table| table.get(key.name));
        let Some(value) = value else {
            let line = table.map_or(1, |(name, _)| self.line(name.span().start));
            return Err(self.missing(line, &key.path(), &key.range()));
        };
        let numbers = match value.get_ref() {
            DeValue::Array(items) => items.iter().map(|item| settings::number(item.get_ref())).collect(),
            single => settings::number(single).map(|number| vec![number]),
        };
        let is_array = matches!(value.get_ref(), DeValue::Array(_));
        match numbers {
            Some(numbers) if numbers.len() == key.count && is_array == (key.count > 1) => {
                let (text, line) = (self.written(value), self.line(value.span().start));
                let entry = Entry { numbers, text, line };
                check_range(key, &entry, self.file)?;
                Ok(entry)
            }
            _ => Err(self.wrong(&key.path(), value, &key.range())),
        }
    }
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
