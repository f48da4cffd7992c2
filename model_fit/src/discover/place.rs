//! Where the residual comes from, whatever the suspects say: an unknown function of one or two variables at each place.
//!
//! ```text
//!   place p, variables x (and y):   x, |x|, x^2, x |x|, x^3, sign x     or   x y, x^2 y, x y^2     or a constant
//!   g_k  = responses of all outputs to the coefficients of these at p, less what the model's own numbers can do
//!   R^2  = share of the residual's power that the g_k of a group explain together
//!   BIC gain = -n ln(1 - R^2) - k ln n        n independent samples, k functions
//! ```
//! The groups that lead are fitted in the simulator, and their share is what the fit took: a strong term is not linear in its
//! size, and a lag is not in its time.
//!
//! A suspect is one law at one place; a wrong one that looks similar may be named where the right one is not in the file. These
//! groups have no law, so that the best of them says place and variables alone. A function of an input acts the same at the input
//! and in the equation that it drives: it is said of the input, and any other of the equation.
//!
//! Source: the unknown-input view of model error, e.g. Gillijns, De Moor 2007, Automatica 43(1).

use super::super::fit::Fitting;
use super::super::judge::GAIN_APART;
use super::super::record::MeasuredRecord;
use super::super::report::ModelReport;
use super::super::select::{Fitted, SAME, effective_sample_sizes};
use super::features::{Term, group_terms, variables};
use super::screen::{Screen, coefficient};
use super::{ROWS, start};
use crate::parallel;
use model::{Model, Program};
use serde::Serialize;
use std::path::Path;

/// Least share of the residual's power that a place must explain to be said.
const LEAST_SHARE: f64 = 0.3;
/// A further variable is said where the residual power without it is larger by a factor of e to this; places whose residual
/// powers differ by less than e to the second explain as much. Set on the first run of seed 2675484125523028
/// (tests/docs/model-study.md): 0.3 to 0.7 and 0.03 to 0.2 said the variables of the same 52 or 53 of its 60 records.
const MORE: f64 = 0.5;
const AS_MUCH: f64 = 0.05;
/// Fewest and most groups that are fitted, as of the terms of a search, and steps of their fits.
const FITTED: [usize; 2] = [4, 8];
const STEPS: usize = 8;

/// Where the residual comes from.
#[derive(Clone, Debug, Serialize)]
pub struct Located {
    /// As in `suspects`: the input, equation, definition or output.
    pub place: String,
    /// Variables that it depends on; none for a constant.
    pub variables: Vec<String>,
    /// Share of the residual's power that a function of these explains there, linearly.
    pub share: f64,
    /// Other places and variables that explain it as well.
    pub alternatives: Vec<Place>,
}

/// A place and variables of which a function explains as much as the reported one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    pub(crate) place: String,
    pub(crate) variables: Vec<String>,
}

/// A group of terms: a place with variables.
struct Group {
    place: Place,
    /// It is a lag, not a function.
    is_of_change: bool,
    terms: Vec<usize>,
    bic_gain: f64,
    share: f64,
    rank: usize,
}

/// The place and the variables that explain most of a fitted model's residual; `None` where none explains enough of it.
pub(crate) fn located(baseline: &Fitted<'_>) -> Option<Located> {
    let model = baseline.fitting.model;
    let terms = group_terms(model, &variables(baseline), period_s(&baseline.fitting));
    let text: String = terms.iter().map(|term| term.text.as_str()).collect();
    let text = format!("{}\n{text}", model.text);
    let with_terms = Model::parse(&text, Path::new("model with the terms of places")).ok()?;
    let first = model.suspects.len();
    let screen = Screen::of(&with_terms, baseline, first, terms.len())?;
    let mut samples: f64 = baseline.effective.iter().sum();
    let mut groups = groups(&with_terms, first, &terms);
    groups.iter_mut().for_each(|group| group.weigh(screen.share(&group.terms), samples));
    groups.sort_by(|one, other| other.bic_gain.total_cmp(&one.bic_gain));
    let rows: usize = baseline.fitting.records.iter().map(|record| record.time_s.len()).sum();
    groups.truncate((ROWS / rows.max(1)).clamp(FITTED[0], FITTED[1]));
    let fits: Vec<Option<(f64, f64)>> =
        parallel::map(&groups, |group| refit((&with_terms, first), baseline, &screen, &group.terms));
    for (group, fit) in groups.iter_mut().zip(&fits) {
        group.weigh(fit.map_or(group.share, |(share, _)| share), samples);
    }
    let most = |groups: &[Group]| groups.iter().map(|group| group.bic_gain).fold(f64::NEG_INFINITY, f64::max);
    // Without the missing term the residual may be correlated over the whole record; that of the best group is not.
    let best = most(&groups);
    let of_best = groups.iter().zip(&fits).filter(|(group, _)| group.bic_gain >= best);
    samples = of_best.filter_map(|(_, fit)| Some((*fit)?.1)).fold(samples, f64::max);
    groups.iter_mut().for_each(|group| group.weigh(group.share, samples));
    let best = most(&groups);
    groups.retain(|group| group.bic_gain > best - GAIN_APART.max(MORE * samples));
    let fewest = groups.iter().map(|group| group.place.variables.len()).min()?;
    groups.retain(|group| group.place.variables.len() == fewest);
    let best = most(&groups);
    groups.retain(|group| group.bic_gain > best - SAME.max(AS_MUCH * samples));
    groups.sort_by(|one, other| one.rank.cmp(&other.rank).then(other.bic_gain.total_cmp(&one.bic_gain)));
    let mut groups = groups.into_iter();
    let best = groups.next().filter(|best| best.share >= LEAST_SHARE && best.bic_gain > 0.0)?;
    let Place { place, variables } = best.place;
    Some(Located { place, variables, share: best.share, alternatives: groups.map(|one| one.place).collect() })
}

