//! The box on top: verdict, effects with numbers, closed gap.

use super::words;
use crate::report::{Explanation, HeldOutFinding, NamedEffect, Report, Verdict, listed};
use model_fit::WORSE;
use pagekit::page::escaped;

/// What the page says first: the doubt of the held-out record, where there is one, in place of the verdict.
pub(super) fn title(report: &Report) -> &'static str {
    doubt(report).unwrap_or(match report.verdict {
        Verdict::NothingMissing if report.small.is_empty() => "Nothing is missing",
        Verdict::NothingMissing => "Nothing is missing that is large enough to be named",
        Verdict::ParametersOnly => "Numbers of the rig are off",
        Verdict::Named => "What the simulation lacks",
        Verdict::Ambiguous => "Several explanations fit alike",
        Verdict::OutsideCatalogue => "Something is missing that the catalogue does not have",
        Verdict::BadData => "A record cannot be used",
    })
}

/// What a finding lacks: the support of the held-out record, or that nothing beside it is missing.
fn doubt(report: &Report) -> Option<&'static str> {
    let is_outside = report.verdict == Verdict::OutsideCatalogue;
    match report.held_out_finding() {
        Some(HeldOutFinding::Worse) if report.is_rig_file_enough() => {
            Some("Fitted parameters make the held-out record worse")
        }
        Some(HeldOutFinding::Worse) if is_outside => Some(
            "Something is missing that the catalogue does not have, and what was fitted makes the held-out record worse",
        ),
        Some(HeldOutFinding::Worse) => Some("What was found makes the held-out record worse"),
        Some(HeldOutFinding::NotConfirmed) if is_outside => {
            Some("The held-out record does not confirm what was found outside the catalogue")
        }
        Some(HeldOutFinding::NotConfirmed) => Some("The held-out record does not confirm what was found"),
        Some(HeldOutFinding::SomethingMissing) => Some("The held-out record shows that something is missing"),
        Some(HeldOutFinding::MoreMissing) if is_outside => None,
        Some(HeldOutFinding::MoreMissing) => Some("The held-out record shows that more is missing"),
        None if report.verdict == Verdict::Named && report.adequate == Some(false) => {
            Some("Part of what the simulation lacks")
        }
        None => None,
    }
}

/// Heading, files and box.
pub(super) fn head(report: &Report) -> String {
    let files = &report.inputs;
    let mut from = format!("{} against {}", files.rig, listed(&files.train));
    if let Some(verification) = &report.verification {
        from += &format!(", verified on {}", verification.record);
    }
    // Green and whole for an answer, amber for an open question, dashed for no answer.
    let open = ('?', "verdict", " style=\"border-color:var(--s4)\"");
    let (sign, class, style) = match report.verdict {
        Verdict::BadData => ('\u{2717}', "verdict no", ""),
        Verdict::Ambiguous | Verdict::OutsideCatalogue => open,
        _ if doubt(report).is_some() || report.more_probable().is_some() => open,
        _ => ('\u{2713}', "verdict", ""),
    };
    let mut points: Vec<String> = report.named.iter().flat_map(named).collect();
    points.extend(report.named_explanation().map(probability));
    points.extend(report.small.iter().map(|small| effect_line(small, "<i>smaller:</i> ")));
    points.extend(report.parameters.iter().map(|quantity| {
        let before = quantity.before.map_or(String::new(), |before| {
            format!(", the rig file says {}", words::with_unit(&words::short(before), &quantity.unit))
        });
        format!(
            "<b>{}</b>: {}{}",
            escaped(&quantity.name),
            escaped(&words::quantity(quantity)),
            escaped(&before)
        )
    }));
    points.extend(report.nearest.iter().map(|nearest| effect_line(nearest, "<i>resembles</i> ")));
    points.extend(report.remaining.iter().map(|remaining| {
        format!(
            "More is missing, in this balance: {}; it depends on {}",
            escaped(&words::balance(&remaining.balance)),
            escaped(remaining.strongest())
        )
    }));
    points.extend(misfit(report));
    points.extend(held_out_excess(report));
    if let Some(next) = &report.next {
        let what = next.experiment.as_ref().or(next.otherwise.as_ref());
        points.extend(what.map(|what| format!("To run next: {}", escaped(what))));
    }
    let points: String = points.iter().map(|point| format!("<li>{point}</li>\n")).collect();
    let points = if points.is_empty() { points } else { format!("<ul>\n{points}</ul>\n") };
    format!(
        "<header>\n<h1>{}</h1>\n<p class=\"soft\">{}</p>\n<div class=\"{class}\"{style} role=\"note\" aria-label=\"Verdict\">\n\
         <p>{sign} {}</p>\n{points}</div>\n</header>\n",
        title(report),
        escaped(&from),
        escaped(&report.summary)
    )
}

