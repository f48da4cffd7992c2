//! What a search found, in a report.

use super::super::report::{ModelReport, ParameterEstimate, place, term};
use super::Discovery;
use crate::Verdict;
use serde::{Deserialize, Serialize};

/// A term that a search found, which no suspect describes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiscoveredTerm {
    /// What `parameters` call the suspect of its numbers.
    pub name: String,
    /// The input, equation, definition or output that it changes, such as `equation of v`.
    #[serde(default)]
    pub place: String,
    /// How it stands there; its coefficient `k_found` is among `parameters`.
    #[serde(default)]
    pub(crate) term: String,
    /// Inputs and states that it reads.
    #[serde(default)]
    pub variables: Vec<String>,
    #[serde(default)]
    pub(crate) share_explained: f64,
    /// Share of halves of the records in which the best term is one like it.
    #[serde(default)]
    pub stability: f64,
    /// Other terms of the search that explain the records as well.
    #[serde(default)]
    pub(crate) alternatives: Vec<String>,
    /// As `[[suspects]]` of a model file, before it was fitted.
    pub(crate) text: String,
}

impl ModelReport {
    /// What a search found; the verdict is then that something is missing that is no suspect.
    pub(in super::super) fn describe(&mut self, discovery: &Discovery<'_>) {
        let model = discovery.found.baseline.fitting.model;
        let name = |suspect: usize| model.suspects[suspect].name.clone();
        self.discovered = discovery
            .terms
            .iter()
            .map(|one| DiscoveredTerm {
                name: name(one.evaluation.suspect),
                place: place(model, one.evaluation.suspect),
                term: term(model, one.evaluation.suspect),
                variables: one.variables.clone(),
                share_explained: one.evaluation.share,
                stability: one.stability,
                alternatives: one.alternatives.iter().map(|other| name(*other)).collect(),
                text: one.text.trim_start().to_owned(),
            })
            .collect();
        self.notes.push(discovery.note.clone());
        if self.discovered.is_empty() {
            return;
        }
        self.verdict = Verdict::OutsideCatalogue;
        let names: Vec<String> = self.discovered.iter().map(|one| self.in_words(one)).collect();
        self.headline = format!(
            "Something is missing that is no suspect; a search describes it by {}",
            names.join(" and ")
        );
    }

    /// A term with its coefficient and the band of it.
    pub(in super::super) fn in_words(&self, one: &DiscoveredTerm) -> String {
        let is_it = |number: &&ParameterEstimate| {
            number.suspect.as_deref() == Some(&one.name) && number.name == "k_found"
        };
        let Some(k) = self.parameters.iter().find(is_it) else { return one.name.clone() };
        let significant = super::super::report::significant;
        let band = k.standard_error.map_or(String::new(), |error| format!(" ± {}", significant(error)));
        format!("{} (k_found = {}{band} {})", one.name, significant(k.value), k.unit)
    }
}
