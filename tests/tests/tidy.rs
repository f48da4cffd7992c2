//! Tidy is a test: reads the tracked files and says with path:line what to do instead.
//!
//! The rules stand in `tidy_rules`, each with samples that it must find and samples that it must pass; a rule that finds nothing
//! any more fails here before it can wave something through.

use crate::tidy_rules::{File, Problem, RULES, names_of_scripts, too_large};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use system_tests::workspace;

/// Tracked files that are text, and the complaints about size, which need no reading.
fn tracked() -> (Vec<File>, Vec<String>) {
    // A checkout that belongs to another user, as in a container, is none for git otherwise.
    let output = Command::new("git")
        .current_dir(workspace())
        .args(["-c", "safe.directory=*", "ls-files", "--stage", "-z"])
        .output()
        .expect("git is installed");
    assert!(
        output.status.success(),
        "tidy needs a git checkout, to know which files are tracked: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let list = String::from_utf8(output.stdout).expect("paths are UTF-8");
    let mut files = Vec::new();
    let mut problems = Vec::new();
    for entry in list.split_terminator('\0') {
        let (stage, path) = entry.split_once('\t').expect("MODE OBJECT STAGE<tab>PATH");
        // Deleted, and the deletion not yet committed: nothing to read.
        let Ok(bytes) = fs::read(workspace().join(path)) else { continue };
        problems.extend(too_large(bytes.len()).map(|advice| format!("{path}:1: {advice}")));
        if let Ok(text) = String::from_utf8(bytes) {
            files.push(File { path: path.into(), executable: stage.starts_with("100755"), text });
        }
    }
    (files, problems)
}

#[test]
fn the_tracked_files_are_tidy() {
    let (files, mut complaints) = tracked();
    assert!(files.len() > 50, "git lists only {} files", files.len());
    for file in &files {
        for rule in RULES.iter().filter(|rule| (rule.applies)(&file.path)) {
            for Problem { line, advice } in (rule.check)(file) {
                complaints.push(format!("{}:{line}: {advice} [{}]", file.path, rule.name));
            }
        }
    }
    assert!(complaints.is_empty(), "{} complaint(s):\n{}", complaints.len(), complaints.join("\n"));
}

/// The Python distribution is built from its own folder, so that its licence texts stand there too.
#[test]
fn the_python_distribution_carries_the_licence_texts() {
    for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
        let read = |folder: &str| fs::read_to_string(workspace().join(folder).join(name)).unwrap();
        assert_eq!(read("python"), read("."), "copy {name} into python/");
    }
}

#[test]
fn documents_name_only_scripts_that_exist() {
    let (files, _) = tracked();
    let mut known: BTreeSet<&str> = BTreeSet::new();
    for file in &files {
        known.extend(Path::new(&file.path).ancestors().filter_map(Path::to_str));
    }
    let mut complaints = Vec::new();
    let mut named = 0;
    for file in files.iter().filter(|file| file.path.ends_with(".md") && !file.path.ends_with("CHANGELOG.md"))
    {
        for (line, script) in names_of_scripts(&file.text) {
            named += 1;
            if !known.contains(script.as_str()) {
                complaints
                    .push(format!("{}:{line}: {script} is not in the checkout: name one that is", file.path));
            }
        }
    }
    assert!(named > 0, "README names no script at all: the search is broken");
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn every_rule_finds_its_bad_samples_and_passes_its_good_ones() {
    for rule in RULES {
        assert!(!rule.bad.is_empty() && !rule.good.is_empty(), "{}: no samples", rule.name);
        for (path, text, line) in rule.bad {
            let file = File::sample(path, text);
            assert!((rule.applies)(path), "{} does not look at {path}", rule.name);
            let found: Vec<_> = (rule.check)(&file).into_iter().map(|problem| problem.line).collect();
            assert_eq!(found, [*line], "{}: {path} with {text:?}", rule.name);
        }
        for (path, text) in rule.good {
            let found = if (rule.applies)(path) { (rule.check)(&File::sample(path, text)) } else { vec![] };
            let advice: Vec<_> = found.iter().map(|problem| &problem.advice).collect();
            assert!(advice.is_empty(), "{}: {path} with {text:?}: {advice:?}", rule.name);
        }
    }
}

#[test]
fn a_large_file_and_a_script_in_prose_are_found() {
    assert!(too_large(512 << 10).is_none());
    assert!(too_large((512 << 10) + 1).is_some());
    let text = "Run `scripts/test`.\nOr .ci/run, or (scripts/vm/job); see scripts/.\nhttps://example.org/scripts/other";
    let expected = [(1, "scripts/test"), (2, ".ci/run"), (2, "scripts/vm/job"), (2, "scripts")];
    assert_eq!(names_of_scripts(text), expected.map(|(line, name)| (line, name.to_owned())));
}

#[test]
fn every_file_of_tests_belongs_to_an_executable() {
    let (files, _) = tracked();
    let text = |path: &str| files.iter().find(|file| file.path == path).map_or("", |file| file.text.as_str());
    let mut complaints = Vec::new();
    let mut modules = 0;
    for file in &files {
        // CRATE/tests/NAME.rs
        let Some((room, name)) = file.path.strip_suffix(".rs").and_then(|path| path.split_once("/tests/"))
        else {
            continue;
        };
        if name == "main" || name.contains('/') || text(&format!("{room}/tests/main.rs")).is_empty() {
            continue;
        }
        modules += 1;
        let is_module =
            text(&format!("{room}/tests/main.rs")).lines().any(|line| line == format!("mod {name};"));
        let is_target = text(&format!("{room}/Cargo.toml")).contains(&format!("name = \"{name}\""));
        if !is_module && !is_target {
            complaints
                .push(format!("{}:1: no executable holds it: name it in {room}/tests/main.rs", file.path));
        }
    }
    assert!(modules > 50, "only {modules} files of tests: the search is broken");
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// No figure of CI would show it: instructions are counted of the plant's period alone.
#[test]
fn every_crate_that_a_cycle_calls_is_compiled_for_speed() {
    let manifest = fs::read_to_string(workspace().join("Cargo.toml")).expect("the workspace's manifest");
    let ours =
        ["algorithms", "axis-control", "controller", "emulator", "plant", "plugin", "protocol", "realtime"];
    let others = [
        "crc",
        "crossbeam-channel",
        "crossbeam-utils",
        "hdrhistogram",
        "libm",
        "rand_pcg",
        "rustix",
        "socketcan",
    ];
    for name in ours.iter().chain(&["expression", "rig-node", "runlog", "xcp"]).chain(&others) {
        let level = format!("[profile.release.package.{name}]\nopt-level = 3\n");
        assert!(manifest.contains(&level), "{name} runs in each cycle: give it opt-level 3 in Cargo.toml");
    }
}

#[test]
fn every_mutant_of_the_list_applies() {
    let read = |path: &str| {
        fs::read_to_string(workspace().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
    };
    let list = read("tests/mutants/list.tsv");
    let mut mutants = 0;
    for (number, line) in (1..).zip(list.lines()).filter(|(_, line)| !line.starts_with('#')) {
        let [_, file, from, to] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("line {number}: {line}")
        };
        assert_eq!(
            read(file).matches(from).count(),
            1,
            "tests/mutants/list.tsv:{number}: '{from}' stands once in {file}"
        );
        assert_ne!(from, to, "tests/mutants/list.tsv:{number}");
        mutants += 1;
    }
    assert!(mutants >= 30, "{mutants} mutants");
}
