//! Studies put together by hand: what is counted where, and which folders go together.

use super::*;
use crate::folder::{Plan, make_whole};
use crate::program::{Execution, ProgramEnd};
use plant::effects::SHEETS;
use serde_json::json;
use std::fs;
use std::path::Path;

fn identity(name: &str) -> Identity {
    Identity { name: name.to_owned(), crc32: 7, arguments: vec![], leave_out: false }
}

/// A study whose program always tells the truth.
fn study(root: &Path, program: &str) -> Study {
    part_of_study(root, program, |_| true)
}

/// The same with the results of some draws.
fn part_of_study(root: &Path, program: &str, holds: impl Fn(usize) -> bool) -> Study {
    let study = Study::begin(root, &Plan::new(3, Shape::SMALL)).unwrap();
    for draw in study.draws.iter().filter(|draw| holds(draw.number)) {
        leave(&study, draw.number, identity(program), vec![], &truth_of(draw));
    }
    study
}

fn leave(study: &Study, number: usize, program: Identity, without: Vec<String>, report: &Value) {
    let taken = Execution { ended: ProgramEnd::Exited(0), wall_s: 2.0, memory_kib: 2048 };
    let result = RunResult { schema_version: 1, number, program, taken, without };
    make_whole(&study.run("truth", number), |folder| {
        fs::write(folder.join("result.json"), json!(result).to_string()).unwrap();
        fs::write(folder.join("report.json"), report.to_string()).unwrap();
        Ok::<_, FolderError>(())
    })
    .unwrap();
}

fn truth_of(draw: &Draw) -> Value {
    let named: Vec<_> = draw
        .recipe
        .hidden
        .iter()
        .map(|hidden| {
            let sheet = plant::effects::sheet(hidden.name).unwrap();
            let parameters: Vec<_> = sheet
                .keys
                .iter()
                .zip(&hidden.numbers)
                .map(|(key, number)| {
                    json!({"name": key.name, "value": number, "unit": key.unit.name(), "standard_error": number.abs() / 10.0})
                })
                .collect();
            let place = hidden.place.to_string();
            let (axis, element) = place.split_once('.').map_or((place.as_str(), None), |(axis, element)| (axis, Some(element)));
            json!({"effect": hidden.name, "where": {"axis": axis, "element": element}, "parameters": parameters})
        })
        .collect();
    let parameters: Vec<_> = draw
        .recipe
        .wrong_parameters
        .iter()
        .map(|(name, factor)| json!({"name": name, "value": factor, "unit": "", "standard_error": 0.01}))
        .collect();
    let verdict = match (named.is_empty(), parameters.is_empty()) {
        (false, _) => "named",
        (true, false) => "parameters-only",
        (true, true) => "nothing-missing",
    };
    json!({"schema_version": 1, "verdict": verdict, "named": named, "parameters": parameters,
        "gap": {"p": {"before": 4.0, "after": 1.0, "floor": 1.0, "closed": 1.0}}})
}

/// A study of everything whose program always tells the truth, scored.
pub(crate) fn scored(label: &str) -> Score {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), label);
    Score { label: label.to_owned(), ..score(&[folder.path().to_owned()], "truth", UNKNOWN).unwrap() }
}

/// The same, whose effects were left out of the catalogue: it tells what is expected, and names nothing.
pub(crate) fn scored_without(label: &str) -> Score {
    let folder = tempfile::tempdir().unwrap();
    let expectations = without(folder.path());
    let known = ScoreInputs { expectations: Some(&expectations), ..UNKNOWN };
    Score { label: label.to_owned(), ..score(&[folder.path().to_owned()], "truth", known).unwrap() }
}

