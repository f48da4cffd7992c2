//! Distribution of each figure: a table of quantiles, and histograms.

use super::{quantile, sorted, value};
use crate::merge::Results;
use pagekit::grid::Grid;
use pagekit::number::without_unit;
use pagekit::page::escaped;
use std::fmt::Write as _;

/// Number of bars of a histogram.
const BARS: usize = 40;
/// Size of a histogram in units of its SVG viewBox.
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 120.0;

/// The table of all figures that are shown, and a histogram of each.
pub(super) fn section(results: &Results, shown: &[String]) -> String {
    let head = ["figure", "runs", "least", "5 %", "median", "95 %", "99 %", "most"];
    let mut rows = Vec::new();
    let mut pictures = String::new();
    for figure in shown {
        let values = sorted(results.numbers(figure).unwrap_or_default());
        if values.is_empty() {
            rows.push(
                [without_unit(figure), "0".into()].into_iter().chain(vec!["-".to_owned(); 6]).collect(),
            );
            continue;
        }
        let at = |share| value(figure, quantile(&values, share));
        let quantiles = [0.0, 0.05, 0.5, 0.95, 0.99, 1.0].map(at);
        rows.push([without_unit(figure), values.len().to_string()].into_iter().chain(quantiles).collect());
        pictures += &histogram(figure, &values);
    }
    Grid::new(head, rows).html() + &pictures
}

fn histogram(figure: &str, values: &[f64]) -> String {
    let (least, most) = (values[0], values[values.len() - 1]);
    let width = if most > least { most - least } else { 1.0 };
    let mut counts = [0_u64; BARS];
    for value in values {
        counts[(((value - least) / width * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    let highest = counts.iter().copied().max().unwrap_or(1).max(1) as f64;
    let step = WIDTH / BARS as f64;
    let mut bars = String::new();
    for (place, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let height = (HEIGHT * *count as f64 / highest).max(1.0);
        // Writing to a text cannot fail.
        let _ = write!(
            bars,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\" fill=\"var(--s0)\"/>",
            place as f64 * step,
            HEIGHT - height,
            step - 1.0
        );
    }
    let (title, from, to) =
        (escaped(&without_unit(figure)), escaped(&value(figure, least)), escaped(&value(figure, most)));
    format!(
        "<figure><svg class=\"chart\" role=\"img\" aria-label=\"{title}: {} runs from {from} to {to}\" \
         viewBox=\"0 0 {WIDTH} {:.0}\" \
         width=\"100%\" style=\"max-width:{WIDTH}px\">{bars}<line x1=\"0\" y1=\"{HEIGHT}\" x2=\"{WIDTH}\" y2=\"{HEIGHT}\" \
         stroke=\"var(--ink)\"/></svg><figcaption>{title}, from {from} to {to}; the highest bar has {highest} runs</figcaption>\
         </figure>\n",
        values.len(),
        HEIGHT + 2.0,
    )
}
