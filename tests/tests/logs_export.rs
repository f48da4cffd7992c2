//! A run's log in the files of other tools: CSV against the run's own tables, MDF4 as asammdf reads it, MCAP as Foxglove's reader
//! does, ASC and BLF as python-can reads them; what is no log is refused by line and column.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use system_tests::foreign_python::{light_path, python, run_script};
use system_tests::{CompletedProcess, Pace, Program, Running, SHORT, Scene, Table, run_both};

fn run_folder() -> PathBuf {
    static RUN: LazyLock<Scene> = LazyLock::new(|| {
        let scene = Scene::new(SHORT);
        let folder = scene.path("emulator");
        run_both(&scene.emulator(Pace::Lockstep), &scene.controller(Pace::Lockstep).out(&folder));
        scene
    });
    RUN.path("emulator")
}

fn export(source: &Path, format: &str, out: &Path, options: &[&str]) -> CompletedProcess {
    let mut bench = Program::Bench.command();
    bench
        .env("AIRBENCH_PYTHON", python())
        .env("PYTHONPATH", light_path())
        .arg("export")
        .arg(source)
        .args(["--to", format, "--out"])
        .arg(out);
    Running::start("bench export", bench.args(options)).wait()
}

/// Columns of a CSV; where a cell is empty there is no value.
fn columns(file: &Path) -> BTreeMap<String, Vec<Option<f64>>> {
    let mut reader = csv::Reader::from_path(file).expect("the export is there");
    let mut table: BTreeMap<String, Vec<Option<f64>>> = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, Option<f64>>>() {
        for (name, value) in row.expect("a number or nothing for each name of the head") {
            table.entry(name).or_default().push(value);
        }
    }
    table
}

fn close(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-9 * one.abs().max(1.0)
}

/// Columns of measurement.csv and the signals that carry them.
const CARRIED: [(&str, &str); 8] = [
    ("drive_position_m", "DriveSensors.position_m"),
    ("drive_force_N", "DriveSensors.force_n"),
    ("drive_pressure_a_Pa", "DriveSensors.pressure_a_pa"),
    ("drive_pressure_b_Pa", "DriveSensors.pressure_b_pa"),
    ("load_position_m", "LoadSensors.position_m"),
    ("load_force_N", "LoadSensors.force_n"),
    ("load_pressure_a_Pa", "LoadSensors.pressure_a_pa"),
    ("load_pressure_b_Pa", "LoadSensors.pressure_b_pa"),
];

#[test]
fn a_csv_holds_the_signals_of_the_measurement_at_its_times() {
    let folder = run_folder();
    let out = folder.join("every.csv");
    let reported = export(&folder, "csv", &out, &["--every-ms", "1"]).expect_code(0);
    assert!(reported.stdout.contains("time counts from cycle 0"), "{}", reported.stdout);
    let (exported, measured) = (columns(&out), Table::read(&folder.join("measurement.csv")));
    let times: Vec<f64> = exported["time_s"].iter().flatten().copied().collect();
    let first = times.iter().position(|time_s| *time_s == 0.0).expect("a row for cycle 0");
    assert!(measured.len() > 1000);
    for (column, signal) in CARRIED {
        for (cycle, value) in measured.column(column).into_iter().enumerate() {
            let row = first + cycle;
            assert!(close(times[row], cycle as f64 * 1e-3));
            assert!(
                exported[signal][row].is_some_and(|cell| close(cell, value)),
                "{signal} in cycle {cycle}"
            );
        }
    }
    // The command that acts in a cycle was on the bus in the one before.
    let valves = measured.column("drive_valve");
    assert!(valves.iter().any(|valve| *valve != 0.0));
    for (cycle, valve) in valves.into_iter().enumerate().skip(5) {
        let sent = exported["DriveValveCommand.opening"][first + cycle - 1].expect("after the first cycles");
        let enabled = exported["DriveValveCommand.enable"][first + cycle - 1] == Some(1.0);
        assert!(close(if enabled { sent } else { 0.0 }, valve), "cycle {cycle}: {sent} and {valve}");
    }
}

