//! `emulator faults`: the table of faults as text, as JSON and for the page; check of a script.

use super::script::signals;
use super::table::{FaultSpec, Places, all};
use crate::cli::FaultsArguments;
use crate::inputs::Script;
use crate::run::RunError;
use runlog::run_folder::SCHEMA_VERSION;
use runlog::telemetry::{FaultEntry, FaultKey};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// The table, or the result of the check of a script.
pub(crate) fn text(arguments: &FaultsArguments) -> Result<String, RunError> {
    Ok(if let Some(path) = &arguments.check {
        let Script { script, .. } = Script::read(path)?;
        format!("{}: {} fault(s), each as the table allows", path.display(), script.faults.len())
    } else if arguments.json {
        serde_json::to_string_pretty(&as_json()).unwrap_or_default()
    } else if arguments.markdown {
        as_markdown()
    } else {
        let rows: Vec<_> = all().map(as_text).collect();
        format!("{}\nconditions are on: {}", rows.join(""), signals().collect::<Vec<_>>().join(", "))
    })
}

/// Places as text; frames are too many to be listed.
fn places(places: Places) -> String {
    match places {
        Places::Frames => "bus (all frames), or bus.NAME with a frame's name in rig.dbc".to_owned(),
        _ => places.names().join(", "),
    }
}

fn default(key: &FaultKey) -> String {
    key.default.map_or_else(|| "has to be given".to_owned(), |value| format!("default {value}"))
}

fn as_text(spec: &FaultSpec) -> String {
    let mut text = format!("{}\n    {}\n    at {}\n", spec.name, spec.about, places(spec.places));
    for key in spec.keys {
        let _ = writeln!(text, "    {}: {}; {}; {}", key.name, key.meaning, key.range(), default(key));
    }
    text
}

fn as_json() -> Value {
    json!({
        "schema_version": SCHEMA_VERSION,
        "faults": faults(),
        "conditions": signals().collect::<Vec<_>>(),
    })
}

/// All faults in the form of programs.
pub(crate) fn faults() -> Vec<FaultEntry> {
    let entry = |spec: &FaultSpec| FaultEntry {
        fault: spec.name.to_owned(),
        group: spec.group,
        about: spec.about.to_owned(),
        places: spec.places.names(),
        keys: spec.keys.to_vec(),
    };
    all().map(entry).collect()
}

/// The table of `emulator/docs/faults.md`.
fn as_markdown() -> String {
    let mut text = String::from("| fault | at | numbers | what happens |\n|---|---|---|---|\n");
    for spec in all() {
        let number =
            |key: &FaultKey| format!("`{}` {}, {}: {}", key.name, key.range(), default(key), key.meaning);
        let numbers = spec.keys.iter().map(number).collect::<Vec<_>>().join("; ");
        let _ = writeln!(text, "| `{}` | {} | {numbers} | {} |", spec.name, places(spec.places), spec.about);
    }
    text.trim_end().to_owned()
}
