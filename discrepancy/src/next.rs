//! Experiment design: the experiment that best discriminates between ambiguous explanations.
//!
//! ```text
//!   explanations ──► each entry of the menu, rehearsed as if each were true ──► T of each pair
//!                                                 ──► most pairs apart, then the largest least T
//! ```
//!
//! T is the expected gain in chi2 of the true explanation over its rival with refitted amplitude, with noise and model error
//! (`next/divergence.rs`). The target is 25, a distance d' = 5 between the two mean records: the difference of chi2 has mean 25
//! and standard deviation 10, so that noise alone prefers the rival in 0.6 % of records. The criterion is T-optimality [Atkinson,
//! Fedorov 1975]. Repetitions average noise: an experiment that reaches 25
//! within [`MOST_REPETITIONS`] is proposed with so many. Where none does, [`remedies`] names a manual measurement: tilting,
//! uncoupling, locking the piston.
//!
//! | file | holds |
//! |---|---|
//! | [`menu`] | the experiments |
//! | [`closed_loop`] | one of them in closed loop with an explanation's rig |
//! | [`divergence`] | how far explanations lie apart in it |
//! | [`nuisance`] | baseline parameters that are refitted jointly |
//! | [`remedies`] | what would separate effects where no experiment does |
//!
//! Which entry separates which twins: `discrepancy/docs/next.md`. Source: discrepancy-notes.md, pipeline 9; Hunter and Reiner
//! 1965; Atkinson and Fedorov 1975, Biometrika 62(1): T-optimality.

pub mod closed_loop;
pub(crate) mod divergence;
pub mod menu;
pub(crate) mod nuisance;
pub(crate) mod remedies;

use crate::report::{Next, listed};
use closed_loop::drive;
use divergence::{Divergence, divergences};
use menu::{Entry, MENU};
use plant::RigParameters;
use rayon::prelude::*;

/// Target divergence, a squared distance: d' = 5.
pub(crate) const TARGET_DIVERGENCE: f64 = 25.0;
/// Maximum number of repetitions.
pub(crate) const MOST_REPETITIONS: u32 = 6;

/// A model that explains the records.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// The baseline with the missing effects, numbers fitted.
    pub rig: RigParameters,
    /// Its effects, as `line-delay drive` or `parameter:mass`.
    pub names: Vec<String>,
}

impl Explanation {
    fn title(&self) -> String {
        if self.names.is_empty() { "nothing".to_owned() } else { self.names.join(" with ") }
    }
}

/// Divergences of an entry of the menu.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentDivergences {
    pub name: &'static str,
    /// For each ordered pair: the true explanation, its rival, their divergence.
    pub pairs: Vec<(usize, usize, Divergence)>,
}

/// The proposed experiment.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// For the report; [`Next::experiment`] is the file's name.
    pub next: Next,
    /// Text of the experiment file, if one is proposed.
    pub(crate) experiment_toml: Option<String>,
    /// All entries of the menu that can be rehearsed, in its order.
    pub table: Vec<ExperimentDivergences>,
}

impl ExperimentDivergences {
    /// The smallest T of its pairs, in one repetition.
    pub fn least(&self) -> f64 {
        self.pairs.iter().map(|pair| pair.2.in_repetitions(1)).fold(f64::INFINITY, f64::min)
    }

    /// T in `times` repetitions of the pairs that reach the target within [`MOST_REPETITIONS`].
    fn apart(&self, times: u32) -> impl Iterator<Item = f64> {
        let enough =
            self.pairs.iter().filter(|pair| pair.2.in_repetitions(MOST_REPETITIONS) >= TARGET_DIVERGENCE);
        enough.map(move |pair| pair.2.in_repetitions(times))
    }

    /// The smallest of those; 0 without one.
    fn least_apart(&self, times: u32) -> f64 {
        let least = self.apart(times).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    }
}

/// Proposes the experiment that best discriminates between explanations, or a manual measurement where none does.
///
/// `axes_measured` are drive and load. The new record will be used together with the present ones, on their common axes. Where
/// that is one axis, entries with linked rods are left out. `progress` gets a line for each entry of the menu.
pub fn propose(
    baseline: &RigParameters,
    explanations: &[Explanation],
    axes_measured: [bool; 2],
    progress: &mut dyn FnMut(&str),
) -> Proposal {
    let mut table = Vec::new();
    if explanations.len() > 1 {
        let both = axes_measured == [true, true];
        for entry in MENU.iter().filter(|entry| both || !entry.is_linked()) {
            progress(&format!("rehearsing {}", entry.name));
            table.extend(judge(entry, baseline, explanations, axes_measured));
        }
    }
    let (next, experiment_toml) = choose(explanations, &table);
    Proposal { next, experiment_toml, table }
}

