//! Records that the plant makes for the tests, with whatever is hidden in it.

use discrepancy::check::check;
use discrepancy::course::Course;
use discrepancy::records::{ReadOptions, read};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup, quantise_valve};
use std::fmt::Write;

/// Twelve seconds of the drive: a second of rest, then strokes over most of its way and rests between.
pub(crate) fn course(hidden: &RigParameters, seed: u64) -> Course {
    let mut plant = Plant::new(hidden, &Setup::default()).expect("a setup of the rig");
    let mut sensors = Sensors::new(hidden, seed);
    let mut text = String::from(
        "time_s,drive_valve,drive_position_m,drive_force_N,drive_pressure_a_Pa,drive_pressure_b_Pa\n",
    );
    for cycle in 0..12_000 {
        let at_s = f64::from(cycle) * 1e-3;
        let [shown, _] = sensors.sample(&plant, &Inputs::default());
        let aim_m = 0.1 + 0.3 * (0.5 - 0.5 * (1.3 * (at_s - 1.0).max(0.0)).cos());
        // A pause in every fourth second.
        let valve = if at_s < 1.0 || at_s % 4.0 > 3.3 { 0.0 } else { 8.0 * (aim_m - shown.position.value) };
        let valve = quantise_valve(valve.clamp(-1.0, 1.0));
        let [position, force, a, b] =
            [shown.position, shown.force, shown.pressure_a, shown.pressure_b].map(|reading| reading.value);
        writeln!(text, "{at_s:.3},{valve},{position},{force},{a},{b}").expect("a string takes all");
        plant.step(&Inputs { valve: [valve, 0.0], ..Inputs::default() });
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("measurement.csv");
    std::fs::write(&file, text).expect("the folder is ours");
    let record = read(&file, &ReadOptions::default()).expect("a record");
    let rig = RigParameters::baseline();
    Course::of(&record, &check(&record, &rig), &rig).expect("both are whole")
}
