//! What no effect of the catalogue explains is added to the model as a table, and closes the gap on another record.

use crate::record::{STROKES_RAD_PER_S, hiding, measurement};
use discrepancy::report::{Report, Verdict};
use discrepancy::workflow::{Outcome, RigFile, Task, close, extended};
use plant::RigParameters;

/// Closes on two records of a rig with something hidden in it that is no candidate.
fn closed(hidden: &RigParameters, without: &str) -> (Outcome, RigFile) {
    let folder = tempfile::tempdir().expect("a folder");
    let [rig, train, test] = ["rig.toml", "train.csv", "test.csv"].map(|name| folder.path().join(name));
    std::fs::write(&rig, RigParameters::BASELINE_TOML).expect("the folder is ours");
    std::fs::write(&train, measurement(hidden, 11, STROKES_RAD_PER_S)).expect("the folder is ours");
    std::fs::write(&test, measurement(hidden, 12, 1.0)).expect("the folder is ours");
    let task = Task {
        rig: rig.clone(),
        train: vec![train],
        test: Some(test),
        without: vec![without.to_owned()],
        ..Task::default()
    };
    (close(&task, &mut |_| ()).expect("good records"), RigFile::read(&rig).expect("good"))
}

#[test]
fn a_spring_that_is_no_candidate_is_added_as_a_table_that_closes_the_gap() {
    let hidden = hiding(&[("position-dependent-force", "drive", &[("spring_n", 30.0)])]);
    let (outcome, rig_file) = closed(&hidden, "position-dependent-force");
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::OutsideCatalogue, "{}", report.summary);
    assert!(report.named.is_empty());
    assert_eq!(report.adequate, Some(false));
    let located = report.location.as_ref().and_then(|location| location.dependence.as_ref());
    let located = located.expect("whatever the verdict");
    assert_eq!((located.balance.as_str(), located.variables[0].variable.as_str()), ("drive.force", "x"));
    let nearest =
        &report.nearest.as_ref().expect("a friction that depends on the position is like it").effect;
    assert!(report.summary.contains(&format!("It resembles {nearest} (drive), whose law takes")));
    assert!(!outcome.extended.as_ref().expect("a usable record").contains(nearest));
    let outside = report.outside.as_ref().expect("of this verdict");
    assert!(outside.added && outside.why_not.is_none(), "{:?}", outside.why_not);
    let table = &outside.tables[0];
    assert_eq!((table.balance.as_str(), table.variable.as_str()), ("drive.force", "x"));

    let closed: Vec<f64> = report.misfit.values().filter_map(|misfit| misfit.closed).collect();
    assert!(closed.len() >= 2 && closed.iter().all(|share| *share > 0.6), "{:?}", report.misfit);
    assert!(report.verification.as_ref().expect("of a test").confirmed);

    // The rig file loads, has the table to the bit and says where it is from; the report alone gives the same file.
    let text = outcome.extended.expect("a usable record");
    let rig = RigParameters::from_toml(&text, "rig.toml").expect("the extended file is a rig");
    assert_eq!(rig.tabulated().len(), outside.tables.len());
    assert_eq!(rig.tabulated()[0].value, outside.tables[0].value);
    assert!(text.contains("# Found from ") && text.contains("train.csv"));
    let written = serde_json::to_string(report).expect("a report is JSON");
    let reported: Report = serde_json::from_str(&written).expect("what other steps read");
    assert_eq!(extended(&rig_file, &reported).expect("the same"), text);
}

#[test]
fn what_a_table_cannot_add_to_is_described_and_not_added() {
    let hidden = hiding(&[("force-sensor-offset", "drive", &[("offset_n", 25.0)])]);
    let (outcome, _) = closed(&hidden, "force-sensor-offset");
    let outside = outcome.report.outside.as_ref().expect("an offset is no other effect");
    assert_eq!(outside.balance, "drive.force-sensor");
    assert!(!outside.added && outside.tables.is_empty());
    assert!(outside.why_not.as_ref().is_some_and(|why| why.contains("force-sensor is neither")));
    assert!(!outcome.extended.expect("a usable record").contains("tabulated"));
}
