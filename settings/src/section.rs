//! A table of a TOML file, read key by key: what is wrong is reported with file, line, key, value and what is allowed.
//!
//! Every number is checked against a [`Parameter`]. A key that nobody asked for is refused by [`Section::finish`], which names
//! those that were asked for.

use crate::number;
use crate::parameters::{Parameter, ParameterSet};
use crate::source::{Result, SettingsError, Source};
use crate::spelling::nearest;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A text with the line that it stands in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// What is written.
    pub text: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// Byte of the file at which it begins; that of its value where it has escapes.
    pub at: usize,
}

/// One table of a [`Source`].
pub struct Section<'a> {
    source: &'a Source<'a>,
    path: String,
    table: &'a DeTable<'a>,
    at: usize,
    asked: Vec<String>,
}

impl<'a> Section<'a> {
    pub(crate) fn new(source: &'a Source<'a>, path: String, table: &'a DeTable<'a>, at: usize) -> Self {
        Self { source, path, table, at, asked: Vec::new() }
    }

    /// Its keys, in the order of the file. They are not marked as known.
    #[must_use]
    pub fn keys(&self) -> Vec<String> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().to_string()).collect()
    }

    /// The numbers listed under `key`, or the one that stands there; none when it is absent.
    ///
    /// # Errors
    /// No finite number, and no list of them.
    pub fn numbers(&mut self, key: &str) -> Result<Vec<f64>> {
        let Some(value) = self.value(key) else { return Ok(Vec::new()) };
        let finite =
            |value: &Spanned<DeValue<'_>>| number(value.get_ref()).filter(|number| number.is_finite());
        let all = match value.get_ref().as_array() {
            Some(list) => list.iter().map(finite).collect(),
            None => finite(value).map(|number| vec![number]),
        };
        all.ok_or_else(|| self.refused(key, "allowed is a finite number, or a list of them"))
    }

    /// The finite number under `key`, of any range; `None` when it is absent.
    ///
    /// # Errors
    /// No finite number.
    pub fn finite(&mut self, key: &str) -> Result<Option<f64>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let finite = number(value.get_ref()).filter(|number| number.is_finite());
        finite.map(Some).ok_or_else(|| self.refused(key, "allowed is a finite number"))
    }

    /// The whole number under `key`, from the least to the most; `None` when it is absent.
    ///
    /// # Errors
    /// No integer, or out of range.
    pub fn whole(&mut self, key: &str, [least, most]: [u64; 2]) -> Result<Option<u64>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let digits = value.get_ref().as_integer();
        let whole = digits.and_then(|digits| u64::from_str_radix(digits.as_str(), digits.radix()).ok());
        whole
            .filter(|whole| (least..=most).contains(whole))
            .map(Some)
            .ok_or_else(|| self.refused(key, &format!("allowed is a whole number, {least} to {most}")))
    }

    /// Whether `key` is set to true; false when it is absent.
    ///
    /// # Errors
    /// Neither true nor false.
    pub fn flag(&mut self, key: &str) -> Result<bool> {
        let Some(value) = self.value(key) else { return Ok(false) };
        value.get_ref().as_bool().ok_or_else(|| self.refused(key, "allowed is true or false"))
    }

    /// The values of the list under `key`, as they stand; `None` when it is absent.
    ///
    /// # Errors
    /// No list.
    pub fn list(&mut self, key: &str) -> Result<Option<&'a [Spanned<DeValue<'a>>]>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let list = value.get_ref().as_array().map(|list| Some(&list[..]));
        list.ok_or_else(|| self.refused(key, "allowed is a list"))
    }

    /// The texts listed under `key`; none when it is absent.
    ///
    /// # Errors
    /// No list of texts.
    pub fn texts(&mut self, key: &str) -> Result<Vec<String>> {
        let list = self.list(key)?.unwrap_or_default();
        let texts = list.iter().map(|item| item.get_ref().as_str().map(String::from)).collect::<Option<_>>();
        texts.ok_or_else(|| self.refused(key, "allowed is a list of texts"))
    }

    /// Byte of the file at which the value under `key` begins; that of the table when it is absent.
    #[must_use]
    pub fn at(&self, key: &str) -> usize {
        self.entry(key).map_or(self.at, |value| value.span().start)
    }

    /// Whether the key is there. It is not marked as known.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    /// The text under `key`; `None` when absent or no text. The key is not marked as known.
    #[must_use]
    pub fn peek(&self, key: &str) -> Option<&str> {
        self.entry(key).and_then(|value| value.get_ref().as_str())
    }

    /// The number under `key`; `None` when absent or no number. The key is not marked as known.
    #[must_use]
    pub fn peek_number(&self, key: &str) -> Option<f64> {
        self.entry(key).and_then(|value| number(value.get_ref()))
    }

    /// The numbers listed under `key`; `None` when absent or no list of numbers. The key is not marked as known.
    #[must_use]
    pub fn peek_numbers(&self, key: &str) -> Option<Vec<f64>> {
        self.entry(key)?.get_ref().as_array()?.iter().map(|item| number(item.get_ref())).collect()
    }

    /// The value under `key` as it is written, on one line and cut; empty when it is absent.
    #[must_use]
    pub fn written(&self, key: &str) -> String {
        self.entry(key).map_or_else(String::new, |value| self.source.written(value.span()))
    }

    /// Its name with those of the tables around it, such as `drive.change[1]`; empty for the whole file.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Line of the value under `key`, from 1; that of the table when it is absent.
    #[must_use]
    pub fn line_of(&self, key: &str) -> usize {
        self.source.line(self.at(key))
    }

    /// Line in which the table begins, from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.source.line(self.at)
    }

    /// The number of this parameter, in its range; `None` when the key is absent.
    ///
    /// # Errors
    /// No number, or out of range.
    pub fn number(&mut self, parameter: &Parameter) -> Result<Option<f64>> {
        let Some(value) = self.value(&parameter.name) else { return Ok(None) };
        match number(value.get_ref()) {
            Some(number) => {
                parameter.check(number).map(Some).map_err(|error| self.reported(value, &error.to_string()))
            }
            None => {
                let Parameter { name, unit, least, most, .. } = parameter;
                let allowed = format!("allowed is a number, {least} to {most} {unit}");
                Err(self.refused(name, allowed.trim_end()))
            }
        }
    }

    /// The number of this parameter, or its default.
    ///
    /// # Errors
    /// No number, or out of range.
    pub fn number_or_default(&mut self, parameter: &Parameter) -> Result<f64> {
        Ok(self.number(parameter)?.unwrap_or(parameter.default))
    }

    /// The numbers of these parameters, read in the order of their table, each the default where its key is absent.
    ///
    /// # Errors
    /// No number, or out of range.
    pub fn parameters<P: ParameterSet>(&mut self) -> Result<P> {
        let numbers = P::TABLE.iter().map(|parameter| self.number_or_default(parameter));
        Ok(P::of(&numbers.collect::<Result<Vec<_>>>()?))
    }

    /// The number of this parameter, which must be there.
    ///
    /// # Errors
    /// Missing, no number, or out of range.
    pub fn needed_number(&mut self, parameter: &Parameter) -> Result<f64> {
        let Parameter { name, unit, least, most, meaning, .. } = parameter;
        let missing = format!("{name} is missing: {meaning}, {least} to {most} {unit}");
        self.number(parameter)?.ok_or_else(|| self.lacks(missing.trim_end()))
    }

    /// The whole number of this parameter, or its default.
    ///
    /// # Errors
    /// No whole number, or out of range.
    pub fn whole_or_default(&mut self, parameter: &Parameter) -> Result<u32> {
        let number = self.number_or_default(parameter)?;
        if number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number) {
            return Ok(number as u32);
        }
        let message = format!("{} = {number}; allowed is a whole number", parameter.name);
        Err(self.wrong_at(&parameter.name, &message))
    }

    /// The text under `key`; `None` when it is absent.
    ///
    /// # Errors
    /// No text.
    pub fn text(&mut self, key: &str) -> Result<Option<Text>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) => Ok(Some(Text {
                text: text.into(),
                line: self.source.line(value.span().start),
                at: self.source.start_of_text(value, text),
            })),
            None => Err(self.refused(key, "allowed is a text in quotes")),
        }
    }

    /// The text under `key`, which must be there; `meaning` is for the message when it is not.
    ///
    /// # Errors
    /// Missing, or no text.
    pub fn needed_text(&mut self, key: &str, meaning: &str) -> Result<Text> {
        self.text(key)?.ok_or_else(|| self.lacks(&format!("{key} is missing: {meaning}")))
    }

    /// Which of the named choices `key` makes; the first when it is absent.
    ///
    /// # Errors
    /// None of them.
    pub fn choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Result<T> {
        let Some(written) = self.text(key)? else { return Ok(choices[0].1) };
        self.chosen(key, &written.text, choices)
    }

    /// The same of a key that must be there.
    ///
    /// # Errors
    /// Missing, or none of them.
    pub fn needed_choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Result<T> {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let written = self.needed_text(key, &format!("one of {}", names.join(", ")))?;
        self.chosen(key, &written.text, choices)
    }

    /// The named choices listed under `key`; none when it is absent.
    ///
    /// # Errors
    /// No list, or one that holds something else.
    pub fn choices<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Result<Vec<T>> {
        self.texts(key)?.iter().map(|text| self.chosen(key, text, choices)).collect()
    }

    fn chosen<T: Copy>(&self, key: &str, text: &str, choices: &[(&str, T)]) -> Result<T> {
        choices.iter().find(|(name, _)| *name == text).map(|(_, choice)| *choice).ok_or_else(|| {
            let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
            self.wrong_at(key, &format!("{key} = \"{text}\"; allowed is {}", names.join(", ")))
        })
    }

    /// The table under `key`; `None` when it is absent.
    ///
    /// # Errors
    /// No table.
    pub fn section(&mut self, key: &str) -> Result<Option<Self>> {
        self.section_as(key, None)
    }

    /// The same; `example` is how it is written, for the message where something else stands there.
    ///
    /// # Errors
    /// No table.
    pub fn section_as(&mut self, key: &str, example: Option<&str>) -> Result<Option<Self>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        self.inner(self.path_of(key), value, example).map(Some)
    }

    /// The table under `key`; one without keys when it is absent.
    ///
    /// # Errors
    /// No table.
    pub fn section_or_empty(&mut self, key: &str) -> Result<Self> {
        let section = self.section(key)?;
        let empty = || Self::new(self.source, self.path_of(key), &self.source.empty, self.at);
        Ok(section.unwrap_or_else(empty))
    }

    /// The table under `key`, which must be there; `meaning` is for the message when it is not.
    ///
    /// # Errors
    /// Missing, or no table.
    pub fn needed_section(&mut self, key: &str, meaning: &str) -> Result<Self> {
        self.section(key)?.ok_or_else(|| self.lacks(&format!("[{key}] is missing: {meaning}")))
    }

    /// The tables of the list under `key`, each called by its place from 1 on; none when it is absent.
    ///
    /// # Errors
    /// No list of tables.
    pub fn sections(&mut self, key: &str) -> Result<Vec<Self>> {
        let Some(value) = self.value(key) else { return Ok(Vec::new()) };
        let Some(list) = value.get_ref().as_array() else {
            return Err(self.refused(key, &format!("allowed is a list of tables: [[{}]]", self.path_of(key))));
        };
        let path = |place: usize| format!("{}[{place}]", self.path_of(key));
        list.iter().enumerate().map(|(index, item)| self.inner(path(index + 1), item, None)).collect()
    }

    /// The table under `key` as it stands, unread; empty when it is absent.
    ///
    /// # Errors
    /// No table.
    pub fn opaque(&mut self, key: &str) -> Result<toml::Table> {
        let Some(section) = self.section(key)? else { return Ok(toml::Table::new()) };
        // The text parsed before, so its parts do.
        let whole: toml::Table = toml::from_str(self.source.text)
            .map_err(|error| SettingsError(format!("{}: {error}", self.source.file.display())))?;
        let keys = section.path.split('.');
        let found = keys.into_iter().try_fold(whole, |table, key| table.get(key)?.as_table().cloned());
        Ok(found.unwrap_or_default())
    }

    /// A file that the text names, relative to the folder of the file that is read.
    #[must_use]
    pub fn sibling_path(&self, name: &str) -> PathBuf {
        self.source.file.parent().unwrap_or(Path::new("")).join(name)
    }

    /// Refuses keys that nobody asked for.
    ///
    /// # Errors
    /// The first of them.
    pub fn finish(&self) -> Result<()> {
        let asked: Vec<&str> = self.asked.iter().map(String::as_str).collect();
        self.allow(&asked)
    }

    /// Refuses keys that are none of these, before any is read: errors caused by a misspelt table name would be less clear.
    ///
    /// # Errors
    /// The first of them.
    pub fn allow(&self, allowed: &[&str]) -> Result<()> {
        let unknown = |name: &&Spanned<_>| !allowed.iter().any(|allowed| name.get_ref() == allowed);
        let Some(name) = self.table.keys().find(unknown) else { return Ok(()) };
        let path = self.path_of(name.get_ref());
        let meant = nearest(name.get_ref(), allowed)
            .map_or(String::new(), |meant| format!(": did you mean {meant}?"));
        Err(self.source.wrong_from(
            name.span().start,
            &format!("unknown key {path}; allowed is {}{meant}", allowed.join(", ")),
        ))
    }

    /// An error of the whole table.
    #[must_use]
    pub fn wrong(&self, message: &str) -> SettingsError {
        let dot = if self.path.is_empty() { "" } else { "." };
        self.source.wrong_from(self.at, &format!("{}{dot}{message}", self.path))
    }

    /// An error of the value under `key`, which begins with that key.
    #[must_use]
    pub fn wrong_at(&self, key: &str, message: &str) -> SettingsError {
        self.entry(key).map_or_else(|| self.wrong(message), |value| self.reported(value, message))
    }

    /// An error of the value under `key`, which it repeats as it is written before it says what is wrong; or of its absence.
    #[must_use]
    pub fn refused(&self, key: &str, problem: &str) -> SettingsError {
        let Some(value) = self.entry(key) else {
            return self.wrong(&format!("{key} is missing; {problem}"));
        };
        let written = self.source.written(value.span());
        self.reported(value, &format!("{key} = {written}; {problem}"))
    }

    /// The same of one item of the list under `key`, by its place from 0.
    #[must_use]
    pub fn refused_item(&self, key: &str, place: usize, problem: &str) -> SettingsError {
        let item = self.entry(key).and_then(|value| value.get_ref().as_array()?.get(place));
        let Some(item) = item else { return self.refused(key, problem) };
        let written = self.source.written(item.span());
        self.reported(item, &format!("{key} has {written}; {problem}"))
    }

    /// A missing key, with those that are there: it may be one of them, misspelt.
    fn lacks(&self, message: &str) -> SettingsError {
        let keys: Vec<&str> = self.table.keys().map(|name| name.get_ref().as_ref()).collect();
        self.wrong(&format!("{message}; the keys here are {}", keys.join(", ")))
    }

    fn reported(&self, value: &Spanned<DeValue<'_>>, message: &str) -> SettingsError {
        self.source.wrong_from(value.span().start, &self.path_of(message))
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    fn value(&mut self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        if !self.asked.iter().any(|asked| asked == key) {
            self.asked.push(key.into());
        }
        self.entry(key)
    }

    fn entry(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(key)
    }

    fn inner(&self, path: String, value: &'a Spanned<DeValue<'a>>, example: Option<&str>) -> Result<Self> {
        let Some(table) = value.get_ref().as_table() else {
            let example = example.map_or_else(|| format!("[{path}] with its keys below"), str::to_owned);
            let message = match value.get_ref() {
                DeValue::Array(_) => format!("{path} must be a table and no list: write {example}"),
                _ => {
                    let written = self.source.written(value.span());
                    format!("{path} = {written} must be a table: write {example}")
                }
            };
            return Err(self.source.wrong_from(value.span().start, &message));
        };
        Ok(Self::new(self.source, path, table, value.span().start))
    }
}

#[cfg(test)]
mod tests;
