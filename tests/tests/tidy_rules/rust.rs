//! Rules for Rust and for what the rooms may know of each other.

use super::{Problem, Rule};
use plant::effects::SHEETS;
use plant::effects::sheet::Sheet;
use std::str::SplitWhitespace;

fn is_rust(path: &str) -> bool {
    path.ends_with(".rs")
}

/// Every file says what it is for.
pub(super) const PURPOSE: Rule = Rule {
    name: "purpose",
    applies: is_rust,
    check: |file| {
        if file.text.starts_with("//! ") {
            return Vec::new();
        }
        vec![Problem {
            line: 1,
            advice: "begin the file with '//!' and a sentence that says what it is for".into(),
        }]
    },
    bad: &[("a.rs", "use std::fmt;\n", 1), ("a.rs", "", 1), ("a.rs", "// Prints.\n//! Late.\n", 1)],
    good: &[("a.rs", "//! Prints.\n"), ("a.toml", "")],
};

/// Whole comments that say nothing of what they stand at.
const FILLERS: [&str; 5] = ["What to do.", "What it is of.", "All of them.", "On.", "Off."];

/// A comment says what the name does not: an article and one word repeat it, or say nothing.
pub(super) const SAYING_COMMENTS: Rule = Rule {
    name: "saying-comments",
    applies: is_rust,
    check: |file| {
        file.each_line(|line| {
            let comment = line.trim_start().strip_prefix("/// ")?;
            let words: Vec<&str> = comment.split(' ').collect();
            let repeats_name = matches!(words[..], ["The" | "A" | "An" | "Its", word] if word.ends_with('.'));
            (repeats_name || FILLERS.contains(&comment))
                .then(|| "say unit, shape or source, or strike the comment".to_owned())
        })
    },
    bad: &[
        ("a.rs", "/// The file.\npub struct Report;\n", 1),
        ("a.rs", "struct A {\n    /// Its name.\n    name: u8,\n", 2),
        ("a.rs", "/// All of them.\nconst ALL: [u8; 2] = [1, 2];\n", 1),
    ],
    good: &[("a.rs", "/// All of them, sorted.\n/// The file as given.\n/// Its name, cut.\n// The file.\n")],
};

/// What the crate of each folder may depend on, after the packages that not everybody may know.
const EDGES: &str = include_str!("crate_edges.txt");
/// What a crate may depend on in its tests alone: a controller needs a plant there.
const IN_TESTS: &[(&str, &str)] = &[
    ("algorithms", "plant"),
    ("axis", "plant"),
    ("controller", "plant"),
    ("model", "realtime"),
    ("model_fit", "plant"),
];

/// What [`EDGES`] lists behind a name, line by line.
fn listed(name: &str) -> impl Iterator<Item = SplitWhitespace<'static>> {
    EDGES.lines().filter_map(move |line| Some(line.strip_prefix(name)?.strip_prefix(':')?.split_whitespace()))
}

/// House-style: who knows whom.
pub(super) const CRATE_EDGES: Rule = Rule {
    name: "crate-edges",
    applies: |path| path.strip_suffix("/Cargo.toml").is_some_and(|folder| listed(folder).next().is_some()),
    check: |file| {
        let folder = file.path.trim_end_matches("/Cargo.toml");
        let known: Vec<&str> = listed(folder).flatten().collect();
        let forbidden = |in_tests: bool| -> Vec<&str> {
            let may_know =
                |other: &&str| known.contains(other) || in_tests && IN_TESTS.contains(&(folder, *other));
            listed("packages").flatten().filter(|other| !may_know(other)).collect()
        };
        let (mut in_dependencies, mut in_tests) = (false, false);
        file.each_line(|line| {
            let line = line.trim();
            if let Some(table) = line.strip_prefix('[') {
                let table = table.trim_end_matches(']');
                in_dependencies = table.ends_with("dependencies");
                in_tests = table.starts_with("dev-dependencies");
                // Such as [dependencies.plant].
                let named = table.split_once("dependencies.").map(|(_, name)| name)?;
                return forbidden(in_tests).contains(&named).then(|| edge(folder, named));
            }
            let key = line.split(['.', '=', ' ']).next().unwrap_or_default().trim_matches('"');
            let forbidden = forbidden(in_tests);
            // Such as physics = { package = "plant" }, or a path.
            let renamed = forbidden.iter().find(|name| {
                line.contains(&format!("package = \"{name}\""))
                    || line.contains(&format!("path = \"../{name}\""))
            });
            let named = forbidden.iter().find(|name| **name == key).or(renamed)?;
            in_dependencies.then(|| edge(folder, named))
        })
    },
    bad: &[
        ("protocol/Cargo.toml", "[dependencies]\nrealtime.workspace = true\n", 2),
        ("plant/Cargo.toml", "[dev-dependencies]\nprotocol = { path = \"../protocol\" }\n", 2),
        ("realtime/Cargo.toml", "[dependencies.plant]\nworkspace = true\n", 1),
        ("emulator/Cargo.toml", "[dependencies]\nclap = \"1\"\nbench.workspace = true\n", 3),
        ("controller/Cargo.toml", "[dependencies]\nrig = { package = \"emulator\", version = \"1\" }\n", 2),
        ("discrepancy/Cargo.toml", "[dependencies]\nemulator.workspace = true\n", 2),
        ("campaign/Cargo.toml", "[dependencies]\ndiscrepancy.workspace = true\n", 2),
        ("figures/Cargo.toml", "[dependencies]\nbench.workspace = true\n", 2),
        ("discrepancy/Cargo.toml", "[dependencies]\nfigures.workspace = true\n", 2),
        ("front/Cargo.toml", "[dependencies]\nbench.workspace = true\n", 2),
        ("axis/Cargo.toml", "[dependencies]\nplant.workspace = true\n", 2),
        ("xcp/Cargo.toml", "[dev-dependencies]\nplant.workspace = true\n", 2),
    ],
    good: &[
        ("protocol/Cargo.toml", "[package]\nname = \"protocol\"\n[dependencies]\nplantuml = \"1\"\n"),
        ("emulator/Cargo.toml", "[dependencies]\nplant.workspace = true\n[[bench]]\nname = \"bench\"\n"),
        ("bench/Cargo.toml", "[dependencies]\nemulator.workspace = true\n"),
        (
            "axis/Cargo.toml",
            "[dependencies]\nnominal.workspace = true\n[dev-dependencies]\nplant.workspace = true\n",
        ),
    ],
};

