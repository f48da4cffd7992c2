//! On real SocketCAN: Debian's kernel in a virtual machine runs emulator and controller on `vcan0`, and can-utils record,
//! send and disturb. One machine does all jobs, one after the other.
//!
//! No test here is ever skipped; without network for the first download it fails.

use protocol::can::CanFrame;
use protocol::frames::{Frame, MainChainState};
use serde_json::Value;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;
use system_tests::foreign_python::python;
use system_tests::guest::{Guest, compare_candump, data_frames};
use system_tests::{Table, count, firmware, json, socketcan};

/// The machine after its jobs.
fn machine() -> &'static Guest {
    static MACHINE: OnceLock<Guest> = OnceLock::new();
    MACHINE.get_or_init(|| {
        python(); // tells at once what is missing
        let payload = socketcan::payload();
        let line = |n: u16| format!("(1700000000.{:06}) can7 5A5#{n:04X}\n", u32::from(n) * 1000);
        fs::write(payload.join("replay.log"), (0..REPLAYED).map(line).collect::<String>()).unwrap();
        // Between two jobs as long as `lines_of_run` wants it.
        let jobs =
            ["job", "job-firmware", "job-foreign", "job-answers"].map(|job| format!("sh /airbench/{job}"));
        let way_out = ". /airbench/job-functions && export EXPERIMENT=$way_out";
        let jobs = format!("{way_out} && {}", jobs.join(" && sleep 1.5 && "));
        let guest = Guest::run(&["--payload", payload.to_str().unwrap(), "--", &jobs]);
        assert_eq!(guest.codes().len(), FIRMWARE_CODES.len() + FOREIGN_CODES.len());
        guest
    })
}

/// Exit codes of the programs of `job-firmware`; 0 of the firmware: it still ran.
const FIRMWARE_CODES: [(&str, i32); 3] = [("canplayer", 0), ("emulator", 0), ("firmware-still-runs", 0)];
/// Exit codes of the programs of `job-foreign`.
const FOREIGN_CODES: [(&str, i32); 9] = [
    ("controller-lockstep", 2), // a barrier is asked for on a bus that has none
    ("controller-no-interface", 3),
    ("down-controller", 0),
    ("down-emulator", 0),
    ("emulator-interface-down", 3),
    ("emulator-lockstep", 2),
    ("emulator-no-interface", 3),
    ("foreign-controller", 1), // aborted by the emergency stop
    ("foreign-emulator", 0),
];

fn ended_with(guest: &Guest, expected: &[(&str, i32)]) {
    let codes = guest.codes();
    for (name, code) in expected {
        assert_eq!(codes.get(*name), Some(code), "{name}");
    }
}

#[test]
fn candump_recorded_what_the_runs_files_say() {
    let guest = machine();
    let run = guest.out();
    let summary = json(&run.join("summary.json"));
    assert_eq!(summary["ended_because"], "the controllers are done");
    assert!(count(&summary, "/cycles") > 5000 && count(&summary, "/frames_received") > 0);
    assert_eq!(count(&summary, "/frames_malformed"), 0);
    assert_eq!(json(&run.join("controller.json"))["axes"]["drive"]["chain_state"], "done");

    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("candump.log");
    fs::write(&log, guest.lines_of_run("candump.log", &run)).unwrap();
    let reported = compare_candump(&log, &run).unwrap_or_else(|complaint| panic!("{complaint}"));
    eprintln!("compared: {reported}");
    let reported: Value = serde_json::from_str(&reported).unwrap();
    assert!(count(&reported, "/frames") > 5000 && count(&reported, "/sensor_frames") > 2000, "{reported:#}");
    assert_eq!(count(&reported, "/sensor_values"), 4 * count(&reported, "/sensor_frames"));
    assert_eq!(count(&reported, "/valve_values"), 2 * count(&summary, "/cycles"));
    assert!(
        count(&reported, "/valve_values_not_zero") > 1000,
        "the valve hardly moved: its column shows nothing"
    );
    assert_eq!(count(&reported, "/skipped_cycles"), count(&summary, "/skipped"));
    assert_eq!(reported["last_main_chain"], "done");

    comparison_notices_every_alteration(&log, &run);
}