fn without(root: &Path) -> Expectations {
    let expectations: Expectations =
        serde_json::from_str(include_str!("../../../study/outside-expected.json")).unwrap();
    let study = Study::begin(root, &Plan::new(3, Shape::SMALL)).unwrap();
    for draw in study.draws.iter().filter(|draw| draw.kind == Kind::Single) {
        let hidden = &draw.recipe.hidden[0];
        let program = Identity { leave_out: true, ..identity("humble") };
        let expected = &expectations[hidden.name];
        let axis = crate::draws::axis_of(hidden.place).unwrap_or(plant::Axis::Load).name();
        let balance = match expected.balances[0].as_str() {
            "linkage" => "linkage".to_owned(),
            name => format!("{axis}.{name}"),
        };
        let variables = json!([{"variable": expected.variables[0], "r2": 0.9, "p_value": 0.005}]);
        let report = json!({"verdict": "outside-catalogue", "outside": {"balance": balance, "variables": variables},
            "gap": {"x": {"before": 3.0, "after": 2.0, "floor": 1.0, "closed": 0.625}}});
        leave(&study, draw.number, program, vec![hidden.name.to_owned()], &report);
    }
    expectations
}

#[test]
fn with_effects_left_out_only_single_draws_are_wanted_and_the_tables_are_others() {
    let score = scored_without("without");
    assert_eq!(score.cases.len(), SHEETS.len());
    let tables = score.leave_out.as_ref().unwrap();
    let all = tables.splits.iter().find(|split| split.name == "all").unwrap();
    for rate in [all.no_wrong_name, all.both_right] {
        assert_eq!((rate.count, rate.of), (SHEETS.len(), SHEETS.len()));
    }
    assert_eq!(all.verdicts["outside-catalogue"], SHEETS.len());
    assert_eq!(tables.splits[0].no_wrong_name.of + tables.splits[1].no_wrong_name.of, SHEETS.len());
    assert!(tables.splits[0].claimed_closed_ratio.quantiles.unwrap() == [0.625; 4]);
    let line = |name: &str| score.tables.headline.iter().find(|line| line.name.contains(name)).unwrap().rate;
    assert_eq!(line("all signals together closed").count, tables.splits[0].no_wrong_name.of);
    assert!(score.tables.splits.is_empty() && score.cases[0].repeat.contains("one leave-out "));
    let page = crate::page::page(&score);
    for part in ["no wrong name", "What was told", "outside-catalogue 1", "were left out"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("Nothing hidden</h2>"));

    // What must show is wanted then, and every single draw.
    let folder = tempfile::tempdir().unwrap();
    let expectations = without(folder.path());
    let folders = [folder.path().to_owned()];
    assert!(matches!(super::score(&folders, "truth", UNKNOWN), Err(ScoreError::NoExpectations)));
    fs::remove_dir_all(folder.path().join("runs/truth/0007")).unwrap();
    let known = ScoreInputs { expectations: Some(&expectations), ..UNKNOWN };
    let missing = super::score(&folders, "truth", known);
    assert!(matches!(missing, Err(ScoreError::MissingRuns { count: 1, first: 7, .. })));
}

const UNKNOWN: ScoreInputs<'_> =
    ScoreInputs { limits: None, classes: None, expectations: None, partly: false };

