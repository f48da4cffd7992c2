//! Small files of the kernel below a root: their text, or why there is none.

use std::fs;
use std::path::{Path, PathBuf};

/// Where `proc`, `sys` and `boot` lie: `/`, or a test's folder.
pub(super) struct Root(PathBuf);

impl Root {
    pub(super) fn new(path: &Path) -> Self {
        Self(path.into())
    }

    /// Text of a file without white space around it; `None` when it cannot be read or is empty.
    pub(super) fn text(&self, path: &str) -> Option<String> {
        let text = fs::read_to_string(self.0.join(path)).ok()?;
        let text = text.trim();
        (!text.is_empty()).then(|| text.to_owned())
    }

    pub(super) fn bytes(&self, path: &str) -> Option<Vec<u8>> {
        fs::read(self.0.join(path)).ok()
    }

    /// Text of a file, or that it is unknown and why.
    pub(super) fn fact(&self, path: &str) -> String {
        match fs::read_to_string(self.0.join(path)) {
            Ok(text) if !text.trim().is_empty() => text.trim().to_owned(),
            Ok(_) => format!("unknown: /{path} is empty"),
            Err(error) => unknown(path, &error),
        }
    }

    /// A list of CPUs, of which an empty one, or none of that name, says that there are none.
    pub(super) fn list(&self, path: &str) -> String {
        match fs::read_to_string(self.0.join(path)) {
            Ok(text) if !matches!(text.trim(), "" | "(null)") => text.trim().to_owned(),
            Ok(_) => "none".to_owned(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => "none".to_owned(),
            Err(error) => unknown(path, &error),
        }
    }

    /// What follows `name` and a colon in a file of such lines, or that it is unknown and why.
    pub(super) fn field(&self, path: &str, name: &str) -> String {
        match fs::read_to_string(self.0.join(path)) {
            Ok(text) => {
                field(&text, name).map_or_else(|| format!("unknown: no {name} in /{path}"), str::to_owned)
            }
            Err(error) => unknown(path, &error),
        }
    }

    /// A number that is all a file holds.
    pub(super) fn number(&self, path: &str) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// Names in a folder, those with numbers in them by their numbers.
    pub(super) fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.0.join(path)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort_by_key(|name| (number_in(name), name.clone()));
        names
    }
}

/// What follows `name` and a colon in `text`.
pub(super) fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let value = |line: &'a str| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == name).then_some(value.trim())
    };
    text.lines().find_map(value)
}

/// The first number within a name, as in `cpu12`.
pub(super) fn number_in(name: &str) -> Option<u64> {
    let digits: String =
        name.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}

/// Numbers as the kernel lists them: `0-3,8`; `none` when there are none.
pub(super) fn listed(numbers: &[u64]) -> String {
    let mut parts: Vec<(u64, u64)> = Vec::new();
    for &number in numbers {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => parts.push((number, number)),
        }
    }
    let part = |(first, last): &(u64, u64)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    if parts.is_empty() { "none".to_owned() } else { parts.iter().map(part).collect::<Vec<_>>().join(",") }
}

fn unknown(path: &str, error: &std::io::Error) -> String {
    // The system's own words, without the number that std adds.
    let words = error.to_string();
    let words = words.split(" (os error").next().unwrap_or_default();
    format!("unknown: /{path}: {words}")
}
