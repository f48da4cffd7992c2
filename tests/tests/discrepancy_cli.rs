//! `discrepancy` as a program: a hidden effect is named from a blind record, the same bytes come out whatever the threads and
//! whether or not a held-out record is given, each step runs alone, bad records are survived or refused, and what cannot be
//! read is reported with file, line and what is allowed.
//!
//! The record is the record maker's, whose integrator and laws are not the plant's.

use crate::discrepancy_steps::record;
use record_maker::{Experiment, Hidden, Recipe};
use rustix::process::Signal;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use system_tests::discrepancy::{discrepancy, rig};
use system_tests::exit::{BAD_INPUT, GOOD, INTERRUPTED};
use system_tests::{CompletedProcess, Pace, Program, Running, SHORT, Scene, find, json};
use tempfile::TempDir;

/// A constant force: some 14 degrees at 5 kg.
const EFFECT: &str = "inclination";
const FORCE_N: f64 = 12.0;

/// Line of the first row in a measurement file: a comment and the head stand before it.
const FIRST_ROW: usize = 3;

/// A blind record of the drive and another one to judge on, made once.
struct Records {
    folder: TempDir,
    train: PathBuf,
    test: PathBuf,
}

static RECORDS: LazyLock<Records> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let sheet = plant::effects::sheet(EFFECT).expect("an effect of the catalogue");
    let place = sheet.place_named("drive").expect("the drive can be inclined");
    let hidden = vec![Hidden { name: sheet.name, place, numbers: vec![FORCE_N] }];
    let make = |name: &str, experiment, seed| {
        let recipe = Recipe { seed, experiment, hidden: hidden.clone(), ..Recipe::default() };
        record(folder.path(), name, &recipe)
    };
    let train = make("train", Experiment::Train, 1);
    let test = make("test", Experiment::HeldOut(0), 2);
    Records { folder, train, test }
});

fn on(step: &str, record: &Path, out: &Path, more: &[&str]) -> CompletedProcess {
    let rig = rig();
    let mut all: Vec<&dyn AsRef<OsStr>> = vec![&step, &"--rig", &rig, &"--train", &record];
    all.extend([&"--out" as &dyn AsRef<OsStr>, &out]);
    all.extend(more.iter().map(|argument| argument as &dyn AsRef<OsStr>));
    discrepancy(&all)
}

/// The training record with its lines changed: `change` gets the number of the row and its cells, and hands back none to lose it.
fn spoilt(folder: &Path, change: impl Fn(usize, Vec<&str>) -> Option<String>) -> PathBuf {
    let text = fs::read_to_string(&RECORDS.train).expect("the record");
    let mut lines = text.lines();
    let mut spoilt: Vec<String> = lines.by_ref().take(FIRST_ROW - 1).map(str::to_owned).collect();
    spoilt.extend(lines.enumerate().filter_map(|(row, line)| change(row, line.split(',').collect())));
    let path = folder.join("measurement.csv");
    fs::write(&path, spoilt.join("\n") + "\n").expect("a folder that can be written");
    path
}

type Change = fn(Vec<&str>) -> String;

/// Cells: time, valve, position, force, pressure a, pressure b.
fn swap_pressures(mut cells: Vec<&str>) -> String {
    cells.swap(4, 5);
    cells.join(",")
}

fn turn_force(cells: &[&str]) -> String {
    let mut cells: Vec<String> = cells.iter().map(|cell| (*cell).to_owned()).collect();
    cells[3] = match cells[3].strip_prefix('-') {
        Some(positive) => positive.to_owned(),
        None => format!("-{}", cells[3]),
    };
    cells.join(",")
}

fn effects(report: &Value, list: &str) -> Vec<String> {
    let all = report[list].as_array().unwrap_or_else(|| panic!("no {list}"));
    all.iter().map(|effect| effect["effect"].as_str().expect("a name").to_owned()).collect()
}