#[test]
fn whoever_tells_the_truth_has_all_points() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "oracle");
    let score = score(&[folder.path().to_owned()], "truth", UNKNOWN).unwrap();
    assert_eq!(score.cases.len(), SHEETS.len() + 2 + 4 + 1 + 1);
    assert_eq!(score.without_classes, SHEETS.len() + 2);
    let all = &score.tables.splits[0];
    for rate in [all.class_right, all.top, all.alone, all.where_right] {
        assert_eq!((rate.count, rate.of), (SHEETS.len(), SHEETS.len()));
    }
    let rate =
        |name: &str| score.tables.headline.iter().find(|line| line.name.starts_with(name)).unwrap().rate;
    assert_eq!((rate("nothing hidden").count, rate("nothing hidden").of), (0, 2));
    assert_eq!(rate("a parameter off: reported").count, 4);
    assert_eq!(rate("no good report").count, 0);
    let foreign = score.cases.iter().filter(|case| case.kind == Kind::Single && case.foreign_form).count();
    assert_eq!(score.tables.numbers.covered.count, SHEETS.len() - foreign);
    // Reading JSON may round the last digit.
    assert!(score.tables.numbers.off_ratio.quantiles.unwrap()[3] < 1e-15);
    assert_eq!(score.tables.claimed_closed_ratio.quantiles.unwrap()[0], 1.0);
    assert_eq!(score.tables.confusion[3].called[&score.tables.confusion[3].truth], [1, 1, 1]);

    let page = crate::page::page(&score);
    for part in ["oracle", "scripts/study one run", "color-mix", "valve-hysteresis", "claimed"] {
        assert!(page.contains(part), "{part}");
    }
    // Nothing from elsewhere.
    assert!(!page.contains("http") && !page.contains("src="));
    json!(score);
}

#[test]
fn amplitudes_stand_in_the_bin_of_their_limit() {
    let folder = tempfile::tempdir().unwrap();
    let study = study(folder.path(), "oracle");
    let draw = study.draws.iter().find(|draw| draw.recipe.hidden[0].name == "inclination").unwrap();
    let hidden = &draw.recipe.hidden[0];
    let limits = |limit_value| Limits {
        schema_version: 1,
        window_ms: 100,
        seed: 1,
        limits: vec![crate::limits::Limit {
            effect: "inclination".to_owned(),
            place: hidden.place.to_string(),
            key: "force_n".to_owned(),
            unit: "N".to_owned(),
            side: None,
            limit_value,
            strength: 1.0,
            excited: limit_value.is_some(),
        }],
    };
    let over = |limit| {
        let limits = limits(limit);
        let known = ScoreInputs { limits: Some(&limits), ..UNKNOWN };
        score(&[folder.path().to_owned()], "truth", known).unwrap().cases[draw.number].over_limit[0]
    };
    let ratio = over(Some(hidden.numbers[0].abs() / 5.0)).unwrap();
    assert!((ratio - 5.0).abs() < 1e-12, "{ratio}");
    // Not excited by any amplitude: below every limit.
    assert_eq!(over(None), Some(0.0));
}

#[test]
fn folders_are_scored_together_when_each_result_is_there_once() {
    let folder = tempfile::tempdir().unwrap();
    let part = |name: &str, index: usize, program: &str| {
        let root = folder.path().join(name);
        part_of_study(&root, program, |number| number % 3 == index);
        root
    };
    let [a, b, c] = [part("a", 0, "p"), part("b", 1, "p"), part("c", 2, "p")];
    let again = part("again", 1, "p");
    let foreign = part("foreign", 2, "q");
    let other = folder.path().join("other");
    Study::begin(&other, &Plan::new(4, Shape::SMALL)).unwrap();
    let of = |folders: &[&PathBuf]| {
        let folders: Vec<PathBuf> = folders.iter().map(|folder| (*folder).clone()).collect();
        score(&folders, "truth", UNKNOWN)
    };
    let whole = of(&[&c, &a, &b]).unwrap();
    assert!(whole.cases.iter().enumerate().all(|(at, case)| case.number == at));
    assert_eq!(whole.tables.splits[0].top.count, SHEETS.len());
    assert!(matches!(of(&[&a, &b]), Err(ScoreError::MissingRuns { first: 2, .. })));
    assert!(matches!(of(&[&a, &b, &again, &c]), Err(ScoreError::Duplicate { number: 1, .. })));
    assert!(matches!(of(&[&a, &other, &c]), Err(ScoreError::DifferentStudies { .. })));
    assert!(matches!(of(&[&a, &b, &foreign]), Err(ScoreError::Programs { .. })));
    assert!(matches!(of(&[]), Err(ScoreError::Empty)));
}