#[test]
fn without_a_grid_every_frame_is_in_the_csv_once() {
    let folder = run_folder();
    let out = folder.join("stamps.csv");
    export(&folder.join("bus.log"), "csv", &out, &[]).expect_code(0);
    let log = fs::read_to_string(folder.join("bus.log")).expect("the log");
    let table = columns(&out);
    for (identifier, signal) in
        [(" 120#", "DriveSensors.alive"), (" 130#", "Tick.cycle"), (" 110#", "DriveValveCommand.alive")]
    {
        assert_eq!(table[signal].iter().flatten().count(), log.matches(identifier).count(), "{signal}");
    }
}

#[test]
fn asammdf_reads_the_same_values_units_and_times_from_the_mdf4() {
    let folder = run_folder();
    let (out, csv) = (folder.join("run.mf4"), folder.join("for-mdf.csv"));
    export(&folder, "mdf4", &out, &[]).expect_code(0);
    export(&folder, "csv", &csv, &[]).expect_code(0);
    let read: Value = serde_json::from_str(&run_script("read_mdf4.py", &[&out])).expect("JSON");
    let table = columns(&csv);
    let channels = read["channels"].as_object().expect("channels");
    assert_eq!(
        channels.keys().filter(|name| name.contains('.')).count(),
        table.len() - 1,
        "all but the time"
    );
    for (name, column) in table.iter().filter(|(name, _)| *name != "time_s") {
        let numbers = |key: &str| -> Vec<f64> {
            let list = channels[name][key].as_array().unwrap_or_else(|| panic!("{name} {key}"));
            list.iter().map(|value| value.as_f64().expect("a number")).collect()
        };
        let (times, values) = (numbers("times"), numbers("values"));
        let rows =
            table["time_s"].iter().zip(column).filter_map(|(time_s, value)| Some(((*time_s)?, (*value)?)));
        let expected: Vec<_> = rows.collect();
        assert_eq!(values.len(), expected.len(), "{name}");
        for (sample, (time_s, value)) in times.iter().zip(&values).zip(&expected) {
            assert!(
                close(*sample.0, *time_s) && sample.1 == value,
                "{name}: {sample:?} instead of {value} at {time_s} s"
            );
        }
    }
    for (name, unit) in [("DriveSensors.position_m", "m"), ("LoadSensors.force_n", "N"), ("Tick.cycle", "")] {
        assert_eq!(channels[name]["unit"], unit, "{name}");
    }
}

/// Channels of an MCAP as PyPI's `mcap` reads them.
fn mcap_channels(file: &Path) -> Value {
    let read: Value = serde_json::from_str(&run_script("read_mcap.py", &[file])).expect("JSON");
    assert_eq!(read["sorted"], true, "messages are in the order of time");
    read
}

fn list<'a>(channel: &'a Value, key: &str) -> &'a Vec<Value> {
    channel[key].as_array().unwrap_or_else(|| panic!("{key} of {channel}"))
}

