//! The held-out record: the baseline and the extended model, both frozen.
//!
//! ```text
//!   windows of 400 ms ──► power of each window and signal over what noise gives ──► gap, chi2, whiteness, confirmed
//!   whole record, open loop ──► free run: error in percent of the range, what a rig cannot do
//! ```
//!
//! Figures of windows are robust in two ways, which both models and the draws of nothing share:
//!
//! - *Left out* are the 2 % of the windows, at least one, in which the extended model is worst: around a stop or a
//!   break-away microseconds decide, and one such window would outweigh all others. Both models leave out the same
//!   windows; for a gap they are those of its signal, for chi2 and whiteness those of all signals together. Whether the
//!   extended model is better is asked of all windows.
//! - *Level*: the noise of a channel is known to some per cent only. The tenth of the windows in which the better of both models
//!   leaves least tells it anew, within [`LEVELS`].
//!
//! Better means by more than three standard errors of the sum of f_k ln(before_k / after_k) over windows k, each window a cluster
//! of its own: as in [`crate::fit`], a window counts by how many times its noise it is off. An effect that fewer than ten windows
//! show cannot pass, whatever its size.
//!
//! What noise alone leaves comes from simulated residuals, with memory and errors of the sampling instant as the course has them.
//! The range of nothing comes from whole records that the extended model would have left itself: their starts are looked for as
//! those of the record are. Source: discrepancy-notes.md, 1, 3; rig-model.md, Accuracy (a free run is judged after 0.1 s).
//! Cameron, Gelbach, Miller 2008, Rev. Econ. Stat. 90(3): clusters.

mod free_run;
mod null_power;
mod power;
mod traces;

use crate::fit::LEAST;
use crate::gridded_record::{CHANNELS, GriddedRecord, SIGNALS, searched_share};
use crate::page::Trace;
use crate::records::Channel;
use crate::report::{BeforeAfter, Gap, Verification};
use crate::windows::Windows;
use null_power::NullPower;
use plant::{Axis, RigParameters};
use power::{Power, kept, levels, pooled};
use std::collections::BTreeMap;

/// How far the noise of a channel may be corrected, as a factor on its power.
pub const LEVELS: [f64; 2] = [0.75, 1.15];
/// Standard errors by which the extended model must be better.
const BETTER_ERRORS: f64 = 3.0;
/// By how much a signal's rms may grow.
const WORSE: f64 = 1.02;
/// Spreads of nothing that an excess must have: below, the share of it that went could not be told to a tenth.
const EXCESS_SPREADS: f64 = 10.0;

/// What a held-out record says.
#[derive(Clone, Debug)]
pub struct Verified {
    /// The gap of each signal, by its column.
    pub gap: BTreeMap<String, Gap>,
    /// Everything else.
    pub verification: Verification,
    /// Series for the page.
    pub traces: Vec<Trace>,
}

/// Judges both models on a record that nothing was fitted on.
pub fn verify(
    before: &RigParameters,
    after: &RigParameters,
    record: &GriddedRecord,
    progress: &mut dyn FnMut(&str),
) -> Verified {
    progress("held-out record in windows, before and after");
    let (before, after) = rayon::join(|| Model::new(record, before), || Model::new(record, after));
    progress("held-out record: what noise alone would show");
    let part = record.thinned(searched_share(std::slice::from_ref(record)));
    let part = part.as_ref().map(|part| Model::new(part, after.windows.rig()));
    let null = NullPower::new(&after, part.as_ref());
    progress("held-out record: free run");
    let (run_before, run_after) = rayon::join(
        || free_run::free_run(record, before.windows.rig()),
        || free_run::free_run(record, after.windows.rig()),
    );

    let lanes = after.windows.lanes().len();
    let models = [&before, &after]
        .map(|model| Power::new(&power::sums(&model.residual, lanes), &null.expected, lanes));
    let [power_before, power_after] = &models;
    let levels = levels(&power_before.smaller(power_after), &null);
    let models = [power_before, power_after].map(|power| power.over(&levels));
    let [power_before, power_after] = &models;

    let names: Vec<String> = after.windows.lanes().iter().map(|(axis, at)| column(*axis, *at)).collect();
    let mut gap = BTreeMap::new();
    let mut whiteness = BTreeMap::new();
    let all_kept = kept(&power_after.joint());
    for (lane, name) in names.iter().enumerate() {
        let (axis, at) = after.windows.lanes()[lane];
        let noise = record.noise[axis][at] * levels[lane].sqrt();
        gap.insert(name.clone(), signal_gap(&models, lane, noise, null.spreads[lane]));
        let of = |model: &Model<'_>| power::neighbours(&model.residual, lane, lanes, &all_kept);
        whiteness.insert(name.clone(), BeforeAfter { before: of(&before), after: of(&after) });
    }
    let worse = gap.values().any(|gap| gap.after > WORSE * gap.before);
    let verification = Verification {
        record: record.name.clone(),
        chi2_before: pooled(&power_before.joint(), &all_kept),
        chi2_after: pooled(&power_after.joint(), &all_kept),
        chi2_null: null.range,
        free_run_nrmse_percent: free_run::both(&run_before, &run_after, &column),
        whiteness,
        physical: run_after.unphysical,
        confirmed: !worse && is_better(power_before, power_after),
    };
    let traces = traces::traces(&before, &after);
    Verified { gap, verification, traces }
}

/// A model on the record's windows.
pub(crate) struct Model<'a> {
    windows: Windows<'a>,
    /// Readings over their noise.
    simulated: Vec<f64>,
    /// What they leave.
    residual: Vec<f64>,
}

impl<'a> Model<'a> {
    /// Each model has the freedom of its own windows' starts.
    fn new(record: &'a GriddedRecord, rig: &RigParameters) -> Self {
        let windows = Windows::with_estimated_starts(record, rig);
        let simulated = windows.simulate(rig);
        let residual = windows.residual(&simulated);
        Model { windows, simulated, residual }
    }
}

/// The column of a lane, `drive_position_m`.
fn column(axis: usize, at: usize) -> String {
    debug_assert!(at < CHANNELS);
    Channel::Of(Axis::ALL[axis], SIGNALS[at]).column()
}

/// The gap of a lane whose noise is `noise` in its unit, `spread` that of the pooled power of nothing.
fn signal_gap(models: &[Power; 2], lane: usize, noise: f64, spread: f64) -> Gap {
    let [before, after] = models.each_ref().map(|power| power.lane(lane));
    let kept = kept(&after);
    let [before_power, after_power] = [&before, &after].map(|squares| pooled(squares, &kept));
    let excess = before_power - 1.0;
    let is_resolved = excess > EXCESS_SPREADS * spread;
    Gap {
        before: noise * before_power.sqrt(),
        after: noise * after_power.sqrt(),
        floor: noise,
        closed: is_resolved.then(|| (1.0 - (after_power - 1.0) / excess).min(1.0)),
    }
}

/// Whether a model's windows are better by more than [`BETTER_ERRORS`], each window a cluster.
fn is_better(before: &Power, after: &Power) -> bool {
    let gains: Vec<f64> = before
        .joint()
        .iter()
        .zip(after.joint())
        .filter(|(before, _)| before.expected > 0.0)
        .map(|(before, after)| after.expected * (before.over().max(LEAST) / after.over().max(LEAST)).ln())
        .collect();
    let count = gains.len() as f64;
    if count < 2.0 {
        return false;
    }
    let mean = gains.iter().sum::<f64>() / count;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean > BETTER_ERRORS * (variance / count).sqrt()
}

#[cfg(test)]
mod tests;
