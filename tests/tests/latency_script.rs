//! `scripts/latency`: help, arguments that cannot be used, and a shortest measurement as a whole.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use system_tests::{CompletedProcess, PATIENCE, Program, Running, json, script, skip, workspace};

fn latency(arguments: &[&str]) -> CompletedProcess {
    script("latency", arguments, 2 * PATIENCE)
}

#[test]
fn help_tells_options_files_and_exit_codes() {
    let ended = latency(&["--help"]).expect_code(0);
    let parts = ["--pairs", "--probe", "--load", "report.html", "Exit codes: 0 good; 1", "130 interrupted"];
    ended.expect_stdout(&parts);
}

#[test]
fn arguments_that_cannot_be_used_are_refused_before_anything_is_built() {
    let wrong: [(&[&str], &str); 13] = [
        (&["--fly"], "unknown argument --fly"),
        (&["--pairs"], "--pairs needs a value"),
        (&["--pairs", "0"], "from 1 to 1000"),
        (&["--seconds", "1.5"], "whole number"),
        (&["--priority", "99"], "from 2 to 98"),
        (&["--spin-us", "1000"], "from 0 to 999"),
        (&["--cpu", "4711"], "may not use CPU 4711"),
        (&["--bus", "vcan0"], "can://IFACE"),
        (&["--experiment", "nothing-of-this-name"], "scripts/run --list"),
        (&["--bounds", "/nowhere.toml"], "cannot be read"),
        (&["--claims", "--bounds", "/nowhere.toml"], "leave one out"),
        (&["--claims", "--spin-us", "0"], "leave out --spin-us 0"),
        (&["--out", "/proc/airbench"], "--out"),
    ];
    for (arguments, hint) in wrong {
        latency(arguments).expect_code(2).expect_stderr(&[hint]);
    }
}

#[test]
fn a_pair_leaves_runs_references_reports_and_the_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("latency");
    let out = out.to_str().expect("a path in ASCII");
    let load = ["--load", "sleep 1000"];
    let ended =
        latency(&[&["--pairs", "1", "--seconds", "2", "--out", out][..], &load].concat()).expect_code(0);
    let round_trip = "drive-round-trip p50 / ping-pong-bus p50";
    ended.expect_stdout(&["pair 1 of 1, cyclictest:", "left", round_trip, "spinning / claimed"]);
    let run = Path::new(out).join("pair-01/run");
    for file in ["run.json", "summary.json", "ping-pong.json", "ping-pong-bus.hlog", "conditions.json"] {
        assert!(run.join(file).exists(), "{file}");
    }
    for file in
        ["report.html", "report.json", "spin/report.json", "table.md", "pair-01/run-spin/summary.json"]
    {
        assert!(Path::new(out).join(file).exists(), "{file}");
    }
    let reported = json(&run.join("conditions.json"));
    assert_eq!(
        (reported["group"].as_str(), reported["load_generator"].as_str()),
        (Some("plain"), Some("sleep 1000"))
    );
    assert_eq!((reported["pair"].as_u64(), reported["probe"].as_bool()), (Some(1), Some(false)));
    // Where the package cannot be had, that is reported instead.
    if run.join("cyclictest.json").exists() {
        let command = reported["reference_command"].as_str();
        assert!(command.is_some_and(|command| command.starts_with("cyclictest -m -p 80")));
        assert!(ended.stdout.contains("emulator-wakeup p99 / cyclictest p99"), "{}", ended.stdout);
    } else {
        let why = reported["reference_missing_because"].as_str().expect("a reason");
        skip::report("a_pair_leaves_runs_references_reports_and_the_table: cyclictest", why);
    }
    // A second measurement into the same folder would mix the two.
    let _ =
        latency(&["--pairs", "1", "--seconds", "1", "--out", out]).expect_code(2).expect_stderr(&["earlier"]);
}

#[test]
fn claims_are_judged_gaps_are_recorded_and_the_page_gets_the_table() {
    let folder = tempfile::tempdir().expect("a folder");
    // A checkout of links, but for the page that is written.
    let root = folder.path();
    for part in ["controller", "discrepancy", "latency", "plant", "protocol", "scripts", "target"] {
        symlink(workspace().join(part), root.join(part)).expect("a link");
    }
    let page = root.join("bench/docs/latency.md");
    fs::create_dir_all(root.join("bench/docs")).expect("a folder of our own");
    fs::write(&page, "before\n<!-- latency: begin -->\nold\n<!-- latency: end -->\nafter\n").expect("a page");
    let mut latency = Program::Airbench.command();
    latency.env("AIRBENCH_SHARE", root).arg("latency").arg("--out").arg(root.join("out"));
    latency.args(["--pairs", "1", "--seconds", "1", "--claims", "--probe", "--write"]);
    let ended = Running::start("airbench latency", &mut latency).wait();
    let run = root.join("out/pair-01/run");
    // One pair resolves no claim; a reference that was not measured breaks it. A claim about the spinning runs has no reference:
    // a machine that takes their core away for long breaks it, which a message says.
    let breaks = ended.stderr.contains("a claim about the spinning runs is broken");
    let ended = ended.expect_code(if run.join("cyclictest.json").exists() && !breaks { 0 } else { 1 });
    assert!(ended.stdout.contains("is not resolved, neither kept nor broken"), "{}", ended.stdout);
    assert_eq!(json(&run.join("conditions.json"))["probe"].as_bool(), Some(true));
    let probed = fs::read_to_string(run.join("probe.csv")).expect("gaps of the machine");
    assert!(probed.starts_with("cpu,from_ns,to_ns"), "{probed}");
    let page = fs::read_to_string(&page).expect("the page");
    let table = page.strip_prefix("before\n<!-- latency: begin -->\n`airbench latency --out ");
    let table = table.and_then(|page| page.strip_suffix("\n<!-- latency: end -->\nafter\n"));
    let row = table.and_then(|table| table.lines().find(|line| line.contains("ping-pong-bus p50")));
    assert!(row.is_some_and(|row| row.contains("**not resolved**")), "{page}");
}
