//! The report as a whole: made from folders, written, read back.

use super::files::RunFiles;
use super::made_up;
use super::model::{Cause, Report, Source};
use super::samples::Samples;
use super::{ReportWithSources, choice, from_files, hlog, make_report, output};
use std::path::Path;

pub(super) fn report_of(runs: Vec<RunFiles>) -> Report {
    from_files(runs, &[], None, true).report
}

fn made_in(folder: &Path) -> ReportWithSources {
    make_report(&choice::select_runs(&[folder.into()], &[]).unwrap(), Some("Test"), true)
}

#[test]
fn a_report_goes_through_its_file_unchanged() {
    let mut run = made_up::run(3000);
    made_up::stall(&mut run, "emulator", 500, 5_400_000).vitals.continued = 1;
    made_up::reference(&mut run, (0..3000).map(|n| 9_000 + n).collect());
    let report = report_of(vec![run; 6]);
    assert!(report.ratios.iter().all(|ratio| ratio.interval.is_some()));
    let text = serde_json::to_string_pretty(&report).unwrap();
    let back: Report = serde_json::from_str(&text).unwrap();
    let again = serde_json::to_string_pretty(&back).unwrap();
    let differs = again.lines().zip(text.lines()).find(|(again, first)| again != first);
    assert_eq!(differs, None);
    assert!(!text.contains("NaN"));
}

#[test]
fn no_key_of_a_report_is_lost() {
    let mut run = made_up::run(3000);
    made_up::stall(&mut run, "emulator", 500, 5_400_000).vitals.continued = 1;
    made_up::reference(&mut run, (0..3000).map(|n| 9_000 + n).collect());
    let report = serde_json::to_value(report_of(vec![run; 6])).unwrap();
    runlog::golden::check("report.keys", &runlog::golden::keys(&report));
}

#[test]
fn all_files_are_written_and_the_log_holds_every_sample() {
    let folder = tempfile::tempdir().unwrap();
    made_up::write(&made_up::run(2000), &folder.path().join("1"));
    made_up::write(&made_up::run(3000), &folder.path().join("2"));
    let made = made_in(folder.path());
    let out = folder.path().join("report");
    output::write(&made, &out, false).unwrap();
    let text = std::fs::read_to_string(out.join("latency.hlog")).unwrap();
    let intervals = hlog::read(&text).unwrap();
    for distribution in &made.report.distributions {
        let tagged = intervals.iter().filter(|interval| interval.tag == distribution.name);
        let mut sum = Samples::default();
        tagged.for_each(|interval| sum.add(&interval.samples));
        assert_eq!(sum.count(), distribution.percentiles_ns.count, "{}", distribution.name);
        assert_eq!(sum.percentiles_ns(), distribution.percentiles_ns, "{}", distribution.name);
        let binned: u64 = distribution.bins.iter().map(|bin| bin.count).sum();
        assert_eq!(binned, distribution.percentiles_ns.count, "{}", distribution.name);
    }
    let wakeup = &made.report.distributions[0];
    assert_eq!((wakeup.name.as_str(), wakeup.percentiles_ns.count), ("emulator-wakeup", 5000));
    for name in ["report.json", "report.md", "report.html", "jitterdebugger.json"] {
        assert!(out.join(name).metadata().unwrap().len() > 100, "{name}");
    }
    let markdown = std::fs::read_to_string(out.join("report.md")).unwrap();
    for heading in ["# Test", "## Percentiles in us", "## Runs", "## Lost, late, duplicate", "## Conditions"]
    {
        assert!(markdown.contains(heading), "{heading}");
    }
}

