//! Heat maps: a figure over two factors, or over one.

use super::{quantile, sorted, value};
use crate::campaign::Campaign;
use crate::factor::{Factor, Values};
use crate::merge::Results;
use pagekit::number::{short, without_unit};
use pagekit::page::escaped;
use std::fmt::Write as _;

/// Number of classes of a range.
const CLASSES: usize = 6;
/// Most maps of a figure: each pair of the first four factors.
const MOST_MAPS: usize = 6;
/// Most levels of a list that is shown.
const MOST_VALUES: usize = 40;

/// The maps of all figures that are shown.
pub(super) fn section(campaign: &Campaign, results: &Results, shown: &[String]) -> String {
    let axes: Vec<_> = campaign.file.factors.iter().filter_map(|factor| Axis::of(factor, results)).collect();
    if axes.is_empty() {
        return String::new();
    }
    let mut text = "<h2>Medians over the varied values</h2>\n<p class=\"soft\">In each field the median of its runs; the \
                    stronger its colour, the larger. A range is cut into classes of equal width, or of equal ratio.</p>\n"
        .to_owned();
    for figure in shown {
        let Some(column) = results.numbers(figure) else { continue };
        if axes.len() == 1 {
            text += &map(figure, column, &axes[0], None);
        }
        let pairs = axes
            .iter()
            .enumerate()
            .flat_map(|(place, one)| axes[place + 1..].iter().map(move |other| (one, other)));
        for (one, other) in pairs.take(MOST_MAPS) {
            text += &map(figure, column, one, Some(other));
        }
    }
    text
}

/// A factor in classes.
struct Axis {
    name: String,
    classes: Vec<String>,
    places: Vec<Option<usize>>,
}

impl Axis {
    /// `None` for a list of one value, and for one of more than [`MOST_VALUES`].
    fn of(factor: &Factor, results: &Results) -> Option<Self> {
        let name = factor.name.clone();
        match &factor.values {
            Values::List(list) if list.len() < 2 || list.len() > MOST_VALUES => None,
            Values::List(list) => {
                let classes: Vec<_> = list.iter().map(ToString::to_string).collect();
                let places = if let Some(words) = results.words(&name) {
                    let class = |word: &String| classes.iter().position(|class| class == word);
                    let known: Vec<_> = words.known.iter().map(class).collect();
                    words.places.iter().map(|place| known[*place as usize]).collect()
                } else {
                    let place = |number: &f64| list.iter().position(|value| value.number() == Some(*number));
                    results.numbers(&name)?.iter().map(place).collect()
                };
                Some(Axis { name, classes, places })
            }
            Values::Range(range) => {
                let borders: Vec<f64> =
                    (0..=CLASSES).map(|class| range.at(class as f64 / CLASSES as f64)).collect();
                let classes =
                    borders.windows(2).map(|pair| format!("{} to {}", short(pair[0]), short(pair[1])));
                let place = |number: &f64| {
                    let after = borders.iter().position(|border| number < border).unwrap_or(CLASSES);
                    number.is_finite().then(|| after.saturating_sub(1).min(CLASSES - 1))
                };
                let places = results.numbers(&name)?.iter().map(place).collect();
                Some(Axis { classes: classes.collect(), places, name })
            }
        }
    }
}

fn map(figure: &str, column: &[f64], rows: &Axis, columns: Option<&Axis>) -> String {
    let width = columns.map_or(1, |axis| axis.classes.len());
    let mut fields = vec![Vec::new(); rows.classes.len() * width];
    for (run, number) in column.iter().enumerate() {
        let across = columns.map_or(Some(0), |axis| axis.places[run]);
        if let (Some(down), Some(across), true) = (rows.places[run], across, number.is_finite()) {
            fields[down * width + across].push(*number);
        }
    }
    let medians: Vec<_> = fields
        .iter()
        .map(|field| {
            let values = sorted(field);
            (!values.is_empty()).then(|| (quantile(&values, 0.5), values.len()))
        })
        .collect();
    let known = sorted(&medians.iter().flatten().map(|(median, _)| *median).collect::<Vec<_>>());
    let (Some(least), Some(most)) = (known.first(), known.last()) else { return String::new() };
    let shade =
        |median: f64| if most > least { 5.0 + 50.0 * (median - least) / (most - least) } else { 20.0 };
    let title = match columns {
        Some(columns) => format!("{} over {} and {}", without_unit(figure), rows.name, columns.name),
        None => format!("{} over {}", without_unit(figure), rows.name),
    };
    let title = escaped(&title);
    let mut text = format!(
        "<h3>{title}</h3>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\"><table>\
         <thead><tr><th>{}</th>",
        escaped(&rows.name)
    );
    // Writing to a text cannot fail.
    for class in columns.map_or_else(|| vec!["median".to_owned()], |axis| axis.classes.clone()) {
        let _ = write!(text, "<th class=\"n\">{}</th>", escaped(&class));
    }
    text += "</tr></thead><tbody>\n";
    for (class, fields) in rows.classes.iter().zip(medians.chunks(width)) {
        let _ = write!(text, "<tr><th scope=\"row\">{}</th>", escaped(class));
        for field in fields {
            text += &match field {
                Some((median, runs)) => format!(
                    "<td class=\"n\" title=\"{runs} runs\" style=\"background:\
                     color-mix(in srgb,var(--s0) {:.0}%,var(--ground))\">{}</td>",
                    shade(*median),
                    escaped(&value(figure, *median))
                ),
                None => "<td class=\"n none\">none</td>".to_owned(),
            };
        }
        text += "</tr>\n";
    }
    text + "</tbody></table></div>\n"
}