fn edge(folder: &str, other: &str) -> String {
    format!(
        "{folder} must not know {other} (ARCHITECTURE.md, Crates): move what both need, or assemble them elsewhere"
    )
}

/// What has no place in physics: clock, thread, file, output.
const IMPURE: &[&str] = &[
    "std::time",
    "std::thread",
    "std::fs",
    "std::io",
    "std::net",
    "std::env",
    "println!",
    "print!",
    "dbg!",
    "Instant::now",
    "SystemTime",
];

/// `plant` computes and does nothing else.
pub(super) const PURE_PLANT: Rule = Rule {
    name: "pure-plant",
    // The example of an effect reads the sources in its test, to find out whether it stands in a second place.
    applies: |path| path.starts_with("plant/src/") && is_rust(path) && path != "plant/src/effects/example.rs",
    check: |file| {
        file.each_line(|line| {
            let code = line.split("//").next().unwrap_or_default();
            let found = IMPURE.iter().find(|word| code.contains(*word))?;
            Some(format!(
                "plant has no {found} (ARCHITECTURE.md, Crates): hand it the value, or do it in the emulator"
            ))
        })
    },
    bad: &[
        ("plant/src/a.rs", "//! A.\nuse std::time::Duration;\n", 2),
        ("plant/src/a/b.rs", "fn f() { println!(\"x\"); }\n", 1),
        ("plant/src/a.rs", "    std::fs::read(p)\n", 1),
    ],
    good: &[
        ("plant/src/a.rs", "//! Knows no std::time.\nuse std::fmt; // and no println!\n"),
        ("plant/tests/a.rs", "println!(\"x\");\n"),
    ],
};

/// An effect names its source and tests the properties it claims.
pub(super) const EFFECTS: Rule = Rule {
    name: "effects",
    applies: |path| path.starts_with("plant/src/effects/") && is_rust(path),
    check: |file| {
        if !file.text.contains("const SHEET: Sheet = Sheet {") {
            return Vec::new();
        }
        let asked = [
            (
                "//! Source: ",
                "end the head of an effect with '//! Source: ' and where law and range come from",
            ),
            ("#[cfg(test)]", "test each property that the head of an effect claims"),
        ];
        let missing = asked.iter().filter(|(text, _)| !file.text.contains(text));
        missing.map(|(_, advice)| Problem { line: 1, advice: (*advice).into() }).collect()
    },
    bad: &[
        ("plant/src/effects/a.rs", "//! A.\nconst SHEET: Sheet = Sheet {};\n#[cfg(test)]\n", 1),
        ("plant/src/effects/a.rs", "//! A.\n//! Source: b.\nconst SHEET: Sheet = Sheet {};\n", 1),
    ],
    good: &[
        ("plant/src/effects/a.rs", "//! A.\n//! Source: b.\nconst SHEET: Sheet = Sheet {};\n#[cfg(test)]\n"),
        ("plant/src/effects/a.rs", "//! Machinery.\n"),
    ],
};

