//! `scripts/latency`: help, arguments that cannot be used, and a shortest measurement as a whole.

use std::path::Path;
use system_tests::binaries::script;
use system_tests::process::{Ended, PATIENCE};
use system_tests::records::json;
use system_tests::skip;

fn latency(arguments: &[&str]) -> Ended {
    script("latency", arguments, 2 * PATIENCE)
}

#[test]
fn help_tells_options_files_and_exit_codes() {
    let ended = latency(&["--help"]).expect_code(0);
    let parts = ["--pairs", "--probe", "--load", "report.html", "Exit codes: 0 good; 1", "130 interrupted"];
    ended.expect_printed(&parts);
}

#[test]
fn arguments_that_cannot_be_used_are_refused_before_anything_is_built() {
    let wrong: [(&[&str], &str); 11] = [
        (&["--fly"], "unknown argument --fly"),
        (&["--pairs"], "--pairs needs a value"),
        (&["--pairs", "0"], "from 1 to 1000"),
        (&["--seconds", "1.5"], "whole number"),
        (&["--priority", "99"], "from 2 to 98"),
        (&["--spin-us", "1000"], "from 0 to 999"),
        (&["--cpu", "4711"], "CPU 4711 is not there"),
        (&["--bus", "vcan0"], "can://IFACE"),
        (&["--experiment", "nothing-of-this-name"], "scripts/run --list"),
        (&["--bounds", "/nowhere.toml"], "cannot be read"),
        (&["--out", "/proc/airbench"], "--out"),
    ];
    for (arguments, hint) in wrong {
        let _ = latency(arguments).expect_code(2).expect_said(&[hint]);
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
    ended.expect_printed(&["pair 1 of 1, cyclictest:", "left", round_trip, "spinning / claimed"]);
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
        assert!(
            reported["reference_command"]
                .as_str()
                .is_some_and(|command| command.starts_with("cyclictest -m -p 80"))
        );
        assert!(ended.stdout.contains("emulator-wakeup p99 / cyclictest p99"), "{}", ended.stdout);
    } else {
        let why = reported["reference_missing_because"].as_str().expect("a reason");
        skip::tell("a_pair_leaves_runs_references_reports_and_the_table: cyclictest", why);
    }
    // A second measurement into the same folder would mix the two.
    let _ =
        latency(&["--pairs", "1", "--seconds", "1", "--out", out]).expect_code(2).expect_said(&["earlier"]);
}
