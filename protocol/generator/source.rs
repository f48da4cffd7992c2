//! The text of a DBC file and where in it things stand, so that every refusal can name file and line.
//!
//! `can-dbc` reports the place of a syntax error only; messages and signals are looked up again in the text here. That also
//! catches an identifier beyond 16 bits, which `can-dbc` 10 cuts short without a word.

use can_dbc::{Dbc, DbcError};

/// A DBC file: name for messages, and text.
pub(crate) struct Source<'a> {
    name: &'a str,
    text: &'a str,
}

impl<'a> Source<'a> {
    pub(crate) fn new(name: &'a str, text: &'a str) -> Self {
        Self { name, text }
    }

    /// The syntax tree; a refusal names file, line and, where it is known, column.
    pub(crate) fn parse(&self) -> Result<Dbc, String> {
        Dbc::try_from(self.text).map_err(|error| match error {
            DbcError::Pest(error) => {
                // The parser's text has " --> file:line:column" in its first line; cargo shows one line of an error.
                let problem = error.variant.message().into_owned();
                let text = error.with_path(self.name).to_string();
                let place = text.lines().next().unwrap_or_default().trim_start_matches([' ', '-', '>']);
                format!("{place}: {problem}")
            }
            DbcError::InvalidFloat(ref part)
            | DbcError::InvalidInt(ref part)
            | DbcError::InvalidUint(ref part)
            | DbcError::InvalidNumericValue(ref part)
            | DbcError::UnknownMultiplexIndicator(ref part) => {
                self.at(self.line_with(part), &error.to_string())
            }
            DbcError::MessageIdOutOfRange(id) => self.at(self.line_with(&id.to_string()), &error.to_string()),
            other => self.at(None, &other.to_string()),
        })
    }

    /// `file:line: problem`.
    pub(crate) fn at(&self, line: Option<usize>, problem: &str) -> String {
        match line {
            Some(line) => format!("{}:{line}: {problem}", self.name),
            None => format!("{}: {problem}", self.name),
        }
    }

    /// Line of `BO_ id name:`.
    pub(crate) fn message_line(&self, id: u64, name: &str) -> Option<usize> {
        self.line(|words| match words {
            ["BO_", number, word, ..] => number.parse() == Ok(id) && word.trim_end_matches(':') == name,
            _ => false,
        })
    }

    /// Line of `BO_ … name:`, whatever the identifier.
    pub(crate) fn message_name_line(&self, name: &str) -> Option<usize> {
        self.line(|words| words.len() > 2 && words[0] == "BO_" && words[2].trim_end_matches(':') == name)
    }

    /// Line of the signal `name` of the message in `message_line`.
    pub(crate) fn signal_line(&self, message_line: usize, name: &str) -> Option<usize> {
        let is_signal =
            |line: &str| line.split_whitespace().take(2).map(|w| w.trim_end_matches(':')).eq(["SG_", name]);
        self.text.lines().skip(message_line).position(is_signal).map(|offset| message_line + offset + 1)
    }

    /// Line whose first word is `keyword` and whose second is `name`.
    pub(crate) fn keyword_line(&self, keyword: &str, name: &str) -> Option<usize> {
        self.line(|words| words.starts_with(&[keyword, name]))
    }

    fn line(&self, matches: impl Fn(&[&str]) -> bool) -> Option<usize> {
        let words = |line: &'a str| line.split_whitespace().collect::<Vec<_>>();
        self.text.lines().position(|line| matches(&words(line))).map(|index| index + 1)
    }

    fn line_with(&self, part: &str) -> Option<usize> {
        self.text.lines().position(|line| line.contains(part)).map(|index| index + 1)
    }
}
