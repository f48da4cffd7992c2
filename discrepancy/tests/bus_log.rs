//! A run's log of the bus says the same as its measurement, row for row.

use plant::Axis;
use protocol::frames::{DRIVE_SENSORS, DRIVE_VALVE_COMMAND};
use records::{Channel, LoggedBy, ReadOptions, Record, Signal};
use std::path::{Path, PathBuf};

/// A run of 400 cycles in lockstep with a stop of the rig in its midst; how it was made stands in `tests/data/README.md`.
fn run() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/run")
}

fn read(file: &Path) -> Record {
    records::read(file, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// One count of the wire.
fn count(signal: Signal) -> f64 {
    let place = match signal {
        Signal::Valve => return DRIVE_VALVE_COMMAND.signals[0].factor,
        Signal::Position => 0,
        Signal::Force => 1,
        Signal::PressureA | Signal::PressureB | Signal::AppliedForce => 2,
    };
    DRIVE_SENSORS.signals[place].factor
}

fn channels() -> impl Iterator<Item = (Channel, Signal)> {
    let measured = Channel::ALL.into_iter().filter(|channel| !channel.foreign_only());
    measured.filter_map(|channel| match channel {
        Channel::Of(_, signal) => Some((channel, signal)),
        Channel::SupplyPressure => None,
    })
}

/// The log says what was measured, to a count; how many values it does not have.
fn absent_beside(log: &Record, measured: &Record) -> usize {
    let mut absent = 0;
    let mut row = 0;
    for at in 0..log.len() {
        while measured.time_s()[row] < log.time_s()[at] - 1e-9 {
            row += 1;
        }
        assert!((measured.time_s()[row] - log.time_s()[at]).abs() < 1e-9);
        for (channel, signal) in channels() {
            let expected = measured.value(channel, row).expect("the rig measures everything");
            match log.value(channel, at) {
                Some(value) => {
                    let differs = (value - expected).abs() > count(signal) * 1.000_001;
                    assert!(!differs, "{channel} at {} s: {value}, measured {expected}", log.time_s()[at]);
                }
                None => absent += 1,
            }
        }
    }
    absent
}

/// The log with some of its lines, in a folder of its own.
fn some_lines(keep: impl Fn(usize, &str) -> bool) -> (tempfile::TempDir, PathBuf) {
    let text = std::fs::read_to_string(run().join("bus.log")).unwrap();
    let kept: String = text
        .lines()
        .enumerate()
        .filter(|(place, line)| keep(*place, line))
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bus.log");
    std::fs::write(&path, kept).unwrap();
    (folder, path)
}

#[test]
fn the_log_of_a_run_reads_as_its_measurement() {
    let (log, measured) = (read(&run().join("bus.log")), read(&run().join("measurement.csv")));
    assert_eq!(log.len(), measured.len());
    assert_eq!(log.setup, measured.setup);
    assert_eq!(absent_beside(&log, &measured), 0);
    let valve = Channel::Of(Axis::Drive, Signal::Valve);
    let open = log.channel(valve).unwrap().iter().flatten().filter(|opening| **opening != 0.0).count();
    assert!(open > 100, "the run moves something: {open}");
    let supply = log.channel(Channel::SupplyPressure).unwrap().iter().flatten().count();
    assert_eq!(supply, log.len() / 10, "the status comes every ten cycles");
}

#[test]
fn lost_frames_are_gaps_and_nothing_else_changes() {
    let measured = read(&run().join("measurement.csv"));
    // Every 37th frame of the sensors is missing.
    let lost = |place: usize, line: &str| place.is_multiple_of(37) && line.contains(" 12");
    let (_folder, path) = some_lines(|place, line| !lost(place, line));
    let log = read(&path);
    let absent = absent_beside(&log, &measured);
    assert!(absent > 0 && absent.is_multiple_of(4), "four values for each lost frame: {absent}");
    assert!(log.warnings.iter().any(|warning| warning.text.contains("sensors are not in the log")));
}

#[test]
fn a_log_that_begins_in_the_midst_knows_the_valve_after_the_first_command() {
    let measured = read(&run().join("measurement.csv"));
    let (_folder, path) = some_lines(|place, _| place > 700);
    let log = read(&path);
    let absent = absent_beside(&log, &measured);
    assert!(log.time_s()[0] > 0.1 && absent <= 2 * 2 + 10, "{absent} values before the first commands");
}

#[test]
fn where_a_listener_missed_a_command_nobody_knows_what_acted() {
    let (_folder, path) = some_lines(|place, line| !(place.is_multiple_of(50) && line.contains(" 110#")));
    let read =
        |logged_by| records::read(&path, &ReadOptions { logged_by, ..ReadOptions::default() }).unwrap();
    let absent = |record: &Record| {
        let valve = record.channel(Channel::Of(Axis::Drive, Signal::Valve)).unwrap();
        valve.iter().filter(|opening| opening.is_none()).count()
    };
    let (rig, listener) = (read(LoggedBy::Rig), read(LoggedBy::Listener));
    assert_eq!(absent(&rig), 0, "what the rig did not hear did not act");
    // Eight frames are taken out; one falls into the emergency stop, in which valves are shut whatever was commanded.
    let missed = rig.warnings.iter().filter(|warning| warning.text.contains("drive commands")).count();
    assert_eq!((missed, (4..=8).contains(&absent(&listener))), (1, true), "{}", absent(&listener));
    let _ = absent_beside(&listener, &self::read(&run().join("measurement.csv")));
}

#[test]
fn what_is_no_log_is_reported_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.log");
    for (text, hint) in [
        ("(0000000000.000000) bus0 110#0010000090\n", "no frame of sensors (0x120, 0x121) in 1 frames"),
        ("time_s,drive_valve\n0,1\n", "a.log:1: 'time_s,drive_valve' is no line of candump -L"),
        ("", "no frame of sensors"),
        // A stamp that went wrong: 8000 s would be 8 million rows.
        (
            "(0000000000.000000) bus0 120#CA4CFFFFE4539605\n(0000000000.000000) bus0 130#00000000000002\n\
             (0000008000.001000) bus0 120#CC4CF9FFD5139615\n",
            "a.log:3: 8000 s without a frame of sensors before this line, 10 s at most: split the log there",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let message = records::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains(hint), "{message}");
    }
}
