//! Bad records: each defect is named by the check, with line, column and what to do, or survived with its samples left out.
//!
//! The records are the rig's own, simulated and then spoiled.

use discrepancy::check::{Checked, check};
use discrepancy::gridded_record::GriddedRecord;
use plant::{Axis, CycleRecord, Inputs, Plant, RigParameters, Sensors, Setup, quantise_valve};
use records::{Channel, ReadOptions, Record, Signal, read};
use runlog::cycle_tables::{write_measurement, write_measurement_head};
use runlog::telemetry::SetUp;
use std::sync::OnceLock;

const HEAD_LINES: usize = 2;
const CYCLES: u64 = 8000;
const FORCE: Channel = Channel::Of(Axis::Drive, Signal::Force);
const POSITION: Channel = Channel::Of(Axis::Drive, Signal::Position);
const PRESSURE_A: Channel = Channel::Of(Axis::Drive, Signal::PressureA);

/// A record as text: its head, and its rows as numbers, time first.
#[derive(Clone)]
struct Sheet {
    comment: String,
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

/// Rest, strokes to and fro with both valves, rest.
fn opening(axis: Axis, cycle: u64) -> f64 {
    if !(1000..6500).contains(&cycle) {
        return 0.0;
    }
    let turn = (cycle - 1000) / 250;
    let size = if turn.is_multiple_of(3) { 0.3 } else { 0.15 };
    match (axis, turn % 4) {
        (Axis::Drive, 0) => size,
        (Axis::Drive, 2) => -size,
        (Axis::Load, 1) => 0.5 * size,
        (Axis::Load, 3) => -0.5 * size,
        _ => 0.0,
    }
}

fn simulated(rig: &RigParameters, linked: bool, seed: u64) -> Sheet {
    let setup = Setup { carriage_position_m: 0.2, linked, added_mass_kg: 0.0 };
    let mut plant = Plant::new(rig, &setup).unwrap();
    let mut sensors = Sensors::new(rig, seed);
    let mut text = Vec::new();
    write_measurement_head(&mut text, SetUp { linked, added_mass_kg: 0.0 }).unwrap();
    for cycle in 0..CYCLES {
        let load = if linked { opening(Axis::Load, cycle) } else { 0.0 };
        let valve = [opening(Axis::Drive, cycle), load].map(quantise_valve);
        let inputs = Inputs { valve, ..Inputs::default() };
        let record = CycleRecord {
            cycle,
            valve,
            readings: sensors.sample(&plant, &inputs),
            truth: plant.truth(&inputs),
            terms: plant.terms(&inputs),
        };
        write_measurement(&mut text, cycle, record.measured()).unwrap();
        plant.step(&inputs);
    }
    let text = String::from_utf8(text).unwrap();
    let mut lines = text.lines();
    let comment = lines.next().unwrap().to_owned();
    let columns = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let rows = lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    Sheet { comment, columns, rows }
}

/// The drive alone: its own columns of a record that is not linked.
fn drive() -> Sheet {
    static SHEET: OnceLock<Sheet> = OnceLock::new();
    SHEET.get_or_init(|| simulated(&RigParameters::baseline(), false, 1).of_the_drive()).clone()
}

fn linked() -> Sheet {
    static SHEET: OnceLock<Sheet> = OnceLock::new();
    SHEET.get_or_init(|| simulated(&RigParameters::baseline(), true, 2)).clone()
}

impl Sheet {
    fn of_the_drive(mut self) -> Sheet {
        self.columns.truncate(6);
        self.rows.iter_mut().for_each(|row| row.truncate(6));
        self
    }

    fn place(&self, column: &str) -> usize {
        self.columns.iter().position(|known| known == column).unwrap()
    }

    fn changed(mut self, column: &str, change: impl Fn(usize, f64) -> f64) -> Sheet {
        let place = self.place(column);
        self.rows.iter_mut().enumerate().for_each(|(at, row)| row[place] = change(at, row[place]));
        self
    }

    fn with_column(mut self, column: &str, values: &[f64]) -> Sheet {
        self.columns.push(column.to_owned());
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.push(*value));
        self
    }

