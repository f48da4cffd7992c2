//! Rehearsed records, refitted by every explanation as if nobody knew which one made them.
//!
//! ```text
//!   explanation i, experiment ──► closed loop ──► readings + noise ──► windows of the workflow
//!   L_j = min over a of  sum_k f_k ln(|e_j - C_j a|^2 / f_k) + priors      C_j: parameters, numbers of the effects of j
//!   i is separated from j when L_j - L_i exceeds what the workflow calls indistinguishable
//! ```
//!
//! The refit is one Gauss-Newton step from each explanation's own numbers, which explain the training records already. Priors
//! are those of naming; the numbers of the effects are held by their standard errors in the report, which stand for the training
//! records. A declared term of the user keeps its numbers.
//!
//! An alternative that may move its parameters absorbs a part of what T counts as its distance, and coloured noise hides another.
//!
//! Source: Chernoff 1959, Ann. Math. Stat. 30(3): sequential design of experiments.

use super::Explanation;
use super::closed_loop::{ClosedLoopRun, drive};
use super::menu::Entry;
use super::noise::ReadingNoise;
use crate::candidates::Candidate;
use crate::engine::Engine;
use crate::gridded_record::GriddedRecord;
use crate::name::INDISTINGUISHABLE_LOSS_DIFFERENCE;
use crate::parameters::{COUNT, PARAMETERS};
use crate::refit::{EffectEstimate, coordinate_precision, difference_step, parameter_precisions};
use crate::windows::Windows;
use plant::RigParameters;
use plant::effects::sheet::Part;

/// Losses of the refitted explanations on one rehearsed record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trial {
    /// The explanation that made it.
    pub(crate) truth: usize,
    /// Loss of each explanation above that of the truth, shrunk, over the largest difference that is indistinguishable.
    pub(crate) scaled_loss_differences: Vec<f64>,
}

impl Trial {
    /// Each explanation but the truth, with its scaled loss difference.
    pub(super) fn alternatives(&self) -> impl Iterator<Item = (usize, f64)> {
        let truth = self.truth;
        let differences = self.scaled_loss_differences.iter().copied().enumerate();
        differences.filter(move |(at, _)| *at != truth)
    }
}

/// Trials of one closed-loop run.
pub(super) struct Trials {
    pub(super) trials: Vec<Trial>,
    pub(super) clearance_m: f64,
}

/// What trials of a menu have in common.
pub(super) struct Setting<'a> {
    pub(super) baseline: &'a RigParameters,
    pub(super) explanations: &'a [Explanation],
    pub(super) noise: &'a ReadingNoise,
    /// Axes on which the records are compared.
    pub(super) measured: [bool; 2],
    /// Factor, 1 at most, on the distance of each alternative from each truth (truth, alternative): no explanation is exact, and
    /// model error keeps alternatives nearer than their simulations are ([`Setting::shrunk_by`]).
    pub(super) shrinkage: Vec<Vec<f64>>,
}

/// The seeds of one closed-loop run and of the noise of its records.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seeds {
    pub(super) run: u64,
    pub(super) records: u64,
}

