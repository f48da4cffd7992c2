//! Tables, lists and sections as markup, over that of all pages. What has no content is left out.

use pagekit::markup::Table;
pub(crate) use pagekit::markup::{Cell, number, paragraph, section, words};
use pagekit::page::escaped;

/// A table; empty without rows. The first cell of a row is its head.
pub(crate) fn table(label: &str, heads: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut table = Table::new(label, heads.iter().copied());
    rows.into_iter().for_each(|row| table.row(row));
    table.html().unwrap_or_default()
}

pub(super) fn heading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escaped(text))
}

/// Drawings side by side where there is room; nothing without any.
pub(crate) fn charts(figures: &[String]) -> String {
    if figures.is_empty() {
        String::new()
    } else {
        format!("<div class=\"charts\">\n{}</div>\n", figures.concat())
    }
}

/// A collapsed section; empty without content.
pub(super) fn folded(summary: &str, markup: &str) -> String {
    if markup.is_empty() { String::new() } else { pagekit::markup::folded(summary, markup) }
}
