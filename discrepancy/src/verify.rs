//! The held-out record: the baseline and the extended model, both frozen.
//!
//! ```text
//!   windows of 400 ms ──► power of each window and signal over what noise gives ──► gap, chi2, whiteness, confirmed
//!   whole record, open loop ──► free run: error in percent of the range, what a rig cannot do
//! ```
//!
//! Window figures are robust in two ways, alike for both models and the null draws:
//!
//! - *Trimming*: the 2 % of the windows, at least one, in which the smaller of both models' powers is largest are left out, since
//!   one window around a break-away would outweigh all others. Both models leave out the same windows: those of the signal for a
//!   gap, those of all signals together for chi2 and whiteness. The test of improvement uses all windows.
//! - *Level*: the noise of a channel is known to some per cent only. The lowest decile over the windows of the smaller of both
//!   models' powers corrects it within [`VARIANCE_FACTOR_BOUNDS`].
//!
//! The extended model is better if the mean of f_k ln(before_k / after_k) over windows k exceeds three standard errors, with
//! windows taken as independent (log-variance differences as in a Diebold-Mariano test). Equal gains in m of n windows give
//! t = sqrt(m (n - 1) / (n - m)), so that an effect in fewer than 9 n / (n + 8) windows cannot pass, whatever its size.
//!
//! Expected power comes from drawn noise with the autocorrelation and jitter of the record. The null range of chi2 comes from
//! synthetic records of the extended model, whose start states are estimated as those of the record are. Source:
//! discrepancy-notes.md, 1, 3; rig-model.md, Accuracy (a free run is judged after 0.1 s). Diebold, Mariano 1995, J. Bus. Econ.
//! Stat. 13(3): paired differences.

mod free_run;
mod null_power;
mod power;
mod traces;

use crate::fit::MIN_CHI2_PER_DOF;
use crate::gridded_record::{CHANNELS, GriddedRecord, SIGNALS, searched_share};
use crate::name::lack_of_fit_per_dof;
use crate::page::Trace;
use crate::report::{BeforeAfter, SignalMisfit, Verification};
use crate::windows::Windows;
use model_fit::stats::mean_and_variance;
use model_fit::{WORSE, parallel};
use null_power::NullPower;
use plant::{Axis, RigParameters};
use power::{Power, levels, pooled, untrimmed};
use records::Channel;
use std::collections::BTreeMap;

/// Bounds of the noise level correction, as a factor on the mean square. The upper one exceeds that of the search (`engine.rs`),
/// where the level comes from the rig file's model: here the better of two models gives it. No study set either.
pub(crate) const VARIANCE_FACTOR_BOUNDS: [f64; 2] = [0.75, 1.15];
/// Significance of an improvement, in standard errors.
const BETTER_ERRORS: f64 = 3.0;
/// Smallest excess in null standard deviations; below, the closed share is not known to a tenth.
const MIN_EXCESS_Z: f64 = 10.0;

/// Result of a held-out record.
#[derive(Clone, Debug)]
pub(crate) struct Verified {
    /// The misfit of each signal, by its column.
    pub(crate) misfit: BTreeMap<String, SignalMisfit>,
    /// Chi2, whiteness, free run, and whether the extended model is confirmed.
    pub(crate) verification: Verification,
    /// Series for the page.
    pub(crate) traces: Vec<Trace>,
}

