//! Key figures, ours beside the reference, and how many times the reference ours are, pair by pair.

use super::families::Family;
use super::histograms::scrolling;
use crate::model::{PercentilesNs, Ratio, Source};
use crate::samples::PERCENTILES;
use pagekit::markup::{Cell, Table, folded, none, number, paragraph, words as text};
use pagekit::number::{self, NOT_MEASURED};
use pagekit::svg::{CurveStyle, Drawing, Scale, stroke, text as label};

pub(super) fn percentiles(of: &PercentilesNs) -> Vec<Cell> {
    let lengths =
        [of.p50, of.p90, of.p99, of.p999, of.p9999, of.max].map(|ns| number(number::us_or_not_measured(ns)));
    lengths.into_iter().chain([number(number::count(of.count))]).collect()
}

pub(super) fn key_figures(families: &[Family<'_>]) -> String {
    let mut table = Table::new("Key figures in µs", ["all in µs"].into_iter().chain(PERCENTILES));
    for family in families {
        table.group(&family.title);
        for (_, distribution) in &family.members {
            let is_reference = distribution.source == Source::Reference;
            let mut cells = vec![Cell::About(distribution.shown_name(), distribution.about.clone())];
            cells.extend(percentiles(&distribution.percentiles_ns));
            table.marked_row(if is_reference { "reference" } else { "" }, cells);
        }
    }
    table.html_or("No length of time was measured.")
}

/// The ratios: drawn, as a table, and each pair.
pub(super) fn ratios(ratios: &[Ratio]) -> String {
    if ratios.is_empty() {
        return none("No ratio: no reference was measured beside these runs.");
    }
    let mut table = Table::new("Ratios", ["ours / reference", "median", "interval", "confidence", "pairs"]);
    let mut pairs =
        Table::new("Pairs in µs", ["ratio", "pair", "ours, µs", "reference, µs", "ours / reference"]);
    for ratio in ratios {
        let interval = ratio.interval.map_or_else(
            || NOT_MEASURED.into(),
            |(low, high)| format!("{} – {}", two_decimals(low), two_decimals(high)),
        );
        let confidence = ratio
            .confidence
            .map_or_else(|| NOT_MEASURED.into(), |share| format!("{} %", number::decimal(100.0 * share, 1)));
        table.row([
            text(&ratio.name),
            number(two_decimals(ratio.median)),
            number(interval),
            number(confidence),
            number(number::count(ratio.pairs_ns.len() as u64)),
        ]);
        for (place, (ours, reference)) in ratio.pairs_ns.iter().enumerate() {
            let quotient = quotient(*ours, *reference).map_or_else(|| NOT_MEASURED.into(), two_decimals);
            pairs.row([
                text(&ratio.name),
                number((place + 1).to_string()),
                number(number::in_us(*ours)),
                number(number::in_us(*reference)),
                number(quotient),
            ]);
        }
    }
    let sentence = "Each dot is a pair: our run and the reference's slice beside it, one after the other on the same CPU. The \
                diamond is the median, the bar its interval, which ranks give without assuming a distribution; fewer than six \
                pairs give none. Left of 1 ours is the shorter.";
    let pairs = folded("Each pair", &pairs.html_or("No pair was measured."));
    format!(
        "{}{}{}{pairs}",
        paragraph(sentence),
        forest_plot(ratios),
        table.html_or("No ratio was measured.")
    )
}

fn two_decimals(value: f64) -> String {
    number::decimal(value, 2)
}

/// Ours by the reference's; none by nothing.
fn quotient(ours: u64, reference: u64) -> Option<f64> {
    (reference > 0).then(|| ours as f64 / reference as f64)
}

const WIDTH: f64 = 960.0;
const LEFT: f64 = 400.0;
const ROW: f64 = 30.0;
const TOP: f64 = 14.0;

/// Dots of the pairs, bar of the interval, diamond of the median; a row for each ratio.
fn forest_plot(ratios: &[Ratio]) -> String {
    let pairs =
        ratios.iter().flat_map(|ratio| &ratio.pairs_ns).filter_map(|(one, other)| quotient(*one, *other));
    let others = ratios.iter().flat_map(|ratio| {
        [Some(ratio.median), ratio.interval.map(|(low, _)| low), ratio.interval.map(|(_, high)| high)]
    });
    let known: Vec<f64> =
        pairs.chain(others.flatten()).filter(|ratio| ratio.is_finite() && *ratio > 0.0).collect();
    // Room on both sides, and 1 in sight.
    let low = known.iter().copied().fold(0.8, f64::min) * 0.9;
    let high = known.iter().copied().fold(1.25, f64::max) * 1.1;
    let scale = Scale::logarithmic((low, high), (LEFT, WIDTH - 20.0));
    let bottom = TOP + ROW * ratios.len() as f64;
    let mut drawn = axis(&scale, bottom);
    for (place, ratio) in ratios.iter().enumerate() {
        let y = TOP + ROW * (place as f64 + 0.5);
        drawn += &label("name end", (LEFT - 14.0, y + 4.5), &ratio.name);
        for pair in ratio.pairs_ns.iter().filter_map(|(ours, reference)| quotient(*ours, *reference)) {
            drawn += &CurveStyle::Ours(0).marker((scale.at(pair), y), true);
        }
        if let Some((from, to)) = ratio.interval.filter(|(from, to)| from.is_finite() && to.is_finite()) {
            let (from, to) = (scale.at(from), scale.at(to));
            drawn += &stroke("edge", (from, y + 9.0), (to, y + 9.0));
            drawn += &stroke("edge", (from, y + 5.0), (from, y + 12.0));
            drawn += &stroke("edge", (to, y + 5.0), (to, y + 12.0));
        }
        if ratio.median.is_finite() {
            drawn += &CurveStyle::Ours(3).marker((scale.at(ratio.median), y + 9.0), false);
        }
    }
    let drawing = Drawing {
        identifier: "forest",
        size: (WIDTH, bottom + 44.0),
        title: "Ratios of ours to the reference",
        description: "The same numbers stand in the table below.",
    };
    format!("<figure>\n{}</figure>\n", scrolling("full", "Ratios", &drawing.with(&drawn)))
}

fn axis(scale: &Scale, bottom: f64) -> String {
    let mut drawn = String::new();
    let mut free = f64::NEG_INFINITY;
    for value in [
        0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0,
        100.0,
    ] {
        let at = scale.at(value);
        // What is beyond the axis would pile up on its ends.
        if !(LEFT + 0.5..WIDTH - 20.5).contains(&at) {
            continue;
        }
        drawn += &stroke(if value == 1.0 { "edge" } else { "grid" }, (at, TOP - 8.0), (at, bottom));
        if at - free > 34.0 {
            drawn += &label("middle", (at, bottom + 17.0), &format!("{value}"));
            free = at;
        }
    }
    drawn += &stroke("edge", (LEFT, bottom), (WIDTH - 20.0, bottom));
    drawn + &label("middle", (0.5 * (LEFT + WIDTH - 20.0), bottom + 37.0), "ours / reference, logarithmic")
}
