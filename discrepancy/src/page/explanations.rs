//! The explanations that the search compared: how probable each is, what speaks for it and against it.

use super::words;
use crate::report::{EffectPlace, Explanation, ExplanationKind, Features, Report, listed};
use pagekit::markup::{number, paragraph, table, words as text_cell};
use pagekit::plot::{Bar, figure, share_bars};

pub(super) fn explanations(report: &Report) -> String {
    let with_marginal = report.explanations.iter().any(|explanation| explanation.marginal.is_some());
    let row = |explanation: &Explanation| {
        let optional =
            |value: Option<f64>| number(value.map_or_else(|| words::NOT_MEASURED.to_owned(), words::percent));
        let of_evidence = |value: fn(&Features) -> f64| {
            let value = explanation.evidence.as_ref().map(value);
            number(value.map_or_else(|| words::NOT_MEASURED.to_owned(), words::short))
        };
        let mut cells = vec![
            text_cell(name(explanation)),
            number(words::percent(explanation.probability)),
            // Power of the residual over that of noise: geometric mean over the windows.
            of_evidence(|evidence| evidence.loss_per_dof.exp()),
            of_evidence(|evidence| evidence.loss_difference),
            of_evidence(|evidence| evidence.parameters_moved),
            optional(explanation.evidence.and_then(|evidence| evidence.amplitude_variation)),
        ];
        if with_marginal {
            cells.push(optional(explanation.marginal.map(|marginal| marginal.probability)));
        }
        cells
    };
    let mut heads = vec![
        "explanation",
        "probability",
        "leaves, times noise",
        "loss above the best",
        "parameters moved",
        "amplitude differs by",
    ];
    if with_marginal {
        heads.push("by marginal likelihood, which decides nothing");
    }
    let table = table("Explanations", &heads, report.explanations.iter().map(row));
    if table.is_empty() {
        return table;
    }
    paragraph(&advice(report))
        + &report.significance.as_ref().map_or(String::new(), |tests| paragraph(&tests.in_words()))
        + &probabilities(&report.explanations)
        + &paragraph(
            "The right explanation leaves about 1 times the noise, moves few parameters, and all stretches of the records agree \
             on its amplitude.",
        )
        + &table
}

/// Probability from which an explanation is acted on.
const CLEAR: f64 = 0.9;

/// What to do, in a sentence.
fn advice(report: &Report) -> String {
    let mut ranked: Vec<&Explanation> = report.explanations.iter().collect();
    ranked.sort_by(|left, right| right.probability.total_cmp(&left.probability));
    let [first, second, ..] = ranked[..] else { return String::new() };
    let with_probability = |one: &Explanation| format!("{} ({})", name(one), words::percent(one.probability));
    let first_words = with_probability(first);
    if let (Some(named), Some(other)) = (report.named_explanation(), report.more_probable()) {
        return format!(
            "Named is {}, the best model of the search, although {} is more probable by what is known of other records. Record \
             what tells these two apart before you decide.",
            with_probability(named),
            with_probability(other)
        );
    }
    match (first.kind, first.probability >= CLEAR) {
        (ExplanationKind::NoneOfThese, _) => format!(
            "Most probable is {first_words}: look at where model and records disagree before you add anything to the model."
        ),
        (ExplanationKind::Null, true) => format!("Keep {first_words}."),
        (ExplanationKind::Parameters, true) => format!("Correct the numbers of the rig file: {first_words}."),
        (ExplanationKind::Effects, true) => format!("Add to the model: {first_words}."),
        (_, false) => format!(
            "No explanation has {}: {first_words} is followed by {} ({}). Record what tells these two apart before you decide.",
            words::percent(CLEAR),
            name(second),
            words::percent(second.probability)
        ),
    }
}

fn probabilities(explanations: &[Explanation]) -> String {
    let bar = |one: &Explanation| Bar {
        label: shortened(&name(one)),
        value: one.probability,
        text: words::percent(one.probability),
        is_full: one.probability >= CLEAR,
    };
    let rows: Vec<Bar> = explanations.iter().map(bar).collect();
    figure(
        "How probable each explanation is",
        "From the evidence below, weighed as on records whose truth is known; full from 90 %.",
        &[],
        &share_bars("probabilities", "Probability of each explanation", &rows),
    )
}

/// As much of a name's end as a bar has room for: sets often begin with the same effect. The table has all of it.
fn shortened(name: &str) -> String {
    const MOST: usize = 44;
    match name.char_indices().nth_back(MOST - 1) {
        Some((start, _)) if start > 0 => format!("…{}", name[start..].trim_start()),
        _ => name.to_owned(),
    }
}

fn name(explanation: &Explanation) -> String {
    let effect =
        |one: &EffectPlace| format!("{} at the {}", one.effect, words::place(&one.effect, &one.place));
    match explanation.kind {
        ExplanationKind::Null => "the rig file as it is".to_owned(),
        ExplanationKind::Parameters => "parameters alone".to_owned(),
        ExplanationKind::NoneOfThese => "none of these".to_owned(),
        ExplanationKind::Effects => {
            let sets = explanation.sets.iter().map(|set| listed(&set.iter().map(effect).collect::<Vec<_>>()));
            sets.collect::<Vec<_>>().join(", or ")
        }
    }
}
