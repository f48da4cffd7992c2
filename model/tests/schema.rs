//! `docs/model-file.schema.json` has the keys that the reader asks for, in each table, and no other.

use crate::refused;
use serde_json::Value;
use std::collections::BTreeSet;

fn schema() -> Value {
    serde_json::from_str(include_str!("../../docs/model-file.schema.json")).unwrap()
}

/// The keys that the reader allows beside `nonsense`, as its message lists them.
fn allowed(text: &str) -> BTreeSet<String> {
    let message = refused(text);
    let (unknown, list) = message.split_once("; allowed is ").unwrap_or_else(|| panic!("{message}\n{text}"));
    assert!(unknown.ends_with("nonsense"), "{message}");
    list.split(", ").map(str::to_owned).collect()
}

#[test]
fn the_schema_has_the_keys_of_the_reader() {
    let schema = schema();
    let head = "[inputs.u]\n[states.x]\nstart = 0\nderivative = \"u/1[s]\"\n[outputs.y]\nvalue = \"x\"\n";
    let suspect = |lines: &str| format!("{head}[[suspects]]\nname = \"s\"\nplace = \"u\"\n{lines}");
    let used = |lines: &str| suspect(&format!("use = \"actuator/lag\"\n{lines}"));
    let written = |lines: &str| suspect(&format!("add = \"1\"\n{lines}"));
    for (place, texts) in [
        ("", vec![format!("nonsense = 1\n{head}")]),
        ("/properties/record", vec![format!("{head}[record]\nnonsense = 1\n")]),
        ("/properties/rows", vec![format!("{head}[rows]\nnonsense = 1\n")]),
        ("/properties/held_out", vec![format!("{head}[held_out]\nnonsense = 1\n")]),
        ("/properties/fit", vec![format!("{head}[fit]\nnonsense = 1\n")]),
        (
            "/properties/solver",
            vec![
                format!("{head}[solver]\nnonsense = 1\n"),
                format!("{head}[solver]\nmethod = \"fixed\"\nstep_s = 1\nnonsense = 1\n"),
            ],
        ),
        ("/$defs/table", vec![format!("{head}[tables.f]\nx = [0, 1]\ny = [0, 1]\nnonsense = 1\n")]),
        ("/$defs/input", vec![format!("{head}[inputs.v]\nnonsense = 1\n")]),
        ("/$defs/parameter", vec![format!("{head}[parameters.p]\nvalue = 1\nnonsense = 1\n")]),
        (
            "/$defs/state",
            vec![format!("{head}[states.z]\nstart = 0\nderivative = \"0/1[s]\"\nnonsense = 1\n")],
        ),
        ("/$defs/memory", vec![format!("{head}[memory.m]\nupdate = \"m\"\nnonsense = 1\n")]),
        (
            "/$defs/friction",
            vec![format!("{head}[friction.f]\nvelocity = \"x\"\nsliding = \"1\"\nnonsense = 1\n")],
        ),
        ("/$defs/output", vec![format!("{head}[outputs.z]\nvalue = \"1\"\nnonsense = 1\n")]),
        ("/$defs/written_suspect", vec![written("nonsense = 1\n")]),
        (
            "/$defs/library_suspect",
            vec![used("nonsense = 1\n"), suspect("use = \"actuator/offset\"\ntimes = \"1\"\nnonsense = 1\n")],
        ),
        ("/$defs/changed_parameter", vec![used("parameters.lag = { nonsense = 1 }\n")]),
        ("/$defs/changed_state", vec![used("states.late = { start = 0, nonsense = 1 }\n")]),
    ] {
        let table = schema.pointer(place).unwrap_or_else(|| panic!("{place}"));
        assert_eq!(table["additionalProperties"], false, "{place}");
        let keys: BTreeSet<String> = table["properties"].as_object().unwrap().keys().cloned().collect();
        let mut read: BTreeSet<String> = texts.iter().flat_map(|text| allowed(text)).collect();
        if place == "/$defs/written_suspect" {
            read.remove("use"); // which makes it the other form
        }
        assert_eq!(read, keys, "{place}: what the reader allows, and what the schema has");
        for key in table["required"].as_array().into_iter().flatten() {
            assert!(keys.contains(key.as_str().unwrap()), "{place}: {key}");
        }
    }
}