/// Compares both models on a record that was not used in any fit.
pub(crate) fn verify(
    before: &RigParameters,
    after: &RigParameters,
    record: &GriddedRecord,
    progress: &mut dyn FnMut(&str),
) -> Verified {
    progress("held-out record in windows, before and after");
    let [before, after] = parallel::map_pair([before, after], |rig| Model::new(record, rig));
    progress("held-out record: what noise alone would show");
    let part = record.thinned(searched_share(std::slice::from_ref(record)));
    let part = part.as_ref().map(|part| Model::new(part, &after.windows.rig));
    let null = NullPower::new(&after, part.as_ref());
    progress("held-out record: free run");
    let [run_before, run_after] =
        parallel::map_pair([&before, &after], |model| free_run::free_run(record, &model.windows.rig));

    let outputs = after.windows.outputs.len();
    let models = [&before, &after]
        .map(|model| Power::new(&power::sums(&model.residual, outputs), &null.expected, outputs));
    let [power_before, power_after] = &models;
    let levels = levels(&power_before.smaller(power_after), &null);
    let models = [power_before, power_after].map(|power| power.divided_by_levels(&levels));
    let [power_before, power_after] = &models;

    let names: Vec<String> = after.windows.outputs.iter().map(|(axis, at)| column(*axis, *at)).collect();
    let mut misfit = BTreeMap::new();
    let mut whiteness = BTreeMap::new();
    let all_kept = untrimmed(&power_before.smaller(power_after).joint());
    for (output, name) in names.iter().enumerate() {
        let (axis, at) = after.windows.outputs[output];
        let noise = record.noise[axis][at] * levels[output].sqrt();
        misfit.insert(name.clone(), signal_misfit(&models, output, noise, null.pooled_sds[output]));
        let of = |model: &Model<'_>| power::lag1_autocorrelation(&model.residual, output, outputs, &all_kept);
        whiteness.insert(name.clone(), BeforeAfter { before: of(&before), after: of(&after) });
    }
    let worse = misfit.values().any(|misfit| misfit.after > WORSE * misfit.before);
    let chi2_after = pooled(&power_after.joint(), &all_kept);
    let verification = Verification {
        record: record.name.clone(),
        chi2_before: pooled(&power_before.joint(), &all_kept),
        chi2_after,
        chi2_null: null.range,
        free_run_nrmse_percent: free_run::both(&run_before, &run_after, &column),
        whiteness,
        physical: run_after.unphysical,
        confirmed: !worse && is_better(power_before, power_after),
        worse,
        adequate: chi2_after <= null.range[1],
        more_missing: lacks_fit(chi2_after, null.range, record.linked),
    };
    let traces = traces::traces(&before, &after);
    Verified { misfit, verification, traces }
}

/// Both models on a record for the page alone, without judgement.
pub(crate) fn drawn(before: &RigParameters, after: &RigParameters, record: &GriddedRecord) -> Vec<Trace> {
    let [before, after] = parallel::map_pair([before, after], |rig| Model::new(record, rig));
    traces::traces(&before, &after)
}

/// Whether a model lacks fit: chi2 above the null range, and by as much as an inadequate model of training records.
pub(crate) fn lacks_fit(chi2: f64, [least, most]: [f64; 2], linked: bool) -> bool {
    chi2 > most && (chi2 / (0.5 * (least + most))).ln() > lack_of_fit_per_dof(linked)
}

/// A model in the windows of the record.
pub(crate) struct Model<'a> {
    windows: Windows<'a>,
    /// Readings over their noise.
    simulated: Vec<f64>,
    /// Whitened residual.
    residual: Vec<f64>,
}

impl<'a> Model<'a> {
    /// Each model has its own start states.
    fn new(record: &'a GriddedRecord, rig: &RigParameters) -> Self {
        let windows = Windows::with_estimated_starts(record, rig);
        let simulated = windows.simulate(rig);
        let residual = windows.residual(&simulated);
        Model { windows, simulated, residual }
    }
}

/// The column of an output, `drive_position_m`.
fn column(axis: usize, at: usize) -> String {
    debug_assert!(at < CHANNELS);
    Channel::Of(Axis::ALL[axis], SIGNALS[at]).column()
}

/// Misfit of an output; `noise` in its unit, `null_sd` the null standard deviation of the pooled power.
fn signal_misfit(models: &[Power; 2], output: usize, noise: f64, null_sd: f64) -> SignalMisfit {
    let [before, after] = models.each_ref().map(|power| power.output(output));
    let kept = untrimmed(&models[0].smaller(&models[1]).output(output));
    let [before_power, after_power] = [&before, &after].map(|squares| pooled(squares, &kept));
    let excess = before_power - 1.0;
    let is_resolved = excess > MIN_EXCESS_Z * null_sd;
    SignalMisfit {
        before: noise * before_power.sqrt(),
        after: noise * after_power.sqrt(),
        floor: noise,
        closed: is_resolved.then(|| (1.0 - (after_power - 1.0) / excess).min(1.0)),
    }
}

/// Whether the mean log improvement exceeds [`BETTER_ERRORS`] over independent windows.
fn is_better(before: &Power, after: &Power) -> bool {
    let bounded = |chi2_per_dof: f64| chi2_per_dof.max(MIN_CHI2_PER_DOF);
    let gains: Vec<f64> = before
        .joint()
        .iter()
        .zip(after.joint())
        .filter(|(before, _)| before.expected > 0.0)
        .map(|(before, after)| after.expected * (bounded(before.ratio()) / bounded(after.ratio())).ln())
        .collect();
    let count = gains.len() as f64;
    if count < 2.0 {
        return false;
    }
    let (mean, variance) = mean_and_variance(&gains);
    mean > BETTER_ERRORS * (variance / count).sqrt()
}

#[cfg(test)]
pub(crate) mod tests;
