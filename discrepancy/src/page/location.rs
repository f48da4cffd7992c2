//! Where the disagreement is: bars over the balances, cells over the regimes, maps over variables, unknown inputs over time.

use super::finding::{curve_figure, located_variables};
use super::words;
use crate::locate::regime::REGIMES;
use crate::report::{Location, Report, UnknownInput};
use pagekit::markup::{Cell, charts, folded, heading, paragraph, table, words as text_cell};
use pagekit::plot::{Bar, COLUMNS, Plot, Sample, bars, columns, figure, range};

/// Over this many times its noise a balance stands out to the eye.
const CLEAR: f64 = 1.5;

pub(super) fn location(report: &Report) -> String {
    let Some(location) = &report.location else { return String::new() };
    let mut figures = vec![balances(location)];
    figures.extend(location.maps.iter().enumerate().map(|(at, map)| {
        curve_figure(&format!("map-{at}"), &format!("Unknown input over {}", map.variable), map)
    }));
    figures.retain(|figure| !figure.is_empty());
    let series: Vec<String> =
        location.series.iter().enumerate().map(|(at, input)| over_time(at, input)).collect();
    let text = charts(&figures)
        + &depends(location)
        + &regimes(location)
        + &folded("Unknown inputs over time", &charts(&series));
    if text.is_empty() {
        return text;
    }
    paragraph(
        "An unknown input (a force, or air into a chamber) is added to each balance of the model wherever the record asks for \
         one. Where nothing is missing it is as large as its noise, 1.",
    ) + &text
}

/// What the balance that disagrees most depends on.
fn depends(location: &Location) -> String {
    let Some(term) = &location.dependence else { return String::new() };
    heading("On what it depends")
        + &paragraph(&format!("Of the balance that disagrees most: {}.", words::balance(&term.balance)))
        + &located_variables("Dependence of the disagreement", term)
}

fn balances(location: &Location) -> String {
    if location.balances.is_empty() {
        return String::new();
    }
    let rows: Vec<Bar> = location
        .balances
        .iter()
        .map(|one| Bar {
            label: words::balance(&one.balance),
            value: one.birge_ratio,
            text: format!(
                "{} ({})",
                words::short(one.birge_ratio),
                words::with_unit(&words::short(one.rms), &one.unit)
            ),
            is_full: one.birge_ratio > CLEAR,
        })
        .collect();
    figure(
        "Which balance",
        "Unknown input over its noise, logarithmic; 1 for a closed balance. In brackets its rms.",
        &[],
        &bars("balances", "Unknown input of each balance over its noise", &rows),
    )
}

fn regimes(location: &Location) -> String {
    let cells = &location.regimes;
    let mut names: Vec<&str> =
        REGIMES.into_iter().filter(|name| cells.iter().any(|cell| cell.regime == *name)).collect();
    let mut balances: Vec<&str> = Vec::new();
    for cell in cells {
        if !names.contains(&cell.regime.as_str()) {
            names.push(&cell.regime);
        }
        if !balances.contains(&cell.balance.as_str()) {
            balances.push(&cell.balance);
        }
    }
    let heads: Vec<String> = names
        .iter()
        .map(|name| {
            let windows = cells.iter().filter(|cell| cell.regime == *name).map(|cell| cell.windows).max();
            format!("{} ({})", name.replace('-', " "), windows.unwrap_or(0))
        })
        .collect();
    let heads: Vec<&str> = std::iter::once("balance").chain(heads.iter().map(String::as_str)).collect();
    let row = |balance: &&str| {
        let shaded = |name: &&str| {
            let cell = cells.iter().find(|cell| cell.balance == *balance && cell.regime == *name);
            match cell.filter(|cell| cell.windows > 0 && cell.birge_ratio.is_finite()) {
                // A hundred times the noise is as dark as it gets.
                Some(cell) => {
                    Cell::Shaded(cell.birge_ratio.max(1.0).log10() / 2.0, words::short(cell.birge_ratio))
                }
                None => Cell::Shaded(0.0, words::NOT_MEASURED.to_owned()),
            }
        };
        std::iter::once(text_cell(words::balance(balance))).chain(names.iter().map(shaded)).collect()
    };
    let table = table("Regimes", &heads, balances.iter().map(row));
    if table.is_empty() {
        return table;
    }
    let about = "The same by what the axis was doing; in brackets the windows of each regime.";
    heading("In which regime") + &paragraph(about) + &table
}

fn over_time(at: usize, input: &UnknownInput) -> String {
    let Some(x) = range(input.time_s.iter().copied()) else { return String::new() };
    let values = input.value.iter().copied();
    let y = range(values.chain([-2.0 * input.noise, 2.0 * input.noise])).unwrap_or((-1.0, 1.0));
    let mut plot = Plot::new(x, y, "time, s", &words::with_unit("unknown input,", &input.unit));
    plot.between(-2.0 * input.noise, 2.0 * input.noise);
    plot.series("line s1", "trace s1", &columns(&input.time_s, &input.value, COLUMNS));
    let caption = words::balance(&input.balance);
    figure(
        &caption,
        "",
        &[
            (Sample::Line("line s1"), "unknown input"),
            (Sample::Area("area"), "noise, \u{b1} 2 standard deviations"),
        ],
        &plot.drawn(&format!("series-{at}"), &caption, "Unknown input over time."),
    )
}