#[test]
fn an_mcap_holds_every_value_of_the_tables_at_the_time_of_its_row() {
    let folder = run_folder();
    let out = folder.join("tables.mcap");
    export(&folder, "mcap", &out, &[]).expect_code(0);
    let read = mcap_channels(&out);
    let zero_ns: u64 = read["metadata"]["airbench"]["cycle_zero_ns"]
        .as_str()
        .and_then(|ns| ns.parse().ok())
        .expect("a time");
    for (topic, file) in [
        ("/measurement", "measurement.csv"),
        ("/truth", "truth.csv"),
        ("/controller/drive", "controller-drive.csv"),
        ("/controller/load", "controller-load.csv"),
    ] {
        let channel = &read["channels"][topic];
        let (times, messages) = (list(channel, "times_ns"), list(channel, "messages"));
        let mut table =
            csv::ReaderBuilder::new().comment(Some(b'#')).from_path(folder.join(file)).expect(file);
        let names = table.headers().expect("a head").clone();
        let rows: Vec<_> = table.records().map(|row| row.expect("a row")).collect();
        assert!(rows.len() > 1000 && rows.len() == messages.len() && rows.len() == times.len(), "{file}");
        for ((row, time), message) in rows.iter().zip(times).zip(messages) {
            let time_s: f64 = row[0].parse().expect("a time");
            assert_eq!(time.as_u64(), Some(zero_ns + (time_s * 1e3).round() as u64 * 1_000_000), "{file}");
            let mut values = 0;
            for (name, cell) in names.iter().zip(row).filter(|(_, cell)| !cell.is_empty()) {
                values += 1;
                let (value, schema) = (&message[name], &channel["schema"]["properties"][name]);
                if name.ends_with("_chain") {
                    assert_eq!((value.as_str(), &schema["type"]), (Some(cell), &"string".into()), "{name}");
                } else {
                    let expected: f64 = cell.parse().expect("a number");
                    assert_eq!(value.as_f64(), Some(expected), "{file}: {name} at {time_s} s");
                    assert_eq!(schema["type"], "number", "{name}");
                }
            }
            assert_eq!(message.as_object().map(serde_json::Map::len), Some(values), "{file}: nothing else");
        }
    }
    let properties = &read["channels"]["/measurement"]["schema"]["properties"];
    for (column, unit) in [("drive_position_m", "m"), ("load_force_N", "N"), ("load_pressure_b_Pa", "Pa")] {
        assert_eq!(properties[column]["unit"], unit, "{column}");
    }
    assert!(properties["drive_valve"].get("unit").is_none(), "an opening is a plain number");
}

#[test]
fn an_mcap_holds_each_frame_as_it_was_and_its_signals() {
    let folder = run_folder();
    let (out, csv) = (folder.join("frames.mcap"), folder.join("for-mcap.csv"));
    export(&folder.join("bus.log"), "mcap", &out, &[]).expect_code(0);
    export(&folder, "csv", &csv, &[]).expect_code(0);
    let read = mcap_channels(&out);
    let frames = &read["channels"]["/can"];
    let log = fs::read_to_string(folder.join("bus.log")).expect("the log");
    assert_eq!(log.lines().count(), list(frames, "messages").len());
    for ((line, time), message) in log.lines().zip(list(frames, "times_ns")).zip(list(frames, "messages")) {
        let ns = time.as_u64().expect("a time");
        let stamp = format!("({:010}.{:06})", ns / 1_000_000_000, ns % 1_000_000_000 / 1000);
        let (interface, frame) = (&message["interface"], &message["frame"]);
        let texts = [interface, frame].map(|text| text.as_str().expect("a text"));
        assert_eq!(line, [&stamp, texts[0], texts[1]].join(" "));
        let id = u64::from_str_radix(texts[1].split('#').next().expect("a number"), 16).expect("hexadecimal");
        assert_eq!(message["id"].as_u64(), Some(id));
    }
    for (name, column) in columns(&csv).iter().filter(|(name, _)| *name != "time_s") {
        let (message, signal) = name.split_once('.').expect("a frame and a signal");
        let channel = &read["channels"][format!("/can/{message}")];
        let exported: Vec<_> =
            list(channel, "messages").iter().map(|message| message[signal].as_f64()).collect();
        let expected: Vec<_> = column.iter().filter(|value| value.is_some()).copied().collect();
        assert!(exported == expected, "{name}");
    }
}