    fn without_rows(mut self, lost: impl Fn(usize) -> bool) -> Sheet {
        let mut at = 0;
        self.rows.retain(|_| {
            at += 1;
            !lost(at - 1)
        });
        self
    }

    fn read(&self) -> Record {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("measurement.csv");
        // What is no number is an empty cell.
        let cell = |value: &f64| if value.is_nan() { String::new() } else { value.to_string() };
        let rows: Vec<String> =
            self.rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>().join(",")).collect();
        let text = format!("{}\n{}\n{}\n", self.comment, self.columns.join(","), rows.join("\n"));
        std::fs::write(&path, text).unwrap();
        read(&path, &ReadOptions::default()).unwrap()
    }

    fn checked(&self) -> Checked {
        check(&self.read(), &RigParameters::baseline())
    }
}

fn kinds(checked: &Checked) -> Vec<&str> {
    checked.report.findings.iter().map(|finding| finding.kind.as_str()).collect()
}

fn texts(checked: &Checked) -> String {
    checked.report.findings.iter().map(|finding| format!("{}\n", finding.text)).collect()
}

fn is_fatal(checked: &Checked, kind: &str, column: &str, hint: &str) {
    assert!(!checked.report.usable, "{kind}: {checked:#?}");
    assert_eq!(kinds(checked), [kind], "{}", texts(checked));
    let finding = &checked.report.findings[0];
    assert_eq!(finding.column.as_deref(), Some(column));
    assert!(finding.fatal && finding.line.is_some() && finding.text.contains(hint), "{}", finding.text);
    let place = format!("measurement.csv:{}: ", finding.line.unwrap());
    assert!(finding.text.contains(&place), "{}", finding.text);
}

fn is_survived(checked: &Checked, kind: &str, row: usize) {
    assert!(checked.report.usable, "{}", texts(checked));
    assert_eq!(kinds(checked), [kind], "{}", texts(checked));
    let line = (row + HEAD_LINES + 1) as u64;
    assert_eq!(checked.report.findings[0].line, Some(line), "{}", texts(checked));
}

fn unusable(checked: &Checked, channel: Channel) -> usize {
    (0..checked.report.rows).filter(|row| !checked.is_usable(channel, *row)).count()
}

/// Specified noise of a column with its rounding, times a factor for the first.
fn specified(column: &str, factor: f64) -> f64 {
    let rig = RigParameters::baseline();
    let sensors = rig.sensors();
    let (noise, step) = match column {
        column if column.contains("position") => (sensors.position_noise_m, sensors.position_step_m()),
        column if column.contains("force") => (sensors.force_noise_n, sensors.force_step_n()),
        _ => (sensors.pressure_noise_pa, sensors.pressure_step_pa()),
    };
    (factor * noise).hypot(step / 12.0_f64.sqrt())
}

#[test]
fn good_records_have_no_findings_and_their_noise_and_steps_are_estimated() {
    for sheet in [drive(), linked()] {
        let checked = sheet.checked();
        assert!(checked.report.usable && checked.report.findings.is_empty(), "{}", texts(&checked));
        assert_eq!((checked.report.rows, checked.report.length_s), (CYCLES as usize, 7.999));
        for (column, found) in &checked.report.channels {
            assert!((found.unusable - 0.0).abs() < 1e-12);
            if column.contains("valve") {
                assert_eq!(found.noise, None);
                continue;
            }
            let ratio = found.noise.unwrap() / specified(column, 1.0);
            assert!((0.9..1.1).contains(&ratio), "{column}: {ratio}");
            // The step and nothing else: noise^2 = specified^2 - step^2 / 12 would not tell it.
            let step = specified(column, 0.0) * 12.0_f64.sqrt();
            assert!((found.quantum.unwrap() / step - 1.0).abs() < 1e-3, "{column}: {found:?}");
        }
    }
}

#[test]
fn noise_is_reported_at_half_twice_and_four_times_the_specified() {
    for factor in [0.5, 2.0, 4.0] {
        let rig = RigParameters::baseline()
            .with("sensors.position_noise_um", &[20.0 * factor])
            .and_then(|rig| rig.with("sensors.force_noise_n", &[0.5 * factor]))
            .and_then(|rig| rig.with("sensors.pressure_noise_pa", &[400.0 * factor]))
            .unwrap();
        let checked = simulated(&rig, false, 3).of_the_drive().checked();
        assert!(checked.report.findings.is_empty(), "{}", texts(&checked));
        for (column, found) in checked.report.channels.iter().filter(|(column, _)| !column.contains("valve"))
        {
            let ratio = found.noise.unwrap() / specified(column, factor);
            assert!((0.9..1.1).contains(&ratio), "{factor}, {column}: {ratio}");
        }
    }
}

