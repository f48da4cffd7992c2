//! Which experiment: the one whose rehearsed records tell the explanations apart most often.
//!
//! ```text
//!   entries from the shortest on, few trials each ──► all loss differences large ──► all trials: still so ──► this one
//!                    └──► none is so clear: the few with the largest on average get all trials, the best of them
//!   probability = mean over truths and alternatives of the share of trials that separate the two
//! ```
//!
//! Of equally good ones the shorter comes first, then the one that stays farther from the ends of the stroke. Losses of
//! independent records add up: k repetitions, or a second experiment after the first, sum the differences of their trials.
//!
//! A share of records, with its interval, says what a user asks before an experiment: how likely it decides.
//!
//! Source: Wilson 1927, J. Am. Stat. Assoc. 22(158): interval of a proportion.

use super::MOST_REPETITIONS;
use super::menu::Entry;
use super::refits::{Seeds, Setting, Trial};
use model_fit::parallel;
use std::cmp::Ordering;

/// Trials of each explanation in the first round.
const FIRST_RECORDS: u64 = 2;
/// Trials of a finalist, all explanations together, in further closed-loop runs of at most so many records each.
const TRIALS: u64 = 20;
const RECORDS_PER_RUN: u64 = 4;
/// Entries that get all of their trials.
const FINALISTS: usize = 3;
/// Largest distance, in indistinguishable differences, that counts in the first round: beyond it a trial is decided.
const DECIDED: f64 = 3.0;
/// Probability at which no further finalist is looked at.
const CERTAIN: f64 = 0.95;
/// Probability that is wanted: repetitions are added until it is reached.
pub(super) const WANTED: f64 = 0.8;
/// Probability below which an experiment is not worth its time.
pub(super) const WORTH_IT: f64 = 0.5;
/// Least rise of the probability that is worth a second experiment.
const LEAST_RISE: f64 = 0.05;

/// A probability from trials, with its interval of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Probability {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Probability {
    /// Of a share of so many trials.
    pub(super) fn of(share: f64, trials: f64) -> Self {
        // 97.5 % of a standard normal.
        let z2 = 1.96_f64.powi(2);
        let centre = (share + z2 / (2.0 * trials)) / (1.0 + z2 / trials);
        let half = (z2 * (share * (1.0 - share) / trials + z2 / (4.0 * trials * trials))).sqrt()
            / (1.0 + z2 / trials);
        // Exactly 0 and 1 at the ends, whatever the rounding.
        let low = if share <= 0.0 { 0.0 } else { (centre - half).max(0.0) };
        let high = if share >= 1.0 { 1.0 } else { (centre + half).min(1.0) };
        Probability { value: share, low, high }
    }
}

/// An entry of the menu with its trials.
#[derive(Clone, Debug, PartialEq)]
pub struct RehearsedEntry {
    pub(crate) name: &'static str,
    pub(crate) trials: Vec<Trial>,
    /// Without initial positioning, s.
    pub(crate) length_s: f64,
    /// Least distance of a moved rod from the ends of its stroke, m.
    pub(crate) clearance_m: f64,
}

impl RehearsedEntry {
    fn of_truth(&self, truth: usize) -> Vec<&Trial> {
        self.trials.iter().filter(|trial| trial.truth == truth).collect()
    }

    /// Whether it has more trials than those of the first round.
    fn is_finalist(&self, explanations: usize) -> bool {
        self.trials.len() as u64 > FIRST_RECORDS * explanations as u64
    }

    fn truths(&self) -> usize {
        self.trials.iter().map(|trial| trial.truth + 1).max().unwrap_or(0)
    }

    /// Mean scaled loss difference of the alternatives, each trial counted up to where it is decided.
    pub(super) fn score(&self) -> f64 {
        let all: Vec<f64> = self
            .trials
            .iter()
            .flat_map(|trial| trial.alternatives().map(|(_, difference)| difference.clamp(-1.0, DECIDED)))
            .collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    }

