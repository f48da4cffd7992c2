//! Open-loop simulation of the whole record from its first samples at rest, judged after 0.1 s.

use crate::gridded_record::{AxisState, CHANNELS, GriddedRecord};
use crate::report::BeforeAfter;
use crate::windows::{first_state, set_state};
use plant::{Axis, PERIOD_S, Plant, RigParameters};
use std::collections::BTreeMap;

/// Periods that are not judged: internal states and lags fill [rig-model.md, Accuracy].
const FILLING_PERIODS: usize = 100;
/// Pressure that air from the supply does not exceed by much in a chamber, over the supply's.
const HIGHEST: f64 = 1.1;
/// How far a rod may be beyond its stops, m: rounding.
const BEYOND_M: f64 = 1e-9;

#[derive(Debug)]
pub(super) struct FreeRun {
    /// Of each axis and channel, rms error in percent of the range of the readings; `None` where there are none.
    pub(super) nrmse_percent: [[Option<f64>; CHANNELS]; 2],
    pub(super) unphysical: Vec<String>,
}

pub(super) fn free_run(record: &GriddedRecord, rig: &RigParameters) -> FreeRun {
    let mut plant =
        Plant::in_state(rig, &first_state(record, rig)).expect("a start state is one of the rig's");
    let at_rest = record.smoothed_states[0].map(|state| AxisState { rod_velocity_m_per_s: 0.0, ..state });
    set_state(&mut plant, record, 0, &at_rest);
    let stroke_m = rig.cylinder().stroke_m;
    let highest_pa = HIGHEST * plant.supply_pressure_pa();
    let mut errors = [[(0.0, 0_usize); CHANNELS]; 2];
    let mut ranges = [[[f64::INFINITY, f64::NEG_INFINITY]; CHANNELS]; 2];
    let mut unphysical: BTreeMap<(usize, &str), usize> = BTreeMap::new();
    for (period, (inputs, samples)) in record.inputs.iter().zip(&record.samples).enumerate() {
        let truth = plant.truth(inputs);
        let shown = plant.noise_free_readings(&truth);
        for i in (0..2).filter(|i| record.measured[*i]) {
            let axis = &truth.axes[i];
            let extension_m = plant.state().axes[i].extension_m;
            let pressures_pa = [axis.pressure_a_pa, axis.pressure_b_pa];
            let found = [
                ("not finite", !plant.state().is_finite()),
                ("a pressure not above zero", pressures_pa.iter().any(|pressure_pa| *pressure_pa <= 0.0)),
                (
                    "a pressure more than a tenth above the supply's",
                    pressures_pa.iter().any(|pressure_pa| *pressure_pa > highest_pa),
                ),
                ("the piston beyond its stroke", !(-BEYOND_M..=stroke_m + BEYOND_M).contains(&extension_m)),
            ];
            for (what, _) in found.into_iter().filter(|(_, found)| *found) {
                unphysical.entry((i, what)).or_insert(period);
            }
            for at in 0..CHANNELS {
                let Some(sample) = samples[i][at] else { continue };
                let range = &mut ranges[i][at];
                *range = [range[0].min(sample), range[1].max(sample)];
                if period >= FILLING_PERIODS {
                    let (sum, count) = &mut errors[i][at];
                    *sum += (shown[i][at] - sample).powi(2);
                    *count += 1;
                }
            }
        }
        if !plant.state().is_finite() {
            break;
        }
        plant.step(inputs);
    }
    let nrmse_percent = std::array::from_fn(|i| {
        std::array::from_fn(|at| {
            let ((sum, count), [least, most]) = (errors[i][at], ranges[i][at]);
            (count > 0 && most > least).then(|| 100.0 * (sum / count as f64).sqrt() / (most - least))
        })
    });
    let unphysical = unphysical
        .into_iter()
        .map(|((i, what), period)| {
            format!("{} axis: {what}, first after {:.3} s", Axis::ALL[i].name(), period as f64 * PERIOD_S)
        })
        .collect();
    FreeRun { nrmse_percent, unphysical }
}

/// The errors of both runs by column.
pub(super) fn both(
    before: &FreeRun,
    after: &FreeRun,
    column: &dyn Fn(usize, usize) -> String,
) -> BTreeMap<String, BeforeAfter> {
    let mut all = BTreeMap::new();
    for (i, at) in (0..2).flat_map(|i| (0..CHANNELS).map(move |at| (i, at))) {
        if let (Some(before), Some(after)) = (before.nrmse_percent[i][at], after.nrmse_percent[i][at]) {
            all.insert(column(i, at), BeforeAfter { before, after });
        }
    }
    all
}