impl Setting<'_> {
    /// Trials of an experiment if one explanation were true: one closed-loop run, records with noise of their own. `None` where
    /// the run does not suit the rig.
    pub(super) fn trials(&self, entry: &Entry, truth: usize, seeds: Seeds) -> Option<Trials> {
        let run = drive(entry, self.baseline, &self.explanations[truth].rig, seeds.run).ok()?;
        let run = Some(run).filter(|run| run.ends_well(self.baseline.cylinder().stroke_m))?;
        let measured = if run.linked { [true, true] } else { self.measured };
        let record =
            |number: u64| self.noise.record(&run, self.baseline, measured, (seeds.run << 32) + number);
        let first = record(0);
        let engines = record_engines(self, &first, &run);
        // Of linked rods the search for start states takes most of the time: that of the first record serves all.
        let of_starts = |engine: &Engine<'_>| engine.windows.iter().map(Windows::sensitivities).collect();
        let of_starts: Vec<Vec<_>> = engines.iter().filter(|_| run.linked).map(of_starts).collect();
        let mut fits: Vec<LinearisedFit> = Vec::new();
        let mut trials = vec![self.trial(&engines, truth, &mut fits)?];
        for number in 1..seeds.records {
            let record = record(number);
            let all: Option<Vec<_>> = engines
                .iter()
                .zip(&of_starts)
                .map(|(engine, of_starts)| engine.replicated(std::slice::from_ref(&record), of_starts))
                .collect();
            let engines = all.filter(|all| !all.is_empty());
            let engines = engines.unwrap_or_else(|| record_engines(self, &record, &run));
            trials.push(self.trial(&engines, truth, &mut fits)?);
        }
        let clearance_m = run.clearance_m(self.baseline.cylinder().stroke_m)?;
        Some(Trials { trials, clearance_m })
    }

    fn trial(&self, engines: &[Engine<'_>], truth: usize, fits: &mut Vec<LinearisedFit>) -> Option<Trial> {
        let engine_of = |at: usize| engines.get(at).unwrap_or(&engines[0]);
        let rigs = self.explanations.iter().map(|explanation| &explanation.rig);
        let simulated: Vec<Vec<f64>> =
            rigs.enumerate().map(|(at, rig)| engine_of(at).simulate(rig)).collect();
        if fits.is_empty() {
            // Sensitivities hardly depend on the noise: those of the first record serve all.
            let of = |at: usize| LinearisedFit::new(self, at, engine_of(at), &simulated[at]);
            *fits = (0..self.explanations.len()).map(of).collect::<Option<_>>()?;
        }
        let mut losses = Vec::with_capacity(fits.len());
        let mut design_effect = 1.0;
        for (at, fit) in fits.iter().enumerate() {
            let residual = engine_of(at).residual(&simulated[at]);
            let (loss, clustered) = fit.loss(engine_of(at), &residual, Noise::Drawn)?;
            losses.push(loss);
            if at == truth {
                design_effect = clustered;
            }
        }
        let most = INDISTINGUISHABLE_LOSS_DIFFERENCE * design_effect;
        let scaled = |(loss, shrinkage): (&f64, &f64)| shrinkage * (loss - losses[truth]) / most;
        let scaled_loss_differences = losses.iter().zip(&self.shrinkage[truth]).map(scaled).collect();
        Some(Trial { truth, scaled_loss_differences })
    }

    /// The same setting with the distances shrunk by what the training records show of them.
    ///
    /// In the training records the explanations differ by one indistinguishable difference at most. Where one of them, were it
    /// exact, would be farther from another there, model error keeps the two alike: their distances in other experiments are
    /// divided by that expected distance.
    pub(super) fn shrunk_by(self, training: &Engine<'_>) -> Self {
        let expected = self.expected_distances(training).unwrap_or_default();
        let factor = |distance: &f64| if *distance > 1.0 { distance.recip() } else { 1.0 };
        let rows = expected.iter().map(|row| row.iter().map(factor).collect());
        Setting { shrinkage: rows.chain(self.shrinkage.into_iter().skip(expected.len())).collect(), ..self }
    }

    /// For each truth the expected distance of each alternative in the training records.
    fn expected_distances(&self, training: &Engine<'_>) -> Option<Vec<Vec<f64>>> {
        let rigs = self.explanations.iter().map(|explanation| &explanation.rig);
        let simulated: Vec<Vec<f64>> = rigs.map(|rig| training.simulate(rig)).collect();
        let all = 0..self.explanations.len();
        let fits = all.clone().map(|at| LinearisedFit::new(self, at, training, &simulated[at]));
        let fits: Vec<LinearisedFit> = fits.collect::<Option<_>>()?;
        let of_truth = |truth: usize| -> Option<Vec<f64>> {
            let losses = fits.iter().zip(&simulated).map(|(fit, alternative)| {
                fit.loss(training, &training.difference(&simulated[truth], alternative), Noise::Expected)
            });
            let losses: Vec<(f64, f64)> = losses.collect::<Option<_>>()?;
            let (least, clustered) = losses[truth];
            let most = INDISTINGUISHABLE_LOSS_DIFFERENCE * clustered;
            Some(losses.iter().map(|(loss, _)| (loss - least) / most).collect())
        };
        all.map(of_truth).collect()
    }
}

/// Whether a residual has its noise, or is to be judged as if it had the expected one.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Noise {
    Drawn,
    Expected,
}

/// One engine for all explanations; on linked rods one for each, since start states depend on the rig.
fn record_engines<'a>(
    setting: &Setting<'_>,
    record: &'a GriddedRecord,
    run: &ClosedLoopRun,
) -> Vec<Engine<'a>> {
    let engine = Engine::new(std::slice::from_ref(record), setting.baseline);
    if run.linked {
        let rigs = setting.explanations.iter().map(|explanation| &explanation.rig);
        rigs.map(|rig| engine.with_starts_under(rig)).collect()
    } else {
        vec![engine]
    }
}

/// The linearised fit of an explanation.
struct LinearisedFit {
    /// Sensitivities to the parameters, then to the numbers of the effects.
    columns: Vec<Vec<f64>>,
    precisions: Vec<f64>,
    /// Deviations of the parameters from the rig file's.
    offsets: Vec<f64>,
}