#[test]
fn an_mcap_of_a_log_alone_has_no_tables_and_says_which_frames_are_no_signals() {
    let scene = Scene::new(SHORT);
    let (log, out) = (scene.write("foreign.log", FOREIGN), scene.path("foreign.mcap"));
    let said = export(&log, "mcap", &out, &[]).expect_code(0);
    said.expect_stderr(&["foreign.log:2: 4 frames that rig.dbc does not know are in /can alone"]);
    let read = mcap_channels(&out);
    let topics: Vec<_> = read["channels"].as_object().expect("channels").keys().collect();
    assert_eq!(topics, ["/can", "/can/DriveSensors"]);
    let exported: Vec<_> =
        list(&read["channels"]["/can"], "messages").iter().map(|message| message["frame"].as_str()).collect();
    let expected: Vec<_> = FOREIGN.lines().map(|line| line.split(' ').nth(2)).collect();
    assert_eq!(exported, expected);
}

#[test]
fn an_mcap_takes_no_table_that_is_none_or_whose_time_nobody_tells() {
    let scene = Scene::new(SHORT);
    let folder = scene.path("copied");
    fs::create_dir(&folder).expect("a folder");
    let copy = |name: &str| fs::copy(run_folder().join(name), folder.join(name)).expect("a file of the run");
    let _ = ["bus.log", "measurement.csv", "summary.json"].map(copy);
    let out = scene.path("copied.mcap");
    let table = folder.join("measurement.csv");
    let text = fs::read_to_string(&table).expect("the table");
    let broken = text.replacen("\n0.004,", "\n0.004,x", 1);
    assert_ne!(broken, text);
    fs::write(&table, broken).expect("the table");
    export(&folder, "mcap", &out, &[]).expect_code(2).expect_stderr(&["measurement.csv", "line 7: 'x"]);
    let left: Vec<_> = fs::read_dir(scene.path("")).expect("the scene").flatten().collect();
    assert!(left.iter().all(|file| !file.file_name().to_string_lossy().starts_with("copied.")), "{left:?}");

    fs::remove_file(folder.join("summary.json")).expect("it was there");
    let said = export(&folder, "mcap", &out, &[]).expect_code(0);
    said.expect_stderr(&["no summary.json says when cycle 0", "the tables are left out"]);
    let read = mcap_channels(&out);
    assert!(read["channels"].as_object().expect("channels").keys().all(|topic| topic.starts_with("/can")));
    assert_eq!(read["metadata"], serde_json::json!({}));
}

#[test]
fn an_mcap_takes_no_table_of_a_controller_of_an_earlier_run() {
    let scene = Scene::new(SHORT);
    let folder = scene.path("copied");
    fs::create_dir(&folder).expect("a folder");
    let copy = |name: &str| fs::copy(run_folder().join(name), folder.join(name)).expect("a file of the run");
    let _ = ["bus.log", "summary.json", "controller-drive.csv", "controller-load.csv"].map(copy);
    fs::write(folder.join("controller-drive.json"), "{}").expect("a report");
    let out = scene.path("copied.mcap");
    export(&folder, "mcap", &out, &[]).expect_code(0).expect_stderr(&["controller-load.csv: left out"]);
    let channels = &mcap_channels(&out)["channels"];
    assert!(channels["/controller/drive"].is_object() && channels["/controller/load"].is_null());
}

#[test]
fn an_mdf4_begins_when_its_log_does() {
    let scene = Scene::new(SHORT);
    let log = scene.write("dated.log", "(1700000000.000250) a 160#0100\n(1700000000.000500) a 160#0200\n");
    let out = scene.path("dated.mf4");
    export(&log, "mdf4", &out, &[]).expect_code(0);
    let read: Value = serde_json::from_str(&run_script("read_mdf4.py", &[&out])).expect("JSON");
    let start_s = read["start"].as_f64().expect("a number");
    // Python's times of day have microseconds.
    assert!((start_s - 1_700_000_000.000_25).abs() < 2e-6, "{start_s}");
    assert_eq!(read["channels"]["RunControl.command"]["times"], serde_json::json!([0.0, 0.000_25]));
}

