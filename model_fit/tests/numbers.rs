//! What is said of the numbers of a model file, and of a report that is another model's.

use crate::closing::{close, file, number};
use model_fit::{ClosedModel, ModelReport, explain, read};
use serde_json::Value;
use std::path::Path;

const LINE: &str = r#"
[inputs.u]
unit = "V"
[parameters]
gain = { unit = "mm/V", value = 1, range = [0, 2] }
[outputs.y]
unit = "mm"
value = "gain*u"
[[suspects]]
name = "square"
place = "y"
add = "c*u^2"
parameters.c = { unit = "mm/V^2", value = 0.01, range = [0, 9] }
"#;

/// 300 rows of an output of u with a noise of 0.1 mm, u from -1 V on in steps of `step` V.
fn record(step: f64, output: impl Fn(f64) -> f64) -> String {
    let row = |k: u32| {
        let u = -1.0 + step * f64::from(k % 5);
        format!("{},{u},{}\n", f64::from(k) * 0.1, output(u) + 0.01 * f64::from(k * k % 31) - 0.15)
    };
    "t_s,u,y\n".to_owned() + &(0..300).map(row).collect::<String>()
}

fn closed(folder: &Path, model: &str, train: &str, test: Option<&str>) -> ClosedModel {
    let (model, train) = (file(folder, "model.toml", model), file(folder, "train.csv", train));
    let tests: Vec<_> = test.into_iter().map(|test| file(folder, "test.csv", test)).collect();
    close(&model, &[train], &tests).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_number_at_the_end_of_its_range_is_named_and_has_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let report = closed(folder.path(), LINE, &record(0.5, |u| 3.0 * u), None).report;
    let gain = &report.parameters[0];
    assert!(gain.is_at_bound && gain.standard_error.is_none(), "{gain:?}");
    let said = "gain ended at the end of its range, 2.00 mm/V";
    assert!(report.notes.iter().any(|note| note.starts_with(said)), "{:?}", report.notes);
    let square = &report.suspects[0].decision;
    assert!(square.contains("ended at the end of"), "{square}");
}

#[test]
fn a_number_that_is_far_from_what_is_known_of_it_is_said_in_tolerances() {
    let folder = tempfile::tempdir().unwrap();
    let of = |tolerance: &str| {
        let known = LINE.replace("value = 1, range = [0, 2]", &format!("value = 1, tolerance = {tolerance}"));
        closed(folder.path(), &known, &record(0.5, |u| 1.5 * u), None).report.notes
    };
    let said = "gain is 1.06 mm/V, 6.32 tolerances from 1.00: is its unit, its sign or the tolerance wrong";
    let notes = of("0.01");
    assert!(notes.iter().any(|note| note.starts_with(said)), "{notes:?}");
    assert!(of("0.3").iter().all(|note| !note.contains("tolerances from")));
}

#[test]
fn a_number_whose_error_is_as_large_as_itself_is_said_to_be_hardly_determined() {
    let folder = tempfile::tempdir().unwrap();
    let weak = LINE
        .replace("value = \"gain*u\"", "value = \"gain*u + small*u^2\"")
        .replace("[outputs.y]", "small = { unit = \"mm/V^2\", value = 0.001, range = [0, 9] }\n[outputs.y]");
    let train = record(0.5, |u| 1.5 * u + 0.003 * u * u);
    let report = closed(folder.path(), &weak, &train, None).report;
    let small = number(&report, "small");
    assert!(
        small.is_at_bound || small.standard_error.is_some_and(|error| error > 0.5 * small.value),
        "{small:?}"
    );
    assert!(report.notes.iter().any(|note| note.starts_with("small ")), "{:?}", report.notes);
    let text = explain(&folder.path().join("model.toml"), &[folder.path().join("train.csv")]).unwrap();
    assert!(text.contains("\n  small "), "{text}");
}

