//! The rules of tidy: which files each looks at, what it finds, and samples of both.
//!
//! A rule takes one file and gives lines with advice; it reads nothing else. Samples that would offend another rule, or this
//! file's own tidiness, are put together from halves.

mod rust;
mod text;

pub(crate) struct File {
    /// Path from the checkout's root.
    pub(crate) path: String,
    pub(crate) executable: bool,
    pub(crate) text: String,
}

/// A line and what to do about it.
pub(crate) struct Problem {
    pub(crate) line: usize,
    pub(crate) advice: String,
}

pub(crate) struct Rule {
    /// Short name, reported with each complaint.
    pub(crate) name: &'static str,
    /// Whether the rule looks at the file of this path.
    pub(crate) applies: fn(&str) -> bool,
    pub(crate) check: fn(&File) -> Vec<Problem>,
    /// Path, text and line of the one problem that must be found.
    pub(crate) bad: &'static [(&'static str, &'static str, usize)],
    /// Path and text in which nothing must be found.
    pub(crate) good: &'static [(&'static str, &'static str)],
}

/// All rules that look at one file at a time.
pub(crate) const RULES: &[&Rule] = &[
    &rust::PURPOSE,
    &rust::SAYING_COMMENTS,
    &rust::CRATE_EDGES,
    &rust::PURE_PLANT,
    &rust::EFFECTS,
    &rust::EFFECTS_BY_NAME,
    &rust::UNITS_IN_NAMES,
    &rust::LINE_LENGTH,
    &text::FILE_LENGTH,
    &text::UNFINISHED,
    &text::WHITESPACE,
    &text::SCRIPTS,
];

impl File {
    /// A sample; a path that ends with `+x` is executable.
    pub(crate) fn sample(path: &str, text: &str) -> Self {
        let name = path.strip_suffix("+x").unwrap_or(path);
        Self { path: name.into(), executable: name != path, text: text.into() }
    }

    fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        (1..).zip(self.text.lines())
    }

    /// A problem on each line of which `find` says something.
    fn each_line(&self, mut find: impl FnMut(&str) -> Option<String>) -> Vec<Problem> {
        self.lines().filter_map(|(line, text)| Some(Problem { line, advice: find(text)? })).collect()
    }
}

/// The advice about a file of so many bytes, if it is too large.
pub(crate) fn too_large(bytes: usize) -> Option<String> {
    const LARGEST: usize = 512 << 10;
    (bytes > LARGEST)
        .then(|| format!("{} KiB in the repository: generate or download it instead", bytes >> 10))
}

/// Lines and names of scripts that a document speaks of.
pub(crate) fn names_of_scripts(text: &str) -> Vec<(usize, String)> {
    let is_name = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let mut found = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        for word in text.split(|c: char| !is_name(c) && c != ':') {
            let word = word.trim_end_matches([':', '.', '/']);
            if word == "scripts" && !text.contains("scripts/") {
                continue;
            }
            if word == "scripts" || word.starts_with("scripts/") || word.starts_with(".ci/") {
                found.push((line, word.to_owned()));
            }
        }
    }
    found
}
