//! A TOML file with the places of what stands in it, for messages.

use crate::{Section, column_of, line_of, written};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A file that cannot be used: file, line, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct SettingsError(pub(crate) String);

impl SettingsError {
    /// A file that cannot be opened or read.
    #[must_use]
    pub fn unreadable(file: &Path, error: &std::io::Error) -> Self {
        Self(format!("cannot read {}: {error}", file.display()))
    }
}

/// What a file says, or its place and what is wrong there.
pub type Result<T, E = SettingsError> = core::result::Result<T, E>;

/// A TOML file that is being read.
pub struct Source<'a> {
    pub(crate) text: &'a str,
    pub(crate) file: &'a Path,
    root: Spanned<DeTable<'a>>,
    /// In place of a table that is left out.
    pub(crate) empty: DeTable<'a>,
    columns: bool,
    holds_secrets: bool,
}

impl<'a> Source<'a> {
    /// Parses `text`; `file` is for messages, and paths in it are relative to its folder.
    ///
    /// # Errors
    /// [`SettingsError`] for what is no TOML.
    pub fn parse(text: &'a str, file: &'a Path) -> Result<Self> {
        Self::new(text, file, false)
    }

    /// The same of a file with secrets: messages quote neither its lines nor a value of the wrong type.
    ///
    /// # Errors
    /// [`SettingsError`] for what is no TOML.
    pub fn parse_with_secrets(text: &'a str, file: &'a Path) -> Result<Self> {
        Self::new(text, file, true)
    }

    fn new(text: &'a str, file: &'a Path, holds_secrets: bool) -> Result<Self> {
        let root = DeTable::parse(text).map_err(|error| {
            let line = line_of(text, error.span().map_or(0, |span| span.start));
            let problem = if holds_secrets { error.message().to_owned() } else { error.to_string() };
            SettingsError(format!("{}:{line}: not TOML: {}", file.display(), problem.trim_end()))
        })?;
        Ok(Self { text, file, root, empty: DeTable::new(), columns: false, holds_secrets })
    }

    /// The same, with messages that name the column after the line.
    #[must_use]
    pub fn with_columns(self) -> Self {
        Self { columns: true, ..self }
    }

    /// The file as it was parsed.
    #[must_use]
    pub fn text(&self) -> &str {
        self.text
    }

    /// The whole file.
    #[must_use]
    pub fn root(&self) -> Section<'_> {
        Section::new(self, String::new(), self.root.get_ref(), 0)
    }

    /// A value as it is written, on one line and cut.
    pub(crate) fn written(&self, span: Range<usize>) -> String {
        if self.holds_secrets { "(not shown)".into() } else { written(self.text, span) }
    }

    pub(crate) fn line(&self, at: usize) -> usize {
        line_of(self.text, at)
    }

    /// An error at a byte of the file.
    #[must_use]
    pub fn wrong_from(&self, at: usize, message: &str) -> SettingsError {
        let (file, line) = (self.file.display(), self.line(at));
        SettingsError(if self.columns {
            format!("{file}:{line}:{}: {message}", column_of(self.text, at))
        } else {
            format!("{file}:{line}: {message}")
        })
    }

    /// Byte at which the text of a value begins: after its quote if it has no escapes, else at the value.
    pub(crate) fn start_of_text(&self, value: &Spanned<DeValue<'_>>, text: &str) -> usize {
        let span = value.span();
        let raw = self.text.get(span.clone()).unwrap_or_default();
        span.start + raw.find(text).filter(|_| !text.is_empty()).unwrap_or(0)
    }
}
