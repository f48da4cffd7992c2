//! The real records beside the project read with the mappings that ship; skipped aloud where they are not there.

use crate::real::{crate_folder, data};
use plant::Axis;
use records::{Channel, Form, ReadOptions, Record, Signal};
use std::path::Path;

const POSITION: Channel = Channel::Of(Axis::Drive, Signal::Position);
const FORCE: Channel = Channel::Of(Axis::Drive, Signal::Force);
const APPLIED: Channel = Channel::Of(Axis::Drive, Signal::AppliedForce);
const PRESSURE: Channel = Channel::Of(Axis::Drive, Signal::PressureA);

fn read(file: &Path, mapping: &str) -> Record {
    let mapping = Some(crate_folder().join("mappings").join(mapping));
    records::read(file, &ReadOptions { mapping, ..ReadOptions::default() })
        .unwrap_or_else(|error| panic!("{error}"))
}

fn range(record: &Record, channel: Channel) -> (f64, f64) {
    let values = record.channel(channel).expect("the mapping has it").iter().flatten();
    values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (value.min(least), value.max(most)))
}

#[test]
fn the_emps_records_read_with_their_mapping() {
    let Some(folder) = data("the_emps_records_read_with_their_mapping") else { return };
    for name in ["emps_train.csv", "emps_test_pulses.csv"] {
        let record = read(&folder.join("emps").join(name), "emps.toml");
        assert_eq!(
            (record.form, &record.warnings[..], record.nominal_period_s),
            (Form::Foreign, &[][..], Some(1e-3))
        );
        assert!(record.len() > 20_000, "{name}: {} rows", record.len());
        assert_eq!(record.line(0), 2);
        // The first row's command, by hand: 2.5386 V and 2.5532 V of 35.15 N.
        let first_n = record.value(APPLIED, 0).unwrap();
        assert!((first_n - 89.5).abs() < 0.5, "{name}: {first_n} N");
        // A stage of 250 mm whose amplifier ends at 10 V.
        let (_, most_m) = range(&record, POSITION);
        assert!((0.2..0.3).contains(&most_m), "{name}: {most_m} m");
        let (least_n, most_n) = range(&record, APPLIED);
        assert!(least_n > -351.6 && most_n < 351.6, "{name}: {least_n} to {most_n} N");
        let is_even = |pair: &[f64]| (pair[1] - pair[0] - 1e-3).abs() < 1e-6;
        assert!(record.time_s().windows(2).all(is_even), "{name}: 1 kHz");
    }
}

#[test]
fn the_cylinder_records_read_with_their_mapping_holes_and_all() {
    let Some(folder) = data("the_cylinder_records_read_with_their_mapping_holes_and_all") else { return };
    for seal in ["O-ring257", "X-ring257"] {
        for bar in [1, 3, 5, 7] {
            let name = format!("cyl25_friction_{seal}_{bar}bar.csv");
            let record = read(&folder.join("cylinder-friction").join(&name), "cylinder-friction.toml");
            assert_eq!(record.warnings, [], "{name}");
            // Gauge in the file, absolute in the record; set within a tenth of a bar.
            let (least_pa, most_pa) = range(&record, PRESSURE);
            let set_pa = 101_325.0 + 1e5 * f64::from(bar);
            assert!(
                (least_pa - set_pa).abs() < 2e4 && (most_pa - set_pa).abs() < 2e4,
                "{name}: {least_pa}, {most_pa}"
            );
            // The force that holds against the gauge pressure on some 519 mm2.
            let (_, most_n) = range(&record, FORCE);
            assert!((most_n - 51.9 * f64::from(bar)).abs() < 40.0, "{name}: {most_n} N");
            let longest_s = record.time_s().windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            assert!((0.05..0.4).contains(&longest_s), "{name}: a hole of {longest_s} s");
        }
    }
}