#[test]
fn a_hidden_effect_is_named_in_the_same_bytes_whatever_the_threads_and_the_held_out_record_changes_gap_alone()
{
    let records = &*RECORDS;
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let test = records.test.to_str().expect("a path in ASCII");
    let one = on("close", &records.train, &out("one"), &["--threads", "1", "--test", test]).expect_code(GOOD);
    on("close", &records.train, &out("two"), &["--threads", "2", "--test", test]).expect_code(GOOD);
    for file in ["report.json", "report.html", "rig.toml"] {
        let [one, two] =
            ["one", "two"].map(|name| fs::read(out(name).join(file)).expect("a file of a close"));
        assert!(one == two, "{file} differs between one thread and two");
    }

    let mut report = json(&out("one/report.json"));
    assert_eq!(report["named"][0]["effect"], EFFECT, "{}{:#}", one.stdout, report["named"]);
    assert_eq!(report["named"][0]["where"]["axis"], "drive");
    assert!(one.stdout.contains(EFFECT), "{}", one.stdout);
    assert!(one.stderr.contains(" s: "), "no progress: {}", one.stderr);
    let reported = &report["named"][0]["parameters"][0];
    let (value, error) = (reported["value"].as_f64().unwrap(), reported["standard_error"].as_f64().unwrap());
    assert!((value - FORCE_N).abs() < (4.0 * error).max(0.1 * FORCE_N), "{reported}");

    // `name` is a close without a held-out record.
    on("name", &records.train, &out("name"), &["--threads", "2"]).expect_code(GOOD);
    let without = json(&out("name/report.json"));
    the_held_out_record_changes_two_fields_alone(&out("one"), &out("name"));
    assert!(
        report["gap"].as_object().is_some_and(|gap| gap.contains_key("drive_position_m")),
        "{}",
        report["gap"]
    );
    assert!(report["verification"].is_object());
    assert_eq!(without["gap"], serde_json::json!({}));
    for field in ["gap", "verification"] {
        report[field] = without[field].clone();
    }
    assert_eq!(report, without, "the held-out record changed more than gap and verification");

    the_extended_rig_is_one(&out("one/rig.toml"));
    the_steps_after_a_report(&out("one"));
}

/// The bytes of both results, but for the values of `gap` and `verification` and the pictures of the page.
fn the_held_out_record_changes_two_fields_alone(with: &Path, without: &Path) {
    let text = |folder: &Path, name: &str| fs::read_to_string(folder.join(name)).expect("a file of a close");
    assert_eq!(text(with, "rig.toml"), text(without, "rig.toml"));
    // Fields of the report stand two spaces in; the value of one ends where the next begins.
    let rest = |report: &str| {
        let mut skipped = false;
        let is_kept = |line: &&str| {
            if line.starts_with("  \"") {
                skipped = line.starts_with("  \"gap\"") || line.starts_with("  \"verification\"");
            }
            !skipped
        };
        report.lines().filter(is_kept).collect::<Vec<_>>().join("\n")
    };
    let [with, without] = [with, without].map(|folder| rest(&text(folder, "report.json")));
    assert!(
        with.len() > 1000 && with == without,
        "the held-out record changed more than gap and verification"
    );
}

/// Rehearsal and emulator take the extended rig as it is.
fn the_extended_rig_is_one(rig: &Path) {
    let text = fs::read_to_string(rig).expect("the extended rig");
    assert!(text.contains(&format!("[effects.{EFFECT}.drive]")), "{text}");
    let scene = Scene::new(SHORT);
    scene.rehearsal().rig(rig).start().wait().expect_code(GOOD);
    scene.emulator(Pace::Real).rig(rig).with("--seconds 0.5").start().wait().expect_code(GOOD);
}

/// `extend`, `verify` and `next` from what a close left.
fn the_steps_after_a_report(closed: &Path) {
    let (rig, report) = (rig(), closed.join("report.json"));
    let (extended, proposed) = (closed.join("again.toml"), closed.join("proposed.toml"));
    discrepancy(&[&"extend", &"--rig", &rig, &"--report", &report, &"--out", &extended]).expect_code(GOOD);
    let read = |path: &Path| fs::read_to_string(path).expect("a rig file");
    assert_eq!(read(&extended), read(&closed.join("rig.toml")));

    let (test, out) = (&RECORDS.test, closed.join("verified"));
    let verified =
        discrepancy(&[&"verify", &"--rig", &rig, &"--extended", &extended, &"--test", test, &"--out", &out]);
    let confirmed = json(&report)["verification"]["confirmed"].as_bool().expect("a verification");
    let verified = verified.expect_code(i32::from(!confirmed));
    let parts = ["drive_position_m: before", "chi2", if confirmed { ": confirmed" } else { "not confirmed" }];
    verified.expect_stdout(&parts);
    let alone = json(&out.join("verification.json"));
    for field in ["gap", "verification"] {
        assert_eq!(alone[field], json(&report)[field], "{field} of verify alone is that of close");
    }

    let next =
        discrepancy(&[&"next", &"--rig", &rig, &"--report", &report, &"--out", &proposed]).expect_code(GOOD);
    let ambiguous = json(&report)["verdict"] == "ambiguous";
    assert!(ambiguous || next.stdout.contains("nothing that cannot be told apart"), "{}", next.stdout);
    let experiment = &json(&report)["next"]["experiment"];
    assert_eq!(proposed.exists(), ambiguous && experiment.is_string(), "{}", next.stdout);
}

