//! Rules for all text: length, unfinished work, white space, scripts.

use super::{Problem, Rule};

fn is_script(path: &str) -> bool {
    // The pure data beside them has an extension of its own, or is a list that says so.
    (path.starts_with("scripts/") || path == ".ci/run") && !path.ends_with(".md")
}

fn is_source(path: &str) -> bool {
    path.ends_with(".rs") || path.ends_with(".py") || is_script(path)
}

fn is_text(path: &str) -> bool {
    is_source(path) || path.ends_with(".md") || path.ends_with(".toml")
}

/// House-style, A file.
pub(super) const FILE_LENGTH: Rule = Rule {
    name: "file-length",
    applies: is_source,
    check: |file| {
        const MOST_LINES: usize = 500;
        let lines = file.text.lines().count();
        if lines <= MOST_LINES {
            return Vec::new();
        }
        let advice = format!("{lines} lines, {MOST_LINES} at most: split it by what it does");
        vec![Problem { line: MOST_LINES + 1, advice }]
    },
    bad: &[("a.rs", LINES_501, 501), ("scripts/a", LINES_501, 501)],
    good: &[("a.rs", LINES_500), ("a.md", LINES_501)],
};

const LINES_501: &str = empty_lines::<501>();
const LINES_500: &str = empty_lines::<500>();

/// `N` empty lines.
const fn empty_lines<const N: usize>() -> &'static str {
    match std::str::from_utf8(&[b'\n'; N]) {
        Ok(text) => text,
        Err(_) => panic!("line feeds are UTF-8"),
    }
}

/// Words of work that was left for later, in halves so that they are not found here.
const UNFINISHED_WORDS: &[(&str, &str)] = &[
    ("to", "do!("),
    ("unimple", "mented!("),
    ("#[ign", "ore"),
    ("FIX", "ME"),
    ("XX", "X"),
    ("TO", "DO:"),
    ("HA", "CK:"),
];

/// Whether `word` stands in `line` by itself, unlike the last letters of a template for mktemp.
fn has_word(line: &str, word: &str) -> bool {
    let cut = |c: Option<char>, inner: Option<char>| {
        !(c.is_some_and(char::is_alphanumeric) && inner.is_some_and(char::is_alphanumeric))
    };
    line.match_indices(word).any(|(at, _)| {
        let (before, after) = (line[..at].chars().next_back(), line[at + word.len()..].chars().next());
        cut(before, word.chars().next()) && cut(after, word.chars().next_back())
    })
}

/// Nothing is left for later, and no test is ignored.
pub(super) const UNFINISHED: Rule = Rule {
    name: "unfinished",
    applies: is_text,
    check: |file| {
        file.each_line(|line| {
            let (head, tail) =
                UNFINISHED_WORDS.iter().find(|(head, tail)| has_word(line, &format!("{head}{tail}")))?;
            Some(format!("{head}{tail}: finish it, or write into the issue what is missing"))
        })
    },
    bad: &[
        ("a.rs", concat!("//! A.\nfn f() { to", "do!() }\n"), 2),
        ("a.rs", concat!("#[ign", "ore]\n"), 1),
        ("a.rs", concat!("    #[ign", "ore = \"slow\"]\n"), 1),
        ("a.md", concat!("Text.\n\nFIX", "ME later\n"), 3),
        ("a.toml", concat!("# XX", "X\n"), 1),
        ("scripts/a", concat!("# TO", "DO: more\n"), 1),
        ("a.py", concat!("# HA", "CK: odd\n"), 1),
    ],
    good: &[
        ("scripts/a", concat!("mktemp a.", "XX", "XX", "XX\n")),
        ("a.rs", "// nothing to do; ignore it\n"),
        ("a.csv", concat!("FIX", "ME\n")),
    ],
};

/// No white space that nobody sees.
pub(super) const WHITESPACE: Rule = Rule {
    name: "white-space",
    applies: is_text,
    check: |file| {
        let mut problems = file.each_line(|line| {
            if line.contains('\t') {
                return Some("a tab: use spaces".into());
            }
            line.ends_with(char::is_whitespace)
                .then(|| "white space at the end of the line: delete it".into())
        });
        // `lines` takes a carriage return for part of the line's end.
        problems.extend(
            file.text
                .split('\n')
                .zip(1..)
                .filter(|(line, _)| line.ends_with('\r'))
                .map(|(_, line)| Problem { line, advice: "a carriage return: use line feeds alone".into() }),
        );
        if !file.text.is_empty() && !file.text.ends_with('\n') {
            let line = file.text.lines().count();
            problems.push(Problem { line, advice: "no line feed at the end of the file: add one".into() });
        }
        problems
    },
    bad: &[
        ("a.rs", "//! A.\nlet a = 1; \n", 2),
        ("a.toml", "a = 1\n\tb = 2\n", 2),
        ("a.md", "Text.\n \n", 2),
        ("a.md", "Text.\r\nMore.\n", 1),
        ("a.rs", "//! A.", 1),
    ],
    good: &[("a.rs", "//! A.\n\nlet a = \"\\t\";\n"), ("a.dbc", "\tCM_ \n"), ("a.md", "")],
};

/// What a person starts can be started and stops at the first error; what is sourced says so.
pub(super) const SCRIPTS: Rule = Rule {
    name: "scripts",
    applies: |path| is_script(path.trim_end_matches("+x")),
    check: |file| {
        let first = file.text.lines().next().unwrap_or_default();
        let one = |advice: &str| vec![Problem { line: 1, advice: advice.into() }];
        if !file.executable {
            return if first.starts_with("# shellcheck shell=") {
                Vec::new()
            } else {
                one(
                    "not executable: 'git update-index --chmod=+x', or begin with '# shellcheck shell=bash' if it is sourced",
                )
            };
        }
        // The guest of scripts/vcan-vm has no bash, and dash of Debian 12 knows no pipefail.
        if file.path.starts_with("scripts/vm/") && first == "#!/bin/sh" {
            return Vec::new();
        }
        if first != "#!/usr/bin/env bash" {
            return one("begin with '#!/usr/bin/env bash'");
        }
        let strict = ["set -euo pipefail", "set -Eeuo pipefail"];
        if file.text.lines().any(|line| strict.contains(&line)) {
            Vec::new()
        } else {
            one("add 'set -euo pipefail' below the header: an error must not go unnoticed")
        }
    },
    bad: &[
        ("scripts/a", "#!/usr/bin/env bash\nset -euo pipefail\n", 1),
        ("scripts/a+x", "#!/usr/bin/env bash\nset -e\n", 1),
        ("scripts/a+x", "#!/bin/bash\nset -euo pipefail\n", 1),
        ("scripts/a+x", "echo\n", 1),
        ("scripts/a+x", "#!/bin/sh\nset -eu\n", 1),
        (".ci/run+x", "#!/usr/bin/env bash\n# set -euo pipefail\n", 1),
    ],
    good: &[
        ("scripts/a+x", "#!/usr/bin/env bash\n# What it does.\nset -Eeuo pipefail\n"),
        ("scripts/tools.sh", "# shellcheck shell=bash\n"),
        ("scripts/vm/init+x", "#!/bin/sh\n"),
        ("tests/a", "echo\n"),
    ],
};
