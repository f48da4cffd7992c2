//! A record that the plant makes, as text and on its grid.

use discrepancy::gridded_record::GriddedRecord;
use discrepancy::workflow::{Task, open};
use plant::{Inputs, Plant, RigParameters, Sensors, Setup, quantise_valve};
use std::fmt::Write;

/// Name, place and numbers of an effect.
pub(crate) type Hidden<'a> = (&'a str, &'a str, &'a [(&'a str, f64)]);

/// The baseline with hidden effects.
pub(crate) fn hiding(effects: &[Hidden<'_>]) -> RigParameters {
    effects.iter().fold(RigParameters::baseline(), |rig, (name, place, numbers)| {
        rig.with_effect(name, place, numbers).expect("numbers of the sheet")
    })
}

/// Strokes of the records that are gridded, rad/s.
pub(crate) const STROKES_RAD_PER_S: f64 = 1.3;

/// Twelve seconds of the drive as a record: a second of rest, then strokes over most of its way and rests between.
pub(crate) fn measurement(hidden: &RigParameters, seed: u64, strokes_rad_per_s: f64) -> String {
    measurement_of(&["drive"], hidden, seed, strokes_rad_per_s)
}

/// The same of some axes, whose rods are not linked.
fn measurement_of(axes: &[&str], hidden: &RigParameters, seed: u64, strokes_rad_per_s: f64) -> String {
    let mut plant = Plant::new(hidden, &Setup::default()).expect("a setup of the rig");
    let mut sensors = Sensors::new(hidden, seed);
    let columns = ["valve", "position_m", "force_N", "pressure_a_Pa", "pressure_b_Pa"];
    let mut text = String::from("time_s");
    for axis in axes {
        columns.iter().for_each(|column| write!(text, ",{axis}_{column}").expect("a string takes all"));
    }
    text.push('\n');
    for cycle in 0..12_000 {
        let at_s = f64::from(cycle) * 1e-3;
        let shown = sensors.sample(&plant, &Inputs::default());
        let aim_m = 0.1 + 0.3 * (0.5 - 0.5 * (strokes_rad_per_s * (at_s - 1.0).max(0.0)).cos());
        let mut inputs = Inputs::default();
        write!(text, "{at_s:.3}").expect("a string takes all");
        for (at, shown) in shown.iter().enumerate().take(axes.len()) {
            // The load's rod comes from the other side. A pause in every fourth second.
            let gain = [8.0, -8.0][at];
            let valve =
                if at_s < 1.0 || at_s % 4.0 > 3.3 { 0.0 } else { gain * (aim_m - shown.position.value) };
            inputs.valve[at] = quantise_valve(valve.clamp(-1.0, 1.0));
            let [position, force, a, b] = [shown.position, shown.force, shown.pressure_a, shown.pressure_b]
                .map(|reading| reading.value);
            write!(text, ",{},{position},{force},{a},{b}", inputs.valve[at]).expect("a string takes all");
        }
        text.push('\n');
        plant.step(&inputs);
    }
    text
}

/// Strokes of a rig, read beside the rig file that is thought to be its.
pub(crate) fn gridded(hidden: &RigParameters, rig: &RigParameters) -> GriddedRecord {
    on_its_grid(&measurement(hidden, 11, STROKES_RAD_PER_S), rig)
}

/// The first four seconds of strokes that are twice as fast, which tell as much in a third of the fits' time.
pub(crate) fn gridded_briefly(hidden: &RigParameters, rig: &RigParameters) -> GriddedRecord {
    let whole = measurement(hidden, 11, 2.0 * STROKES_RAD_PER_S);
    let brief: Vec<&str> = whole.lines().take(4002).collect();
    on_its_grid(&(brief.join("\n") + "\n"), rig)
}

/// The same of both axes, whose rods are not linked.
pub(crate) fn both_gridded(hidden: &RigParameters, rig: &RigParameters) -> GriddedRecord {
    on_its_grid(&measurement_of(&["drive", "load"], hidden, 11, STROKES_RAD_PER_S), rig)
}

fn on_its_grid(measurement: &str, rig: &RigParameters) -> GriddedRecord {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("train.csv");
    std::fs::write(&path, measurement).expect("the folder is ours");
    open(&path, &Task::default().options, rig).expect("readable").gridded.expect("a good record")
}