#[test]
fn the_steps_before_a_report_run_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let train = &RECORDS.train;
    let check = on("check", train, folder.path(), &[]).expect_code(GOOD);
    check.expect_stdout(&["8000 rows", "can be used", "drive_force_N: noise 0.5"]);
    assert_eq!(json(&folder.path().join("checks.json"))[0]["usable"], true);

    let calibrate = on("calibrate", train, folder.path(), &[]).expect_code(GOOD);
    // The missing effect is no number of the file. It hides points of a table, which are printed as not determined.
    for reported in [
        "parameter:mass = ",
        "cylinder.dead_volume_cm3 = ",
        "valve.kv_supply_m3_per_h[3]: not determined by these records",
    ] {
        assert!(calibrate.stdout.contains(reported), "{}", calibrate.stdout);
    }
    let parameters = json(&folder.path().join("parameters.json"));
    let mass = &parameters[0];
    assert_eq!(mass["name"], "parameter:mass");
    assert!(mass["standard_error"].as_f64().is_some_and(|error| error > 0.0), "{mass}");
    assert!(
        fs::read_to_string(folder.path().join("rig.toml")).expect("a rig file").contains("parameter:mass")
    );

    let locate = on("locate", train, folder.path(), &[]).expect_code(GOOD);
    assert!(locate.stdout.contains("times its noise"), "{}", locate.stdout);
    let location = json(&folder.path().join("location.json"));
    let bars = location["balances"].as_array().expect("bars");
    let most = bars.iter().max_by(|one, other| {
        one["over_noise"].as_f64().unwrap().total_cmp(&other["over_noise"].as_f64().unwrap())
    });
    assert_eq!(most.expect("a bar")["balance"], "drive.force", "{bars:#?}");
}

#[test]
fn lost_rows_a_hole_and_a_saturated_channel_are_reported_and_survived() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = spoilt(folder.path(), |row, mut cells| {
        // 1 % of the rows here and there, 50 ms in one piece.
        let lost = row.wrapping_mul(2_654_435_761) % 100_000 < 1000 || (5000..5050).contains(&row);
        if (6000..6400).contains(&row) {
            cells[4] = "1000000";
        }
        (!lost).then(|| cells.join(","))
    });
    let check = on("check", &record, folder.path(), &[]).expect_code(GOOD);
    let checks = json(&folder.path().join("checks.json"));
    let findings = &checks[0]["findings"];
    for kind in ["lost-samples", "gap"] {
        let finding = find(findings, "kind", kind);
        assert!(finding["line"].is_u64() && finding["fatal"] == false, "{finding}");
    }
    let saturated = findings.as_array().expect("findings").iter().any(|finding| {
        (finding["kind"] == "clipped" || finding["kind"] == "stuck")
            && finding["column"] == "drive_pressure_a_Pa"
    });
    assert!(saturated, "{}", check.stdout);

    // A held-out record that cannot be used takes nothing away from what was found, and is reported.
    let swapped = folder.path().join("swapped");
    fs::create_dir(&swapped).expect("a folder");
    let swapped = spoilt(&swapped, |_, cells| Some(swap_pressures(cells)));
    let test = swapped.to_str().expect("a path in ASCII");
    let ended = on("close", &record, folder.path(), &["--test", test]).expect_code(BAD_INPUT);
    assert!(ended.stdout.contains("not judged on the held-out record"), "{}", ended.stdout);
    assert!(ended.stdout.contains("pressures a and b are swapped"), "{}", ended.stdout);
    let report = json(&folder.path().join("report.json"));
    assert!(
        report["verification"].is_null() && report["gap"] == serde_json::json!({}),
        "{:#}",
        report["gap"]
    );
    assert!(effects(&report, "named").iter().any(|name| name == EFFECT), "{:#}", report["named"]);
}