#[test]
fn ping_pongs_beside_a_run_are_references_with_ratios() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = made_up::run(2000);
    // The rig's round trip is in its log or its summary, never in the rows.
    made_up::edit_summary(&mut run, |summary| {
        summary["round_trip_ns"] = serde_json::json!({ "p50": 30_000, "count": 2000 });
    });
    made_up::write(&run, folder.path());
    let part = |tag: &str, ns: u64| hlog::Interval {
        tag: tag.into(),
        start_s: 0.0,
        duration_s: 10.0,
        samples: (0..100).map(|_| ns).collect(),
    };
    let parts = [part("ping-pong-bus", 20_000), part("ping-pong-bus-to-arrival", 16_000)];
    let mut log = Vec::new();
    hlog::write(&mut log, 1e9, &parts).unwrap();
    std::fs::write(folder.path().join("ping-pong-bus.hlog"), log).unwrap();
    // An older measurement left the figures alone.
    let reported =
        serde_json::json!({ "socketpair": { "p50": 8_000, "count": 100 }, "commands": { "bus": "bench x" } });
    std::fs::write(folder.path().join("ping-pong.json"), reported.to_string()).unwrap();
    let report = made_in(folder.path()).report;
    let bus = report.distributions.iter().find(|one| one.name == "ping-pong-bus").unwrap();
    assert_eq!((bus.source, bus.percentiles_ns.count), (Source::Reference, 100));
    let names: Vec<_> = report.ratios.iter().map(|ratio| ratio.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "drive-round-trip p50 / ping-pong-bus p50",
            "drive-round-trip p50 / ping-pong-bus-to-arrival p50",
            "drive-round-trip p50 / ping-pong-socketpair p50",
        ]
    );
    assert!(report.conditions.command_lines.iter().any(|fact| fact.name == "ping-pong bus"));
}

#[test]
fn only_the_markdown_is_written_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    output::write(&from_files(vec![made_up::run(10)], &[], None, false), &out, true).unwrap();
    let names: Vec<_> = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["report.md"]);
}

#[test]
fn what_is_missing_or_damaged_is_reported_and_the_rest_is_used() {
    let folder = tempfile::tempdir().unwrap();
    made_up::write(&made_up::run(500), folder.path());
    std::fs::remove_file(folder.path().join("summary.json")).unwrap();
    std::fs::write(folder.path().join("emulator.hlog"), "Tag=a,nonsense\n").unwrap();
    let table = folder.path().join("controller-timing.csv");
    let text = std::fs::read_to_string(&table).unwrap();
    let damaged: Vec<_> =
        text.lines().enumerate().map(|(n, line)| if n == 7 { "1,2" } else { line }).collect();
    std::fs::write(&table, damaged.join("\n") + "\n").unwrap();
    let report = made_in(folder.path()).report;
    let lacks = report.runs[0].lacks.join("\n");
    for words in [
        "summary.json",
        "emulator.hlog is damaged and was read up to there: line 1",
        "controller-timing.csv is damaged and was left out: line 8",
    ] {
        assert!(lacks.contains(words), "{words} in {lacks}");
    }
    assert_eq!(report.distributions[0].percentiles_ns.count, 500, "the rig's rows still speak");
    assert!(!report.claim.supported);
}

#[test]
fn a_run_of_the_flight_recorder_alone_has_its_events_explained() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = made_up::run(500);
    made_up::stall(&mut run, "emulator", 100, 5_400_000).vitals.continued = 1;
    made_up::stall(&mut run, "emulator", 300, 2_400_000);
    let mut windows = Vec::new();
    for cycle in [105, 302] {
        let mut window = run.clone();
        window.rows.values_mut().for_each(|rows| rows.retain(|row| row.cycle.abs_diff(cycle) < 30));
        windows.push((cycle, window));
    }
    run.rows.clear();
    made_up::write(&run, folder.path());
    for (cycle, window) in windows {
        let dump = folder.path().join(format!("flight/emulator-{cycle:010}-overrun"));
        made_up::write(&window, &dump);
        std::fs::rename(dump.join("emulator-timing.csv"), dump.join("timing.csv")).unwrap();
    }
    let causes: Vec<_> = made_in(folder.path()).report.worst.iter().map(|event| event.cause).collect();
    assert_eq!(causes, [Cause::EmulatorStopped, Cause::MachineStoodStill]);
}