#[test]
fn a_held_out_record_that_is_left_much_worse_is_remarked_with_the_ratio() {
    let folder = tempfile::tempdir().unwrap();
    let plant = |u: f64| 1.5 * u + 0.5 * u * u;
    // The square is named; at up to 19 V a cube shows that is not in the training record.
    let test = record(5.0, |u| plant(u) + 1e-3 * u.powi(3));
    let report = closed(folder.path(), LINE, &record(0.5, plant), Some(&test)).report;
    assert_eq!(report.named.len(), 1, "{report:#?}");
    assert!(
        report.headline.contains("better on what was held out, though on test.csv y ")
            && report.headline.contains(" times that of the training records"),
        "{}",
        report.headline
    );
    assert_eq!(report.confirmed, Some(true));
}

/// Whether a report is of a model file of this text, or why not.
fn is_of(reported: &Value, folder: &Path, text: &str) -> Result<(), String> {
    let reported: ModelReport = serde_json::from_value(reported.clone()).unwrap();
    let model = read(&file(folder, "other.toml", text)).unwrap();
    reported.is_of(&model).map_err(|error| error.to_string())
}

#[test]
fn the_report_of_another_model_extends_none() {
    let folder = tempfile::tempdir().unwrap();
    let report = closed(folder.path(), LINE, &record(0.5, |u| 1.5 * u + u * u), None).report;
    let reported = serde_json::to_value(&report).unwrap();
    let is_of = |text: &str| is_of(&reported, folder.path(), text);
    assert_eq!(is_of(LINE), Ok(()));
    assert_eq!(is_of(&LINE.replace("value = 1,", "value = 1.2,")), Ok(()));
    let other = is_of(&LINE.replace("\"gain*u\"", "\"gain*u + 0.1[mm]\"")).unwrap_err();
    assert!(
        other.contains("the report is of another model") && other.contains("output y = gain*u"),
        "{other}"
    );
}

/// Changes of a file, each with the line of its first version that tells them apart.
const CHANGES: [[&str; 3]; 6] = [
    ["unit = \"V\"", "unit = \"mV\"", "input u [V] from column u, kept between samples"],
    ["[0, 2]", "[0, 3]", "number gain [mm/V] fitted within 0 to 2"],
    ["[0, 9] }", "[0, 9], fixed = true }", "number c of square [mm/V^2] fitted within 0 to 9"],
    ["unit = \"mm\"\nvalue", "unit = \"mm\"\nscale = 2\nvalue", "output y [mm], column y"],
    ["y = [0, 2]", "y = [0, 2.5]", "table bump: 2 points, 1 over 1, area 1"],
    [
        "start_samples = 3",
        "start_samples = 4",
        "held out: the first 3 samples of a record are for its start, and not scored",
    ],
];

/// What would change a number, or what it means, is another version; a report of another schema is none at all.
#[test]
fn the_report_of_another_version_of_a_file_extends_none() {
    let folder = tempfile::tempdir().unwrap();
    let more = "[tables.bump]\nx = [0, 1]\ny = [0, 2]\n[held_out]\nstart_samples = 3\n";
    let model_file = LINE.to_owned() + more;
    let report = closed(folder.path(), &model_file, &record(0.5, |u| 1.5 * u + u * u), None).report;
    let mut reported = serde_json::to_value(&report).unwrap();
    let is_of = |reported: &Value, text: &str| is_of(reported, folder.path(), text);
    assert_eq!(is_of(&reported, &model_file), Ok(()));
    assert_eq!(is_of(&reported, &format!("# A comment.\n{model_file}")), Ok(()));
    for [from, to, line] in CHANGES {
        assert!(model_file.contains(from), "{from}\n{model_file}");
        let refused = is_of(&reported, &model_file.replacen(from, to, 1)).unwrap_err();
        let message = format!(
            "the model file was changed since its report: one of both has no '{line}'; close it again"
        );
        assert_eq!(refused, message, "{from} to {to}");
    }
    reported["schema_version"] = 2.into();
    let refused = is_of(&reported, &model_file).unwrap_err();
    assert_eq!(refused, "the report has schema version 2; this program reads 1");
}