/// T of all ordered pairs in an entry; `None` where a rehearsal fails, does not end or comes near an end of the stroke.
pub fn judge(
    entry: &Entry,
    baseline: &RigParameters,
    explanations: &[Explanation],
    axes_measured: [bool; 2],
) -> Option<ExperimentDivergences> {
    let named = |name: &str| explanations.iter().any(|one| one.names.iter().any(|known| known == name));
    let parameters = nuisance::nuisance_parameters().filter(|parameter| !named(parameter.name));
    let perturbed: Vec<_> =
        parameters.filter_map(|parameter| nuisance::perturbed(baseline, parameter).ok()).collect();
    let pairs: Option<Vec<Vec<_>>> = (0..explanations.len())
        .into_par_iter()
        .map(|truth| {
            let run = drive(entry, baseline, &explanations[truth].rig).ok()?;
            let run = Some(run).filter(|run| run.ends_well(baseline.cylinder().stroke_m))?;
            let rivals: Vec<usize> = (0..explanations.len()).filter(|rival| *rival != truth).collect();
            let rigs: Vec<_> = [truth].iter().chain(&rivals).map(|place| &explanations[*place].rig).collect();
            let values = divergences(&run, baseline, &rigs, &perturbed, axes_measured);
            Some(rivals.into_iter().zip(values).map(|(rival, value)| (truth, rival, value)).collect())
        })
        .collect();
    Some(ExperimentDivergences { name: entry.name, pairs: pairs?.concat() })
}

fn choose(explanations: &[Explanation], table: &[ExperimentDivergences]) -> (Next, Option<String>) {
    let titles: Vec<String> = explanations.iter().map(Explanation::title).collect();
    let alike = format!("{} explain the records alike", listed(&titles));
    // Ties go to the first of the menu.
    let better = |one: &ExperimentDivergences, other: &ExperimentDivergences| {
        let key = |judged: &ExperimentDivergences| (judged.apart(1).count(), judged.least_apart(1));
        key(one) > key(other)
    };
    let best = table.iter().fold(None, |best: Option<&ExperimentDivergences>, one| match best {
        Some(best) if !better(one, best) => Some(best),
        _ => Some(one),
    });
    let Some(best) = best else {
        let reason = if explanations.len() < 2 {
            "nothing is ambiguous".to_owned()
        } else {
            format!("{alike}, and no experiment of the menu can be rehearsed with them")
        };
        return (Next { reason, experiment: None, divergence: None, otherwise: None }, None);
    };
    let entry = MENU.iter().find(|entry| entry.name == best.name).expect("it is of the menu");
    let left: Vec<(usize, usize)> = best
        .pairs
        .iter()
        .filter(|pair| pair.2.in_repetitions(MOST_REPETITIONS) < TARGET_DIVERGENCE)
        .map(|(one, other, _)| (*one.min(other), *one.max(other)))
        .collect();
    let otherwise = remedies::of_pairs(explanations, &left);
    if left.len() == best.pairs.len() {
        let reason = format!(
            "{alike}, and no experiment of this rig separates them: \
             the best, {}, is expected to by {:.1}, and {TARGET_DIVERGENCE} are wanted",
            best.name,
            best.least()
        );
        return (Next { reason, experiment: None, divergence: Some(best.least()), otherwise }, None);
    }
    let times = (1..MOST_REPETITIONS).find(|times| best.least_apart(*times) >= TARGET_DIVERGENCE);
    let times = times.unwrap_or(MOST_REPETITIONS);
    let how_often = if times > 1 { format!(" in {times} repetitions") } else { String::new() };
    let rest = if left.is_empty() { "" } else { "; it does not separate all of them" };
    let total = best.least_apart(times);
    let reason = format!(
        "{alike}; {}, which serves to tell apart {}, is expected to separate them by {total:.0}{how_often} \
         ({TARGET_DIVERGENCE} are wanted){rest}",
        entry.name, entry.purpose
    );
    let experiment = Some(entry.file());
    (Next { reason, experiment, divergence: Some(total), otherwise }, Some(text(entry, times)))
}

/// The file of an entry with so many repetitions.
fn text(entry: &Entry, times: u32) -> String {
    let how = "# Proposed by 'discrepancy next'. Run it as it is: scripts/run FILE\n";
    let toml = if times > 1 {
        entry.toml.replacen("[run]\n", &format!("[run]\nrepetitions = {times}\n"), 1)
    } else {
        entry.toml.to_owned()
    };
    format!("{how}{toml}")
}

#[cfg(test)]
mod tests;
