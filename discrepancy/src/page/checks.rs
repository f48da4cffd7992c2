//! The records: whether they can be used, what was noticed, and what their channels are made of.

use super::markup::{Cell, folded, heading, number, table, words as said};
use super::words;
use crate::report::{ChannelCheck, Finding, RecordCheck, Report};

/// The section.
pub(super) fn checks(report: &Report) -> String {
    report.checks.iter().map(|check| record(check)).collect()
}

fn record(check: &RecordCheck) -> String {
    let state = if check.usable { "can be used" } else { "cannot be used" };
    let facts = [vec![
        Cell::Judged(check.usable, state.to_owned()),
        number(check.rows.to_string()),
        number(format!("{} s", words::fixed(check.length_s, 2))),
    ]];
    let mut findings: Vec<&Finding> = check.findings.iter().collect();
    // What keeps the record from being used comes first; else as in the report.
    findings.sort_by_key(|finding| !finding.fatal);
    let row = |finding: &&Finding| {
        let weight = if finding.fatal { "cannot be used for it" } else { "left out" };
        vec![
            Cell::About(finding.kind.replace('-', " "), weight.to_owned()),
            said(finding.column.as_deref().unwrap_or(words::NOTHING)),
            number(finding.line.map_or_else(|| words::NOTHING.to_owned(), |line| line.to_string())),
            Cell::Sentence(finding.text.clone()),
        ]
    };
    let channel = |(column, channel): (&String, &ChannelCheck)| {
        let (unit, factor) = words::shown_small(words::unit_of(column));
        let size = |value: Option<f64>| {
            number(value.map_or_else(
                || words::NOTHING.to_owned(),
                |value| words::with_unit(&words::short(value * factor), &unit),
            ))
        };
        vec![
            said(column),
            size(channel.noise),
            size(channel.quantum),
            number(words::percent(channel.unusable)),
        ]
    };
    let channels = table(
        "Channels",
        &["channel", "noise", "smallest step", "left out"],
        check.channels.iter().map(channel),
    );
    heading(&check.file)
        + &table("Record", &["record", "samples", "length"], facts)
        + &table("Findings", &["noticed", "column", "line", "what, and what to do"], findings.iter().map(row))
        + &folded("Its channels", &channels)
}