/// A log with a date, of two interfaces, with all kinds of frames.
const FOREIGN: &str = "(1700000000.000250) can0 120#0011223344556677\n\
                       (1700000000.000500) can1 1ABCDEF0#01\n\
                       (1700000000.001000) can0 7FF#R3\n\
                       (1700000000.001000) can0 000#\n\
                       (1700000003.999999) can1 18FF00AA#AABBCCDD\n";

/// Frames of a log as the script prints them.
fn frames(log: &str) -> Vec<String> {
    let microseconds = |stamp: &str| -> u64 { stamp.replace(['(', ')', '.'], "").parse().expect("a stamp") };
    let words: Vec<Vec<&str>> = log.lines().map(|line| line.split(' ').collect()).collect();
    let first = microseconds(words[0][0]);
    words.iter().map(|line| format!("{} {}", microseconds(line[0]) - first, line[2])).collect()
}

#[test]
fn python_can_reads_asc_and_blf_equal_to_the_log() {
    let scene = Scene::new(SHORT);
    for log in [run_folder().join("bus.log"), scene.write("foreign.log", FOREIGN)] {
        let expected = frames(&fs::read_to_string(&log).expect("the log"));
        for format in ["asc", "blf"] {
            let out = scene.path(&format!("log.{format}"));
            let reported = export(&log, format, &out, &[]).expect_code(0).stdout;
            assert!(reported.contains(&format!("{} frames, read back equal", expected.len())), "{reported}");
            let read = run_script("read_frames.py", &[&out]);
            let read: Vec<_> = read.lines().map(str::to_owned).collect();
            assert!(
                read == expected,
                "{format} of {}: {:?}",
                log.display(),
                read.iter().zip(&expected).find(|(a, b)| a != b)
            );
        }
    }
}

#[test]
fn what_is_no_log_is_refused_by_line_and_column_and_leaves_no_file() {
    let scene = Scene::new(SHORT);
    for (text, place, words) in [
        ("(0.000001) a 120#00\n(0.000002) a 120#0\n\n", ":2:18:", "two digits"),
        ("\u{1}\u{2}\n\n", ":1:1:", "begins with"),
        ("(0.1) a 120##000\n", ":1:13:", "CAN FD"),
        ("\n\n\n", "", "holds no frame"),
    ] {
        let log = scene.write("hostile.log", text);
        let out = scene.path("out.csv");
        export(&log, "csv", &out, &[]).expect_code(2).expect_stderr(&[place, words]);
        let left: Vec<_> = fs::read_dir(scene.path("")).expect("the scene").flatten().collect();
        assert!(left.iter().all(|file| !file.file_name().to_string_lossy().starts_with("out.")), "{left:?}");
    }
    let log = scene.write("cut.log", "(0.000001) a 160#0100\n(0.00");
    let said = export(&log, "csv", &scene.path("cut.csv"), &[]).expect_code(0);
    said.expect_stderr(&["cut.log:2: the last line is cut"]);
    let log = scene.write("years.log", "(1.0) a 160#0100\n(9999999999.0) a 160#0100\n");
    export(&log, "csv", &scene.path("out.csv"), &["--every-ms", "1"])
        .expect_code(2)
        .expect_stderr(&["cut it"]);
}

#[test]
fn frames_without_signals_and_a_python_without_python_can_are_reported() {
    let scene = Scene::new(SHORT);
    let log = scene.write("odd.log", "(0.1) a 7F0#00\n(0.2) a 110#0000000000\n(0.3) a 160#0100\n");
    let said = export(&log, "csv", &scene.path("odd.csv"), &[]).expect_code(0);
    said.expect_stderr(&[
        "odd.log:1: 1 frames that rig.dbc does not know",
        "odd.log:2: 1 frames that rig.dbc does not allow",
    ]);
    let none = scene.path("no-python");
    let none = none.to_str().expect("UTF-8");
    let said = export(&log, "blf", &scene.path("odd.blf"), &["--python", none]).expect_code(2);
    said.expect_stderr(&["no-python", "pip install python-can"]);
}
