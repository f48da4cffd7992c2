//! Worst cases: the runs with the largest figures, and the command that repeats each.

use super::value;
use crate::campaign::Campaign;
use crate::factor::Values;
use crate::merge::{IncompleteRun, Results};
use pagekit::grid::Grid;
use pagekit::number::without_unit;
use pagekit::page::escaped;

/// Number of runs shown for each figure.
const RUNS_SHOWN: usize = 8;

/// The worst of each figure that is shown.
pub(super) fn section(
    campaign: &Campaign,
    results: &Results,
    shown: &[String],
    repeat: &dyn Fn(u64) -> String,
) -> String {
    let mut text = "<h2>Worst cases</h2>\n".to_owned();
    if !results.incomplete_runs.is_empty() {
        let head = ["run", "ended", "because", "with", "repeated by"];
        let rows =
            results.incomplete_runs.iter().take(RUNS_SHOWN).map(|IncompleteRun { run, ended, because }| {
                vec![run.to_string(), ended.clone(), because.clone(), values(campaign, *run), repeat(*run)]
            });
        text += "<h3>Runs that did not come to their end, the first</h3>\n";
        text += &Grid::new(head, rows).html();
    }
    for figure in shown {
        let Some(column) = results.numbers(figure) else { continue };
        let mut runs: Vec<_> = (0..column.len()).filter(|run| column[*run].is_finite()).collect();
        // Ties: the first run.
        runs.sort_by(|one, other| column[*other].total_cmp(&column[*one]));
        let head = [&*without_unit(figure), "run", "with", "repeated by"];
        let rows = runs.iter().take(RUNS_SHOWN).map(|run| {
            let number = *run as u64;
            vec![value(figure, column[*run]), number.to_string(), values(campaign, number), repeat(number)]
        });
        text += &format!("<h3>{}</h3>\n{}", escaped(&without_unit(figure)), Grid::new(head, rows).html());
    }
    text
}

fn values(campaign: &Campaign, run: u64) -> String {
    let point = campaign.points.point(run);
    let reported =
        campaign.file.factors.iter().zip(&point.values).map(|(factor, value)| match &factor.values {
            Values::Range(_) => {
                format!("{} {}", factor.name, value.number().map_or_else(String::new, pagekit::number::short))
            }
            Values::List(_) => format!("{} {value}", factor.name),
        });
    reported.collect::<Vec<_>>().join(", ")
}
