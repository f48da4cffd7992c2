//! What `bench report` writes is read by others: HdrHistogram's Python package, and whoever expects jitterdebugger's JSON.

use serde_json::Value;
use std::path::{Path, PathBuf};
use system_tests::foreign_python::run_script;
use system_tests::{CompletedProcess, Pace, Program, Running, SHORT, Scene, count, json, run_both, turn};

fn run(scene: &Scene) -> PathBuf {
    let _machine = turn::take();
    let out = scene.path("run");
    run_both(&scene.emulator(Pace::Real).out(&out), &scene.controller(Pace::Real).out(&out));
    out
}

fn report(folder: &Path, options: &[&str]) -> CompletedProcess {
    let mut bench = Program::Bench.command();
    Running::start("bench report", bench.arg("report").arg(folder).args(options)).wait()
}

/// What the Python package makes of a log: count and maximum of each tag.
fn read_by_python(log: &Path) -> Value {
    let printed = run_script("read_hlog.py", &[log]);
    serde_json::from_str(&printed).unwrap_or_else(|error| panic!("{error}: {printed}"))
}

#[test]
fn others_read_what_a_report_writes() {
    let scene = Scene::new(SHORT);
    let out = run(&scene);
    let reported = report(&out, &[]).expect_code(0).stdout;
    assert!(reported.contains("emulator-wakeup"), "{reported}");

    let report_json = json(&out.join("report.json"));
    assert_eq!(report_json["schema"], "airbench-latency-report");
    let distributions = report_json["distributions"].as_array().expect("a list");
    assert!(!distributions.is_empty());
    let read = read_by_python(&out.join("latency.hlog"));
    assert_eq!(read.as_object().expect("tags").len(), distributions.len());
    for distribution in distributions {
        let name = distribution["name"].as_str().expect("a name");
        let percentiles = &distribution["percentiles_ns"];
        assert_eq!(count(&read[name], "/count"), count(percentiles, "/count"), "{name}");
        let (theirs_ns, ours_ns) = (count(&read[name], "/max"), count(percentiles, "/max"));
        // Either end of a bin of three significant digits.
        assert!(theirs_ns.abs_diff(ours_ns) <= ours_ns / 500 + 1, "{name}: {theirs_ns} and {ours_ns}");
    }

    let jitter = json(&out.join("jitterdebugger.json"));
    assert_eq!(jitter["version"], 2);
    assert!(jitter["sysinfo"]["release"].as_str().is_some_and(|release| !release.is_empty()), "{jitter:#}");
    let rig = &jitter["cpu"]["0"];
    let bins = rig["histogram"].as_object().expect("bins");
    let counted: u64 = bins.values().map(|samples| samples.as_u64().expect("a count")).sum();
    assert_eq!(counted, count(rig, "/count"));
    assert!(bins.keys().all(|us| us.parse::<u64>().is_ok()));
    assert!(count(rig, "/min") <= count(rig, "/max"));
    let page = std::fs::read_to_string(out.join("report.html")).expect("the page");
    assert!(page.starts_with("<!") && page.contains("emulator-wakeup"), "no page of this run");
}

#[test]
fn bounds_and_bad_input_have_their_exit_codes() {
    let scene = Scene::new(SHORT);
    let out = run(&scene);
    let bounds = |name: &str, text: &str| {
        let file = scene.write(name, &format!("[bounds]\n{text}\n"));
        report(&out, &["--bounds", file.to_str().expect("a path"), "--markdown-only"])
    };
    bounds("kept.toml", "\"counts.cycles\" = { min = 1 }").expect_code(0);
    let broken = bounds("broken.toml", "\"emulator-wakeup.p50_ns\" = { max = 1 }").expect_code(1);
    assert!(broken.stdout.contains("BROKEN"), "{}", broken.stdout);
    let unknown = bounds("unknown.toml", "\"emulator-wakup.p50_ns\" = { max = 1 }").expect_code(2);
    assert!(unknown.stderr.contains("there are emulator-wakeup."), "{}", unknown.stderr);
    let nothing = report(&scene.path("nothing"), &[]).expect_code(2);
    assert!(nothing.stderr.contains("nothing"), "{}", nothing.stderr);
}
