//! The report as one page for somebody who doubts it: opens offline, needs no script, asks for nothing from elsewhere.
//!
//! First whether the figures may be quoted and why not, then the figures, then what happened, then how it was measured.
//!
//! | file | holds |
//! |---|---|
//! | `families` | which distributions stand in one chart, and which reference beside them |
//! | `figures` | key figures and ratios |
//! | `histograms`, `maxima` | their charts |
//! | `events`, `timeline` | the worst events, the cycles around them; findings |
//! | `runs` | arrivals, counts, each run's percentiles |
//! | `comparison` | groups side by side; bounds |
//! | `conditions` | machine and command lines, what was not controlled, how to read |

mod comparison;
mod conditions;
mod events;
mod families;
mod figures;
mod histograms;
mod maxima;
mod runs;
mod timeline;

use crate::model::{Claim, Report};
use pagekit::number;
use pagekit::page::{document, escaped};

/// The report as one HTML page that needs nothing from outside.
pub fn page(report: &Report) -> String {
    let families = families::families(&report.distributions);
    let sections = [
        ("figures", "Key figures", figures::key_figures(&families)),
        ("ratios", "Ours against the reference", figures::ratios(&report.ratios)),
        (
            "histograms",
            "Histograms",
            pagekit::markup::paragraph(HISTOGRAMS) + &histograms::histograms(&families),
        ),
        ("maxima", "Largest values over time", maxima::maxima(report, &families)),
        ("worst", "The worst events", events::worst(report)),
        ("findings", "Findings", events::findings(&report.findings)),
        ("arrivals", "Arrivals of cyclic frames", runs::arrivals(&report.runs)),
        ("runs", "Runs and counts", runs::counts(&report.runs)),
        ("comparison", "Comparison", comparison::comparison(report.comparison.as_ref())),
        ("bounds", "Bounds", comparison::bounds(&report.bounds)),
        ("conditions", "Conditions", conditions::conditions(&report.conditions)),
        ("not-controlled", "What was not controlled", conditions::not_controlled(report)),
        ("reading", "How to read this", conditions::how_to_read()),
    ];
    let contents = sections
        .iter()
        .map(|(identifier, title, _)| format!("<li><a href=\"#{identifier}\">{}</a></li>\n", escaped(title)));
    let body = format!(
        "{}<nav aria-label=\"Contents\">\n<ul class=\"contents\">\n{}</ul>\n</nav>\n<main>\n{}</main>\n{}",
        head(report),
        contents.collect::<String>(),
        sections
            .iter()
            .map(|(identifier, title, markup)| pagekit::markup::section(identifier, title, markup))
            .collect::<String>(),
        foot(report)
    );
    document(&report.title, &body)
}

const HISTOGRAMS: &str = "Markers stand at p50, p99, p99.9 and the maximum. The reference is the grey area. Both axes are \
                          logarithmic: the tail would not be seen otherwise.";

fn head(report: &Report) -> String {
    let number = report.runs.len() as u64;
    let length_s: f64 =
        report.runs.iter().map(|run| run.duration_s).filter(|length| length.is_finite()).sum();
    format!(
        "<header>\n<h1>{}</h1>\n<p class=\"soft\">{} of {} s{}. Made {}.</p>\n{}</header>\n",
        escaped(&report.title),
        number::counted(number, "run", "runs"),
        number::decimal(length_s, 0),
        if number == 1 { "" } else { " together" },
        number::instant(report.made_unix_s),
        verdict(&report.claim)
    )
}

/// Whether a latency claim is supported, in a box that says so by sign, word and border.
fn verdict(claim: &Claim) -> String {
    let (class, sign, word) = if claim.supported {
        ("verdict", '✓', "Latency claim: supported")
    } else {
        ("verdict no", '✗', "Latency claim: not supported")
    };
    let reasons = if claim.reasons.is_empty() && claim.supported {
        String::new()
    } else {
        let lead = if claim.supported { "What weakens it:" } else { "Why not:" };
        format!("<p>{lead}</p>\n{}", pagekit::markup::list(&claim.reasons, "No reason was recorded."))
    };
    format!(
        "<div class=\"{class}\" role=\"note\" aria-label=\"Verdict\">\n<p>{sign} {word}</p>\n<p>{}</p>\n{reasons}</div>\n",
        escaped(&claim.sentence)
    )
}

fn foot(report: &Report) -> String {
    format!(
        "<footer class=\"page-foot\">\n<p>Schema {}, version {}. The same data for programs is in report.json beside this \
         page.</p>\n</footer>\n",
        escaped(&report.schema),
        report.schema_version
    )
}
