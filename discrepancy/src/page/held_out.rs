//! What the held-out record says: the gap of each signal, and whether the extended model is confirmed.

use super::words;
use crate::report::{BeforeAfter, Report, SignalMisfit};
use pagekit::markup::{Cell, number, paragraph, table, words as text_cell};
use std::collections::BTreeMap;

pub(super) fn misfit(report: &Report) -> String {
    let row = |(signal, misfit): (&String, &SignalMisfit)| {
        let (unit, factor) = words::shown_small(words::unit_of(signal));
        let size = |value: f64| number(words::with_unit(&words::short(value * factor), &unit));
        let closed = match misfit.closed {
            Some(closed) => Cell::Judged(closed >= 0.95, words::percent(closed)),
            None => text_cell("not significant"),
        };
        vec![
            text_cell(words::signal(signal)),
            size(misfit.before),
            size(misfit.after),
            size(misfit.floor),
            closed,
        ]
    };
    let heads = ["signal", "before", "after", "noise alone", "closed"];
    let table = table("Gap of each signal", &heads, report.misfit.iter().map(row));
    if table.is_empty() {
        return table;
    }
    paragraph(
        "Noise-equivalent rms of measured minus simulated: noise times the root of the whitened windows' variance ratio. Closed: \
         the share of its power above the noise that went; a tick from 95 % on.",
    ) + &table
}

pub(super) fn verification(report: &Report) -> String {
    let Some(verification) = &report.verification else { return String::new() };
    let [low, high] = verification.chi2_null.map(words::short);
    let within = verification.chi2_after >= verification.chi2_null[0]
        && verification.chi2_after <= verification.chi2_null[1];
    let mut rows = vec![
        vec![
            text_cell("extended model better, no signal worse"),
            Cell::Judged(
                verification.confirmed,
                if verification.confirmed { "confirmed" } else { "not confirmed" }.to_owned(),
            ),
        ],
        vec![
            text_cell("windowed \u{3c7}\u{b2} per degree of freedom, before"),
            text_cell(words::short(verification.chi2_before)),
        ],
        vec![
            text_cell("the same, after"),
            Cell::Judged(
                within,
                format!("{}; the 95 % null range is {low} to {high}", words::short(verification.chi2_after)),
            ),
        ],
    ];
    let sound = if verification.physical.is_empty() {
        Cell::Judged(true, "no unphysical state".to_owned())
    } else {
        Cell::Judged(false, verification.physical.join("; "))
    };
    rows.push(vec![text_cell("free run"), sound]);
    let mut text =
        paragraph(&format!("Record: {}. The models were frozen before it was opened.", verification.record));
    text += &table("Verification", &["what", "result"], rows);
    text + &signals(&verification.free_run_nrmse_percent, &verification.whiteness)
}

fn signals(errors: &BTreeMap<String, BeforeAfter>, whiteness: &BTreeMap<String, BeforeAfter>) -> String {
    let mut names: Vec<&String> = errors.keys().chain(whiteness.keys()).collect();
    names.sort();
    names.dedup();
    let two = |pair: Option<&BeforeAfter>, unit: &str| {
        let figures = |value: fn(&BeforeAfter) -> f64| {
            let text = pair.map_or_else(|| words::NOT_MEASURED.to_owned(), |pair| words::short(value(pair)));
            number(if pair.is_some() { words::with_unit(&text, unit) } else { text })
        };
        [figures(|pair| pair.before), figures(|pair| pair.after)]
    };
    let rows = names.into_iter().map(|name| {
        let cells = two(errors.get(name), "%").into_iter().chain(two(whiteness.get(name), ""));
        std::iter::once(text_cell(words::signal(name))).chain(cells).collect()
    });
    table(
        "Free run and whiteness",
        &[
            "signal",
            "free run, of its range, before",
            "after",
            "residuals' memory of 1 sample, before",
            "after",
        ],
        rows,
    )
}
