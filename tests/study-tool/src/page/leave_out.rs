//! Sections of a score with effects left out of the program's catalogue.

use super::{percent, reported, table};
use crate::compare::verdicts;
use crate::leave_out::tables::{Split, Tables};
use crate::score::tables::QuantileSummary;
use crate::score::{Case, Score};
use pagekit::page::escaped;

/// Names, titles and markup of the sections.
pub(super) fn sections(score: &Score, tables: &Tables) -> Vec<(&'static str, &'static str, String)> {
    vec![
        ("splits", "By memory, amplitude and difficulties", splits("part", &tables.splits)),
        ("effects", "Effect by effect", splits("effect", &tables.effects)),
        ("told", "What was told", left_out_cases(score)),
    ]
}

fn splits(head: &str, splits: &[Split]) -> String {
    let row = |split: &Split| {
        let rates = [split.no_wrong_name, split.balance_right, split.variable_right, split.both_right];
        let mut row = vec![escaped(&split.name)];
        row.extend(rates.iter().map(reported));
        row.extend([split.claimed_closed_ratio, split.claimed_joint_ratio].iter().map(median));
        row.push(escaped(&verdicts(split)));
        row
    };
    let heads = [
        head,
        "no wrong name",
        "balance",
        "variable among the first two",
        "both",
        "gap closed as claimed, worst signal, median",
        "all signals together",
        "verdicts",
    ];
    table(&heads, splits.iter().map(row))
}

fn median(spread: &QuantileSummary) -> String {
    spread.quantiles.map_or("<span class=\"none\">none</span>".to_owned(), |all| {
        format!("{} % <span class=\"soft\">of {}</span>", percent(all[1]), spread.of)
    })
}

fn left_out_cases(score: &Score) -> String {
    let row = |case: &Case| {
        let left = case.left_out.as_ref()?;
        let mark = |right| if right { '✓' } else { '✗' };
        let closed = case.judgement.claimed_joint_ratio.map_or(String::new(), percent);
        let balance = left.balance.as_deref().unwrap_or("none");
        Some(vec![
            case.number.to_string(),
            escaped(&left.without.join(", ")),
            escaped(&format!("{} {}", mark(left.no_wrong_name), case.judgement.called)),
            escaped(&format!("{} {balance}", mark(left.balance_right))),
            escaped(&format!("{} {}", mark(left.variable_right), left.variables.join(", "))),
            escaped(left.formula.as_deref().unwrap_or("")),
            closed,
        ])
    };
    let heads = ["draw", "left out", "called", "balance", "variables", "formula", "gap closed, %"];
    format!(
        "<details>\n<summary>All cases, with balance and variables that were told</summary>\n{}</details>\n",
        table(&heads, score.cases.iter().filter_map(row))
    )
}
