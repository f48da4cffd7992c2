//! The page of a campaign: end states, distributions of figures, their dependence on factors, worst cases.
//!
//! One self-contained file with the stylesheet of all pages.

mod confusion;
mod distribution;
mod heat;
mod worst;

use crate::campaign::Campaign;
use crate::file::is_figure;
use crate::merge::Results;
use figures::definition;
use figures::top::POSITIONS;
use pagekit::grid::Grid;
use pagekit::number::{in_use, short};
use pagekit::page::{document, escaped};
use std::fmt::Write as _;

/// Number of figures on the page when the campaign's file has no `worst`.
const DEFAULT_FIGURES: usize = 4;

/// The page; `repeat` makes the command that repeats a run.
pub(crate) fn page(campaign: &Campaign, results: &Results, repeat: &dyn Fn(u64) -> String) -> String {
    let shown = shown(campaign, results);
    let mut body = format!("<h1>{}</h1>\n", escaped(&campaign.file.title));
    body += &lead(campaign, results);
    body += &endings(results);
    // Writing to a text cannot fail.
    let _ = write!(body, "<h2>Distributions of the figures</h2>\n{}", distribution::section(results, &shown));
    body += &heat::section(campaign, results, &shown);
    body += &confusion::section(campaign, results);
    body += &worst::section(campaign, results, &shown, repeat);
    let _ = write!(
        body,
        "<h2>The campaign's file</h2>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"File\"><pre>{}</pre>\
         </div>\n",
        escaped(&campaign.file.text)
    );
    document(&campaign.file.title, &body)
}

/// Figures with a histogram, heat maps and worst cases.
fn shown(campaign: &Campaign, results: &Results) -> Vec<String> {
    if !campaign.file.worst.is_empty() {
        return campaign.file.worst.clone();
    }
    let measured = |name: &&String| {
        let column = results.numbers(name).unwrap_or_default();
        (campaign.file.figures.contains(name) || campaign.file.figures.is_empty())
            && (is_figure(name) || campaign.file.figures.contains(name))
            && column.iter().any(|value| value.is_finite())
    };
    campaign.parts.columns.iter().filter(measured).take(DEFAULT_FIGURES).cloned().collect()
}

fn lead(campaign: &Campaign, results: &Results) -> String {
    let parts = &campaign.parts;
    let factors: Vec<_> = campaign.file.factors.iter().map(|factor| escaped(&factor.name)).collect();
    let over =
        if factors.is_empty() { "nothing but the sensors' noise".to_owned() } else { factors.join(", ") };
    let time = if results.simulated_s > 0.0 {
        format!(", {} h of the rig's time", short(results.simulated_s / 3600.0))
    } else {
        String::new()
    };
    format!(
        "<p class=\"lead\">{} runs{time}: {} combinations of what is listed, {} draws of each. Varied: {over}.</p>\n\
         <p class=\"soft\">Campaign <span class=\"code\">{}</span>, made by <span class=\"code\">{}</span>. All rows: \
         <a href=\"runs.csv\">runs.csv</a>.</p>\n",
        results.runs, campaign.points.combinations, campaign.file.draws, parts.campaign, parts.program
    )
}

fn endings(results: &Results) -> String {
    let share =
        |count: usize| format!("{} ({} %)", count, short(100.0 * count as f64 / results.runs.max(1) as f64));
    let mut rows = Vec::new();
    if let Some(ended) = results.words("ended") {
        for (place, word) in ended.known.iter().enumerate() {
            let count = ended.places.iter().filter(|run_place| **run_place as usize == place).count();
            rows.push(vec![format!("ended: {word}"), share(count)]);
        }
    }
    let passed = results.numbers("passed").unwrap_or_default();
    let judged = passed.iter().filter(|value| value.is_finite()).count();
    if judged > 0 {
        let kept = passed.iter().filter(|value| **value == 1.0).count();
        rows.push(vec!["kept the experiment's bounds".to_owned(), share(kept)]);
    }
    format!("<h2>How the runs ended</h2>\n{}", Grid::new(["runs", "how many"], rows).html())
}

/// A value with its display unit.
fn value(figure: &str, number: f64) -> String {
    let unit = match definition(figure) {
        Some(definition) => definition.unit,
        None if POSITIONS.contains(&figure) => "m",
        None => "1",
    };
    in_use(number, unit)
}

/// The finite values of a column, ascending.
fn sorted(column: &[f64]) -> Vec<f64> {
    let mut values: Vec<_> = column.iter().copied().filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Empirical quantile at `share`; `values` ascend and are not empty.
fn quantile(values: &[f64], share: f64) -> f64 {
    values[((values.len() - 1) as f64 * share).round() as usize]
}