/// An effect and its alternatives, with equal weight.
fn named(named: &NamedEffect) -> Vec<String> {
    let line = effect_line(named, "");
    std::iter::once(line)
        .chain(named.alternatives.iter().map(|other| effect_line(other, "<i>or</i> ")))
        .collect()
}

fn probability(named: &Explanation) -> String {
    format!("Probability of this explanation: {}", words::percent(named.probability))
}

fn effect_line(named: &NamedEffect, before: &str) -> String {
    let numbers = words::numbers(named);
    let numbers = if numbers.is_empty() { numbers } else { format!(": {numbers}") };
    format!(
        "{before}<b>{}</b> at the {}{}; it explains {} of the log misfit there",
        escaped(&named.effect),
        escaped(&words::place(&named.effect, &named.place)),
        escaped(&numbers),
        words::percent(named.share_explained)
    )
}

/// What the held-out record shows beyond the model.
fn held_out_excess(report: &Report) -> Option<String> {
    let verification = report.verification.as_ref()?;
    let than = match report.held_out_finding()? {
        HeldOutFinding::SomethingMissing => "the rig file",
        HeldOutFinding::MoreMissing => "the extended model",
        HeldOutFinding::Worse | HeldOutFinding::NotConfirmed => return None,
    };
    Some(format!(
        "{}, a held-out record, differs from {than} by more than noise: \u{3c7}\u{b2} per degree of freedom {}, of noise at most \
         {}. It excites what the training records do not: give it as --train, and another record as --test",
        escaped(&verification.record),
        words::short(verification.chi2_after),
        words::short(verification.chi2_null[1])
    ))
}

/// How much of the gap of the held-out record is closed, over the signals that had one.
fn misfit(report: &Report) -> Option<String> {
    let is_worse = report.held_out_finding() == Some(HeldOutFinding::Worse);
    if report.verdict == Verdict::BadData || report.is_rig_file_enough() && !is_worse {
        return None;
    }
    let verification = report.verification.as_ref()?;
    let record = escaped(&verification.record);
    if is_worse {
        let signals: Vec<String> = report
            .misfit
            .iter()
            .filter(|(_, misfit)| misfit.after > WORSE * misfit.before)
            .map(|(signal, misfit)| {
                format!("{} by {}", words::signal(signal), words::percent(misfit.after / misfit.before - 1.0))
            })
            .collect();
        return Some(format!(
            "On {record}, a held-out record, the simulation gets worse with it: {}. Do not use the extended model; look at the \
             other candidates, or record more",
            escaped(&listed(&signals))
        ));
    }
    let mut closed: Vec<f64> = report.misfit.values().filter_map(|misfit| misfit.closed).collect();
    closed.sort_by(f64::total_cmp);
    let (least, most) = (closed.first()?, closed.last()?);
    let range = if words::percent(*least) == words::percent(*most) {
        words::percent(*least)
    } else {
        format!("{} to {}", words::percent(*least), words::percent(*most))
    };
    Some(format!("On {record}, a held-out record, {range} of the gap to the noise is closed"))
}