#[test]
fn columns_that_mean_something_else_make_the_verdict_bad_data() {
    let cases: [(&str, &str, Change); 2] = [
        ("swapped-pressures", "pressures a and b are swapped", swap_pressures),
        ("force-sign", "drive_force_N", |cells| turn_force(&cells)),
    ];
    for (kind, reported, change) in cases {
        let folder = tempfile::tempdir().expect("a folder");
        let record = spoilt(folder.path(), |_, cells| Some(change(cells)));
        let ended = on("close", &record, folder.path(), &[]).expect_code(BAD_INPUT);
        let report = json(&folder.path().join("report.json"));
        assert_eq!(report["verdict"], "bad-data");
        assert!(effects(&report, "named").is_empty());
        let finding = find(&report["checks"][0]["findings"], "kind", kind);
        assert_eq!(finding["fatal"], true);
        let line = finding["line"].as_u64().unwrap_or_else(|| panic!("no line in {finding}"));
        ended.expect_stdout(&[reported, &format!("{}:{line}: ", record.display())]);
        assert!(folder.path().join("report.html").exists());
        assert!(!folder.path().join("rig.toml").exists(), "a model out of a record that cannot be used");
        // The steps alone refuse it too, with the same words.
        let ended = on("calibrate", &record, folder.path(), &[]).expect_code(BAD_INPUT);
        assert!(ended.stderr.contains(reported), "{}", ended.stderr);
    }
}

#[test]
fn what_is_read_is_never_written_over_and_no_record_is_both_trained_on_and_held_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let (train, rig_file) = (&RECORDS.train, folder.path().join("rig.toml"));
    fs::copy(rig(), &rig_file).expect("a folder that can be written");
    let close = |more: &[&dyn AsRef<OsStr>]| {
        let out = folder.path();
        let mut all: Vec<&dyn AsRef<OsStr>> =
            vec![&"close", &"--rig", &rig_file, &"--out", &out, &"--train", train];
        all.extend(more);
        discrepancy(&all).expect_code(BAD_INPUT)
    };
    close(&[]).expect_stderr(&["rig.toml", "would be written over", "another --out"]);
    assert_eq!(fs::read(&rig_file).expect("the rig file"), fs::read(rig()).expect("the rig file"));
    close(&[&train]).expect_stderr(&["--train", "given twice"]);
    close(&[&"--test", &train]).expect_stderr(&["--test", "a training record as well"]);
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1, "only the rig file");
}

#[test]
fn an_earlier_result_does_not_stay_beside_bad_data_and_an_interrupted_run_leaves_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    fs::create_dir(&out).expect("a folder");
    for name in ["report.json", "rig.toml", "next-chirps.toml", "notes.txt"] {
        fs::write(out.join(name), "{}").expect("a folder that can be written");
    }
    // Without a column that the simulation needs: reported as any other defect, with a report.
    let record = folder.path().join("narrow.csv");
    let text = fs::read_to_string(&RECORDS.train).expect("the record");
    fs::write(&record, text.replace("drive_pressure_b_Pa", "drive_presure_b_Pa")).expect("room");
    let check = on("check", &record, &out, &[]).expect_code(BAD_INPUT);
    check.expect_stdout(&["cannot be used", "column drive_presure_b_Pa", "no column drive_pressure_b_Pa"]);
    on("close", &record, &out, &[]).expect_code(BAD_INPUT);
    assert_eq!(json(&out.join("report.json"))["verdict"], "bad-data");
    assert!(!out.join("rig.toml").exists() && !out.join("next-chirps.toml").exists());
    assert!(out.join("notes.txt").exists(), "foreign files stay");

    let empty = folder.path().join("empty");
    let mut command = Program::Discrepancy.command();
    command.args([OsStr::new("close"), OsStr::new("--rig"), rig().as_os_str(), OsStr::new("--train")]);
    command.args([RECORDS.train.as_os_str(), OsStr::new("--out"), empty.as_os_str()]);
    let mut running = Running::start("discrepancy", &mut command);
    running.wait_for("screening");
    running.signal(Signal::INT);
    let ended = running.wait().expect_code(INTERRUPTED);
    assert!(ended.stderr.contains("interrupted"), "{}", ended.stderr);
    assert_eq!(fs::read_dir(&empty).expect("the folder").count(), 0);
}