impl Group {
    fn weigh(&mut self, share: f64, samples: f64) {
        self.share = share;
        self.bic_gain = -samples * (1.0 - share).max(1e-12).ln() - self.terms.len() as f64 * samples.ln();
    }
}

/// Share of the residual that some terms explain, fitted together with all that the model leaves open from the coefficients of
/// the linear screening, and the effective sample size of the residual then; `None` where that cannot be simulated.
fn refit(
    (with_terms, first): (&Model, usize),
    baseline: &Fitted<'_>,
    screen: &Screen,
    terms: &[usize],
) -> Option<(f64, f64)> {
    let before = &baseline.fitting;
    let (terms, coefficients_si) = screen.together(terms);
    let suspects: Vec<usize> = terms.iter().map(|term| first + term).collect();
    let of = |index: usize| {
        let place =
            suspects.iter().position(|suspect| coefficient(with_terms, Some(*suspect)) == Some(index));
        place.map(|place| coefficients_si[place])
    };
    let fitting =
        Fitting::new(with_terms, Program::new(with_terms, &suspects).ok()?, before.records, &suspects);
    // All of the screened coefficients, or nothing: a strong term may be far from straight.
    let start =
        |share: f64| start(&fitting, baseline, |index| of(index).map(|screened_si| share * screened_si));
    let (point, _) = fitting.near(&baseline.point).fit_from(vec![start(1.0), start(0.0)], STEPS).ok()?;
    let scaled = |squares: &[f64]| -> f64 {
        let outputs = squares.iter().zip(&baseline.point.squares).enumerate();
        outputs.map(|(output, (squares, before_them))| squares / before.variance(output, *before_them)).sum()
    };
    let share = (1.0 - scaled(&point.squares) / scaled(&baseline.point.squares)).clamp(0.0, 1.0);
    Some((share, effective_sample_sizes(&fitting, &point).ok()?.iter().sum()))
}

/// Terms of one place and the same variables.
fn groups(model: &Model, first: usize, terms: &[Term]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (index, term) in terms.iter().enumerate() {
        let place = super::super::report::place(model, first + index);
        let place = Place { place, variables: term.variables.clone() };
        let is_of_change = term.is_of_change();
        let is_same = |group: &&mut Group| group.place == place && group.is_of_change == is_of_change;
        match groups.iter_mut().find(is_same) {
            Some(group) => group.terms.push(index),
            None => {
                let target = model.suspects[first + index].target;
                let rank = rank(target, model.target_name(target), &term.variables);
                groups.push(Group {
                    place,
                    is_of_change,
                    terms: vec![index],
                    bic_gain: 0.0,
                    share: 0.0,
                    rank,
                });
            }
        }
    }
    groups
}

/// Of places that explain as much the one that is said: a function of an input is said of the input.
fn rank(target: model::Target, name: &str, variables: &[String]) -> usize {
    let reads_target = matches!(target, model::Target::Input(_)) && variables.iter().any(|one| one == name);
    match target {
        model::Target::Input(_) if reads_target => 0,
        model::Target::State(_) => 1,
        model::Target::Definition(_) => 2,
        model::Target::Output(_) => 3,
        model::Target::Input(_) => 4,
    }
}

/// Shortest mean period of the samples, s.
fn period_s(fitting: &Fitting<'_>) -> f64 {
    let period = |record: &MeasuredRecord| {
        let times = &record.sampled_s;
        (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64
    };
    fitting.records.iter().map(period).fold(f64::INFINITY, f64::min)
}

impl ModelReport {
    /// Where the residual of the model alone comes from, for who reads what was named beside it: nothing where the residual is
    /// noise, or where a name says the same place. What a held-out record takes back says nothing.
    #[must_use]
    pub fn located_in_words(&self) -> Option<String> {
        let located = self.located.as_ref()?;
        let named = self.named.iter().map(|one| (&one.suspect, &one.place));
        let found: Vec<_> = named.chain(self.discovered.iter().map(|one| (&one.name, &one.place))).collect();
        if self.taken_back || found.is_empty() && !self.adequate {
            return Some(located.in_words());
        }
        let is_it = |place: &String| {
            *place == located.place || located.alternatives.iter().any(|other| other.place == *place)
        };
        if self.adequate || found.iter().any(|(_, place)| is_it(place)) {
            return None;
        }
        let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
        let names = names.join(" and ");
        Some(format!(
            "{}; that is without {names}: of what is left beside it no place is known",
            located.in_words()
        ))
    }
}

impl Located {
    fn in_words(&self) -> String {
        let of = |variables: &[String]| match variables {
            [] => "a constant".to_owned(),
            all => format!("a function of {}", all.join(" and ")),
        };
        let also = |other: &Place| format!("; as well: {} at {}", of(&other.variables), other.place);
        let others: String = self.alternatives.iter().map(also).collect();
        format!(
            "what the model alone leaves looks most like {} at {}, whatever the suspects are ({:.0} % of its power){others}",
            of(&self.variables),
            self.place,
            self.share * 100.0
        )
    }
}