/// Alters one thing at a time in the files that agree: one count of one signal, one frame, one cell, one counter.
fn comparison_notices_every_alteration(log: &Path, run: &Path) {
    let measurement = run.join("measurement.csv");
    let bus_log = run.join("bus.log");
    let summary = run.join("summary.json");
    let line_of = |path: &Path, what: &str, from: f64| -> usize {
        let text = fs::read_to_string(path).unwrap();
        let lines: Vec<_> = text.lines().collect();
        let from = (lines.len() as f64 * from) as usize;
        from + lines[from..].iter().position(|line| line.contains(what)).unwrap()
    };
    // In the middle of the run everything moves.
    let middle = |path: &Path, what: &str| line_of(path, what, 0.5);
    // Position is the low bytes: one count more or less in the first.
    let one_count = |line: &str| {
        let at = line.find("#").unwrap() + 1;
        let count = u8::from_str_radix(&line[at..at + 2], 16).unwrap() ^ 1;
        format!("{}{count:02X}{}", &line[..at], &line[at + 2..])
    };
    let cell = |column: usize, step: f64| {
        move |line: &str| {
            let mut cells: Vec<_> = line.split(',').map(str::to_owned).collect();
            cells[column] = (cells[column].parse::<f64>().unwrap() + step).to_string();
            cells.join(",")
        }
    };
    let gone = |_: &str| String::new();
    let one = |line: usize| line..line + 1;
    type Change<'a> = &'a dyn Fn(&str) -> String;
    // The row of a skipped cycle has no frame that could contradict it, so a sensor's column is altered over many rows.
    let alterations: [(&Path, Range<usize>, Change<'_>, &str); 8] = [
        (log, one(middle(log, " 120#")), &one_count, "bus.log"),
        (log, one(middle(log, " 121#")), &gone, "121"),
        (log, one(middle(log, " 111#")), &gone, "111"),
        (&bus_log, one(middle(&bus_log, " 110#")), &one_count, "110"),
        (&measurement, 4000..4500, &cell(2, 0.5 / 65535.0), "drive_position_m"),
        (&measurement, 4000..4500, &cell(9, 1e6 / 16383.0), "load_pressure_a_Pa"),
        (&measurement, one(5000), &cell(1, 1.0 / 2047.0), "drive_valve"),
        (
            &summary,
            one(line_of(&summary, "\"frames_received\"", 0.0)),
            &|line| line.replace(": ", ": 1"),
            "heard",
        ),
    ];
    for (path, range, change, hint) in alterations {
        let good = fs::read_to_string(path).unwrap();
        let mut lines: Vec<_> = good.lines().map(str::to_owned).collect();
        for line in &mut lines[range.clone()] {
            let changed = change(line);
            assert_ne!(changed, *line);
            *line = changed;
        }
        lines.retain(|line| !line.is_empty());
        fs::write(path, lines.join("\n") + "\n").unwrap();
        let complaint =
            compare_candump(log, run).expect_err(&format!("{hint}: the alteration was not noticed"));
        assert!(complaint.contains(hint), "{} {range:?}: {complaint}", path.display());
        fs::write(path, good).unwrap();
    }
    compare_candump(log, run).expect("the files are as they were");
}

/// Frames that canplayer of can-utils replays.
const REPLAYED: u16 = 50;

#[test]
fn the_c_firmware_positions_on_vcan_and_canplayer_replays_a_log() {
    let guest = machine();
    ended_with(guest, &FIRMWARE_CODES);
    let run = guest.out().join("firmware");
    let summary = json(&run.join("summary.json"));
    assert_eq!(summary["ended_because"], "the controllers are done");
    assert_eq!(
        (count(&summary, "/frames_malformed"), count(&summary, "/drive_commands/two_sources")),
        (0, 0)
    );

    let log = fs::read_to_string(run.join("bus.log")).unwrap();
    let done = firmware::positioned(&data_frames(&log), firmware::REPETITIONS);
    eprintln!("{done:?}, {} of {} cycles skipped", count(&summary, "/skipped"), count(&summary, "/cycles"));
    assert!(done.cycles > 14_000 && done.set_points > 1400 && done.keeps_the_bounds(), "{done:?}");

    let on_the_bus = data_frames(&guest.lines_of_run("candump.log", &run));
    let replayed: Vec<_> = on_the_bus.iter().filter(|frame| frame.standard_id() == Some(0x5A5)).collect();
    let expected: Vec<_> = (0..REPLAYED).map(|n| CanFrame::new(0x5A5, &n.to_be_bytes())).collect();
    assert!(
        replayed.into_iter().eq(&expected),
        "canplayer's frames are not on vcan0 as they stand in the log"
    );
}

#[test]
fn foreign_programs_and_a_bus_that_goes_down_are_counted_and_survived() {
    let guest = machine();
    ended_with(guest, &FOREIGN_CODES);
    let run = guest.out();
    foreign_frames_are_counted(&run);
    let log = guest.lines_of_run("candump.log", &run.join("foreign"));
    the_emergency_stop_of_cansend_trips_the_rig(&run, &log);
    the_bus_that_went_down_was_counted(&run);
}

/// 300 frames of cangen on an identifier that nobody knows, an extended one and a remote request; two malformed commands.
fn foreign_frames_are_counted(run: &Path) {
    for file in ["summary.json", "controller.json"] {
        let report = json(&run.join("foreign").join(file));
        let ignored =
            (count(&report, "/frames_ignored/unknown"), count(&report, "/frames_ignored/malformed"));
        assert_eq!(ignored, (302, 2), "{file}");
        assert_eq!(count(&report, "/bus/dropped_on_receive"), 0, "{file}");
    }
    let summary = json(&run.join("foreign/summary.json"));
    assert_eq!(count(&summary, "/drive_commands/two_sources"), 0, "malformed commands are no second source");
}

fn the_emergency_stop_of_cansend_trips_the_rig(run: &Path, log: &str) {
    let summary = json(&run.join("foreign/summary.json"));
    let events = summary["events"].as_array().unwrap();
    assert_eq!(events.iter().filter(|event| event["kind"] == "emergency-stop").count(), 1, "{events:?}");

    let frames: Vec<_> = data_frames(log).iter().filter_map(|frame| Frame::decode(frame).ok()).collect();
    let tripped = frames.iter().position(|frame| matches!(frame, Frame::ConsoleEmergencyStop(_))).unwrap();
    let stopped = |frames: &[Frame]| -> Vec<bool> {
        frames
            .iter()
            .filter_map(|frame| match frame {
                Frame::RigStatus(status) => Some(status.emergency_stop),
                _ => None,
            })
            .collect()
    };
    let (before, after) = (stopped(&frames[..tripped]), stopped(&frames[tripped..]));
    assert!(before.len() > 10 && before.iter().all(|stopped| !stopped), "{before:?}");
    // The status on the way when the stop was sent may still be of before.
    assert!(after.len() > 10 && after[1..].iter().all(|stopped| *stopped), "{after:?}");
    let aborted = frames[tripped..].iter().any(
        |frame| matches!(frame, Frame::DriveChainStatus(status) if status.main_chain == MainChainState::Aborted),
    );
    assert!(aborted, "the drive's main chain did not go to aborted");

    let supply_pa = Table::read(&run.join("foreign/truth.csv")).column("supply_pressure_Pa");
    let (first, last) = (supply_pa[0], supply_pa[supply_pa.len() - 1]);
    // The supply node decays with 50 ms from 7 bar to 1.01325 bar; seconds later nothing of it is left.
    assert!((first - 7e5).abs() < 1.0 && (last - 101_325.0).abs() < 100.0, "{first} Pa, then {last} Pa");
}

fn the_bus_that_went_down_was_counted(run: &Path) {
    for file in ["summary.json", "controller.json"] {
        let report = json(&run.join("down").join(file));
        assert_eq!((count(&report, "/bus/disconnects"), count(&report, "/bus/reconnects")), (1, 1), "{file}");
        assert!(count(&report, "/bus/sent") > 0, "{file}");
    }
    let summary = json(&run.join("down/summary.json"));
    assert!(count(&summary, "/bus/dropped_on_send") > 0);
    let kinds: Vec<_> =
        summary["events"].as_array().unwrap().iter().map(|event| event["kind"].clone()).collect();
    let place = |wanted: Value| {
        kinds.iter().position(|kind| *kind == wanted).unwrap_or_else(|| panic!("no {wanted} in {kinds:?}"))
    };
    // The valve shuts while the bus is gone, and follows again when it is back.
    let drive = |what: &str| serde_json::json!({ what: "drive" });
    let order = [place(drive("command-stale")), place("bus-back".into()), place(drive("command-fresh"))];
    assert!(place("bus-lost".into()) < order[0] && order.is_sorted(), "{kinds:?}");
}

/// So that what `bench can` is held against (`socketcan_answers.rs`) is the kernel's, and not what somebody once wrote down.
#[test]
fn socketcan_answers_are_those_that_are_recorded() {
    let out = machine().out();
    let answers = |path: &Path| fs::read_to_string(path).unwrap();
    let recorded = socketcan::expected();
    let same = |file: &str, expected: &str| {
        assert_eq!(socketcan::first_difference(&answers(&out.join(file)), expected), None, "{file}");
    };
    for file in ["answers.txt", "rust.txt", "down.txt"] {
        same(file, &answers(&recorded.join(file)));
    }
    for folder in ["can-utils", "isotp", "programs", "own-programs"] {
        assert_eq!(socketcan::texts(&out.join(folder)), socketcan::texts(&recorded.join(folder)), "{folder}");
    }
    // On this kernel `bench can` has to find a thread's descriptors by its process.
    same("answers-guest.txt", &socketcan::expected_answers());
}
