//! Groups of runs side by side, and the bounds of a threshold file.

use crate::model::{BoundResult, Comparison, ComparisonCell};
use crate::resolution::{self, Verdict};
use pagekit::markup::{Cell, Table, none, number, paragraph, words as text};
use pagekit::number::{self, NOT_MEASURED};

/// The groups with their changes against the first.
pub(super) fn comparison(comparison: Option<&Comparison>) -> String {
    let Some((comparison, (first, others))) =
        comparison.and_then(|comparison| Some((comparison, comparison.groups.split_first()?)))
    else {
        return none("Nothing was compared: the runs are of one group.");
    };
    let mut head = vec!["median of the runs, µs".to_owned(), first.clone()];
    for group in others {
        head.extend([group.clone(), "change".to_owned(), "beyond the noise?".to_owned()]);
    }
    let mut table = Table::new("Comparison", head);
    for row in &comparison.rows {
        let mut cells = vec![text(&row.figure)];
        for (place, cell) in row.cells.iter().enumerate() {
            cells.push(number(median(cell)));
            if place > 0 {
                cells.push(number(cell.change_percent.map_or_else(|| NOT_MEASURED.into(), number::change)));
                cells.push(text(noise(cell.beyond_noise)));
            }
        }
        table.row(cells);
    }
    let sentence = format!(
        "In brackets the least and the largest of the group's runs. Changes are against {first}. A change is beyond the noise \
         when repeated runs of one group do not differ that much among themselves."
    );
    format!("{}{}", paragraph(&sentence), table.html_or("No figure was measured in these groups."))
}

fn median(cell: &ComparisonCell) -> String {
    let (least, largest) = cell.range_ns;
    format!("{} ({} – {})", number::in_us(cell.median_ns), number::in_us(least), number::in_us(largest))
}

fn noise(beyond: Option<bool>) -> &'static str {
    match beyond {
        Some(true) => "beyond",
        Some(false) => "within",
        None => "too few runs to tell",
    }
}

/// The bounds: kept, broken, or not resolved.
pub(super) fn bounds(bounds: &[BoundResult]) -> String {
    let mut table = Table::new("Bounds", ["figure", "value", "interval", "at least", "at most", "verdict"]);
    let reported = |value: Option<f64>| value.map_or_else(|| NOT_MEASURED.into(), number::compact);
    for bound in bounds {
        let value = if bound.value.is_some() { reported(bound.value) } else { "not measured".into() };
        let verdict = match bound.verdict() {
            Verdict::Kept => Cell::Judged(true, "kept".into()),
            Verdict::Broken => Cell::Judged(false, "broken".into()),
            Verdict::NotResolved { pairs } => {
                Cell::Open(format!("not resolved: {}", resolution::in_words(pairs)))
            }
        };
        let interval = bound.interval.map_or_else(
            || NOT_MEASURED.into(),
            |(low, high)| format!("{} – {}", number::compact(low), number::compact(high)),
        );
        table.row([
            text(&bound.figure),
            number(value),
            number(interval),
            number(reported(bound.min)),
            number(reported(bound.max)),
            verdict,
        ]);
    }
    let sentence = "A ratio is judged by the interval of its median. Where the interval crosses the bound, or there are fewer \
                    than six pairs and so no interval, the bound is not resolved: neither kept nor broken. The pairs that would \
                    resolve it follow from an interval that shrinks as one over the root of their number, around a median that \
                    stays.";
    let lead = if bounds.is_empty() { String::new() } else { paragraph(sentence) };
    format!("{lead}{}", table.html_or("No threshold file was given."))
}
