//! The report as one self-contained page: opens offline, without scripts.
//!
//! First the verdict in a sentence with the names, then the disagreement as a picture, what is known of each name, the picture
//! after; below that the evidence, in the order in which somebody who doubts the verdict would ask for it. A section that has
//! nothing to say is left out. Markup that an XML parser reads too, in the style of all pages ([`pagekit::page`]).
//!
//! | file | holds |
//! |---|---|
//! | `verdict` | the box on top |
//! | `pictures` | measured against simulated, before and after |
//! | `finding` | names, parameters, what is outside the catalogue, what to run next |
//! | `location` | balances, regimes, maps, unknown inputs over time |
//! | `explanations` | what was compared: nothing, parameters, sets of effects |
//! | `candidates` | ranking, what is not excited, detection limits |
//! | `held_out` | gap and verification |
//! | `checks` | the records |
//! | `words` | numbers with units |

mod candidates;
mod checks;
mod explanations;
mod finding;
mod held_out;
mod location;
mod pictures;
mod verdict;
mod words;

use crate::report::{Report, Verdict};
use pagekit::markup::section;
use pagekit::page::{document, escaped};

/// Numbers of one signal over time, in the unit that stands beside them; what is missing is not finite.
pub(crate) type Values = Vec<f64>;

/// A signal of a record with both models, sample by sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Trace {
    /// As a column of the record, `drive_position_m`.
    pub(crate) signal: String,
    /// SI.
    pub(crate) unit: String,
    pub(crate) time_s: Values,
    /// What the record says.
    pub(crate) measured: Values,
    /// What the baseline says.
    pub(crate) before: Values,
    /// What the extended model says; empty when there is none.
    pub(crate) after: Values,
    /// Measured minus baseline, with start states projected out.
    pub(crate) before_residual: Values,
    /// Measured minus extended model; empty when there is none.
    pub(crate) after_residual: Values,
    /// Standard deviation of the sensor's noise, its rounding included; 0 where nobody knows it.
    pub(crate) noise: f64,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pictures {
    pub(crate) record: String,
    pub(crate) held_out: bool,
    pub(crate) traces: Vec<Trace>,
}

pub(crate) fn page(report: &Report, pictures: &Pictures) -> String {
    let bad = report.verdict == Verdict::BadData;
    let mut sections = vec![
        ("disagreement", "Measured against simulated", pictures::before(report, pictures)),
        ("finding", finding::title(report), finding::finding(report)),
        ("next", "What to measure next", finding::next(report)),
        ("after", "After: with what was found", pictures::after(report, pictures)),
        ("gap", "The gap, before and after", held_out::misfit(report)),
        ("verification", "On a held-out record", held_out::verification(report)),
        ("location", "Where they disagree", location::location(report)),
        ("explanations", "What else it could be", explanations::explanations(report)),
        ("candidates", "Candidates, the best first", candidates::candidates(report)),
        ("limits", "What these records can show", candidates::limits(report)),
        ("records", "The records", checks::checks(report)),
    ];
    if bad {
        // For an unusable record its findings come first.
        sections.rotate_right(1);
    }
    sections.retain(|(_, _, markup)| !markup.is_empty());
    let contents: String = sections
        .iter()
        .map(|(name, title, _)| format!("<li><a href=\"#{name}\">{}</a></li>\n", escaped(title)))
        .collect();
    let body: String = sections.iter().map(|(name, title, inside)| section(name, title, inside)).collect();
    document(
        verdict::title(report),
        &format!(
            "{}<nav aria-label=\"Contents\">\n<ul class=\"contents\">\n{contents}</ul>\n</nav>\n<main>\n{body}</main>\n\
             <footer class=\"page-foot\">\n<p>Schema version {}. The same for programs is in report.json beside this page. \
             \u{b1} is half the half-width of a nominal 95.4 % interval.</p>\n</footer>\n",
            verdict::head(report),
            report.schema_version
        ),
    )
}

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;
