//! The balance of the linkage: contact law against measured force.
//!
//! ```text
//! unknown = F - F_c(d),  in contact:  k (d -+ gap/2) + c dd/dt against the measured force, mean over a window
//! ```
//!
//! Only windows with contact on one side throughout count. Position noise of 20 um in both sensors is some 13 N in a window of 20
//! ms at 2e6 N/m; the noise of the force is a tenth of a newton.
//!
//! Source: rig-model.md, Masses and linkage.

use super::estimate::variables;
use super::noise_colour::ar1_se_factor;
use super::regime::Regimes;
use super::{SHORT_WINDOW_PERIODS, UnknownPoint, VARIABLES};
use crate::gridded_record::GriddedRecord;
use crate::windows::UnknownKind;
use plant::{PERIOD_S, RigParameters};

/// Force of certain contact, over the noise of its sensor.
const TOUCHING: f64 = 10.0;

/// Appends the linkage's windows of a record with both axes.
pub(super) fn gather(
    rig: &RigParameters,
    gridded: &GriddedRecord,
    contact_n: &[f64],
    position_ar1_coefficients: [f64; 2],
    points: &mut Vec<UnknownPoint>,
) {
    if !gridded.linked || gridded.measured != [true, true] {
        return;
    }
    let linkage = rig.linkage();
    let least_n = TOUCHING * gridded.noise[1][1];
    for window in 0..(gridded.len() - 1) / SHORT_WINDOW_PERIODS {
        let from = window * SHORT_WINDOW_PERIODS;
        let forces = &contact_n[from..from + SHORT_WINDOW_PERIODS];
        let side = forces[0].signum();
        let touching = forces.iter().all(|force| force * side > least_n);
        if !touching || gridded.excluded_periods[from..=from + SHORT_WINDOW_PERIODS].iter().any(|gap| *gap) {
            continue;
        }
        let mut sum_n = 0.0;
        let mut count = 0.0;
        let mut ends_m = Vec::with_capacity(SHORT_WINDOW_PERIODS);
        for (at, force_n) in forces.iter().enumerate() {
            let samples = &gridded.samples[from + at];
            let (Some(drive_m), Some(load_m)) = (samples[0][0], samples[1][0]) else { continue };
            let distance_m = load_m - drive_m;
            ends_m.push(distance_m);
            sum_n += force_n - linkage.stiffness_n_per_m * (distance_m - side * 0.5 * linkage.gap_m);
            count += 1.0;
        }
        if count < SHORT_WINDOW_PERIODS as f64 / 2.0 {
            continue;
        }
        let parted_m_per_s = slope(&ends_m) / PERIOD_S;
        let [drive_m, load_m] =
            [0, 1].map(|axis| gridded.noise[axis][0] * ar1_se_factor(position_ar1_coefficients[axis]));
        let noise_m = drive_m.hypot(load_m);
        let n = count;
        // The damping takes the slope of the same distances; both are independent about the middle of a window.
        let slope_noise_m_per_s = noise_m * (12.0 / (n * n * n)).sqrt() / PERIOD_S;
        let stiff_n = linkage.stiffness_n_per_m * noise_m / n.sqrt();
        let damped_n = linkage.damping_n_s_per_m * slope_noise_m_per_s;
        let mut variables: [f64; VARIABLES.len()] = variables(gridded, 0, from, UnknownKind::Force);
        variables[super::FORCE] = forces.iter().sum::<f64>() / SHORT_WINDOW_PERIODS as f64;
        points.push(UnknownPoint {
            window,
            value: sum_n / count - linkage.damping_n_s_per_m * parted_m_per_s,
            deviation: stiff_n.hypot(damped_n).hypot(gridded.noise[1][1] / n.sqrt()),
            variables,
            per_pressure_offset: [0.0; 2],
            regimes: Regimes::of(rig, gridded, 0, from),
        });
    }
}

/// Slope of a straight line through equally spaced values, per space.
fn slope(values: &[f64]) -> f64 {
    let middle = (values.len() as f64 - 1.0) / 2.0;
    let (mut above, mut below) = (0.0, 0.0);
    for (at, value) in values.iter().enumerate() {
        let from_middle = at as f64 - middle;
        above += from_middle * value;
        below += from_middle * from_middle;
    }
    if below > 0.0 { above / below } else { 0.0 }
}
