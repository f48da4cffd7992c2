//! The explanations that the search compared, each with what speaks for it and against it.

use super::markup::{number, paragraph, table, words as text_cell};
use super::words;
use crate::name::{Evidence, ExplanationKind};
use crate::report::{EffectPlace, Explanation, Report, listed};

pub(super) fn explanations(report: &Report) -> String {
    let row = |explanation: &Explanation| {
        let evidence = explanation.evidence?;
        let optional =
            |value: Option<f64>| number(value.map_or_else(|| words::NOTHING.to_owned(), words::percent));
        Some(vec![
            text_cell(name(explanation)),
            number(words::short(noise_ratio(&evidence))),
            number(words::short(evidence.behind)),
            number(words::short(evidence.parameters_moved)),
            optional(evidence.amplitude_variation),
        ])
    };
    let heads = [
        "explanation",
        "leaves, times noise",
        "loss behind the best",
        "parameters moved",
        "amplitude differs by",
    ];
    let table = table("Explanations", &heads, report.explanations.iter().filter_map(row));
    if table.is_empty() {
        return table;
    }
    paragraph(
        "The right explanation leaves about 1 times the noise, moves few parameters, and all stretches of the records agree on \
         its amplitude. Where no row does all three, it is none of these: look at where they disagree, and record more. \
         Where two rows do, a difference of less than 9 in loss does not tell them apart.",
    ) + &table
}

/// Mean power of what is left, over that of noise: the geometric mean of the windows.
fn noise_ratio(evidence: &Evidence) -> f64 {
    evidence.loss_per_dof.exp()
}

fn name(explanation: &Explanation) -> String {
    let effect =
        |one: &EffectPlace| format!("{} at the {}", one.effect, words::place(&one.effect, &one.place));
    match explanation.kind {
        ExplanationKind::Nothing => "the rig file as it is".to_owned(),
        ExplanationKind::Parameters => "parameters alone".to_owned(),
        ExplanationKind::NoneOfThese => "none of these".to_owned(),
        ExplanationKind::Effects => {
            let sets = explanation.sets.iter().map(|set| listed(&set.iter().map(effect).collect::<Vec<_>>()));
            sets.collect::<Vec<_>>().join(", or ")
        }
    }
}
