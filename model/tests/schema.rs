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
    let table = |lines: &str| vec![format!("{head}{lines}\nnonsense = 1\n")];
    let solver = ["", "method = \"fixed\"\nstep_s = 1"].map(|keys| table(&format!("[solver]\n{keys}")));
    for (place, texts) in [
        ("", vec![format!("nonsense = 1\n{head}")]),
        ("/properties/record", table("[record]")),
        ("/properties/rows", table("[rows]")),
        ("/properties/held_out", table("[held_out]")),
        ("/properties/fit", table("[fit]")),
        ("/properties/solver", solver.concat()),
        ("/$defs/table", table("[tables.f]\nx = [0, 1]\ny = [0, 1]")),
        ("/$defs/input", table("[inputs.v]")),
        ("/$defs/parameter", table("[parameters.p]\nvalue = 1")),
        ("/$defs/state", table("[states.z]\nstart = 0\nderivative = \"0/1[s]\"")),
        ("/$defs/memory", table("[memory.m]\nupdate = \"m\"")),
        ("/$defs/friction", table("[friction.f]\nvelocity = \"x\"\nsliding = \"1\"")),
        ("/$defs/output", table("[outputs.z]\nvalue = \"1\"")),
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
