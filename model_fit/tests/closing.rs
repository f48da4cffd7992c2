//! `close` of this crate, whose report is held against `docs/model-report.schema.json` in every test that closes a model, and
//! what these tests share.

use model_fit::{ClosedModel, ModelError, ModelReport, ParameterEstimate, Search};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Values in -0.5 to 0.5.
pub(crate) fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
}

pub(crate) fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path
}

/// A model closed on a training record and a held-out one, which lie beside it in the folder.
pub(crate) fn closed(
    folder: &Path,
    (name, model): (&str, &str),
    [train, test]: [String; 2],
    search: Search,
) -> ClosedModel {
    let model = file(folder, name, model);
    let (train, test) = (file(folder, "train.csv", &train), file(folder, "test.csv", &test));
    close_with(&model, (&[train], &[test]), search, &mut |_| {}).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn number<'a>(report: &'a ModelReport, name: &str) -> &'a ParameterEstimate {
    let number = report.parameters.iter().find(|number| number.name == name);
    number.unwrap_or_else(|| panic!("{name}: {:#?}", report.parameters))
}

/// Names of the suspects that are named.
pub(crate) fn named(report: &ModelReport) -> Vec<&str> {
    report.named.iter().map(|named| named.suspect.as_str()).collect()
}

pub(crate) fn close(file: &Path, train: &[PathBuf], tests: &[PathBuf]) -> Result<ClosedModel, ModelError> {
    close_with(file, (train, tests), Search::MoreThanNoise, &mut |_| {})
}

pub(crate) fn close_with(
    file: &Path,
    records: (&[PathBuf], &[PathBuf]),
    search: Search,
    progress: &mut dyn FnMut(&str),
) -> Result<ClosedModel, ModelError> {
    let closed = model_fit::close(file, records, search, progress)?;
    let wrong = against_schema(&serde_json::to_value(&closed.report).unwrap());
    assert!(wrong.is_empty(), "{}: {}", file.display(), wrong.join("\n"));
    Ok(closed)
}

/// What of a report the schema refuses. A number that is not finite is a null in JSON.
fn against_schema(report: &Value) -> Vec<String> {
    let schema: Value = serde_json::from_str(include_str!("../../docs/model-report.schema.json")).unwrap();
    let mut wrong = Vec::new();
    SchemaValidator { whole: &schema, wrong: &mut wrong }.value(&schema, report, "$");
    wrong
}

struct SchemaValidator<'a> {
    whole: &'a Value,
    wrong: &'a mut Vec<String>,
}

impl SchemaValidator<'_> {
    /// The keywords of JSON schema 2020-12 that the schema has.
    fn value(&mut self, schema: &Value, value: &Value, place: &str) {
        if let Some(name) = schema["$ref"].as_str() {
            let whole = self.whole;
            return self.value(whole.pointer(name.trim_start_matches('#')).unwrap(), value, place);
        }
        let is_of = |kind: &Value| match kind.as_str().unwrap() {
            "null" => value.is_null(),
            "boolean" => value.is_boolean(),
            "number" => value.is_number(),
            "integer" => value.is_u64() || value.is_i64(),
            "string" => value.is_string(),
            "array" => value.is_array(),
            "object" => value.is_object(),
            other => panic!("{place}: type {other}"),
        };
        let is_one = match &schema["type"] {
            Value::Null => {
                let all = schema["enum"].as_array().cloned().unwrap_or_else(|| vec![schema["const"].clone()]);
                all.contains(value)
            }
            Value::Array(kinds) => kinds.iter().any(is_of),
            kind => is_of(kind),
        };
        let number = |key: &str, or: f64| schema[key].as_f64().unwrap_or(or);
        let range = number("minimum", f64::NEG_INFINITY)..=number("maximum", f64::INFINITY);
        if !is_one || value.as_f64().is_some_and(|number| !range.contains(&number)) {
            self.wrong.push(format!("{place}: {value}"));
            return;
        }
        match value {
            Value::Object(table) => {
                let properties = schema["properties"].as_object().unwrap();
                let keys =
                    |table: &serde_json::Map<String, Value>| table.keys().cloned().collect::<BTreeSet<_>>();
                if keys(table) != keys(properties) {
                    self.wrong.push(format!("{place}: keys {:?} for {:?}", keys(table), keys(properties)));
                    return;
                }
                table
                    .iter()
                    .for_each(|(key, value)| self.value(&properties[key], value, &format!("{place}.{key}")));
            }
            Value::Array(all) => {
                let count = number("minItems", 0.0)..=number("maxItems", f64::INFINITY);
                if !count.contains(&(all.len() as f64)) {
                    self.wrong.push(format!("{place}: {} items", all.len()));
                }
                for (index, one) in all.iter().enumerate() {
                    self.value(&schema["items"], one, &format!("{place}[{index}]"));
                }
            }
            _ => {}
        }
    }
}

#[test]
fn the_schema_refuses_nulls_keys_and_values_that_it_does_not_have() {
    let left = |ratio: Value, rows: Value| {
        serde_json::json!({"record": "a", "output": "y", "unit": "m", "rms_before": 1.0, "rms_after": null,
                           "ratio": ratio, "rows": rows})
    };
    let report = |verdict: &str, left: Value| {
        let mut report = serde_json::json!({
            "schema_version": 1, "model": "m.toml", "name": "m", "train": ["a"], "verdict": verdict, "headline": "",
            "confirmed": null, "taken_back": false, "adequate": true, "residuals": [], "parameters": [], "training": [left],
            "held_out": [], "held_out_alternatives": [], "named": [], "discovered": [], "located": null, "suspects": [],
            "structure": {"undetermined": [], "hidden": [], "without_effect": [], "twins": [], "advice": []}, "notes": [],
        });
        report["equations"] = serde_json::json!([]);
        report["declared"] = serde_json::json!([]);
        report
    };
    assert_eq!(
        against_schema(&report("guessed", left(Value::Null, (-1).into()))),
        ["$.training[0].rms_after: null", "$.training[0].rows: -1", "$.verdict: \"guessed\""]
    );
    let mut one = report("named", left(Value::Null, 1.into()));
    one["training"][0]["rms_after"] = 1.5.into();
    assert_eq!(against_schema(&one), Vec::<String>::new());
    one["structure"]["more"] = Value::Null;
    assert!(against_schema(&one)[0].starts_with("$.structure: keys"));
}
