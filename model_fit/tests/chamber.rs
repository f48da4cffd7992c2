//! The model file of a chamber on records that the plant made: a hidden volume, a valve that passes more, nothing.

use crate::closing::{close_with, file, number};
use crate::real::crate_folder;
use model_fit::{ModelReport, Search, Verdict, simulate};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup, quantise_valve};
use std::fmt::Write as _;
use std::path::PathBuf;

/// A record of the drive alone, 8 s: opens and shuts in steps of many sizes.
fn record(rig: &RigParameters, seed: u64) -> String {
    let setup = Setup { carriage_position_m: 0.1, linked: false, added_mass_kg: 0.0 };
    let mut plant = Plant::new(rig, &setup).unwrap();
    let mut sensors = Sensors::new(rig, seed);
    let mut text =
        String::from("time_s,drive_valve,drive_position_m,drive_pressure_a_Pa,drive_pressure_b_Pa\n");
    let openings = [0.25, -0.3, 0.0, 0.4, -0.5, 0.15, -0.15, 0.6, 0.0, -0.6, 0.3, -0.2];
    for k in 0..8000_u64 {
        let opening = openings[((k + 37 * seed) / 250) as usize % openings.len()];
        let inputs = Inputs { valve: [quantise_valve(opening), 0.0], ..Inputs::default() };
        let [drive, _] = sensors.sample(&plant, &inputs);
        let seconds = k as f64 * 1e-3;
        let (x, a, b) = (drive.position.value, drive.pressure_a.value, drive.pressure_b.value);
        writeln!(text, "{seconds:.3},{},{x},{a},{b}", inputs.valve[0]).unwrap();
        plant.step(&inputs);
    }
    text
}

/// Pressure in the chamber, Pa, at each of 68 samples of 1 ms, from a pressure, with the piston at rest and a constant command.
fn pressure(start_pa: f64, valve: f64) -> Vec<f64> {
    let mut text =
        String::from("time_s,drive_valve,drive_position_m,drive_pressure_a_Pa,drive_pressure_b_Pa\n");
    (0..68).for_each(|k| writeln!(text, "{:.3},{valve},0.1,{start_pa},1e5", f64::from(k) * 1e-3).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let record = file(folder.path(), "record.csv", &text);
    let table = simulate(&model(), &record).unwrap_or_else(|error| panic!("{error}")).table;
    table.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn a_shut_valve_passes_nothing_and_an_open_one_fills_from_the_supply() {
    assert!(pressure(3e5, 0.0).iter().all(|pressure_pa| *pressure_pa == 3e5));
    // 25.9 / 2 K_V p_up with K_V 0.36 m^3/h at half opening and 7 bar, into 0.1 m of 1963.5 mm^2 and 20 cm^3: below half of it
    // all the time. After 62 ms the slower lag, 8 ms, leaves 5e-4 of it.
    let by_hand_pa_per_s = 101_325.0 * 12.95 * 0.36 * 7.0 / 3600.0 / (0.1 * 1963.5e-6 + 20e-6);
    let filled_pa = pressure(101_325.0, 0.5);
    let slope_pa_per_s = (filled_pa[65] - filled_pa[62]) / 3e-3;
    assert!(
        filled_pa[65] < 3.5e5 && (slope_pa_per_s / by_hand_pa_per_s - 1.0).abs() < 1e-3,
        "{slope_pa_per_s}"
    );
    assert!(pressure(3e5, -0.5)[67] < 2.5e5);
}

fn model() -> PathBuf {
    crate_folder().join("../discrepancy/models/chamber.toml")
}

fn closed(rig: &RigParameters) -> ModelReport {
    let folder = tempfile::tempdir().unwrap();
    let [train, test] = [1, 2].map(|seed| file(folder.path(), &format!("{seed}.csv"), &record(rig, seed)));
    close_with(&model(), (&[train], &[test]), Search::Never, &mut |_| {})
        .unwrap_or_else(|error| panic!("{error}"))
        .report
}

#[test]
fn a_hidden_dead_volume_is_named_in_the_pressure_of_its_chamber() {
    let rig = RigParameters::baseline();
    let report = closed(&rig.with_effect("dead-volume", "drive", &[("volume_cm3", 50.0)]).unwrap());
    // In one chamber an offset of the position is the same, and which of the two it is stays open.
    assert_eq!(report.verdict, Verdict::Ambiguous, "{}", report.headline);
    assert_eq!(report.named[0].suspect, "dead-volume");
    assert_eq!(report.named[0].alternatives, ["position-sensor-offset"]);
    let more = number(&report, "more").value;
    assert!((more - 30.0).abs() < 5.0, "{more} cm^3 more than the 20 of the file");
    assert_eq!(report.confirmed, Some(true), "{}", report.headline);
}

#[test]
fn a_chamber_without_anything_hidden_lacks_nothing() {
    let report = closed(&RigParameters::baseline());
    assert_eq!(report.verdict, Verdict::NothingMissing, "{}", report.headline);
}

#[test]
fn a_chamber_whose_valve_passes_more_has_another_scale() {
    let rig = RigParameters::baseline();
    let valve = rig.valve();
    let more = |kv: &[f64]| -> Vec<f64> { kv.iter().map(|kv| 1.1 * kv).collect() };
    let (supply, exhaust) = (more(&valve.kv_supply_m3_per_h), more(&valve.kv_exhaust_m3_per_h));
    let rig = rig.with("valve.kv_supply_m3_per_h", &supply).unwrap();
    let report = closed(&rig.with("valve.kv_exhaust_m3_per_h", &exhaust).unwrap());
    assert_eq!((report.verdict, report.named[0].suspect.as_str()), (Verdict::Named, "valve-passes-more"));
    let scale = number(&report, "scale").value;
    assert!((scale - 1.1).abs() < 0.03, "{scale}");
}
