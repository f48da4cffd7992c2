//! The ranking of candidates, effects that are not excited, and detection limits.

use super::words;
use crate::report::{Candidate, Report};
use model_fit::estimator::Convergence;
use pagekit::markup::{Cell, charts, folded, heading, number, paragraph, table, words as text_cell};
use pagekit::plot::{Bar, bars, figure};

/// Candidates that are drawn; all stand in the table.
const DRAWN: usize = 15;

pub(super) fn candidates(report: &Report) -> String {
    if report.candidates.is_empty() {
        return String::new();
    }
    let bar = |one: &Candidate| Bar {
        label: format!("{} {}", one.effect, one.place),
        value: one.score,
        text: words::short(one.score),
        is_full: one.score > 1.0,
    };
    let rows: Vec<Bar> = report.candidates.iter().take(DRAWN).map(bar).collect();
    let drawn = figure(
        "How much each would explain",
        "Over what pure noise would reach, logarithmic: above 1 it exceeds what chance gives the best candidate; no test \
         of this effect. It is named only when its refit in the simulator holds too.",
        &[],
        &bars("ranking", "Candidates by score", &rows),
    );
    let row = |one: &Candidate| {
        // What to doubt about the fit stands behind the decision that rests on it.
        let doubt = one.fit.and_then(Convergence::doubt).map(|doubt| format!("; {doubt}"));
        vec![
            text_cell(&one.effect),
            text_cell(words::place(&one.effect, &one.place)),
            number(words::short(one.score)),
            number(one.share_explained.map_or_else(|| words::NOT_MEASURED.to_owned(), words::percent)),
            number(words::with_unit(&words::short(one.amplitude), &one.unit)),
            Cell::Sentence(one.decision.clone() + &doubt.unwrap_or_default()),
        ]
    };
    let heads =
        ["effect", "where", "score", "share of the log misfit, alone", "amplitude", "what became of it"];
    let count = report.candidates.len();
    let all = table("All candidates", &heads, report.candidates.iter().map(row));
    charts(&[drawn]) + &folded(&format!("All {count} candidates, and what became of each"), &all)
}

pub(super) fn limits(report: &Report) -> String {
    let mut text = String::new();
    if !report.not_excited.is_empty() {
        text += &heading("Not excited");
        text += &paragraph("The training records do not excite these effects; they may be present.");
        let rows = report
            .not_excited
            .iter()
            .map(|one| vec![text_cell(&one.effect), text_cell(words::place(&one.effect, &one.place))]);
        text += &table("Not excited", &["effect", "where"], rows);
    }
    // Without anything missing the limits are the answer, and stand further up.
    if !report.is_rig_file_enough() {
        let limits = limits_table(report);
        if !limits.is_empty() {
            text += &heading("Detection limits");
            text += &paragraph(
                "Decision limit of each other effect (Currie): an effect of this size is found in half of such records or fewer.",
            );
            text += &folded(&format!("Limits of {} effects", report.detection_limits.len()), &limits);
        }
    }
    text
}

pub(super) fn limits_table(report: &Report) -> String {
    let rows = report.detection_limits.iter().map(|one| {
        vec![
            text_cell(&one.effect),
            text_cell(words::place(&one.effect, &one.place)),
            text_cell(&one.name),
            number(words::with_unit(&words::short(one.value), &one.unit)),
        ]
    });
    table("Detection limits", &["effect", "where", "number", "would have shown from"], rows)
}
