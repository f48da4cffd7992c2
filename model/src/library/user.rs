//! Libraries that a user keeps in files, and what `use` names.
//!
//! A library that ships is bound in tests; one of a user is checked as it is read: each name in its expressions is a variable, a
//! number, a state, a memory or a friction of its own, so that none means something of the model that uses it by chance.

use super::{Entry, Library, PLACE, library, names};
use expression::compile::RESERVED;
use settings::{Result, Source};
use std::borrow::Cow;
use std::path::Path;

/// A suspect with its library.
#[derive(Clone, Debug)]
pub struct LibrarySuspect {
    /// The library that has it.
    pub library: Cow<'static, Library>,
    place: usize,
}

impl LibrarySuspect {
    /// The suspect in its library.
    #[must_use]
    pub fn entry(&self) -> &Entry {
        &self.library.entries[self.place]
    }
}

impl Library {
    /// What `use` of a file in this folder names: LIBRARY/SUSPECT of those that ship, or PATH.toml/SUSPECT of a file of the user,
    /// relative to the folder.
    ///
    /// # Errors
    /// What is allowed, or what is wrong with the file.
    pub fn find(used: &str, folder: &Path) -> Result<LibrarySuspect, String> {
        let (name, suspect) = used.rsplit_once('/').unwrap_or((used, ""));
        let library = if name.ends_with(".toml") {
            Cow::Owned(Self::of_user(name, &folder.join(name))?)
        } else {
            let all = Self::all();
            Cow::Borrowed(all.iter().find(|one| one.name == name).ok_or_else(|| {
                let known: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
                format!(
                    "'{name}' is no library; allowed is LIBRARY/SUSPECT, of {}, or FILE.toml/SUSPECT of a library of yours",
                    known.join(", ")
                )
            })?)
        };
        let Some(place) = library.entries.iter().position(|entry| entry.name == suspect) else {
            let known: Vec<&str> = library.entries.iter().map(|entry| entry.name.as_str()).collect();
            return Err(format!("'{suspect}' is not in {name}; it has {}", known.join(", ")));
        };
        Ok(LibrarySuspect { library, place })
    }

    /// Reads a library that a user keeps in a file.
    ///
    /// # Errors
    /// File and line, and what is wrong there.
    pub fn of_user(name: &str, file: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(file).map_err(|why| format!("{}: {why}", file.display()))?;
        let checked = library(name, &text, file).and_then(|library| library.checked(&text, file));
        checked.map_err(|error| error.to_string())
    }

    /// Checks that each name in its expressions is one of its own. Those that ship are bound in tests.
    fn checked(self, text: &str, file: &Path) -> Result<Self> {
        let source = Source::parse(text, file)?;
        let refused = |name: &str, of: &str, why: &str| {
            let at = text.find(&format!("\"{of}\"")).or_else(|| text.find(of)).unwrap_or(0);
            Err(source.wrong_from(at, &format!("{of}: '{name}' {why}")))
        };
        for (place, variable) in self.variables.iter().enumerate() {
            let above = |name: &String| self.variables[..place].iter().any(|other| other.name == *name);
            let default = names(variable.default.as_deref().unwrap_or_default());
            if let Some(name) = default.iter().find(|name| !above(name) && !RESERVED.contains(&name.as_str()))
            {
                return refused(name, &variable.name, "is no variable above it: a default is over these");
            }
        }
        for (place, entry) in self.entries.iter().enumerate() {
            if self.entries[..place].iter().any(|other| other.name == entry.name) {
                return refused(&entry.name, &entry.name, "stands twice in this library");
            }
            let variable = |name: &str| self.variables.iter().any(|one| one.name == name);
            let is_known = |name: &String| {
                name == PLACE || RESERVED.contains(&name.as_str()) || variable(name) || entry.defines(name)
            };
            let mut used = entry.texts().into_iter().flat_map(names);
            if let Some(name) = used.find(|name| !is_known(name)) {
                return refused(
                    &name,
                    &entry.name,
                    "is no variable of the library and no number of the suspect",
                );
            }
            if let Some(one) = entry.frictions.iter().find(|one| !variable(&one.velocity)) {
                return refused(
                    &one.velocity,
                    &entry.name,
                    "is no variable: friction holds one that is bound to a state",
                );
            }
        }
        Ok(self)
    }
}