/// What reads the sheets of effects names none, so that a new effect needs no line there.
pub(super) const EFFECTS_BY_NAME: Rule = Rule {
    name: "effects-by-name",
    applies: |path| {
        let reads = ["campaign/src/", "discrepancy/src/", "front/src/", "tests/study-tool/src/"];
        let others = ["tests.rs", "/page/samples.rs"];
        let is_other = others.iter().any(|end| path.ends_with(end));
        is_rust(path) && !is_other && reads.iter().any(|folder| path.starts_with(folder))
    },
    check: |file| {
        let mut in_tests = false;
        file.each_line(|line| {
            in_tests |= line == "#[cfg(test)]";
            let is_code = !in_tests && !line.trim_start().starts_with("//");
            let named = |sheet: &&Sheet| is_code && line.contains(&format!("\"{}\"", sheet.name));
            let name = SHEETS.iter().find(named)?.name;
            Some(format!("state in the sheet of {name} what is true of it (plant/src/effects/sheet.rs)"))
        })
    },
    bad: &[("front/src/a.rs", "//! A.\nconst SLOW: &str = \"line-delay\";\n", 2)],
    good: &[
        ("front/src/a.rs", "//! As \"line-delay\".\n#[cfg(test)]\nconst SLOW: &str = \"line-delay\";\n"),
        ("plant/src/effects/a.rs", "name: \"line-delay\",\n"),
    ],
};

/// Units that a name may end with, before a statistic.
const UNITS: &[&str] = &[
    "m", "mm", "m2", "m3", "s", "ms", "us", "ns", "n", "pa", "bar", "kg", "k", "j", "w", "hz", "rad", "deg",
    "percent", "kib", "counts", "si", "per_s", "per_s2", "per_h", "per_m", "per_n", "per_pa", "per_kg",
];
/// Statistics that may follow the unit.
const STATISTICS: &[&str] = &["min", "max", "mean", "rms", "p50", "p90", "p99", "p999", "p9999"];
/// Names of quantities without a unit, or whose unit stands beside them, each with what it is.
const DIMENSIONLESS: &str = include_str!("dimensionless.txt");

/// A public number says its unit in its name.
pub(super) const UNITS_IN_NAMES: Rule = Rule {
    name: "units",
    // Names on the command line are words of its users; its help states the unit.
    applies: |path| is_rust(path) && path.contains("/src/") && !path.ends_with("/cli.rs"),
    check: |file| {
        file.each_line(|line| {
            let (name, kind) = line.trim_start().strip_prefix("pub ")?.split_once(": ")?;
            let field = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
            let float = kind.split(|c: char| !c.is_alphanumeric()).any(|word| word == "f64");
            if !field || !float || is_dimensionless(name) || has_unit(name) {
                return None;
            }
            Some(format!("end '{name}' with its unit, as supply_pressure_pa, or add it to dimensionless.txt of this rule"))
        })
    },
    bad: &[
        ("a/src/b.rs", "//! B.\n    pub pressure: f64,\n", 2),
        ("a/src/b.rs", "    pub ends: [Option<f64>; 2],\n", 1),
        ("a/src/b.rs", "    pub atoms: Vec<f64>,\n", 1),
    ],
    good: &[
        (
            "a/src/b.rs",
            "    pub pressure_pa: f64,\n    pub rod_velocity_m_per_s: [f64; 2],\n    pub opening: f64,\n",
        ),
        ("a/src/b.rs", "    pub wakeup_ns_p99: f64,\n    pub count: u64,\n    pub fn f(x: f64) -> f64 {\n"),
        ("a/src/cli.rs", "    pub bus_grace: f64,\n"),
        ("a/tests/b.rs", "    pub pressure: f64,\n"),
    ],
};

fn is_dimensionless(name: &str) -> bool {
    DIMENSIONLESS.lines().any(|line| line.split(' ').next() == Some(name))
}

fn has_unit(name: &str) -> bool {
    let name = STATISTICS.iter().find_map(|suffix| name.strip_suffix(&format!("_{suffix}"))).unwrap_or(name);
    UNITS.iter().any(|unit| name.ends_with(&format!("_{unit}")))
}

const LONGEST_LINE: usize = 130;
/// Files whose longer lines are rows of a table.
const TABLES: &[&str] =
    &["plant/src/parameters/table.rs", "protocol/src/frames/messages.rs", "protocol/src/frames/payloads.rs"];

/// A line fits the screen; rustfmt breaks code, not comments and texts.
pub(super) const LINE_LENGTH: Rule = Rule {
    name: "line-length",
    applies: |path| is_rust(path) && !TABLES.contains(&path),
    check: |file| {
        file.each_line(|line| {
            let length = line.chars().count();
            // A text that is reported in one piece cannot be broken without a continuation in its midst.
            let one_text = line.trim_start().starts_with(['"', 'b']) || line.contains(" = \"");
            (length > LONGEST_LINE && !(one_text && line.matches('"').count() == 2))
                .then(|| format!("{length} characters, {LONGEST_LINE} at most: break the line"))
        })
    },
    bad: &[(
        "a.rs",
        "//! A.\n// 3456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 \
         123456789 123456789 1\n",
        2,
    )],
    good: &[
        (
            "a.rs",
            "// ────────────────────────────────────────────────────────────────────────────────────────────────────────── ä\n",
        ),
        (
            "a.rs",
            "const A: &str = \"789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 123456789 \
             123456789 123456789 1\";\n",
        ),
    ],
};
