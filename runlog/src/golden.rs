//! Golden files of the formats, for tests: `runlog/tests/golden/`. With `AIRBENCH_GOLDEN=write` a test writes its file anew.

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// The text of a golden file.
///
/// # Panics
/// Without the file.
#[must_use]
pub fn text(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The keys of a JSON file with their paths, sorted, one a line; members of an array are `[]`.
#[must_use]
pub fn keys(file: &Value) -> String {
    let mut keys = BTreeSet::new();
    collect(file, "", &mut keys);
    keys.iter().map(|key| format!("{key}\n")).collect()
}

fn collect(value: &Value, path: &str, keys: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (key, member) in members {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                collect(member, &path, keys);
                keys.insert(path);
            }
        }
        Value::Array(members) => {
            members.iter().for_each(|member| collect(member, &format!("{path}.[]"), keys));
        }
        _ => {}
    }
}

/// Compares with a golden file.
///
/// # Panics
/// When they differ, with the lines that only one of them has.
pub fn check(name: &str, found: &str) {
    if std::env::var_os("AIRBENCH_GOLDEN").is_some_and(|wish| wish == "write") {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
        std::fs::write(path, found).expect("a folder to write to");
    }
    let kept = text(name);
    let only = |these: &str, those: &str| -> Vec<String> {
        let those: BTreeSet<&str> = those.lines().collect();
        these.lines().filter(|line| !those.contains(line)).map(str::to_owned).collect()
    };
    let (lost, new) = (only(&kept, found), only(found, &kept));
    assert!(kept == found, "{name}: lost {lost:#?}, new {new:#?}; if that is wanted, AIRBENCH_GOLDEN=write");
}
