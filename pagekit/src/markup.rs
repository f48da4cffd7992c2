//! Tables, lists and facts as markup. Every table stands in a box of its own that scrolls, by keyboard too, where it is too wide.

use crate::page::escaped;
use std::fmt::Write as _;

/// A cell of a table.
pub enum Cell {
    /// A few words, left-aligned, in one line.
    Words(String),
    /// A sentence, which may be broken.
    Sentence(String),
    /// A number, right-aligned.
    Number(String),
    /// Text with something said below it in small letters.
    About(String, String),
    /// Good or bad, shown by sign, words and colour.
    Judged(bool, String),
    /// Neither good nor bad.
    Open(String),
    /// Words on a ground that is darker the larger the share, from 0 to 1.
    Shaded(f64, String),
}

/// Left-aligned cell of text.
#[must_use]
pub fn words(text: impl Into<String>) -> Cell {
    Cell::Words(text.into())
}

/// Right-aligned cell of a number that is already rounded.
#[must_use]
pub fn number(text: impl Into<String>) -> Cell {
    Cell::Number(text.into())
}

impl Cell {
    fn is_number(&self) -> bool {
        matches!(self, Self::Number(_) | Self::Shaded(..))
    }

    fn written(&self, tag: &str, scope: &str) -> String {
        let marked = |class: &str, sign: char, text: &str| {
            format!("<span class=\"{class}\">{sign} {}</span>", escaped(text))
        };
        let (attributes, inside) = match self {
            Self::Words(text) => (String::new(), escaped(text)),
            Self::Sentence(text) => (" class=\"long\"".into(), escaped(text)),
            Self::Number(text) => (" class=\"n\"".into(), escaped(text)),
            Self::About(text, about) if about.is_empty() => (String::new(), escaped(text)),
            Self::About(text, about) => {
                (String::new(), format!("{}<span class=\"about\">{}</span>", escaped(text), escaped(about)))
            }
            Self::Judged(true, text) => (String::new(), marked("good", '✓', text)),
            Self::Judged(false, text) => (String::new(), marked("bad", '✗', text)),
            Self::Open(text) => (String::new(), marked("open", '?', text)),
            Self::Shaded(share, text) => {
                // Ink stays readable on 55 % of the colour, in light and dark.
                let mixed = (share.clamp(0.0, 1.0) * 55.0).round();
                let shade = format!(
                    " class=\"n\" style=\"background:color-mix(in srgb,var(--s1) {mixed}%,transparent);\
                     print-color-adjust:exact;-webkit-print-color-adjust:exact\""
                );
                (shade, escaped(text))
            }
        };
        format!("<{tag}{scope}{attributes}>{inside}</{tag}>")
    }
}

/// Rows of cells under one head, written as HTML.
pub struct Table {
    label: String,
    head: Vec<String>,
    rows: String,
    numbers: Vec<bool>,
}

impl Table {
    /// An empty table; the label is what a screen reader calls its box.
    pub fn new<Name: Into<String>>(label: impl Into<String>, head: impl IntoIterator<Item = Name>) -> Self {
        let head: Vec<String> = head.into_iter().map(Into::into).collect();
        let numbers = vec![false; head.len()];
        Self { label: label.into(), head, rows: String::new(), numbers }
    }

    /// A row; the first cell names it.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.marked_row("", cells);
    }

    /// A row of a class of the stylesheet.
    pub fn marked_row(&mut self, class: &str, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push_str(&if class.is_empty() { "<tr>".into() } else { format!("<tr class=\"{class}\">") });
        for (place, cell) in cells.into_iter().enumerate() {
            if let Some(is_number) = self.numbers.get_mut(place) {
                *is_number |= cell.is_number();
            }
            let (tag, scope) = if place == 0 { ("th", " scope=\"row\"") } else { ("td", "") };
            self.rows.push_str(&cell.written(tag, scope));
        }
        self.rows.push_str("</tr>\n");
    }

    /// A line over all columns above the rows that belong together.
    pub fn group(&mut self, name: &str) {
        let width = self.head.len();
        let _ = writeln!(
            self.rows,
            "<tr class=\"group\"><th scope=\"rowgroup\" colspan=\"{width}\">{}</th></tr>",
            escaped(name)
        );
    }

    /// The table, or a sentence in its place when it has no rows.
    #[must_use]
    pub fn html_or(&self, nothing: &str) -> String {
        self.html().unwrap_or_else(|| none(nothing))
    }

    /// The table; none without rows.
    #[must_use]
    pub fn html(&self) -> Option<String> {
        if self.rows.is_empty() {
            return None;
        }
        let head = self.head.iter().zip(&self.numbers).map(|(name, is_number)| {
            let class = if *is_number { " class=\"n\"" } else { "" };
            format!("<th scope=\"col\"{class}>{}</th>", escaped(name))
        });
        let head: String = head.collect();
        Some(format!(
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n<table>\n\
             <thead><tr>{head}</tr></thead>\n<tbody>\n{}</tbody>\n</table>\n</div>\n",
            escaped(&self.label),
            self.rows
        ))
    }
}

/// That there is nothing.
#[must_use]
pub fn none(sentence: &str) -> String {
    format!("<p class=\"none\">{}</p>\n", escaped(sentence))
}

/// A paragraph of text.
#[must_use]
pub fn paragraph(text: &str) -> String {
    format!("<p class=\"lead\">{}</p>\n", escaped(text))
}

/// A list of sentences, or that there are none.
#[must_use]
pub fn list(sentences: &[String], nothing: &str) -> String {
    if sentences.is_empty() {
        return none(nothing);
    }
    let items: String =
        sentences.iter().map(|sentence| format!("<li>{}</li>\n", escaped(sentence))).collect();
    format!("<ul>\n{items}</ul>\n")
}

/// A heading within a section.
#[must_use]
pub fn heading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escaped(text))
}

/// Something that is opened by who wants to see it; empty without content.
#[must_use]
pub fn folded(summary: &str, markup: &str) -> String {
    if markup.is_empty() {
        return String::new();
    }
    format!("<details>\n<summary>{}</summary>\n{markup}</details>\n", escaped(summary))
}

/// A section with its heading; the identifier is what the list of contents points at.
#[must_use]
pub fn section(identifier: &str, title: &str, markup: &str) -> String {
    format!(
        "<section id=\"{identifier}\" aria-labelledby=\"{identifier}-title\">\n\
         <h2 id=\"{identifier}-title\">{}</h2>\n{markup}</section>\n",
        escaped(title)
    )
}

/// A table; empty without rows. The first cell of a row is its head.
#[must_use]
pub fn table(label: &str, heads: &[&str], rows: impl IntoIterator<Item = Vec<Cell>>) -> String {
    let mut table = Table::new(label, heads.iter().copied());
    rows.into_iter().for_each(|row| table.row(row));
    table.html().unwrap_or_default()
}

/// Drawings side by side where there is room; nothing without any.
#[must_use]
pub fn charts(figures: &[String]) -> String {
    if figures.is_empty() {
        String::new()
    } else {
        format!("<div class=\"charts\">\n{}</div>\n", figures.concat())
    }
}
