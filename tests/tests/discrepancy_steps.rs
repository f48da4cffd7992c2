//! Steps of `discrepancy` alone: records that do not go together are refused by all of them, and what cannot be distinguished
//! gets an experiment.

use plant::{Axis, RigParameters};
use record_maker::{Recipe, simulate, write};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use system_tests::discrepancy::{discrepancy, rig};
use system_tests::exit::{BAD_INPUT, GOOD};
use system_tests::json;

/// 8 s: rests, ramps, steps and half a chirp.
pub(crate) const ROWS: usize = 8000;

/// The measurement of so many rows of a recipe's record, in a folder of this name below `folder`.
pub(crate) fn record(folder: &Path, name: &str, recipe: &Recipe) -> PathBuf {
    let mut record = simulate(recipe, &RigParameters::baseline()).expect("a record");
    record.rows.truncate(ROWS);
    let out = folder.join(name);
    write(&record, &out, &folder.join("truth").join(name)).expect("a folder that can be written");
    out.join("measurement.csv")
}

#[test]
fn steps_alone_refuse_records_that_do_not_go_together() {
    let folder = tempfile::tempdir().expect("a folder");
    // Records of two axes in which nothing is hidden.
    let of_axis = |axis: Axis| record(folder.path(), axis.name(), &Recipe { axis, ..Recipe::default() });
    let [train, other] = &[Axis::Drive, Axis::Load].map(of_axis);
    for step in ["calibrate", "locate"] {
        let twice = [&step as &dyn AsRef<OsStr>, &"--rig", &rig(), &"--train", train, &"--train", train];
        discrepancy(&twice).expect_code(BAD_INPUT).expect_stderr(&["--train", "given twice"]);
        let mixed = [&step as &dyn AsRef<OsStr>, &"--rig", &rig(), &"--train", train, &"--train", other];
        discrepancy(&mixed).expect_code(BAD_INPUT).expect_stderr(&["load", "the same axes"]);
    }
    // Of the held-out record nothing is reported where it shows another axis.
    let out = folder.path().join("closed");
    let ended =
        discrepancy(&[&"close", &"--rig", &rig(), &"--train", train, &"--test", other, &"--out", &out]);
    let ended = ended.expect_code(BAD_INPUT);
    assert!(ended.stdout.contains("no axis that the training records show"), "{}", ended.stdout);
    assert_eq!(json(&out.join("report.json"))["gap"], serde_json::json!({}));
}

#[test]
fn next_writes_an_experiment_that_tells_apart_what_a_report_could_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let [report, out] = ["report.json", "next.toml"].map(|file| folder.path().join(file));
    let effect = |name: &str, key: &str, value: f64, more: &str| {
        format!(
            r#"{{ "effect": "{name}", "where": {{ "axis": "drive", "element": null }}, "share_explained": 1.0, "parameters":
            [{{ "name": "{key}", "value": {value}, "unit": "", "standard_error": null, "before": null }}], "alternatives":
            [{more}] }}"#
        )
    };
    let other = effect("valve-dead-zone", "dead_zone_percent", 0.4, "");
    let named = effect("command-dead-time", "delay_ms", 0.6, &other);
    let inputs = r#"{ "rig": "rig.toml", "train": ["a.csv"], "axes": ["drive"], "searched_share": 1.0 }"#;
    let reported =
        format!(r#"{{ "verdict": "ambiguous", "inputs": {inputs}, "named": [{named}], "parameters": [] }}"#);
    fs::write(&report, reported).expect("a report");
    let next =
        discrepancy(&[&"next", &"--rig", &rig(), &"--report", &report, &"--out", &out]).expect_code(GOOD);
    let parts = ["command-dead-time drive and valve-dead-zone drive", "is expected to separate them"];
    next.expect_stdout(&parts);
    let experiment = fs::read_to_string(&out).expect("an experiment file");
    assert!(experiment.contains("[run]") && experiment.starts_with("# Proposed by"), "{experiment}");
}
