//! Experiment design: the experiment that best tells ambiguous explanations apart, by rehearsal.
//!
//! ```text
//!   explanations ──► each entry of the menu, rehearsed as if each were true, with the records' noise
//!                ──► refitted by all explanations ──► share of the rehearsed records that tell them apart
//! ```
//!
//! The probability is that of the refits (`next/refits.rs`, `next/choice.rs`). An experiment that reaches `choice::WANTED`
//! within [`MOST_REPETITIONS`] is proposed with so many, and a second one where it leaves much open. Where none is worth its
//! time, [`remedies`] names a manual measurement: tilting, uncoupling, locking the piston.
//!
//! T of the proposed entry stands beside it: the expected gain in chi2 of the true explanation over the alternative with refitted
//! amplitude, with noise and model error (`next/divergence.rs`). Its target is 25, a distance d' = 5 between the two mean
//! records. Alone, as the criterion of T-optimality [Atkinson, Fedorov 1975], it takes noise as white and the alternative's
//! other numbers as known.
//!
//! | file | holds |
//! |---|---|
//! | [`menu`] | the experiments |
//! | [`closed_loop`] | one of them in closed loop with an explanation's rig |
//! | [`noise`] | the noise of the training records, drawn anew |
//! | [`refits`] | rehearsed records refitted by all explanations |
//! | [`choice`] | the experiment that tells them apart most often |
//! | [`divergence`] | how far explanations lie apart in it |
//! | [`nuisance`] | baseline parameters that are refitted jointly |
//! | [`remedies`] | what would separate effects where no experiment does |
//!
//! Which entry separates which twins: `discrepancy/docs/next.md`. Of eight pairs of twins there the largest T separated none,
//! the rehearsals five. Source: discrepancy-notes.md, pipeline 9; Hunter and Reiner 1965; Atkinson and Fedorov 1975, Biometrika
//! 62(1): T-optimality.

mod choice;
pub mod closed_loop;
pub(crate) mod divergence;
pub mod menu;
pub mod noise;
pub(crate) mod nuisance;
mod refits;
pub(crate) mod remedies;

use crate::engine::Engine;
use crate::report::{NextExperiment, SecondExperiment, listed};
use choice::{Probability, RehearsedEntry, WORTH_IT, rehearse, second};
use closed_loop::{SEED, drive};
use divergence::{Divergence, divergences};
use menu::{Entry, MENU};
use model_fit::parallel;
use noise::ReadingNoise;
use plant::RigParameters;
use refits::{Setting, axes_concerned};

/// Maximum number of repetitions.
pub(crate) const MOST_REPETITIONS: usize = 6;

/// A model that explains the records.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// The baseline with the missing effects, numbers fitted.
    pub rig: RigParameters,
    /// Its effects, as `line-delay drive` or `parameter:mass`.
    pub names: Vec<String>,
    /// Standard errors of the numbers of its effects, by name and place; the numbers of others have the priors of naming.
    pub errors: Vec<(String, Vec<Option<f64>>)>,
}

impl Explanation {
    fn title(&self) -> String {
        if self.names.is_empty() { "nothing".to_owned() } else { self.names.join(" with ") }
    }
}

/// T of each ordered pair of explanations in one entry of the menu.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentDivergences {
    pub(crate) name: &'static str,
    /// For each ordered pair: the true explanation, the alternative, their divergence.
    pub(crate) pairs: Vec<(usize, usize, Divergence)>,
}

/// The proposed experiment and its file, and the rehearsed menu.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// For the report; [`NextExperiment::experiment`] is the file's name.
    pub next: NextExperiment,
    /// Text of the experiment file, if one is proposed.
    pub(crate) experiment_toml: Option<String>,
    /// All entries of the menu that can be rehearsed, the best first.
    pub rehearsed: Vec<RehearsedEntry>,
}

impl ExperimentDivergences {
    /// The smallest T of its pairs, in one repetition.
    pub fn least(&self) -> f64 {
        self.least_in_repetitions(1)
    }

    fn least_in_repetitions(&self, times: usize) -> f64 {
        self.pairs.iter().map(|pair| pair.2.in_repetitions(times)).fold(f64::INFINITY, f64::min)
    }
}

/// What is proposed for.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// The rig file's rig, whose numbers the controllers have.
    pub baseline: &'a RigParameters,
    /// Models to tell apart; fewer than two need no experiment.
    pub explanations: &'a [Explanation],
    /// Drive and load. The new record will be used together with the present ones, on their common axes; where that is one axis,
    /// entries with linked rods are left out.
    pub axes_measured: [bool; 2],
    /// Sensor noise of the rehearsed records.
    pub noise: &'a ReadingNoise,
    /// The training records; without them the explanations are taken as exact.
    pub training: Option<&'a Engine<'a>>,
}

