//! A record that the plant makes, as text and on its grid.

use discrepancy::gridded_record::GriddedRecord;
use discrepancy::workflow::{Task, open};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup, quantise_valve};
use std::fmt::Write;

/// Name, place and numbers of an effect.
pub(crate) type Hidden<'a> = (&'a str, &'a str, &'a [(&'a str, f64)]);

/// The baseline with effects that nobody is told of.
pub(crate) fn hiding(effects: &[Hidden<'_>]) -> RigParameters {
    effects.iter().fold(RigParameters::baseline(), |rig, (name, place, numbers)| {
        rig.with_effect(name, place, numbers).expect("numbers of the sheet")
    })
}

/// Strokes of the records that are gridded, rad/s.
pub(crate) const STROKES_RAD_PER_S: f64 = 1.3;

/// Twelve seconds of the drive as a record: a second of rest, then strokes over most of its way and rests between.
pub(crate) fn measurement(hidden: &RigParameters, seed: u64, strokes_rad_per_s: f64) -> String {
    let mut plant = Plant::new(hidden, &Setup::default()).expect("a setup of the rig");
    let mut sensors = Sensors::new(hidden, seed);
    let mut text = String::from(
        "time_s,drive_valve,drive_position_m,drive_force_N,drive_pressure_a_Pa,drive_pressure_b_Pa\n",
    );
    for cycle in 0..12_000 {
        let at_s = f64::from(cycle) * 1e-3;
        let [shown, _] = sensors.sample(&plant, &Inputs::default());
        let aim_m = 0.1 + 0.3 * (0.5 - 0.5 * (strokes_rad_per_s * (at_s - 1.0).max(0.0)).cos());
        // A pause in every fourth second.
        let valve = if at_s < 1.0 || at_s % 4.0 > 3.3 { 0.0 } else { 8.0 * (aim_m - shown.position.value) };
        let valve = quantise_valve(valve.clamp(-1.0, 1.0));
        let [position, force, a, b] =
            [shown.position, shown.force, shown.pressure_a, shown.pressure_b].map(|reading| reading.value);
        writeln!(text, "{at_s:.3},{valve},{position},{force},{a},{b}").expect("a string takes all");
        plant.step(&Inputs { valve: [valve, 0.0], ..Inputs::default() });
    }
    text
}

/// Strokes of a rig, read beside the rig file that is thought to be its.
pub(crate) fn gridded(hidden: &RigParameters, rig: &RigParameters) -> GriddedRecord {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("train.csv");
    std::fs::write(&path, measurement(hidden, 11, STROKES_RAD_PER_S)).expect("the folder is ours");
    open(&path, &Task::default().options, rig).expect("readable").gridded.expect("a good record")
}