    /// For each pair of a truth and an alternative the share of trials that tell them apart, in so many repetitions.
    pub(super) fn pairs(&self, times: usize) -> Vec<(usize, usize, f64)> {
        let mut pairs = Vec::new();
        for truth in 0..self.truths() {
            let trials = self.of_truth(truth);
            for alternative in (0..self.truths()).filter(|at| *at != truth) {
                let difference = |at: usize| trials[at % trials.len()].scaled_loss_differences[alternative];
                let separated = (0..trials.len())
                    .filter(|from| (0..times).map(|at| difference(from + at)).sum::<f64>() > 1.0)
                    .count();
                pairs.push((truth, alternative, separated as f64 / trials.len().max(1) as f64));
            }
        }
        pairs
    }

    /// Probability that so many repetitions tell the explanations apart.
    pub(super) fn probability(&self, times: usize) -> Probability {
        let pairs = self.pairs(times);
        let share = pairs.iter().map(|pair| pair.2).sum::<f64>() / pairs.len().max(1) as f64;
        Probability::of(share, (self.trials.len() as f64 / times as f64).max(1.0))
    }

    /// Fewest repetitions with which the wanted probability is reached, else those with the largest one.
    pub(super) fn repetitions(&self, most: usize) -> usize {
        let value = |times: &usize| self.probability(*times).value;
        if let Some(times) = (1..=most).find(|times| value(times) >= WANTED) {
            return times;
        }
        // The first of equal ones.
        (1..=most).rev().max_by(|one, other| value(one).total_cmp(&value(other))).unwrap_or(1)
    }

    /// Probability that this experiment, or another one after it, tells the explanations apart.
    fn probability_then(&self, next: &RehearsedEntry) -> Probability {
        let mut shares = Vec::new();
        for truth in 0..self.truths() {
            let (first, second) = (self.of_truth(truth), next.of_truth(truth));
            for alternative in (0..self.truths()).filter(|at| *at != truth) {
                let mut all = 0;
                let mut separated = 0;
                for (at, one) in first.iter().enumerate() {
                    for (after, other) in second.iter().enumerate() {
                        // Of the same experiment two records, not one twice.
                        if self.name == next.name && at == after {
                            continue;
                        }
                        all += 1;
                        let both = [one, other].map(|trial| trial.scaled_loss_differences[alternative]);
                        separated += usize::from(both[0] + both[1] > 1.0);
                    }
                }
                shares.push(f64::from(separated as u32) / f64::from(all.max(1) as u32));
            }
        }
        let share = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        Probability::of(share, self.trials.len().min(next.trials.len()) as f64)
    }
}