/// Proposes the experiment that best tells explanations apart, or a manual measurement where none does. `progress` gets a line
/// for each entry of the menu.
pub fn propose(question: Question<'_>, progress: &mut dyn FnMut(&str)) -> Proposal {
    let Question { baseline, explanations, axes_measured, noise, training } = question;
    if explanations.len() < 2 {
        return Proposal::without("nothing is ambiguous".to_owned(), None, Vec::new());
    }
    let both = axes_measured == [true, true];
    let entries: Vec<&Entry> = MENU.iter().filter(|entry| both || !entry.is_linked()).collect();
    let measured = axes_concerned(baseline, explanations, axes_measured);
    let shrinkage = vec![vec![1.0; explanations.len()]; explanations.len()];
    let setting = Setting { baseline, explanations, noise, measured, shrinkage };
    let setting = match training {
        Some(training) => setting.shrunk_by(training),
        None => setting,
    };
    choose(question, rehearse(&setting, &entries, progress))
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
    let pairs = parallel::map_range(0..explanations.len(), |truth| {
        let run = drive(entry, baseline, &explanations[truth].rig, SEED).ok()?;
        let run = Some(run).filter(|run| run.ends_well(baseline.cylinder().stroke_m))?;
        let alternatives: Vec<usize> = (0..explanations.len()).filter(|at| *at != truth).collect();
        let rigs: Vec<_> = [truth].iter().chain(&alternatives).map(|at| &explanations[*at].rig).collect();
        let values = divergences(&run, baseline, &rigs, &perturbed, axes_measured);
        Some(alternatives.into_iter().zip(values).map(|(at, value)| (truth, at, value)).collect::<Vec<_>>())
    });
    let pairs: Vec<Vec<_>> = pairs.into_iter().collect::<Option<_>>()?;
    Some(ExperimentDivergences { name: entry.name, pairs: pairs.concat() })
}

impl Proposal {
    fn without(reason: String, otherwise: Option<String>, rehearsed: Vec<RehearsedEntry>) -> Self {
        let next = NextExperiment { reason, otherwise, ..NextExperiment::default() };
        Proposal { next, experiment_toml: None, rehearsed }
    }
}

fn probability_in_words(probability: Probability, trials: usize) -> String {
    let Probability { value, low, high } = probability;
    format!("in {:.0} % of {trials} rehearsed records ({:.0} to {:.0} %)", 1e2 * value, 1e2 * low, 1e2 * high)
}

fn choose(question: Question<'_>, rehearsed: Vec<RehearsedEntry>) -> Proposal {
    let explanations = question.explanations;
    let titles: Vec<String> = explanations.iter().map(Explanation::title).collect();
    let alike = format!("{} explain the records alike", listed(&titles));
    let Some(best) = rehearsed.first() else {
        let reason = format!("{alike}, and no experiment of the menu can be rehearsed with them");
        return Proposal::without(reason, None, rehearsed);
    };
    let entry = MENU.iter().find(|entry| entry.name == best.name).expect("it is of the menu");
    let times = best.repetitions(MOST_REPETITIONS);
    let probability = best.probability(times);
    let open = best.pairs(times).into_iter().filter(|pair| pair.2 < WORTH_IT);
    let left: Vec<(usize, usize)> = open.map(|(one, other, _)| (one.min(other), one.max(other))).collect();
    let otherwise = remedies::of_pairs(explanations, &left);
    let separated = probability_in_words(probability, best.trials.len());
    let divergence = judge(entry, question.baseline, explanations, question.axes_measured)
        .map(|judged| judged.least_in_repetitions(times));
    let found = NextExperiment {
        divergence,
        probability: Some(probability.value),
        probability_interval: Some([probability.low, probability.high]),
        rehearsals: Some(best.trials.len()),
        otherwise,
        ..NextExperiment::default()
    };
    let how_often = if times > 1 { format!(" in {times} repetitions") } else { String::new() };
    if probability.value < WORTH_IT {
        let reason = format!(
            "{alike}, and no experiment of this rig separates them: the best, {}, is expected to{how_often} {separated}",
            best.name
        );
        let next = NextExperiment { reason, ..found };
        return Proposal { next, experiment_toml: None, rehearsed };
    }
    let rest = if left.is_empty() { "" } else { "; it does not separate all of them" };
    let reason = format!(
        "{alike}; {}, which serves to tell apart {}, is expected to separate them{how_often} {separated}{rest}",
        entry.name, entry.purpose
    );
    let then = second(best, times, &rehearsed).map(|(after, both)| SecondExperiment {
        experiment: after.name.to_owned(),
        probability: both.value,
        probability_interval: [both.low, both.high],
    });
    let next = NextExperiment { reason, experiment: Some(entry.file()), then, ..found };
    Proposal { next, experiment_toml: Some(text(entry, times)), rehearsed }
}

/// The file of an entry with so many repetitions.
fn text(entry: &Entry, times: usize) -> String {
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
