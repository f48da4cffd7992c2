//! Headings and collapsed sections as markup, over that of all pages. What has no content is left out.

pub(super) use pagekit::markup::{Cell, charts, number, paragraph, section, table, words};
use pagekit::page::escaped;

pub(super) fn heading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escaped(text))
}

/// A collapsed section; empty without content.
pub(super) fn folded(summary: &str, markup: &str) -> String {
    if markup.is_empty() { String::new() } else { pagekit::markup::folded(summary, markup) }
}
