//! Share of records for which an oracle that knows two rigs exactly decides which of them made the record.
//!
//! ```text
//!   d = |M (y_A - y_B)|      y: readings without noise over the noise, windows of 100 ms; M: free initial states ([signature])
//!   right in Phi(d / 2) of the records, if both are equally likely
//! ```
//!
//! The noise is that of the rig file times a factor, rounding included, and white. The record of an experiment is the closed
//! loop with which `next` rehearses it, simulated with either rig as the truth: the smaller distance counts.
//!
//! [signature]: crate::signature

use crate::signature::{Observer, length};
use crate::trajectory::{Point, TrueTrajectory};
use crate::twins::Part;
use discrepancy::next::closed_loop::{ClosedLoopRun, SEED, drive};
use discrepancy::next::menu::{Entry, MENU};
use plant::{Axis, ParameterError, RigParameters};
use record_maker::Record;
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeMap;

/// Experiments of the certificate: without the other four no pair in the table of `next.md` has a smaller T. Experiments with
/// linked rods do not apply to a record of one axis.
const CERTIFIED: [&str; 8] = [
    "shut-and-hold",
    "chirps",
    "ends",
    "valve-steps",
    "full-exhaust",
    "slow-reversals",
    "weights",
    "load-steps",
];
/// Largest share of right decisions in the train record, and smallest in one experiment.
pub(crate) const ALIKE: f64 = 0.7;
pub(crate) const APART: f64 = 0.9;
/// Keys of the sensors' noise.
const NOISE: [&str; 3] = ["sensors.position_noise_um", "sensors.force_noise_n", "sensors.pressure_noise_pa"];

/// Share of right decisions of the likelihood ratio between two equally likely models.
pub(crate) fn probability(distance: f64) -> f64 {
    Normal::standard().cdf(0.5 * distance)
}

/// A rig with its sensors' noise multiplied.
///
/// # Errors
/// [`ParameterError`] for a noise that the rig file does not allow.
pub(crate) fn with_noise(rig: &RigParameters, noise: f64) -> Result<RigParameters, ParameterError> {
    NOISE.iter().try_fold(rig.clone(), |rig, key| {
        let scaled: Vec<f64> = rig.numbers(key).iter().map(|number| noise * number).collect();
        rig.with(key, &scaled)
    })
}

/// Distance of two rigs in a part of a record that the first one made.
pub(crate) fn in_record(record: &Record, part: Part, truth: &RigParameters, other: &RigParameters) -> f64 {
    between(part.of(record, truth), other)
}

/// Distance of two rigs in an experiment; `None` where one of them cannot run it.
pub(crate) fn in_experiment(entry: &Entry, rigs: [&RigParameters; 2], axis: Axis) -> Option<f64> {
    let baseline = RigParameters::baseline();
    let with = |truth: &RigParameters, other: &RigParameters| {
        let run = drive(entry, &baseline, truth, SEED).ok()?;
        let run = Some(run).filter(|run| run.ends_well(baseline.cylinder().stroke_m))?;
        Some(between(driven(run, truth, axis), other))
    };
    let [one, other] = rigs;
    Some(with(one, other)?.min(with(other, one)?))
}

/// Distances of two rigs in the experiments of the certificate.
pub(crate) fn in_menu(rigs: [&RigParameters; 2], axis: Axis) -> BTreeMap<String, f64> {
    let entries = MENU.iter().filter(|entry| CERTIFIED.contains(&entry.name) && !entry.is_linked());
    let of = |entry: &Entry| Some((entry.name.to_owned(), in_experiment(entry, rigs, axis)?));
    entries.filter_map(of).collect()
}

fn between(trajectory: TrueTrajectory, other: &RigParameters) -> f64 {
    length(&Observer::new(trajectory).signature(other))
}

fn driven(run: ClosedLoopRun, rig: &RigParameters, axis: Axis) -> TrueTrajectory {
    let point = |state: &discrepancy::gridded_record::AxisState| Point {
        extension_m: state.extension_m,
        rod_velocity_m_per_s: state.rod_velocity_m_per_s,
        pressures_pa: state.pressures_pa,
    };
    TrueTrajectory {
        rig: rig.clone(),
        measured: Axis::ALL.map(|each| each == axis),
        start: run.start,
        settling: 1,
        inputs: run.inputs,
        points: run.points.iter().map(|states| states.each_ref().map(point)).collect(),
    }
}