/// Rehearses the entries; the best first, those with all of their trials before the others. Linked rods, whose windows cost many
/// times those of free ones, follow where no other experiment is good enough.
pub(super) fn rehearse(
    setting: &Setting<'_>,
    entries: &[&'static Entry],
    progress: &mut dyn FnMut(&str),
) -> Vec<RehearsedEntry> {
    let (linked, free): (Vec<_>, Vec<_>) = entries.iter().copied().partition(|entry| entry.is_linked());
    let mut all = of_alike(setting, &free, progress);
    if !all.first().is_some_and(|best| best.probability(1).value >= WANTED) {
        all.extend(of_alike(setting, &linked, progress));
        // With few trials after those with all of them.
        all.sort_by(|one, other| {
            let few = |entry: &RehearsedEntry| !entry.is_finalist(setting.explanations.len());
            few(one)
                .cmp(&few(other))
                .then_with(|| if few(one) { ranked(one, other) } else { better(one, other) })
        });
    }
    all
}

/// The shortest first: one that is certain, each loss difference large, ends the search.
fn of_alike(
    setting: &Setting<'_>,
    entries: &[&'static Entry],
    progress: &mut dyn FnMut(&str),
) -> Vec<RehearsedEntry> {
    let mut entries = entries.to_vec();
    entries.sort_by(|one, other| one.length_s().total_cmp(&other.length_s()));
    let mut all = Vec::new();
    for entry in &entries {
        progress(&format!("rehearsing {}", entry.name));
        let Some(mut rehearsed) = round(setting, entry, Seeds { run: 1, records: FIRST_RECORDS }) else {
            continue;
        };
        if rehearsed.score() >= DECIDED {
            more_trials(setting, entry, &mut rehearsed, progress);
            if rehearsed.score() >= DECIDED {
                return vec![rehearsed];
            }
        }
        all.push(rehearsed);
    }
    all.sort_by(ranked);
    let mut finalists = 0;
    for rehearsed in all.iter_mut().take(FINALISTS) {
        let Some(entry) = entries.iter().find(|entry| entry.name == rehearsed.name) else { continue };
        if !rehearsed.is_finalist(setting.explanations.len()) {
            more_trials(setting, entry, rehearsed, progress);
        }
        finalists += 1;
        if rehearsed.probability(1).value >= CERTAIN {
            break;
        }
    }
    all[..finalists].sort_by(better);
    all
}

/// The trials of a finalist after its first round.
fn more_trials(
    setting: &Setting<'_>,
    entry: &'static Entry,
    rehearsed: &mut RehearsedEntry,
    progress: &mut dyn FnMut(&str),
) {
    progress(&format!("rehearsing {} again", entry.name));
    // Records in which each explanation is the truth.
    let mut left = TRIALS.div_ceil(setting.explanations.len() as u64).saturating_sub(FIRST_RECORDS);
    let mut run = 2;
    while left > 0 {
        let records = left.min(RECORDS_PER_RUN);
        if let Some(more) = round(setting, entry, Seeds { run, records }) {
            rehearsed.trials.extend(more.trials);
        }
        (left, run) = (left - records, run + 1);
    }
}

/// The order of the first round.
fn ranked(one: &RehearsedEntry, other: &RehearsedEntry) -> Ordering {
    other.score().total_cmp(&one.score()).then(preferred(one, other))
}

/// Trials of all explanations in an entry, each in a closed-loop run of its own; `None` where one does not suit the rig.
fn round(setting: &Setting<'_>, entry: &'static Entry, seeds: Seeds) -> Option<RehearsedEntry> {
    let runs =
        parallel::map_range(0..setting.explanations.len(), |truth| setting.trials(entry, truth, seeds));
    let runs: Vec<_> = runs.into_iter().collect::<Option<_>>()?;
    let clearance_m = runs.iter().map(|run| run.clearance_m).fold(f64::INFINITY, f64::min);
    let trials = runs.into_iter().flat_map(|run| run.trials).collect();
    Some(RehearsedEntry { name: entry.name, trials, length_s: entry.length_s(), clearance_m })
}

/// The order of finalists.
pub(super) fn better(one: &RehearsedEntry, other: &RehearsedEntry) -> Ordering {
    let [left, right] = [one, other].map(|entry| {
        let times = entry.repetitions(MOST_REPETITIONS);
        let value = entry.probability(times).value;
        (value >= WANTED, times, value)
    });
    let fewer = if left.0 && right.0 { left.1.cmp(&right.1) } else { Ordering::Equal };
    right.0.cmp(&left.0).then(fewer).then(right.2.total_cmp(&left.2)).then(preferred(one, other))
}

/// Shorter, then farther from the ends of the stroke.
fn preferred(one: &RehearsedEntry, other: &RehearsedEntry) -> Ordering {
    one.length_s.total_cmp(&other.length_s).then(other.clearance_m.total_cmp(&one.clearance_m))
}

/// The experiment after the first one that raises the probability most.
pub(super) fn second<'a>(
    first: &RehearsedEntry,
    times: usize,
    all: &'a [RehearsedEntry],
) -> Option<(&'a RehearsedEntry, Probability)> {
    let before = first.probability(times).value;
    if before >= CERTAIN || times > 1 {
        return None;
    }
    let both = all.iter().map(|entry| (entry, first.probability_then(entry)));
    both.min_by(|one, other| other.1.value.total_cmp(&one.1.value).then(preferred(one.0, other.0)))
        .filter(|best| best.1.value >= before + LEAST_RISE)
}
