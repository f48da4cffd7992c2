//! Tables, lists and sections as markup. A table that is too wide scrolls in its box, by keyboard too.

use pagekit::page::escaped;
use std::fmt::Write as _;

/// A cell of a table.
pub(super) enum Cell {
    /// A few words in one line.
    Words(String),
    /// A sentence, which may be broken.
    Sentence(String),
    /// A number, right-aligned.
    Number(String),
    /// Words with something said below them in small letters.
    About(String, String),
    /// Good or bad, shown by sign, words and colour.
    Judged(bool, String),
    /// Words on a ground that is darker the larger the share, from 0 to 1.
    Shaded(f64, String),
}

/// Text.
pub(super) fn words(text: impl Into<String>) -> Cell {
    Cell::Words(text.into())
}

/// A number.
pub(super) fn number(text: impl Into<String>) -> Cell {
    Cell::Number(text.into())
}

impl Cell {
    fn written(&self, tag: &str, scope: &str) -> String {
        let (class, style, inside) = match self {
            Cell::Words(text) => ("", String::new(), escaped(text)),
            Cell::Sentence(text) => (" class=\"long\"", String::new(), escaped(text)),
            Cell::Number(text) => (" class=\"n\"", String::new(), escaped(text)),
            Cell::About(text, about) => (
                "",
                String::new(),
                format!("{}<span class=\"about\">{}</span>", escaped(text), escaped(about)),
            ),
            Cell::Judged(is_good, text) => {
                let (class, sign) = if *is_good { ("good", '\u{2713}') } else { ("bad", '\u{2717}') };
                ("", String::new(), format!("<span class=\"{class}\">{sign} {}</span>", escaped(text)))
            }
            Cell::Shaded(share, text) => {
                // Ink stays readable on 55 % of the colour, in light and dark.
                let mixed = (share.clamp(0.0, 1.0) * 55.0).round();
                let style = format!(
                    " style=\"background:color-mix(in srgb,var(--s1) {mixed}%,transparent);\
                     print-color-adjust:exact;-webkit-print-color-adjust:exact\""
                );
                (" class=\"n\"", style, escaped(text))
            }
        };
        format!("<{tag}{scope}{class}{style}>{inside}</{tag}>")
    }
}

/// A table; nothing without rows. The first cell of a row is its head, the label what a screen reader calls the box.
pub(super) fn table(label: &str, heads: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut numbers = vec![false; heads.len()];
    let mut body = String::new();
    for row in rows {
        body.push_str("<tr>");
        for (at, cell) in row.iter().enumerate() {
            if let (Some(is_number), Cell::Number(_) | Cell::Shaded(..)) = (numbers.get_mut(at), cell) {
                *is_number = true;
            }
            let (tag, scope) = if at == 0 { ("th", " scope=\"row\"") } else { ("td", "") };
            body.push_str(&cell.written(tag, scope));
        }
        body.push_str("</tr>\n");
    }
    if body.is_empty() {
        return String::new();
    }
    let mut text = format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n<table>\n<thead><tr>",
        escaped(label)
    );
    for (head, is_number) in heads.iter().zip(numbers) {
        let class = if is_number { " class=\"n\"" } else { "" };
        let _ = write!(text, "<th scope=\"col\"{class}>{}</th>", escaped(head));
    }
    text + "</tr></thead>\n<tbody>\n" + &body + "</tbody>\n</table>\n</div>\n"
}

/// A paragraph of text.
pub(super) fn paragraph(text: &str) -> String {
    format!("<p class=\"lead\">{}</p>\n", escaped(text))
}

/// A heading within a section.
pub(super) fn heading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escaped(text))
}

/// Drawings side by side where there is room; nothing without any.
pub(super) fn charts(figures: &[String]) -> String {
    if figures.is_empty() {
        String::new()
    } else {
        format!("<div class=\"charts\">\n{}</div>\n", figures.concat())
    }
}

/// A collapsed section; empty without content.
pub(super) fn folded(summary: &str, markup: &str) -> String {
    if markup.is_empty() {
        return String::new();
    }
    format!("<details>\n<summary>{}</summary>\n{markup}</details>\n", escaped(summary))
}

/// A section with its heading; the identifier is what the list of contents points at.
pub(super) fn section(identifier: &str, title: &str, markup: &str) -> String {
    format!(
        "<section id=\"{identifier}\" aria-labelledby=\"{identifier}-title\">\n\
         <h2 id=\"{identifier}-title\">{}</h2>\n{markup}</section>\n",
        escaped(title)
    )
}