#[test]
fn one_per_cent_of_lost_samples_is_survived() {
    let checked = drive().without_rows(|row| row % 100 == 37).checked();
    is_survived(&checked, "lost-samples", 37);
    assert!(texts(&checked).contains("80 rows of 8000 (1.00 %) are lost one by one"), "{}", texts(&checked));
    assert_eq!(unusable(&checked, FORCE), 0);
    let ratio = checked.noise(POSITION).unwrap() / specified("position", 1.0);
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn a_hole_of_50_ms_is_survived_and_bad_only_where_it_is() {
    let checked = drive().without_rows(|row| (3000..3050).contains(&row)).checked();
    is_survived(&checked, "gap", 3000);
    assert!(texts(&checked).contains("a hole of 50.0 ms before 3.050 s"), "{}", texts(&checked));
    assert_eq!(unusable(&checked, PRESSURE_A), 0);
}

#[test]
fn a_channel_that_saturates_now_and_then_is_left_out_there() {
    let sheet = drive();
    let place = sheet.place("drive_force_N");
    let clipped: Vec<bool> = sheet.rows.iter().map(|row| row[place].abs() > 8.0).collect();
    let checked = sheet.changed("drive_force_N", |_, force| force.clamp(-8.0, 8.0)).checked();
    assert!(checked.report.usable, "{}", texts(&checked));
    assert_eq!(kinds(&checked), ["clipped"]);
    assert!(texts(&checked).contains("the extreme of this record: they are left out"), "{}", texts(&checked));
    assert!(clipped.iter().filter(|clipped| **clipped).count() > 50);
    for (row, clipped) in clipped.iter().enumerate() {
        assert!(!clipped || !checked.is_usable(FORCE, row), "row {row}");
        assert!(checked.is_usable(POSITION, row));
    }
    assert!(unusable(&checked, FORCE) < 2000);
}

#[test]
fn a_channel_that_is_mostly_saturated_makes_the_record_useless() {
    let checked = drive().changed("drive_pressure_a_Pa", |_, pressure| pressure.min(4.5e5)).checked();
    is_fatal(&checked, "clipped", "drive_pressure_a_Pa", "record again with a larger range");
    let checked = drive().changed("drive_pressure_a_Pa", |_, _| 1e6).checked();
    assert!(!checked.report.usable && kinds(&checked).contains(&"clipped"), "{}", texts(&checked));
}

#[test]
fn swapped_pressures_are_named() {
    for (sheet, axis) in [(drive(), "drive"), (linked(), "drive"), (linked(), "load")] {
        let mut sheet = sheet;
        let (a, b) =
            (sheet.place(&format!("{axis}_pressure_a_Pa")), sheet.place(&format!("{axis}_pressure_b_Pa")));
        sheet.rows.iter_mut().for_each(|row| row.swap(a, b));
        is_fatal(
            &sheet.checked(),
            "swapped-pressures",
            &format!("{axis}_pressure_a_Pa"),
            "change the two columns",
        );
    }
}

#[test]
fn a_force_of_the_wrong_sign_is_named_linked_and_alone() {
    for (sheet, axis) in [(drive(), "drive"), (linked(), "drive"), (linked(), "load")] {
        let column = format!("{axis}_force_N");
        is_fatal(
            &sheet.changed(&column, |_, force| -force).checked(),
            "force-sign",
            &column,
            "multiply the column by -1",
        );
    }
}

#[test]
fn a_valve_and_a_position_of_the_wrong_sign_are_named() {
    let checked = drive().changed("drive_valve", |_, opening| -opening).checked();
    is_fatal(&checked, "valve-sign", "drive_valve", "positive extends the rod");
    let checked = drive().changed("drive_position_m", |_, position| 0.5 - position).checked();
    is_fatal(&checked, "position-sign", "drive_position_m", "counts the wrong way");
    let checked = drive().changed("drive_position_m", |_, position| -position).checked();
    is_fatal(&checked, "position-sign", "drive_position_m", "counts the wrong way");
}

#[test]
fn units_that_cannot_be_are_named_with_their_factor() {
    for (column, factor, hint) in [
        ("drive_pressure_a_Pa", 1e-5, "reads as bar: multiply the column by 100000"),
        ("drive_pressure_b_Pa", 1e-3, "reads as kPa: multiply the column by 1000"),
        ("drive_position_m", 1e3, "reads as mm: multiply the column by 0.001"),
        ("drive_valve", 100.0, "reads as %: divide the column by 100"),
        ("drive_force_N", 1e-3, "reads as kN: multiply the column by 1000"),
        ("time_s", 1e3, "time reads as ms: divide it by 1000"),
    ] {
        is_fatal(&drive().changed(column, |_, value| factor * value).checked(), "wrong-unit", column, hint);
    }
    let volts = drive().changed("drive_valve", |_, opening| 5.0 + 5.0 * opening).checked();
    is_fatal(&volts, "wrong-unit", "drive_valve", "take 5 from the column and divide it by 5");
}

#[test]
fn a_channel_that_sticks_is_left_out_there_and_a_dead_one_is_fatal() {
    let sheet = drive();
    let level = sheet.rows[2500][sheet.place("drive_pressure_a_Pa")];
    let stick = |row, value| if (2500..2800).contains(&row) { level } else { value };
    let checked = sheet.changed("drive_pressure_a_Pa", stick).checked();
    is_survived(&checked, "stuck", 2500);
    assert!((2500..2800).all(|row| !checked.is_usable(PRESSURE_A, row)));
    assert!((300..302).contains(&unusable(&checked, PRESSURE_A)));
    let dead = drive().changed("drive_force_N", |_, _| 0.0).checked();
    is_fatal(&dead, "stuck", "drive_force_N", "look at the sensor");
}

#[test]
fn time_that_repeats_is_survived_and_time_that_jumps_is_named() {
    let repeated =
        drive().changed("time_s", |row, time| if row == 1234 { time + 1e-3 } else { time }).checked();
    assert!(repeated.report.usable, "{}", texts(&repeated));
    // The time that the row should have had is lost.
    assert_eq!(kinds(&repeated), ["repeated-time", "lost-samples"], "{}", texts(&repeated));
    assert_eq!((0..8000).filter(|row| !repeated.is_usable(FORCE, *row)).collect::<Vec<_>>(), [1234]);
    let jumping =
        drive().changed("time_s", |row, time| if row >= 5000 { time - 2.0 } else { time }).checked();
    assert!(!jumping.report.usable && kinds(&jumping).contains(&"jumping-time"), "{}", texts(&jumping));
    let leaping = drive().changed("time_s", |row, time| if row == 70 { 1e6 } else { time }).checked();
    assert!(texts(&leaping).contains("measurement.csv:73: time jumps"), "{}", texts(&leaping));
}

#[test]
fn one_stamp_that_cannot_be_is_left_out_wherever_it_is() {
    let rig = RigParameters::baseline();
    for wrong in [0, 70, 7999] {
        let sheet =
            drive().changed("time_s", |row, time| if row == wrong { time + 1e6 } else { time }).read();
        let checked = check(&sheet, &rig);
        assert!(checked.report.usable, "row {wrong}: {}", texts(&checked));
        assert!(kinds(&checked).contains(&"jumping-time"), "row {wrong}: {}", texts(&checked));
        assert!(!checked.is_usable(FORCE, wrong) && unusable(&checked, FORCE) == 1, "row {wrong}");
        let gridded = GriddedRecord::of(&sheet, &checked, &rig).unwrap();
        assert!((7999..=8000).contains(&gridded.len()), "row {wrong}: {}", gridded.len());
    }
}

#[test]
fn a_pause_longer_than_the_record_is_a_hole_and_no_more() {
    let paused =
        drive().changed("time_s", |row, time| if row >= 4000 { time + 30.0 } else { time }).checked();
    is_survived(&paused, "gap", 4000);
    assert!(texts(&paused).contains("a hole of 30000.0 ms before 34.000 s: nothing is simulated"));
    assert_eq!(unusable(&paused, FORCE), 0);
}

#[test]
fn rests_that_a_coarse_encoder_shows_as_one_value_are_no_stuck_sensor() {
    let coarse = drive().changed("drive_position_m", |_, position| (position / 1e-4).round() * 1e-4);
    let checked = coarse.clone().checked();
    assert!(kinds(&checked).is_empty(), "{}", texts(&checked));
    // One that stands while the piston goes on is.
    let place = coarse.place("drive_position_m");
    let moved = |row: usize| (coarse.rows[row + 200][place] - coarse.rows[row][place]).abs();
    let goes = |row: &usize| coarse.rows[row - 1][place] != coarse.rows[*row][place] && moved(*row) > 0.02;
    let from = (500..7000).find(goes).expect("the drive moves");
    let level = coarse.rows[from][place];
    let stuck = coarse.clone().changed("drive_position_m", |row, position| {
        if (from..from + 200).contains(&row) { level } else { position }
    });
    is_survived(&stuck.checked(), "stuck", from);
}

#[test]
fn a_supply_that_stands_still_is_no_clipped_sensor() {
    let sheet = drive();
    // Constant for most of the time, its largest value too.
    let level = |row: usize| if row % 1000 < 300 { 7e5 - (row % 1000) as f64 * 100.0 } else { 7e5 };
    let levels: Vec<f64> = (0..sheet.rows.len()).map(level).collect();
    let checked = sheet.with_column("supply_pressure_Pa", &levels).checked();
    assert!(checked.report.usable && kinds(&checked).is_empty(), "{}", texts(&checked));
}

#[test]
fn records_that_are_too_short_or_too_slow_are_named() {
    is_fatal_of_time(&drive().without_rows(|row| row >= 500), "too-short");
    is_fatal_of_time(&drive().without_rows(|row| row % 10 != 0), "wrong-period");
}

fn is_fatal_of_time(sheet: &Sheet, kind: &str) {
    let checked = sheet.checked();
    assert!(!checked.report.usable && kinds(&checked).contains(&kind), "{}", texts(&checked));
}

#[test]
fn jitter_of_a_tenth_of_a_millisecond_is_borne_and_reported() {
    // Up to 0.17 ms to each side: 0.1 ms rms.
    let wobble =
        |row: usize| 0.34e-3 * ((row as u32).wrapping_mul(2_654_435_761) as f64 / f64::from(u32::MAX) - 0.5);
    let checked = drive().changed("time_s", |row, time| time + wobble(row)).checked();
    is_survived(&checked, "jitter", 0);
    assert_eq!(unusable(&checked, FORCE), 0);
}

#[test]
fn an_absent_value_is_reported_and_survived() {
    let sheet = drive().changed("drive_force_N", |row, force| if row % 50 == 10 { f64::NAN } else { force });
    let checked = sheet.checked();
    is_survived(&checked, "absent-values", 10);
    assert!((checked.report.channels["drive_force_N"].unusable - 0.02).abs() < 1e-9);
}

#[test]
fn a_parked_load_is_reported_and_spoils_nothing() {
    let checked = simulated(&RigParameters::baseline(), false, 4).checked();
    assert!(checked.report.usable, "{}", texts(&checked));
    assert_eq!(kinds(&checked), ["parked"], "{}", texts(&checked));
    assert!(checked.is_parked(Axis::Load) && !checked.is_parked(Axis::Drive));
}

#[test]
fn effects_of_the_catalogue_are_no_findings() {
    for (effect, place, numbers) in [
        ("force-sensor-offset", "drive", &[("offset_n", 20.0)][..]),
        ("inclination", "drive", &[("force_n", 50.0)]),
        ("pressure-sensor-offset", "drive.a", &[("offset_mbar", 100.0)]),
        ("position-sensor-lag", "drive", &[("time_constant_ms", 8.0)]),
    ] {
        let rig = RigParameters::baseline().with_effect(effect, place, numbers).unwrap();
        let checked = simulated(&rig, false, 5).of_the_drive().checked();
        assert!(checked.report.usable && checked.report.findings.is_empty(), "{effect}: {}", texts(&checked));
    }
}
