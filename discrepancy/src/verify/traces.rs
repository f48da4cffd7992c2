//! Series for the page: measured, both models window by window, and their residuals.

use super::{Model, column};
use crate::page::Trace;
use crate::windows::WINDOW_PERIODS;
use plant::{Axis, PERIOD_S};

/// One trace for each output, over the whole record; what no window has is NaN.
pub(super) fn traces(before: &Model<'_>, after: &Model<'_>) -> Vec<Trace> {
    let windows = &after.windows;
    let record = windows.record;
    let outputs = &windows.outputs;
    let load_offset_m = windows.rig.sensors().load_position_offset_m;
    outputs
        .iter()
        .enumerate()
        .map(|(output, (axis, at))| {
            let noise = record.noise[*axis][*at];
            // As the record has it.
            let offset = if *at == 0 && Axis::ALL[*axis] == Axis::Load { load_offset_m } else { 0.0 };
            let joined = |values: &[f64], offset: f64| {
                let mut series = vec![f64::NAN; record.len()];
                let of_windows = values.chunks_exact(WINDOW_PERIODS * outputs.len());
                for (start, window) in windows.starts.iter().zip(of_windows) {
                    let output = window.iter().skip(output).step_by(outputs.len());
                    series[*start..]
                        .iter_mut()
                        .zip(output)
                        .for_each(|(entry, value)| *entry = value * noise + offset);
                }
                series
            };
            let measured: Vec<f64> = record
                .samples
                .iter()
                .map(|samples| samples[*axis][*at].map_or(f64::NAN, |value| value + offset))
                .collect();
            let residual = |model: &Model<'_>| {
                let mut series = joined(&model.residual, 0.0);
                series
                    .iter_mut()
                    .zip(&measured)
                    .filter(|(_, measured)| measured.is_nan())
                    .for_each(|(value, _)| *value = f64::NAN);
                series
            };
            Trace {
                signal: column(*axis, *at),
                unit: ["m", "N", "Pa", "Pa"][*at].to_owned(),
                time_s: (0..record.len()).map(|period| period as f64 * PERIOD_S).collect(),
                before: joined(&before.simulated, offset),
                after: joined(&after.simulated, offset),
                before_residual: residual(before),
                after_residual: residual(after),
                measured,
                noise,
            }
        })
        .collect()
}
