//! A search for what no suspect describes: a formula of few terms over what varies in the model and what it remembers.
//!
//! ```text
//!   all terms ─► linear responses, gains ─► the best that differ, fitted in the simulator ─► gates, stability ─► taken
//!       ▲                                                                                                         │
//!       └──────────────────────────── beside what was taken ◄─────────────────────────────────────────────────────┘
//! ```
//! | file | holds |
//! |---|---|
//! | `described` | what was found, in a report |
//! | `features` | the terms, as suspects |
//! | `place` | where the residual comes from, whatever the law |
//! | `screen` | gains of all terms, stability |
//!
//! A term is taken under the gates of a suspect ([`super::select`]), where the penalty counts every term of the search, and if
//! the best term of halves of the record is one like it in most of them. The verdict stays that something is missing that is no
//! suspect: a formula is a description.

mod described;
mod features;
mod place;
mod screen;

use super::fit::{Fitting, OPTIONS, Unknown, UnknownId};
use super::judge::{Evaluation, GAIN_APART, judge};
use super::record::MeasuredRecord;
use super::select::{Fitted, MOST_TERMS, SAME, SearchResult, fitted, fitted_from};
use crate::parallel;
pub use described::DiscoveredTerm;
use features::{Term, terms, variables};
use model::{Failure, Model};
pub(super) use place::located;
pub use place::{Located, Place};
use screen::{Screen, coefficient};
use std::path::Path;

/// Rows over the terms that are fitted in a round, and the fewest and most of these: a search takes some seconds on any record.
const ROWS: usize = 8000;
const FITTED: [usize; 2] = [4, 16];
/// Cosine above which two terms are one.
const SAME_RESPONSE: f64 = 0.98;
/// Least stability of a term [Meinshausen, Bühlmann 2010: 0.6 to 0.9].
const STABLE: f64 = 0.6;

/// A model with all terms of a search as further suspects.
pub(super) struct ModelWithTerms {
    model: Model,
    terms: Vec<Term>,
    /// Index of the first of them.
    first: usize,
    left_out: usize,
}

/// A term that was found.
pub(super) struct Discovered {
    pub(super) evaluation: Evaluation,
    pub(super) variables: Vec<String>,
    pub(super) stability: f64,
    /// Others that explain the records as well.
    pub(super) alternatives: Vec<usize>,
    /// As `[[suspects]]` of a model file.
    pub(super) text: String,
}

/// Result of a search for terms.
pub(super) struct Discovery<'a> {
    pub(super) found: SearchResult<'a>,
    pub(super) terms: Vec<Discovered>,
    pub(super) note: String,
}

/// The model with the terms of a search; the reason where there is none.
pub(super) fn with_terms(baseline: &Fitted<'_>) -> Result<ModelWithTerms, String> {
    let model = baseline.fitting.model;
    let records = baseline.fitting.records;
    let length = |record: &MeasuredRecord| record.sampled_s[record.sampled_s.len() - 1] - record.sampled_s[0];
    let length_s = records.iter().map(length).fold(f64::INFINITY, f64::min);
    let period_s = records.iter().map(|record| length(record) / (record.sampled_s.len() - 1) as f64);
    let period_s = period_s.fold(f64::INFINITY, f64::min);
    let (terms, left_out) = terms(model, &variables(baseline), period_s, length_s);
    if terms.is_empty() {
        return Err("nothing varies that a term could be made of".into());
    }
    let text: String = terms.iter().map(|term| term.text.as_str()).collect();
    let text = format!("{}\n{text}", model.text);
    let mut with_terms = Model::parse(&text, Path::new("model with the terms of the search"))
        .map_err(|error| error.to_string())?;
    with_terms.starts = 0;
    with_terms.name.clone_from(&model.name);
    Ok(ModelWithTerms { first: model.suspects.len(), model: with_terms, terms, left_out })
}

