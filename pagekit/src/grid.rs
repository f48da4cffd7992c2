//! A table of words, for a terminal, in Markdown, or in HTML.

use crate::page::escaped;

/// Rows of words under a head; the first column is left-aligned, the others right.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Names of the columns.
    pub head: Vec<String>,
    /// The rows, each as long as the head.
    pub rows: Vec<Vec<String>>,
}

impl Grid {
    /// A grid of rows that are as long as its head.
    #[must_use]
    pub fn new<W: Into<String>>(
        head: impl IntoIterator<Item = W>,
        rows: impl IntoIterator<Item = Vec<String>>,
    ) -> Self {
        Self { head: head.into_iter().map(Into::into).collect(), rows: rows.into_iter().collect() }
    }

    /// Markdown, padded so that it is readable as it stands: what a terminal gets too.
    #[must_use]
    pub fn markdown(&self) -> String {
        let length = |cell: &String| cell.chars().count();
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.chain(self.head.get(column)).map(length).max().unwrap_or(0).max(3)
        };
        let widths: Vec<_> = (0..self.head.len()).map(width).collect();
        let line = |row: &[String]| {
            let cells = row.iter().zip(&widths).enumerate().map(|(place, (cell, width))| {
                let cell = cell.replace('|', "\\|");
                if place == 0 { format!(" {cell:width$} ") } else { format!(" {cell:>width$} ") }
            });
            format!("|{}|\n", cells.collect::<Vec<_>>().join("|"))
        };
        let rule = widths.iter().enumerate().map(|(place, width)| {
            let dashes = "-".repeat(width + 1);
            if place == 0 { format!("{dashes}-") } else { format!("{dashes}:") }
        });
        let rule = format!("|{}|\n", rule.collect::<Vec<_>>().join("|"));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}{rule}{rows}", line(&self.head))
    }

    /// An HTML table in a box that scrolls.
    #[must_use]
    pub fn html(&self) -> String {
        let row = |first: &str, other: &str, row: &[String]| {
            let cells = row.iter().enumerate().map(|(place, cell)| {
                let tag = if place == 0 { first } else { other };
                let class = if place == 0 { "" } else { " class=\"n\"" };
                let scope = if tag == "th" && place == 0 { " scope=\"row\"" } else { "" };
                format!("<{tag}{scope}{class}>{}</{tag}>", escaped(cell))
            });
            format!("<tr>{}</tr>\n", cells.collect::<String>())
        };
        let rows: String = self.rows.iter().map(|cells| row("th", "td", cells)).collect();
        format!(
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Figures\">\n<table>\n<thead>{}</thead>\n\
             <tbody>\n{rows}</tbody>\n</table>\n</div>\n",
            row("th", "th", &self.head)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_markdown_and_html() {
        let grid = Grid::new(["figure", "run"], [vec!["a".into(), "<5>".into()]]);
        assert_eq!(grid.markdown(), "| figure | run |\n|--------|----:|\n| a      | <5> |\n");
        assert!(grid.html().contains("<td class=\"n\">&lt;5&gt;</td>"));
    }
}