impl LinearisedFit {
    fn new(setting: &Setting<'_>, at: usize, engine: &Engine<'_>, simulated: &[f64]) -> Option<Self> {
        let explanation = &setting.explanations[at];
        let rig = &explanation.rig;
        // To first order those of the baseline are those of all explanations, and the engine keeps them.
        let mut columns = engine.parameter_columns(setting.baseline, &[1.0; COUNT]);
        let mut precisions = parameter_precisions();
        let mut offsets = parameter_deviations(setting.baseline, rig);
        for (effect, errors) in free_effects(setting.baseline, explanation) {
            for (key, error) in errors.into_iter().enumerate() {
                columns.push(column(engine, rig, &effect, key, simulated)?);
                let prior = coordinate_precision(&effect.candidate, key);
                precisions.push(error.map_or(prior, |error| error.powi(-2).max(prior)));
                offsets.push(0.0);
            }
        }
        Some(LinearisedFit { columns, precisions, offsets })
    }

    /// The loss, and the design effect of the first number of its effects.
    fn loss(&self, engine: &Engine<'_>, residual: &[f64], noise: Noise) -> Option<(f64, f64)> {
        if residual.len() != self.columns.first()?.len() {
            return None;
        }
        let products = engine.products(residual, &self.columns);
        let products = if noise == Noise::Expected { products.with_expected_noise() } else { products };
        let all: Vec<usize> = (0..self.columns.len()).collect();
        let fit = products.fit_from(&all, &self.precisions, &self.offsets);
        let design_effect = if noise == Noise::Drawn && all.len() > COUNT {
            let clustered = products.covariance(&all, &fit, &self.precisions)?;
            let plain = products.normal(&all, &fit.weights, &self.precisions).0.try_inverse()?;
            (clustered[(COUNT, COUNT)] / plain[(COUNT, COUNT)]).max(1.0)
        } else {
            1.0
        };
        Some((fit.loss, design_effect))
    }
}

fn column(
    engine: &Engine<'_>,
    rig: &RigParameters,
    effect: &EffectEstimate,
    key: usize,
    simulated: &[f64],
) -> Option<Vec<f64>> {
    let change = difference_step(effect, key);
    let mut coordinates = effect.coordinates.clone();
    coordinates[key] += change;
    let changed = engine.simulate(&effect.candidate.rig(rig, &coordinates).ok()?);
    Some(engine.slope(&changed, simulated, change))
}

/// The effects of an explanation that the baseline does not have with these numbers, each with the standard errors of its
/// coordinates where the report has them.
fn free_effects(
    baseline: &RigParameters,
    explanation: &Explanation,
) -> Vec<(EffectEstimate, Vec<Option<f64>>)> {
    let free = explanation.rig.effects().iter().filter(|effect| !baseline.effects().contains(effect));
    free.map(|effect| {
        let sheet = plant::effects::sheet(effect.name).expect("an effect that is on has a sheet");
        let candidate = Candidate::in_rig(baseline, sheet, effect.place);
        let coordinates: Vec<f64> =
            (0..sheet.keys.len()).map(|key| candidate.coordinate(key, effect.numbers[key])).collect();
        let name = format!("{} {}", effect.name, effect.place);
        let errors = explanation.errors.iter().find(|known| known.0 == name).map(|known| &known.1);
        let errors = (0..sheet.keys.len()).map(|key| {
            let error = errors.and_then(|errors| errors.get(key).copied().flatten())?;
            let error = error / candidate.slope(key, coordinates[key]).abs();
            Some(error).filter(|error| error.is_finite() && *error > 0.0)
        });
        let errors = errors.collect();
        (EffectEstimate { candidate, coordinates }, errors)
    })
    .collect()
}

fn parameter_deviations(baseline: &RigParameters, rig: &RigParameters) -> Vec<f64> {
    let deviation = |key: &str| {
        let [value, before] = [rig, baseline].map(|rig| rig.numbers(key).iter().sum::<f64>());
        if before == 0.0 { 0.0 } else { value / before - 1.0 }
    };
    PARAMETERS.iter().map(|parameter| deviation(parameter.keys[0])).collect()
}

/// The measured axes on which explanations differ; all of them where they act on linkage or supply.
pub(super) fn axes_concerned(
    baseline: &RigParameters,
    explanations: &[Explanation],
    measured: [bool; 2],
) -> [bool; 2] {
    let mut axes = [false; 2];
    for explanation in explanations {
        let rig = &explanation.rig;
        if rig.terms() != baseline.terms() || rig.tabulated() != baseline.tabulated() {
            return measured;
        }
        for effect in rig.effects().iter().filter(|effect| !baseline.effects().contains(effect)) {
            match effect.place.part {
                Part::Drive => axes[0] = true,
                Part::Load => axes[1] = true,
                Part::Linkage | Part::Supply => return measured,
            }
        }
    }
    let both = [0, 1].map(|axis| axes[axis] && measured[axis]);
    if both == [false; 2] { measured } else { both }
}