/// Searches beside a model of which no suspect was named.
pub(super) fn search<'a>(
    with_terms: &'a ModelWithTerms,
    records: &'a [MeasuredRecord],
    found: SearchResult<'a>,
    progress: &mut dyn FnMut(&str),
) -> Result<Discovery<'a>, Failure> {
    let ModelWithTerms { model, terms, first, left_out } = with_terms;
    let baseline = fitted(model, records, &[], Some(&found.baseline))?;
    let mut found = SearchResult { extended: baseline.clone(), baseline, ..found };
    let rows: usize = records.iter().map(|record| record.time_s.len()).sum();
    let fitted_terms = (ROWS / rows.max(1)).clamp(FITTED[0], FITTED[1]);
    let mut accepted: Vec<Discovered> = Vec::new();
    let mut why = String::new();
    while accepted.len() < MOST_TERMS {
        progress(&format!("search: term {} among {}", accepted.len() + 1, terms.len()));
        let Some(screen) = Screen::new(&found.extended, *first, terms.len()) else { break };
        let best = screen.best(fitted_terms, SAME_RESPONSE, |term| terms[term].complexity);
        let Some(round) = round(with_terms, &found, &screen, &best) else { break };
        let (fit, evaluation, alternatives) = round;
        let term = evaluation.suspect - first;
        let stability = screen.stability(term);
        if !evaluation.passes || stability < STABLE {
            let gate = match evaluation.passes {
                false => evaluation.gate,
                true => format!("stability {stability:.2}, {STABLE} asked"),
            };
            why = format!("; the next would be {}: {gate}", terms[term].name);
            break;
        }
        found.extended = fit;
        let Term { variables, text, .. } = &terms[term];
        let (variables, text) = (variables.clone(), text.clone());
        accepted.push(Discovered { evaluation, variables, stability, alternatives, text });
    }
    let cut = if *left_out > 0 { format!(", {left_out} longer ones left out") } else { String::new() };
    let note = format!("searched {} terms{cut}, {} taken{why}", terms.len(), accepted.len());
    Ok(Discovery { found, terms: accepted, note })
}

/// Where the fit of a model with more terms begins: at what the smaller one gave, and at the coefficients of the linear
/// screening, by their parameters.
fn start(fitting: &Fitting<'_>, before: &Fitted<'_>, screened_si: impl Fn(usize) -> Option<f64>) -> Vec<f64> {
    let known = |id: UnknownId| before.fitting.unknowns.iter().position(|unknown| unknown.id == id);
    let value = |unknown: &Unknown| match (unknown.id, known(unknown.id)) {
        (_, Some(place)) => before.point.values_si[place],
        (UnknownId::Shared(index), None) => screened_si(index).unwrap_or(unknown.start_si),
        _ => unknown.start_si,
    };
    fitting.unknowns.iter().map(value).collect()
}

/// The best of the terms fitted in the simulator, and others that are as good.
fn round<'a>(
    with_terms: &'a ModelWithTerms,
    found: &SearchResult<'a>,
    screen: &Screen,
    best: &[usize],
) -> Option<(Fitted<'a>, Evaluation, Vec<usize>)> {
    let ModelWithTerms { model, terms, first, .. } = with_terms;
    let before = &found.extended;
    let fit = |term: &usize| {
        let suspect = first + term;
        let suspects: Vec<usize> = before.suspects.iter().copied().chain([suspect]).collect();
        let coefficient = coefficient(model, Some(suspect));
        let screened_si = |index: usize| (Some(index) == coefficient).then(|| screen.coefficient_si(*term));
        let start = |fitting: &Fitting<'a>| vec![start(fitting, before, screened_si)];
        fitted_from(model, before.fitting.records, &suspects, (start, OPTIONS.steps))
            .ok()
            .map(|fit| (suspect, fit))
    };
    let mut fits: Vec<(usize, Fitted<'a>)> = parallel::map(best, fit).into_iter().flatten().collect();
    let least = fits.iter().min_by(|(_, one), (_, other)| one.point.loss.total_cmp(&other.point.loss))?;
    let effective = least.1.effective.clone();
    let judged: Vec<Evaluation> = fits
        .iter()
        .map(|(suspect, fit)| judge(found.reference_fits(), fit, *suspect, (terms.len(), &effective)))
        .collect();
    let most = judged.iter().map(Evaluation::bic_gain).fold(f64::NEG_INFINITY, f64::max);
    // Of those that are as good the simplest.
    let is_as_good = |place: &usize| judged[*place].bic_gain() > most - SAME;
    let place = (0..judged.len())
        .filter(is_as_good)
        .min_by_key(|place| terms[judged[*place].suspect - first].complexity)?;
    let chosen = judged[place].clone();
    let form = |evaluation: &Evaluation| terms[evaluation.suspect - first].form();
    let others = judged.iter().filter(|other| other.passes && form(other) != form(&chosen));
    let alternatives = others.filter(|other| chosen.bic_gain() - other.bic_gain() <= GAIN_APART);
    let alternatives = alternatives.map(|other| other.suspect).collect();
    Some((fits.swap_remove(place).1, chosen, alternatives))
}