#[test]
fn what_cannot_be_read_is_refused_with_file_and_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let write = |name: &str, text: &str| {
        fs::write(path(name), text).expect("a folder that can be written");
        path(name)
    };
    let nan = spoilt(folder.path(), |row, mut cells| {
        if row == 4708 {
            cells[3] = "NaN";
        }
        Some(cells.join(","))
    });
    let empty = write("empty.csv", "");
    let headless = write("headless.csv", "time_s,drive_valve\n");
    let missing = path("nowhere.csv");
    for (record, words) in [
        (&missing, &["nowhere.csv", "No such file"][..]),
        (&nan, &["measurement.csv:4711: ", "drive_force_N", "NaN", "finite number"]),
        (&empty, &["empty.csv"]),
    ] {
        for step in ["close", "check", "calibrate", "locate", "name"] {
            on(step, record, &path("out"), &[]).expect_code(BAD_INPUT).expect_stderr(words);
        }
    }
    on("close", &headless, &path("out"), &[]).expect_code(BAD_INPUT);
    let train = &RECORDS.train;
    // What is missing is missed before anything is computed.
    let nowhere = missing.to_str().expect("a path in ASCII");
    let began = std::time::Instant::now();
    on("close", train, &path("out"), &["--test", nowhere])
        .expect_code(BAD_INPUT)
        .expect_stderr(&["nowhere.csv"]);
    assert!(began.elapsed().as_secs_f64() < 2.0, "a missing --test is reported after {:?}", began.elapsed());
    on("close", train, &path("out"), &["--without", "no-such-effect"])
        .expect_code(BAD_INPUT)
        .expect_stderr(&["no-such-effect", "inclination"]);

    let text = fs::read_to_string(rig()).expect("the rig file");
    let wrong = write("wrong.toml", &text.replacen("pressure_bar = 7.0", "pressure_bar = 70.0", 1));
    let line =
        1 + fs::read_to_string(&wrong).unwrap().lines().position(|line| line.contains("70.0")).unwrap();
    let place = format!("wrong.toml:{line}:");
    for (model, words) in [
        (&wrong, &[place.as_str(), "supply.pressure_bar = 70.0", "3 to 12 bar"][..]),
        (&path("nowhere.toml"), &["nowhere.toml", "No such file"]),
    ] {
        let step =
            |step: &str| discrepancy(&[&step, &"--rig", &model, &"--train", &train, &"--out", &path("out")]);
        for name in ["close", "check", "locate"] {
            step(name).expect_code(BAD_INPUT).expect_stderr(words);
        }
    }
    let no_report = write("report.json", "{}");
    for step in ["extend", "next"] {
        let ended =
            discrepancy(&[&step, &"--rig", &rig(), &"--report", &no_report, &"--out", &path("x.toml")]);
        ended.expect_code(BAD_INPUT).expect_stderr(&["report.json", "named"]);
    }
}

#[test]
fn help_tells_every_step_every_option_and_the_exit_codes() {
    let whole = discrepancy(&[&"--help"]).expect_code(GOOD);
    let parts = ["close", "check", "calibrate", "locate", "name", "extend", "verify", "next", "Exit codes"];
    whole.expect_stdout(&parts);
    for (step, parts) in [
        ("close", &["--rig", "--train", "--test", "--out", "--mapping", "--without", "--threads"][..]),
        ("close", &["this folder: discrepancy-results"]),
        ("check", &["--rig", "--train", "--out", "--mapping"]),
        ("verify", &["--rig", "--extended", "--test"]),
        ("next", &["--rig", "--report", "--out"]),
    ] {
        discrepancy(&[&step, &"--help"]).expect_code(GOOD).expect_stdout(parts);
    }
    discrepancy(&[&"close"]).expect_code(BAD_INPUT).expect_stderr(&["--rig", "--train"]);
    assert!(RECORDS.folder.path().exists());
}
