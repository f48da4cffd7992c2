//! The records: usability, findings, noise and quantum of channels.

use super::words;
use crate::report::{ChannelCheck, Finding, RecordCheck, Report};
use pagekit::markup::{Cell, folded, heading, number, table, words as text_cell};
use pagekit::page::escaped;

pub(super) fn checks(report: &Report) -> String {
    report.checks.iter().map(record).collect()
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
    let noticed: String = findings.into_iter().map(finding).collect();
    let noticed = if noticed.is_empty() { noticed } else { format!("<ul>\n{noticed}</ul>\n") };
    let channel = |(column, channel): (&String, &ChannelCheck)| {
        let (unit, factor) = words::shown_small(words::unit_of(column));
        let size = |value: Option<f64>| {
            number(value.map_or_else(
                || words::NOT_MEASURED.to_owned(),
                |value| words::with_unit(&words::short(value * factor), &unit),
            ))
        };
        vec![
            text_cell(column),
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
        + &noticed
        + &folded("Its channels", &channels)
}

/// A list, not a table: what to do about it must be seen on a telephone too.
fn finding(finding: &Finding) -> String {
    let (class, sign) = if finding.fatal { ("bad", '\u{2717}') } else { ("soft", '\u{b7}') };
    let mut place = finding.kind.replace('-', " ");
    if let Some(column) = &finding.column {
        place += &format!(", {column}");
    }
    if let Some(line) = finding.line {
        place += &format!(", line {line}");
    }
    let weight = if finding.fatal { " <span class=\"soft\">(the record cannot be used)</span>" } else { "" };
    format!(
        "<li><span class=\"{class}\">{sign} {}</span>: {}{weight}</li>\n",
        escaped(&place),
        escaped(&finding.text)
    )
}
