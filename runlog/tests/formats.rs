//! Each file, as a program of this version wrote it, is read and written again to the byte.

use runlog::conditions::Conditions;
use runlog::controller_report::ControllerReport;
use runlog::discrepancy_report::Report;
use runlog::flight_dump::Event;
use runlog::golden;
use runlog::ping_pong::PingPongFile;
use runlog::summary::{ProcessReport, RunDescription, Summary};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

fn read<T: DeserializeOwned>(name: &str) -> T {
    serde_json::from_str(&golden::text(name)).unwrap()
}

fn goes_through<T: Serialize + DeserializeOwned>(name: &str) {
    let again = serde_json::to_string_pretty(&read::<T>(name)).unwrap();
    let text = golden::text(name);
    let differs = again.lines().zip(text.lines()).find(|(again, first)| again != first);
    assert_eq!(differs, None, "{name}");
    assert_eq!(again + "\n", text, "{name}");
}

#[test]
fn the_files_of_a_run_go_through_their_types() {
    goes_through::<Summary>("summary.json");
    goes_through::<RunDescription>("run.json");
    goes_through::<ControllerReport>("controller.json");
    goes_through::<Event>("event.json");
    goes_through::<Conditions>("conditions.json");
}

#[test]
fn ping_pongs_go_through_their_type() {
    let again = serde_json::to_value(read::<PingPongFile>("ping-pong.json")).unwrap();
    assert_eq!(again, read::<Value>("ping-pong.json"));
}

#[test]
fn what_is_read_of_the_report_of_close_is_written_as_it_was() {
    let document = include_str!("../../discrepancy/docs/report.md");
    let example = document.split("```").find_map(|part| part.strip_prefix("json")).unwrap();
    let read: Report = serde_json::from_str(example).unwrap();
    let [first, again]: [Value; 2] =
        [serde_json::from_str(example).unwrap(), serde_json::to_value(&read).unwrap()];
    for key in [
        "schema_version",
        "verdict",
        "summary",
        "inputs",
        "named",
        "small",
        "parameters",
        "carried",
        "adequate",
    ] {
        assert_eq!(first[key], again[key], "{key}");
    }
    for key in ["gap", "not_excited", "outside", "next"] {
        assert_eq!(first[key], again[key], "{key}");
    }
    for pointer in ["/explanations/0/sets", "/location/dependence/balance", "/verification/chi2_null"] {
        assert!(
            first.pointer(pointer).is_some() && first.pointer(pointer) == again.pointer(pointer),
            "{pointer}"
        );
    }
    assert!(serde_json::from_str::<Report>("{}").is_err(), "a report has a verdict");
}

#[test]
fn both_programs_reports_hold_what_they_have_in_common() {
    for name in ["summary.json", "controller.json"] {
        let report: ProcessReport = read(name);
        assert!(report.bus.is_some_and(|bus| bus.sent > 0), "{name}");
        assert!(report.timing.stages.wakeup_ns.count > 0 && !report.timing.arrivals.is_empty(), "{name}");
        assert_eq!(report.records_dropped, Some(0), "{name}");
    }
}

#[test]
fn files_of_earlier_versions_and_joined_ones_are_read() {
    let summary: Summary =
        serde_json::from_str(r#"{"cycles": 5, "passed": true, "frames_lost": null, "axes": {}}"#).unwrap();
    assert_eq!((summary.cycles, summary.skipped, summary.frames_lost), (Some(5), None, None));
    let report: ControllerReport =
        serde_json::from_str(r#"{"axes": {"drive": {"sensors_lost": {"drive": 1, "load": 2}}, "load": {}}}"#)
            .unwrap();
    assert_eq!((report.axes["drive"].sensors_lost, report.axes["load"].sensors_lost), (Some(3), None));
}
